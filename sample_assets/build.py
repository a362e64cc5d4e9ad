"""Build the sample characters and their dialogue from code.

Run ``python sample_assets/build.py`` to write them next to this file. Every run gives the same
bytes.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

from sculpt.ada import build_ada
from sculpt.crab import build_crab
from sculpt.glb import write_glb
from sculpt.mesh import Character
from sculpt.usd import write_usd
from speech import build_dialogue


def write_character(build: Callable[[], Character], folder: Path) -> list[Path]:
    """Sculpt a character and write it as ``.glb`` and ``.usdc``."""
    character = build()
    stem = folder / character.name.lower()
    paths = [stem.with_suffix(".glb"), stem.with_suffix(".usdc")]
    write_glb(character, paths[0])
    write_usd(character, paths[1])
    return paths


PARTS: dict[str, Callable[[Path], list[Path]]] = {
    "ada": lambda folder: write_character(build_ada, folder),
    "crab": lambda folder: write_character(build_crab, folder),
    "dialogue": build_dialogue,
}
"""What can be built: name -> function of the output folder that returns the files written."""


def main() -> None:
    """Build the parts asked for."""
    parser = argparse.ArgumentParser(description="Build the sample from code.")
    parser.add_argument(
        "--only",
        nargs="+",
        choices=list(PARTS),
        default=list(PARTS),
        metavar="NAME",
        help=f"parts to build (default: all of {', '.join(PARTS)})",
    )
    parser.add_argument(
        "--output",
        type=Path,
        default=Path(__file__).resolve().parent,
        help="folder to write to (default: the folder of this script)",
    )
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    for name in PARTS:
        if name in arguments.only:
            for path in PARTS[name](arguments.output):
                print(f"{path.name}: {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
