"""Kinds of damage to the motion of a delivered line: sound files with lips that are wrong."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from animeme.curves import CurveSet
from bench.damage_kinds import Kind, Output, Unsuitable, kind, lines_of, rewritten

Change = Callable[[CurveSet, random.Random], CurveSet]
FRAME_S = 1 / 60


def _curves(change: Change) -> Callable[[Output, Path, random.Random], None]:
    def apply(output: Output, target: Path, chance: random.Random) -> None:
        lines = lines_of(output)
        at = chance.randrange(len(lines))
        lines[at] = replace(lines[at], curves=change(lines[at].curves, chance))
        rewritten(output, target, lines)

    return apply


def _frames(curves: CurveSet) -> tuple[Any, Any]:
    at_s = np.arange(0.0, curves.duration_s + 1e-9, FRAME_S)
    return at_s, curves.sample(at_s)


def _moving(curves: CurveSet, chance: random.Random, least: float = 0.15) -> int:
    spread = np.ptp(curves.weights, axis=0)
    moving = np.flatnonzero(spread > least)
    if not len(moving):
        raise Unsuitable
    return int(chance.choice(moving.tolist()))


def _shifted(by_s: float) -> Change:
    def change(curves: CurveSet, _: random.Random) -> CurveSet:
        at_s, _weights = _frames(curves)
        return CurveSet(at_s, curves.names, curves.sample(at_s - by_s))

    return change


def _lag(curves: CurveSet, chance: random.Random) -> CurveSet:
    return _shifted(chance.choice((-1, 1)) * chance.uniform(0.12, 0.3))(curves, chance)


def _late(curves: CurveSet, chance: random.Random) -> CurveSet:
    by_s = chance.uniform(0.1, 0.5)
    return CurveSet(curves.times_s + by_s, curves.names, curves.weights)


def _short(curves: CurveSet, chance: random.Random) -> CurveSet:
    at_s, weights = _frames(curves)
    kept = int(len(at_s) * chance.uniform(0.3, 0.85))
    return CurveSet(at_s[:kept], curves.names, weights[:kept])


def _rate(curves: CurveSet, chance: random.Random) -> CurveSet:
    return CurveSet(curves.times_s * chance.choice((0.8, 1.25)), curves.names, curves.weights)


def _flat(curves: CurveSet, chance: random.Random) -> CurveSet:
    return CurveSet(curves.times_s, curves.names, curves.weights * chance.uniform(0.01, 0.06))


def _shut(curves: CurveSet, chance: random.Random) -> CurveSet:
    at_s, weights = _frames(curves)
    moving = np.flatnonzero(np.abs(weights).max(axis=1) > 0.05)
    if not len(moving):
        raise Unsuitable
    first = int(moving[0] + chance.uniform(0.2, 0.4) * (moving[-1] - moving[0]))
    weights[first:] = 0.0
    return CurveSet(at_s, curves.names, weights)


def _beyond(curves: CurveSet, chance: random.Random) -> CurveSet:
    column = _moving(curves, chance)
    weights = curves.weights.copy()
    weights[:, column] *= chance.uniform(1.3, 3.0) / weights[:, column].max()
    return CurveSet(curves.times_s, curves.names, weights)


def _one_side(curves: CurveSet, chance: random.Random) -> CurveSet:
    spread = np.ptp(curves.weights, axis=0)
    sided = [
        i for i, name in enumerate(curves.names)
        if name.endswith(("Left", "Right")) and not name.startswith("jaw") and spread[i] > 0.16
        and name not in ("mouthLeft", "mouthRight")
    ]  # fmt: skip
    if not sided:
        raise Unsuitable
    weights = curves.weights.copy()
    weights[:, chance.choice(sided)] = 0.0
    return CurveSet(curves.times_s, curves.names, weights)


def _copied(curves: CurveSet, chance: random.Random) -> CurveSet:
    column = _moving(curves, chance)
    if curves.names[column].endswith(("Left", "Right")):
        raise Unsuitable
    others = [n for n in curves.names if n != curves.names[column]]
    other = curves.names.index(chance.choice(others))
    weights = curves.weights.copy()
    weights[:, other] = weights[:, column]
    return CurveSet(curves.times_s, curves.names, weights)


def _spike(curves: CurveSet, chance: random.Random) -> CurveSet:
    at_s = np.arange(0.0, curves.duration_s, 1 / 30)
    weights = curves.sample(at_s)
    column = chance.randrange(len(curves.names))
    frame = chance.randrange(len(at_s) // 4, 3 * len(at_s) // 4)
    away = chance.uniform(0.5, 0.9)
    near = weights[frame - 1 : frame + 2, column]
    weights[frame, column] = near.max() + away if near.max() + away < 1 else near.min() - away
    return CurveSet(at_s, curves.names, weights)


def _jump(curves: CurveSet, chance: random.Random) -> CurveSet:
    at_s, weights = _frames(curves)
    column = chance.randrange(len(curves.names))
    frame = chance.randrange(len(at_s) // 4, 3 * len(at_s) // 4)
    weights[:frame, column] = 0.0
    weights[frame:, column] = chance.uniform(0.75, 1.0)
    return CurveSet(at_s, curves.names, weights)


def _stuck(curves: CurveSet, chance: random.Random) -> CurveSet:
    weights = curves.weights.copy()
    weights[:, chance.randrange(len(curves.names))] = chance.uniform(0.2, 0.9)
    return CurveSet(curves.times_s, curves.names, weights)


def _still(curves: CurveSet, _: random.Random) -> CurveSet:
    return CurveSet(curves.times_s, curves.names, curves.weights * 0)


def _dense(curves: CurveSet, chance: random.Random) -> CurveSet:
    at_s = np.arange(0.0, curves.duration_s, 1 / chance.choice((240, 480, 1000)))
    return CurveSet(at_s, curves.names, curves.sample(at_s))


def _noise(curves: CurveSet, chance: random.Random) -> CurveSet:
    at_s, weights = _frames(curves)
    random_ = np.random.default_rng(chance.randrange(1 << 30))
    smooth = np.ones(6) / 6
    for column in np.flatnonzero(np.ptp(weights, axis=0) > 0.05):
        noise = np.convolve(random_.uniform(0, 1, len(at_s) + 5), smooth, "valid")
        weights[:, column] = noise * weights[:, column].max()
    return CurveSet(at_s, curves.names, weights)


def _timer(curves: CurveSet, chance: random.Random) -> CurveSet:
    at_s, weights = _frames(curves)
    wave = 0.5 - 0.5 * np.cos(2 * np.pi * chance.uniform(3, 6) * at_s)
    return CurveSet(at_s, curves.names, wave[:, None] * weights.max(axis=0))


def _another(output: Output, target: Path, chance: random.Random) -> None:
    lines = lines_of(output)
    at = chance.randrange(len(lines))
    if len(lines) > 1:
        other = lines[at - 1]
    elif output.others:
        other = lines_of(replace(output, path=chance.choice(output.others)))[0]
    else:
        raise Unsuitable
    lines[at] = replace(lines[at], curves=other.curves)
    rewritten(output, target, lines)


def _other_take(output: Output, target: Path, chance: random.Random) -> None:
    lines = lines_of(output)
    at = chance.randrange(len(lines))
    lines[at] = replace(lines[at], duration_s=lines[at].duration_s * chance.uniform(0.7, 0.95))
    rewritten(output, target, lines)


MISTIMED = "sync-lag sync-unrelated articulation-unrelated"
KINDS: Mapping[str, Kind] = {
    "late start": kind("times-late", _curves(_late)),
    "shifted 120 to 300 ms": kind("sync-lag", _curves(_lag)),
    "another line's motion": kind(f"{MISTIMED} animation-short animation-long", _another),
    "cut short": kind("animation-short", _curves(_short)),
    "24 for 30 frames": kind(f"animation-short animation-long {MISTIMED}", _curves(_rate)),
    "gain of a few percent": kind("delivery-flat animation-still", _curves(_flat)),
    "shut before its end": kind(f"speech-mouth-closed {MISTIMED}", _curves(_shut)),
    "beyond the range": kind("weight-out-of-range", _curves(_beyond)),
    "one side lost": kind("sides-differ", _curves(_one_side)),
    "one curve on two shapes": kind("curves-alike", _curves(_copied)),
    "a frame sticks out": kind("shape-pops", _curves(_spike)),
    "a jump": kind("shape-too-fast", _curves(_jump)),
    "stuck": kind("curve-stuck", _curves(_stuck)),
    "nothing moves": kind("animation-still", _curves(_still)),
    "dense keys": kind("keys-dense", _curves(_dense)),
    "noise": kind(f"{MISTIMED} shape-too-fast", _curves(_noise)),
    "jaw on a timer": kind(MISTIMED, _curves(_timer)),
    "another take": kind("recording-changed", _other_take),
}  # fmt: skip
