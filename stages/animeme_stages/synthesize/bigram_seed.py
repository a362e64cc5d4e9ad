"""A whole set of bigrams from any model: what an animator starts from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from animeme.bigrams import Seeded
from animeme.contracts import Model
from animeme.curves import CurveSet, Floats
from animeme.dataset import CapturedLine, Dataset, Listener, no_listener
from animeme.errors import InputError
from animeme.findings import Finding, Severity
from animeme.phones import SILENCE, Phone, PhoneTrack, contiguous
from animeme_stages.crossmap.solve import bounded_least_squares
from animeme_stages.synthesize.articulation import pieces
from animeme_stages.synthesize.bigram import Bigram
from animeme_stages.synthesize.bigram_files import (
    HOLD_S,
    PAUSE_HOLD_S,
    SCHEMA,
    DrawnSet,
    drawn_from_json,
    find_set,
)
from animeme_stages.synthesize.bigram_fit import (
    POINTS,
    fit_polygons_of,
    greville,
    polygon_matrix,
)
from animeme_stages.synthesize.bigram_passes import USUAL_LIMIT, Segments, segments
from animeme_stages.synthesize.bigram_set import COMMON, PAUSE
from animeme_stages.synthesize.contacts import contact_spans

# Every pair is heard this often, each time between other phones and at other lengths.
ROUNDS = 16
_RATE_HZ = 60.0
# Lengths of phones and pauses are drawn from these, seconds: those of read and spoken English.
_VOWEL_S = (0.08, 0.16)
_CONSONANT_S = (0.055, 0.1)
_PAUSE_S = (0.1, 0.3)
# What leaving out keys may cost, in weights of a pose.
_KEY_ERROR = 0.02
# A pose that never gets beyond this in a pair is left out of it.
_LEAST = 0.04
_DIGITS = 3
# The model's firmest closures, as a quantile of all frames: about 1 in 20 phones is one.
_FIRM = 0.98
# Poses do not conflict where one is up for more than this part of the time that the other is.
_TOGETHER = 0.3
# Limit of a pose at the firmest and one that gives way. As measured on ada's mesh, 18 lines: with
# 0.5 vowels between labials stay shut, with 1.0 one closure in five does not close to 0.02.
_SEEDED_LIMIT = 0.85
# Polygons, being averages, do not quite reach the model's firmest closure.
_BLUNTED = 1.2
_CONTACT_COUNTS = 3.0
# Of several blends of poses that look alike, the one with small weights is meant.
_PENALTY = 1e-3
# A pose is not played beyond this.
_MOST = 1.5


def seed_bigrams(
    model: Model, bigrams: str | None, base: str | None, listener: Listener = no_listener
) -> Seeded:
    """Bigrams of every pair of classes, and of each class with a pause, that move like `model`.

    The model speaks rounds of phones in which each pair occurs once, at lengths and between
    neighbours that differ from round to round; its controls become weights of the poses by
    non-negative least squares; polygons are fitted to these as the stitching plays them, and given
    as few keys as they need.

    Args:
        model: any.
        bigrams: shipped name or file of the set that gives poses, classes and conflicts; None takes
            the model's controls as poses.
        base: what the document says that it extends, None for nothing.
        listener: told of progress.

    Raises:
        InputError: no pose has a control that the model moves.
    """
    poses = find_set(bigrams) if bigrams is not None else None
    classes = poses.set_.classes if poses else COMMON
    tracks = [_round(classes, number) for number in range(ROUNDS + 1)]
    spoken = []
    for number, track in enumerate(tracks):
        spoken.append(model.synthesize(track, rate_hz=_RATE_HZ))
        listener("speaking", (number + 1) / len(tracks))
    names, matrix, findings = _poses(poses, model.controls)
    strength = np.ones(len(names))
    limits: list[dict[str, Any]] = []
    weights = [curves.weights for curves in spoken[1:]]
    if poses is not None:
        weights = [
            bounded_least_squares(matrix.T, one, upper=_MOST, penalty=_PENALTY) for one in weights
        ]
        strength, limits = _strength(poses, names, np.concatenate(weights))
    lines = tuple(
        CapturedLine(f"{number:03}", track, curves.times_s, one / strength)
        for number, (track, curves, one) in enumerate(
            zip(tracks[1:], spoken[1:], weights, strict=True)
        )
    )
    dataset = Dataset(names, lines)
    found, _, _ = fit_polygons_of(dataset, classes, listener, _lay, _emphasis)
    lowest = 0.0 if poses is not None else -np.inf
    pairs = {
        f"{a}|{b}": {"curves": _keys(found[f"{a}|{b}"], names, lowest)}
        for a in (*classes, PAUSE)
        for b in (*classes, PAUSE)
        if f"{a}|{b}" in found
    }
    document: dict[str, Any] = {"schema": SCHEMA, "name": f"like {model.name}"}
    if base:
        document["extends"] = base
    if poses is not None:  # weights are displacements from rest, and so is what lasts
        pairs[f"{PAUSE}|{PAUSE}"] = {"curves": {}}
    credits = getattr(model, "credits_", "")
    source = f"seeded from the model '{model.name}'" + (f": {credits}" if credits else "")
    document |= {"source": source, "licence": ""}
    if poses is not None:
        document["poses"] = {
            pose: {c: round(_BLUNTED * w * scale, 4) for c, w in poses.driven_by(pose).items()}
            for pose, scale in zip(names, strength.tolist(), strict=True)
            if scale != 1.0
        }
        document["conflicts"] = limits
    document |= {"window_s": 0.0, "pairs": pairs}
    rmse, correlation = _judged(document, poses, tracks[0], spoken[0])
    return Seeded(document, rmse, correlation, tuple(findings))


def _strength(
    poses: DrawnSet, names: Sequence[str], weights: Floats
) -> tuple[Floats, list[dict[str, Any]]]:
    """How far the model takes each pose that another gives way to, 1 for the others; shape (K,).

    At weight 1 such a pose is to be as firm as the model makes it: then what conflicts with it
    gives way altogether, and lips meet whatever the lengths of the phones. Poses that the model
    itself brings together do not conflict. The second value has the limits, as a document does.
    """
    strength = np.ones(len(names))
    limits: list[dict[str, Any]] = []
    rank = {pose: place for place, pose in enumerate(poses.set_.priority)}
    for pair, limit in sorted(poses.set_.limits.items(), key=lambda entry: sorted(entry[0])):
        weak, strong = sorted(pair, key=lambda pose: rank.get(pose, -1))
        if strong not in rank or not pair <= set(names):
            continue
        low, high = weights[:, names.index(weak)], weights[:, names.index(strong)]
        firm = round(float(np.quantile(high, _FIRM)), _DIGITS)
        if firm <= 0:
            continue
        if np.mean(low[high > firm / 2] > limit / 4) > _TOGETHER:
            limits.append({"poses": [weak, strong], "limit": USUAL_LIMIT})
        else:
            strength[names.index(strong)] = firm
            limits.append({"poses": [weak, strong], "limit": _SEEDED_LIMIT})
    return strength, limits


def _emphasis(line: CapturedLine) -> Floats:
    """Frames in which lips meet count more: what is missed there is seen."""
    counts = np.ones(len(line.times_s))
    for span in contact_spans(line.track):
        counts[(line.times_s >= span.start_s) & (line.times_s <= span.end_s)] = _CONTACT_COUNTS
    return counts


def _lay(track: PhoneTrack) -> Segments:
    return segments(track, hold_s=HOLD_S, pause_hold_s=PAUSE_HOLD_S)


def _round(classes: Mapping[str, Sequence[str]], number: int) -> PhoneTrack:
    """A track in which every pair of classes, and of each with a pause, occurs once.

    An Euler circuit of the complete graph of classes (Hierholzer 1873), different in each round.
    """
    random = np.random.default_rng(number)
    names = [name for name in (*classes, PAUSE) if name == PAUSE or classes[name]]
    left = {name: [names[i] for i in random.permutation(len(names))] for name in names}
    stack, circuit = [PAUSE], []
    while stack:
        if left[stack[-1]]:
            stack.append(left[stack[-1]].pop())
        else:
            circuit.append(stack.pop())
    # Backwards it is a circuit as well; the first and last are the same pause.
    phones: list[Phone] = []
    at_s = 0.0
    for name in circuit[::-1]:
        symbols = classes.get(name, (SILENCE,))
        symbol = symbols[int(random.integers(len(symbols)))]
        length_s = round(float(random.uniform(*_range_s(symbol))), 3)
        phones.append(Phone(symbol, at_s, at_s + length_s))
        at_s += length_s
    return PhoneTrack("und", "ipa", contiguous(phones, at_s))


def _range_s(symbol: str) -> tuple[float, float]:
    if symbol == SILENCE:
        return _PAUSE_S
    known = pieces(symbol)
    return _VOWEL_S if known and known[0].vowel else _CONSONANT_S


def _poses(
    poses: DrawnSet | None, controls: Sequence[str]
) -> tuple[tuple[str, ...], Floats, list[Finding]]:
    """Poses that the model can fill, their controls, shape (K, len(controls)), and what is said."""
    if poses is None:
        return tuple(controls), np.eye(len(controls)), []
    rows, names, lacking = [], [], []
    for pose in poses.poses or poses.set_.poses:
        row = np.zeros(len(controls))
        for control, weight in poses.driven_by(pose).items():
            if control in controls:
                row[controls.index(control)] = weight
        if row.any():
            rows.append(row)
            names.append(pose)
        else:
            lacking.append(pose)
    if not rows:
        raise InputError(
            "bigrams-poses", "none of the poses has a control that the model moves",
            place="--poses", action="Give poses over controls of the model, or say "
            "--poses controls.",
        )  # fmt: skip
    finding = Finding(
        Severity.INFO, "bigrams-pose-empty",
        f"the model moves no control of some poses, which stay at rest: {', '.join(lacking)}",
        action="Draw them by hand, or seed from a model that moves their controls.",
    )  # fmt: skip
    return tuple(names), np.array(rows), [finding] if lacking else []


def _keys(polygon: Floats, names: Sequence[str], lowest: float) -> dict[str, list[list[float]]]:
    """Keys of each pose that moves, as few as keep its curve within `_KEY_ERROR`."""
    whole = polygon_matrix() @ polygon
    found = {}
    for column, name in enumerate(names):
        curve = np.maximum(whole[:, column], lowest)
        if np.abs(curve).max() <= _LEAST:
            continue
        for points in range(2, POINTS + 1):
            basis = polygon_matrix(points)
            weights = np.maximum(np.linalg.lstsq(basis, curve)[0], lowest)
            if np.abs(basis @ weights - curve).max() <= _KEY_ERROR:
                break
        at = np.round(greville(points), _DIGITS).tolist()
        keys = np.round(weights, _DIGITS).tolist()
        found[name] = [list(key) for key in zip(at, keys, strict=True)]
    return found


def _judged(
    document: Mapping[str, Any], poses: DrawnSet | None, track: PhoneTrack, spoken: CurveSet
) -> tuple[dict[str, float], dict[str, float | None]]:
    """Differences from the model in a round that the set was not fitted to."""
    whole = {**document, "extends": None}
    if poses is not None:
        base = poses.to_json()
        whole = {
            **base,
            **whole,
            "poses": base["poses"] | document["poses"],
            "conflicts": base["conflicts"] + document["conflicts"],
        }
    played = Bigram.from_set(drawn_from_json(whole)).synthesize(track, rate_hz=_RATE_HZ)
    weights = played.sample(spoken.times_s)
    rmse: dict[str, float] = {}
    correlation: dict[str, float | None] = {}
    for name in spoken.names:
        own = spoken.curve(name)
        found = played.names.index(name) if name in played.names else None
        drawn = np.zeros(len(own)) if found is None else weights[:, found]
        rmse[name] = round(float(np.sqrt(np.mean((own - drawn) ** 2))), 4)
        still = own.std() < 1e-6 or drawn.std() < 1e-6
        correlation[name] = None if still else round(float(np.corrcoef(own, drawn)[0, 1]), 3)
    return rmse, correlation
