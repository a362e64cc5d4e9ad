"""Any number of rounds of `support.chaos`: something happens to a run, the next mends it.

python tests/bench/chaos.py --rounds 200 --seed 7
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from support.chaos import Chaos


def main() -> None:
    """Go through the rounds and print what happened."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--no-dask", action="store_true")
    chosen = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="chaos-"))
    started = time.monotonic()
    chaos = Chaos(folder / "all", chosen.seed, dask=not chosen.no_dask)
    try:
        with chaos:
            chaos.rounds(chosen.rounds, lambda this: print(this, flush=True))
    finally:
        print(chaos.summary(), flush=True)
        print(f"{len(chaos.told)} rounds in {time.monotonic() - started:.0f} s; {folder}")


if __name__ == "__main__":
    main()
