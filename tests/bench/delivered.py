"""How often checks of delivered animation complain of captured motion, and of what is no speech.

    animeme align ../shared/data/grid-s1/lines --language en --format alignment --output ALIGNED
    python tests/bench/delivered.py ../shared/data/grid-s1 ALIGNED sample_assets/ada.glb [--lines N]

Captured lips drive ``jawOpen`` of a character: as captured, shifted, with another line's recording,
and replaced by a ramp, noise, and a jaw on a timer. Thresholds were chosen on every other line;
only the others are counted here.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from animeme import registry
from animeme.contracts import Alignment, Speech
from animeme.curves import CurveSet
from animeme.deliveries import read_takes
from animeme.delivery import Performance, Skip, Take
from animeme.dialogue import Line
from animeme.phones import PhoneTrack
from animeme.validation import delivery_checks
from animeme_stages.dataset.motion import read_motion

Floats = NDArray[np.float64]
# What jawOpen reaches in lively speech.
WIDEST = 0.6
CHECKS = (
    "sync", "articulation", "bilabials", "labiodentals", "vowels", "closed-speech",
    "silent-motion", "flat", "speed", "popping",
)  # fmt: skip


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("folder", type=Path)
    arguments.add_argument("alignments", type=Path)
    arguments.add_argument("asset", type=Path)
    arguments.add_argument("--lines", type=int, default=150, help="how many, spread evenly")
    arguments.add_argument("--chosen", action="store_true", help="count the other half")
    given = arguments.parse_args()
    takes = list(read_takes(given.folder / "lines", {given.asset.stem}, "en").values())
    takes = [aligned(take, given.alignments) for take in takes]
    # Halves before all else: every other line of all was fitted to.
    takes = takes[0::2] if given.chosen else takes[1::2]
    takes = takes[:: max(1, len(takes) // given.lines)][: given.lines]
    character = registry.format_of(given.asset).load(given.asset)
    rig = registry.stage("bind-rig")("auto", character, Path())
    checks = delivery_checks()
    counts: dict[str, Counter[str]] = {}
    random = np.random.default_rng(0)
    for index, take in enumerate(takes):
        times_s, opened = lips(take)
        other = takes[(index + 31) % len(takes)]
        for case, (at_s, weights, recording) in variants(
            times_s, opened, take, other, random
        ).items():
            curves = CurveSet(at_s, ("jawOpen",), weights[:, None])
            performance = Performance(
                given.asset, take.line.id, take.line.key, "en", "", curves, (), rig,
                {"jawOpen": 0.0}, recording,
            )  # fmt: skip
            count = counts.setdefault(case, Counter())
            flagged = set()
            for name in CHECKS:
                check = checks[name]
                limits = {key: spec.value for key, spec in check.limits.items()}
                try:
                    found = {entry.code for entry in check.run(performance, limits)}
                except Skip:
                    count[f"{name} skipped"] += 1
                    continue
                count.update(found)
                flagged |= found
            count["any of these"] += bool(flagged)
    for case, count in counts.items():
        print(f"{case} ({len(takes)} lines)")
        for name, number in count.most_common():
            print(f"    {number / len(takes):6.3f}  {name}")


def aligned(take: Take, folder: Path) -> Take:
    """The same line with phones that were found before."""

    def read(line: Line, _: Speech) -> Alignment:
        path = next(folder.rglob(f"{line.audio.stem}.json"))
        track = PhoneTrack.from_document(json.loads(path.read_text(encoding="utf-8")))
        return Alignment(track, (), 1.0)

    return Take(take.line, registry.stage("read-speech"), read)


def lips(take: Take) -> tuple[Floats, Floats]:
    """Captured lip gap as a weight, with the times of its frames."""
    motion = read_motion(take.line.audio.with_suffix(".csv"))
    gap = motion.values[:, motion.controls.index("lip_gap")]
    known = np.isfinite(gap)
    return motion.times_s[known], np.clip(WIDEST * gap[known] / np.percentile(gap[known], 98), 0, 1)


def variants(
    times_s: Floats, opened: Floats, take: Take, other: Take, random: np.random.Generator
) -> dict[str, tuple[Floats, Floats, Take]]:
    at_s = np.arange(0, times_s[-1], 1 / 60)
    return {
        "captured": (times_s, opened, take),
        "120 ms late": (times_s + 0.12, opened, take),
        "120 ms early": (times_s, np.interp(times_s + 0.12, times_s, opened), take),
        "another line's recording": (times_s, opened, other),
        "ramp": (at_s, np.linspace(0, 1, len(at_s)), take),
        "noise": (at_s, random.uniform(0, 1, len(at_s)), take),
        "jaw on a timer": (at_s, 0.5 - 0.5 * np.cos(2 * np.pi * random.uniform(3, 6) * at_s), take),
    }


if __name__ == "__main__":
    main()
