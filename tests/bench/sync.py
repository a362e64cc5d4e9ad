"""Fits and measures the check ``sync`` on captured lips.

    python tests/bench/sync.py ../shared/data/grid-s1 [--lines N] [--fit]

Every other line, by name, is for fitting and for choosing thresholds; the others are measured. With
``--fit`` the weights in ``stages/animeme_stages/check/delivery`` are written anew.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from animeme_stages.check.delivery import sound
from animeme_stages.check.delivery.sync import Sync
from animeme_stages.dataset.motion import read_motion
from animeme_stages.ingest.audio import read_speech

Floats = NDArray[np.float64]
TARGET = Path(sound.__file__).with_name("sound_to_opening.json")
RIDGE = 1000.0


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("folder", type=Path)
    arguments.add_argument("--lines", type=int, default=0, help="how many, spread evenly; 0: all")
    arguments.add_argument("--fit", action="store_true")
    given = arguments.parse_args()
    names = sorted(path.stem for path in (given.folder / "lines").glob("*.flac"))
    if given.lines:
        names = names[:: max(1, len(names) // given.lines)]
    pairs = [lips_and_features(given.folder / "lines" / name) for name in names]
    if given.fit:
        fit(pairs[0::2])
        sound._weights.cache_clear()
    for title, chosen in (("thresholds chosen on", pairs[0::2]), ("held out", pairs[1::2])):
        measure(title, chosen)


def lips_and_features(path: Path) -> tuple[Floats, Floats]:
    """Lip gap and the sound's features, 100 a second."""
    found = sound.features(read_speech(path.with_suffix(".flac")))
    motion = read_motion(path.with_suffix(".csv"))
    gap = motion.values[:, motion.controls.index("lip_gap")]
    known = np.isfinite(gap)
    at_s = np.arange(len(found)) / sound.RATE_HZ
    return np.interp(at_s, motion.times_s[known], gap[known]), found


def fit(pairs: list[tuple[Floats, Floats]]) -> None:
    """Ridge regression of the lip gap without posture, each line at its own scale."""
    size = pairs[0][1].shape[1]
    products, sums = np.zeros((size, size)), np.zeros(size)
    for gap, features in pairs:
        lips = sound.without_posture(gap)
        products += features.T @ features
        sums += features.T @ ((lips - lips.mean()) / lips.std())
    weights = np.linalg.solve(products + RIDGE * np.eye(size), sums)
    document = {
        "source": "GRID corpus, speaker s1 (Cooke et al. 2006, CC BY 4.0), every other line",
        "bands": sound.BANDS,
        "context_frames": list(sound.CONTEXT),
        "weights": [round(float(weight), 6) for weight in weights],
    }
    TARGET.write_text(json.dumps(document) + "\n", encoding="utf-8")


def measure(title: str, pairs: list[tuple[Floats, Floats]]) -> None:
    most_s = float(Sync.limits["most_s"].value)  # type: ignore[arg-type]
    weights = sound._weights()
    lips = [sound.without_posture(gap) for gap, _ in pairs]
    guesses = [sound.without_posture(features @ weights) for _, features in pairs]

    def judged(moved: list[Floats], shift: int = 0) -> tuple[Floats, Floats]:
        pairs_of = zip(moved, guesses[shift:] + guesses[:shift], strict=True)
        cut = ((m[: min(len(m), len(g))], g[: min(len(m), len(g))]) for m, g in pairs_of)
        found = [sound.lag_of(m, g, most_s) for m, g in cut]
        return np.array([lag for lag, _ in found]), np.array([score for _, score in found])

    def delayed(gap: Floats, frames: int) -> Floats:
        at = np.arange(len(gap)) - frames
        return np.interp(at, np.arange(len(gap)), gap)

    lag_s, score = judged(lips)
    near = np.mean(abs(lag_s) <= 0.0401)
    print(f"{title}: {len(pairs)} lines")
    print(f"  lag within ±40 ms: {near:.3f}, median {np.median(lag_s):.3f} s")
    cases = {"as delivered": (lag_s, score), "with another line's audio": judged(lips, 7)}
    for ms in (120, -120):
        moved = [sound.without_posture(delayed(gap, ms // 10)) for gap, _ in pairs]
        cases[f"shifted by {ms:+d} ms"] = judged(moved)
    for least in (0.45, 0.5, 0.55, 0.6, 0.65):
        for late_s in (0.06, 0.08):
            said = ", ".join(
                f"{case} {np.mean((abs(lags) > late_s + 1e-9) | (scores < least)):.3f}"
                for case, (lags, scores) in cases.items()
            )
            print(f"  likeness {least:.2f}, lag {late_s:.2f} s: flagged {said}")


if __name__ == "__main__":
    main()
