"""What is left of the captured motion that the phones could still explain: see docs/models.md.

    python tests/bench/residual.py ../shared/data/grid-s1/lines --tracks tracks.pkl

Models are fitted as in `models.py`, and their held-out error is taken apart: what an offset, a
drift or a shift in time per line would mend, and how much two recordings differ in which the same
word was said between the same words. Half of the mean squared difference of such a pair estimates
the variance that nothing in the phones explains, which no model of phones can undercut.
"""

from __future__ import annotations

import argparse
import pickle
from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import animeme
from animeme.dataset import CapturedLine, Dataset, folds
from animeme.phones import Phone
from animeme.scoring import RATE_HZ
from animeme.training import parse_model

FOUR = ("lip_gap", "lip_width", "jaw_drop", "lower_lip")
SHIFTS_S = np.arange(-12, 13) / 100
# The recordings with the most similar lengths of phones, of those with the same words.
NEAREST = 3


def stretches(line: CapturedLine) -> Iterator[tuple[Any, list[Phone]]]:
    """What is said, with what surrounds it, and its phones; the pause before all is one, too."""
    words = line.track.words
    for i, word in enumerate(words):
        inside = [
            phone
            for phone in line.track.phones
            if phone.start_s >= word.start_s - 1e-6 and phone.end_s <= word.end_s + 1e-6
        ]
        before = words[i - 1].text if i else ""
        after = words[i + 1].text if i + 1 < len(words) else ""
        yield (before, word.text, after, tuple(p.symbol for p in inside)), inside
    first = line.track.phones[0]
    if words and first.symbol == "sil":
        yield ("", tuple(word.text for word in words[:2])), [first]


def floor_of(line: CapturedLine, others: dict[Any, list[tuple[CapturedLine, list[Phone]]]]) -> Any:
    """Half the squared difference from similar recordings, NaN where there is none; (F, N)."""
    found = np.full(line.values.shape, np.nan)
    for key, phones in stretches(line):
        borders = borders_of(phones)
        at = (line.times_s >= borders[0]) & (line.times_s < borders[-1])
        partners = []
        for other, its in others[key]:
            if other is not line:
                theirs = borders_of(its)
                ratio = np.log((np.diff(theirs) + 0.01) / (np.diff(borders) + 0.01))
                partners.append((float(np.abs(ratio).mean()), other.id, other, theirs))
        if not at.any() or not partners:
            continue
        squares = []
        for _, _, other, theirs in sorted(partners, key=lambda entry: entry[:2])[:NEAREST]:
            if len(phones) == 1 and phones[0].symbol == "sil":  # the end of a pause is what counts
                when_s = np.maximum(line.times_s[at] - borders[-1] + theirs[-1], 0.0)
            else:
                when_s = np.interp(line.times_s[at], borders, theirs)
            columns = [np.interp(when_s, other.times_s, column) for column in other.values.T]
            squares.append((np.stack(columns, axis=1) - line.values[at]) ** 2)
        found[at] = np.mean(squares, axis=0) / 2
    return found


def borders_of(phones: Sequence[Phone]) -> Any:
    """Starts of the phones, and the end of the last."""
    return np.array([*(phone.start_s for phone in phones), phones[-1].end_s])


def rms(errors: Any) -> Any:
    """Root of the mean square over lines and frames."""
    return np.sqrt(np.nanmean(np.concatenate([e.reshape(-1, e.shape[-1]) for e in errors]) ** 2, 0))


def without_drift(error: Any, degree: int) -> Any:
    """The error less its best polynomial over the line."""
    axis = np.polynomial.legendre.legvander(np.linspace(-1, 1, len(error)), degree)
    return error - axis @ np.linalg.lstsq(axis, error, rcond=None)[0]


def judged_lines(dataset: Dataset, spec: str, count: int) -> list[tuple[CapturedLine, Any]]:
    """Held-out lines with the model's curves at every shift, (S, F, N)."""
    found = []
    for held in folds(dataset, 5)[:count]:
        rest = [line for i, line in enumerate(dataset.lines) if i not in set(held)]
        model = animeme.train(dataset.subset(rest), *parse_model(spec))
        for line in (dataset.lines[i] for i in held):
            curves = model.synthesize(line.track, rate_hz=RATE_HZ)
            end_s = line.track.duration_s
            at = [curves.sample(np.clip(line.times_s + s, 0, end_s)) for s in SHIFTS_S]
            found.append((line, np.stack(at)))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--folds", type=int, default=2)
    parser.add_argument("--models", nargs="+", default=["dam:contacts=no", "mmm"])
    parser.add_argument("--tracks", type=Path, help="pickle of the read dataset, made if absent")
    arguments = parser.parse_args()
    if arguments.tracks and arguments.tracks.exists():
        dataset = pickle.loads(arguments.tracks.read_bytes())
    else:
        dataset = animeme.read_dataset(arguments.folder, workers=2)
    others: dict[Any, list[tuple[CapturedLine, list[Phone]]]] = defaultdict(list)
    for line in dataset.lines:
        for key, phones in stretches(line):
            others[key].append((line, phones))
    four = [dataset.controls.index(name) for name in FOUR]
    middle = len(SHIFTS_S) // 2
    floors: dict[str, Any] = {}
    print("error | " + " | ".join(dataset.controls) + " | mean ratio of four to the model's error")
    for spec in arguments.models:
        judged = judged_lines(dataset, spec, arguments.folds)
        errors = [curves[middle] - line.values for line, curves in judged]
        whole = rms(errors)

        def show(name: str, found: Any, whole: Any = whole) -> None:
            cells = " | ".join(f"{value:.4f}" for value in found)
            print(f"{name} | {cells} | {np.mean((found / whole)[four]):.3f}", flush=True)

        show(spec, whole)
        for name, degree in (("offset", 0), ("offset and drift", 1)):
            show(f"  less each line's {name}", rms([without_drift(e, degree) for e in errors]))
        scale = np.nanstd(np.concatenate([line.values for line in dataset.lines]), axis=0)
        shifted = [curves - line.values for line, curves in judged]
        best = [int(np.nanmean((e / scale) ** 2, axis=(1, 2)).argmin()) for e in shifted]
        show("  each line shifted", rms([e[i] for e, i in zip(shifted, best, strict=True)]))
        print(f"  standard deviation of the shifts: {1000 * SHIFTS_S[best].std():.0f} ms")
        paused = [
            np.where((line.times_s < line.track.phones[0].end_s)[:, None], e, np.nan)
            for (line, _), e in zip(judged, errors, strict=True)
        ]
        share = np.nansum(np.concatenate(paused) ** 2, 0) / np.nansum(
            np.concatenate(errors) ** 2, 0
        )
        print("  part of the squared error before the first phone:", share.round(2))
        show("  there", rms(paused))
        halves = []
        for line, _ in judged:
            if line.id not in floors:
                floors[line.id] = floor_of(line, others)
            halves.append(floors[line.id])
        known = [np.where(np.isfinite(h), e, np.nan) for h, e in zip(halves, errors, strict=True)]
        alike = rms(known)
        print(f"  frames with a recording alike: {np.isfinite(np.concatenate(halves)).mean():.2f}")
        show("  error in those", alike, alike)
        show("  that no model can explain", rms([np.sqrt(h) for h in halves]), alike)
        # With nothing but that left where there is one alike, and the model's own error elsewhere.
        least = [np.where(np.isfinite(h), h, e**2) for h, e in zip(halves, errors, strict=True)]
        show("  least error over all frames", rms([np.sqrt(e) for e in least]))


if __name__ == "__main__":
    main()
