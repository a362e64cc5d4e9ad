"""Write the schema files from the types in `animeme.documents`."""

from __future__ import annotations

from pathlib import Path

from animeme.documents import schema_text
from animeme.documents.kinds import KINDS, VERSIONS

FOLDER = Path(__file__).parent / "animeme_schemas"


def main() -> None:
    """Write the newest version of each kind; those of older versions stay as they are."""
    for kind in KINDS:
        path = FOLDER / f"{kind}.{VERSIONS[kind]}.schema.json"
        path.write_text(schema_text(kind), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
