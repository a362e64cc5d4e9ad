"""The catalogue page of all checks, from their own text.

``python -m animeme.check_catalogue docs/checks.md`` writes it anew.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

from animeme.delivery import DeliveryCheck, Limit
from animeme.files import write_text
from animeme.validation import delivery_checks

_SUBJECTS = {
    "delivery": "of each file",
    "performance": "of each animation",
    "deliveries": "of all files together",
}
_HEAD = """# Checks of delivered animation

`animeme validate` asks all of these. This page is made from the checks' own text. What a code is
worth and every limit can be changed by a profile; see [ci.md](ci.md).
"""


def catalogue() -> str:
    """The page, Markdown."""
    checks = sorted(delivery_checks().values(), key=lambda check: check.id)
    return "\n".join([_HEAD, *(line for check in checks for line in _entry(check))])


def _entry(check: DeliveryCheck) -> Iterator[str]:
    yield f"## {check.id}\n"
    yield f"Asked {_SUBJECTS[check.subject]}. {check.rationale}\n"
    yield f"Source: {check.source}.\n"
    yield "| code | severity | meaning | what to do |\n| --- | --- | --- | --- |"
    for code, entry in check.codes.items():
        cells = (f"`{code}`", entry.severity.label, entry.meaning, entry.action)
        yield "| " + " | ".join(cells) + " |"
    yield ""
    if check.limits:
        yield "| limit | value | meaning |\n| --- | --- | --- |"
        for name, spec in check.limits.items():
            yield f"| `{name}` | {_value(spec.value)} | {spec.meaning} |"
        yield ""


def _value(value: Limit) -> str:
    if isinstance(value, tuple):
        return ", ".join(value) or "none"
    return f"{value:g}" if isinstance(value, float) else str(value) or "none"


if __name__ == "__main__":
    write_text(Path(sys.argv[1]), catalogue())
