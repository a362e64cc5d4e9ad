"""Fits and measures the check ``sync`` on captured lips.

    animeme align ../shared/data/grid-s1/lines --language en --format alignment --output ALIGNED
    python tests/bench/sync.py ../shared/data/grid-s1 ALIGNED [--fit]

Every other line, by name, is for fitting and for choosing thresholds; the others are measured. With
``--fit`` the weights in ``stages/animeme_stages/check/delivery`` are written anew.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import animeme
from animeme import registry
from animeme.contracts import Speech
from animeme.delivery import Performance
from animeme.phones import PhoneTrack
from animeme_stages.check.delivery import expected, sound
from animeme_stages.check.delivery.signals import opening_at
from animeme_stages.check.delivery.sync import Sync, Verdict, guesses, loud_of, verdict
from animeme_stages.dataset.motion import read_motion
from animeme_stages.ingest.audio import read_speech
from animeme_stages.retarget.retarget import retarget

Floats = NDArray[np.float64]
TARGET = Path(expected.__file__).with_name(expected.WEIGHTS)
RIDGE = 1000.0
# Other lines that a line's lips are tried with, by how far off they are in the list.
OTHERS = (7, 31, 59, 113, 171)
SHIFTS_MS = (120, -120)
LIMITS = {name: float(spec.value) for name, spec in Sync.limits.items()}  # type: ignore[arg-type]
KINDS = ("sound", "phones", "sound and phones")
MODELS = ("dam", "cohen-massaro")


@dataclass(frozen=True)
class Line:
    """Lip gap, 100 a second, and what the guess is made from, per kind."""

    gap: Floats
    speech: Speech
    track: PhoneTrack
    features: dict[str, Floats]


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("folder", type=Path)
    arguments.add_argument("alignments", type=Path)
    arguments.add_argument("--fit", action="store_true")
    given = arguments.parse_args()
    names = sorted(path.stem for path in (given.folder / "lines").glob("*.flac"))
    lines = [line_of(given.folder / "lines" / name, given.alignments) for name in names]
    if given.fit:
        fit(lines[0::2])
        expected._weights.cache_clear()
    for title, chosen in (("fitted to", lines[0::2]), ("held out", lines[1::2])):
        measure(f"{title}, by sound and phones", chosen, phones=True)
        measure(f"{title}, by sound alone", chosen, phones=False)


def line_of(path: Path, alignments: Path) -> Line:
    """What is measured of one line."""
    speech = read_speech(path.with_suffix(".flac"))
    heard = sound.features(speech)
    aligned = json.loads(next(alignments.rglob(f"{path.stem}.json")).read_text(encoding="utf-8"))
    track = PhoneTrack.from_document(aligned)
    motion = read_motion(path.with_suffix(".csv"))
    gap = motion.values[:, motion.controls.index("lip_gap")]
    known = np.isfinite(gap)
    at_s = np.arange(len(heard)) / sound.RATE_HZ
    said = expected.phone_features(track, len(heard))
    return Line(
        np.interp(at_s, motion.times_s[known], gap[known]),
        speech,
        track,
        dict(zip(KINDS, (heard, said, np.hstack([heard, said])), strict=True)),
    )


def fit(lines: list[Line]) -> None:
    """Ridge regression of openings without posture, each line at its own scale."""
    document: dict[str, object] = {
        "source": "GRID corpus, speaker s1 (Cooke et al. 2006, CC BY 4.0), every other line"
    }
    for kind in KINDS:
        document[kind] = ridge([(line.gap, line.features[kind]) for line in lines])
    document["models"] = ridge(
        [
            (opened, line.features["phones"])
            for name in MODELS
            for line, opened in zip(lines, spoken_by(name, lines), strict=True)
        ]
    )
    TARGET.write_text(json.dumps(document) + "\n", encoding="utf-8")


def ridge(pairs: list[tuple[Floats, Floats]]) -> list[float]:
    """Weights of the features that give the openings best."""
    size = pairs[0][1].shape[1]
    products, sums = np.zeros((size, size)), np.zeros(size)
    for opened, features in pairs:
        lips = sound.without_posture(opened)
        products += features.T @ features
        sums += features.T @ ((lips - lips.mean()) / lips.std())
    weights = np.linalg.solve(products + RIDGE * np.eye(size), sums)
    return [round(float(weight), 5) for weight in weights]


def spoken_by(name: str, lines: list[Line]) -> list[Floats]:
    """How far a model opens the mouth of the sample's head in each line."""
    asset = Path(__file__).parents[2] / "sample_assets" / "ada.glb"
    rig = registry.stage("bind-rig")("auto", registry.format_of(asset).load(asset), Path())
    model = animeme.load_model(name)
    found = []
    for line in lines:
        curves = retarget(model.synthesize(line.track, rate_hz=60.0), rig, {})
        performance = Performance(asset, name, name, "en", "", curves, (), rig, {})
        at_s = np.arange(len(line.gap)) / sound.RATE_HZ
        found.append(opening_at(performance, at_s))
    return found


def measure(title: str, lines: list[Line], *, phones: bool) -> None:
    """Print how many lines are flagged, at the shipped limits and around them."""
    expected = [guesses(line.speech, line.track if phones else None) for line in lines]
    lags_s = [verdict_of(line, guess).lag_s for line, guess in zip(lines, expected, strict=True)]
    near = np.mean(np.abs(lags_s) <= 0.0401)
    print(f"{title}: {len(lines)} lines, lag within ±40 ms for {near:.1%}")
    cases = {f"{ms:+d} ms": (ms, 0) for ms in (0, *SHIFTS_MS)}
    cases |= {f"line {other} further on": (0, other) for other in OTHERS}
    found = {
        case: [
            verdict_of(line, expected[(index + other) % len(lines)], late_ms)
            for index, line in enumerate(lines)
        ]
        for case, (late_ms, other) in cases.items()
    }
    for factor in (0.9, 1.0, 1.1):
        flagged = {
            case: float(np.mean([each.clear < factor * each.least for each in verdicts]))
            for case, verdicts in found.items()
        }
        others = [share for case, share in flagged.items() if case.startswith("line")]
        shifts = ", ".join(f"{case} {share:.1%}" for case, share in flagged.items() if "ms" in case)
        print(
            f"    limits × {factor}: doubted {shifts}, another line's recording "
            f"{np.mean(others):.1%} ({min(others):.1%} to {max(others):.1%})"
        )


def verdict_of(line: Line, expected: dict[str, Floats], late_ms: int = 0) -> Verdict:
    """The check's, of lips that are late."""
    at = np.arange(len(line.gap)) - late_ms * sound.RATE_HZ // 1000
    moved = np.interp(at, np.arange(len(line.gap)), line.gap)
    return verdict(moved, expected, loud_of(line.speech), LIMITS)


if __name__ == "__main__":
    main()
