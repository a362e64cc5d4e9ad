"""What writing USD costs: a long line, many lines, and the same lines again and again.

``python tests/bench/assets_usd.py`` prints CPU seconds (best of three) and file sizes. The numbers
of our machine are in docs/assets-usd.md.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from animeme.contracts import LineAnimation
from animeme.curves import CurveSet
from support.usd_kit import FORMAT, ICT, digest, hero

SHAPES = [f"shape{chr(97 + i // 26)}{chr(97 + i % 26)}" for i in range(52)]


def spoken(name: str, shapes: tuple[str, ...], frames: int) -> LineAnimation:
    """A line with a key for every shape in every frame of 60 per second."""
    weights = np.random.default_rng(list(name.encode())).random((frames, len(shapes)))
    times_s = np.arange(frames) / 60.0
    return LineAnimation(name, "en", CurveSet(times_s, shapes, weights), float(times_s[-1]))


def cpu_s(work: Callable[..., object], *arguments: object) -> float:
    """CPU seconds of one call, the best of three."""
    best = float("inf")
    for _ in range(3):
        before = time.process_time()
        work(*arguments)
        best = min(best, time.process_time() - before)
    return best


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        character = FORMAT.load(hero(folder / "hero.usda", shapes=SHAPES))
        for suffix in ("usdc", "usda"):
            target = folder / f"long.{suffix}"
            long = [spoken("long", character.shapes, 10_000)]
            print(
                f"10,000 frames x 52 shapes, .{suffix}: "
                f"{cpu_s(FORMAT.write, character, long, target):.2f} s, "
                f"{target.stat().st_size / 1e6:.1f} MB"
            )
        for count in (1, 10, 25, 50, 100, 200):
            lines = [spoken(f"line{i:03}", character.shapes, 240) for i in range(count)]
            target = folder / f"lines{count}.usdc"
            spent = cpu_s(FORMAT.write, character, lines, target)
            print(
                f"{count:4} lines of 4 s: {spent:.3f} s, {1000 * spent / count:.1f} ms each, "
                f"{target.stat().st_size / 1e6:.2f} MB"
            )
        lines = [spoken(f"line{i}", character.shapes, 240) for i in range(10)]
        target = folder / "again.usdc"
        written = set()
        for _ in range(10):
            FORMAT.write(character, lines, target)
            written.add((target.stat().st_size, digest(target)))
        print(f"ten runs over one file: {len(written)} different results")
        if ICT.exists():
            head = FORMAT.load(ICT)
            lines = [spoken(f"line{i:03}", head.shapes, 240) for i in range(100)]
            target = folder / "ict.usdc"
            print(
                f"27 MB head: load {cpu_s(FORMAT.load, ICT):.2f} s, 100 lines "
                f"{cpu_s(FORMAT.write, head, lines, target):.2f} s, "
                f"harm {cpu_s(FORMAT.harm, head, target):.2f} s, "
                f"read {cpu_s(FORMAT.read_animations, target):.2f} s"
            )


if __name__ == "__main__":
    main()
