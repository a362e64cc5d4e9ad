"""Kinds of damage that a delivered file may have, each with the codes that name it rightly."""

from __future__ import annotations

import random
import shutil
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Sdf, Usd, UsdSkel

from animeme import registry
from animeme.contracts import LineAnimation
from animeme.curves import CurveSet
from animeme.files import anywhere
from support.deliveries import edited, float_of

Change = Callable[[CurveSet, random.Random], CurveSet]
FRAME_S = 1 / 60


class Unsuitable(Exception):  # noqa: N818  no error: another kind is taken
    """A file has nothing that could be damaged in this way."""


@dataclass(frozen=True)
class Output:
    """A file that animeme delivered.

    Attributes:
        path: the file.
        source: what it was made from.
        layout: of its character.
        others: files of the same character and language with other lines.
        languages: folders of the delivery.
    """

    path: Path
    source: Path
    layout: str
    others: Sequence[Path]
    languages: Sequence[str]


@dataclass(frozen=True)
class Kind:
    """A kind of damage.

    Attributes:
        codes: any of them says what is wrong.
        apply: puts the damaged file at the path that it is given, or elsewhere, or nowhere.
    """

    codes: frozenset[str]
    apply: Callable[[Output, Path, random.Random], None]


def _lines(output: Output) -> list[LineAnimation]:
    form = registry.format_of(output.path)
    notes = {
        t.animation: t.note
        for t in form.stored(form.load(output.path, within=anywhere(output.path)))
        if t.note
    }  # type: ignore[attr-defined]
    return [
        LineAnimation(
            str(notes[name]["line"]), str(notes[name]["language"]), curves,
            float(notes[name]["duration_s"]),
        )
        for name, curves in form.read_animations(output.path).items()
        if name in notes
    ]  # fmt: skip


def rewritten(output: Output, target: Path, lines: Sequence[LineAnimation]) -> None:
    """The source with `lines`, in the output's layout."""
    form = registry.format_of(output.source)
    character = form.load(output.source)
    form.for_layout(output.layout, character).write(character, lines, target)


def _curves(change: Change) -> Callable[[Output, Path, random.Random], None]:
    def apply(output: Output, target: Path, chance: random.Random) -> None:
        lines = _lines(output)
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
    lines = _lines(output)
    at = chance.randrange(len(lines))
    if len(lines) > 1:
        other = lines[at - 1]
    elif output.others:
        other = _lines(replace(output, path=chance.choice(output.others)))[0]
    else:
        raise Unsuitable
    lines[at] = replace(lines[at], curves=other.curves)
    rewritten(output, target, lines)


def _other_take(output: Output, target: Path, chance: random.Random) -> None:
    lines = _lines(output)
    at = chance.randrange(len(lines))
    lines[at] = replace(lines[at], duration_s=lines[at].duration_s * chance.uniform(0.7, 0.95))
    rewritten(output, target, lines)


def _cut_off(output: Output, target: Path, chance: random.Random) -> None:
    content = output.path.read_bytes()
    target.write_bytes(content[: int(len(content) * chance.uniform(0.05, 0.95))])


def _garbled(output: Output, target: Path, chance: random.Random) -> None:
    content = bytearray(output.path.read_bytes())
    content[:64] = chance.randbytes(64)
    target.write_bytes(content)


def _glb(edit: Callable[[dict[str, Any], bytearray, random.Random], None]) -> Any:
    def apply(output: Output, target: Path, chance: random.Random) -> None:
        if target.suffix != ".glb":
            raise Unsuitable
        edited(output.path, target, lambda document, binary: edit(document, binary, chance))

    return apply


def _either(glb: Any, usd: Callable[[Usd.Stage, random.Random], None]) -> Any:
    def apply(output: Output, target: Path, chance: random.Random) -> None:
        if target.suffix == ".glb":
            _glb(glb)(output, target, chance)
            return
        shutil.copy(output.path, target)
        layer = Sdf.Layer.FindOrOpen(str(target))
        stage = Usd.Stage.Open(layer)
        usd(stage, chance)
        layer.Save()

    return apply


def _ours(document: Mapping[str, Any]) -> list[dict[str, Any]]:
    return [a for a in document["animations"] if "animeme" in a.get("extras", {})]


def _samplers(document: Mapping[str, Any], chance: random.Random) -> dict[str, Any]:
    animation = chance.choice(_ours(document))
    channels = [c for c in animation["channels"] if c["target"]["path"] == "weights"]
    sampler: dict[str, Any] = animation["samplers"][chance.choice(channels)["sampler"]]
    return sampler


def _put(document: Mapping[str, Any], binary: bytearray, accessor: int, at: int, v: float) -> None:
    struct.pack_into("<f", binary, float_of(dict(document), accessor, at), v)


def _nan(document: dict[str, Any], binary: bytearray, chance: random.Random) -> None:
    accessor = _samplers(document, chance)["output"]
    at = chance.randrange(document["accessors"][accessor]["count"])
    _put(document, binary, accessor, at, chance.choice((float("nan"), float("inf"))))


def _back(document: dict[str, Any], binary: bytearray, chance: random.Random) -> None:
    accessor = _samplers(document, chance)["input"]
    count = document["accessors"][accessor]["count"]
    if count < 3:
        raise Unsuitable
    _put(document, binary, accessor, chance.randrange(2, count), 0.0)


def _negative(document: dict[str, Any], binary: bytearray, chance: random.Random) -> None:
    _put(document, binary, _samplers(document, chance)["input"], 0, -chance.uniform(0.1, 1))


def _fewer(document: dict[str, Any], _: bytearray, chance: random.Random) -> None:
    document["accessors"][_samplers(document, chance)["output"]]["count"] -= 1


def _astray(document: dict[str, Any], _: bytearray, chance: random.Random) -> None:
    channel = chance.choice(chance.choice(_ours(document))["channels"])
    if chance.random() < 0.5:
        channel["sampler"] = 99
    else:
        channel["target"]["node"] = 9999


def _twice(document: dict[str, Any], _: bytearray, chance: random.Random) -> None:
    document["animations"].append(chance.choice(_ours(document)))


def _misspelt(document: dict[str, Any], _: bytearray, chance: random.Random) -> None:
    for holder in (*document["meshes"], *(p for m in document["meshes"] for p in m["primitives"])):
        names = holder.get("extras", {}).get("targetNames")
        if names:
            holder["extras"]["targetNames"] = [f"bs_{i:02}" for i in range(len(names))]


def _edited_source(document: dict[str, Any], _: bytearray, chance: random.Random) -> None:
    if "materials" not in document:
        raise Unsuitable
    if chance.random() < 0.5:
        node = chance.choice([n for n in document["nodes"] if "mesh" in n])
        node["translation"] = [0.0, chance.uniform(0.01, 0.1), 0.0]
    else:
        chance.choice(document["materials"])["alphaMode"] = "MASK"


def _animation(stage: Usd.Stage, chance: random.Random) -> Usd.Attribute:
    found = [
        UsdSkel.Animation(prim).GetBlendShapeWeightsAttr()
        for prim in stage.TraverseAll()
        # What stands for the line that is played refers to one of these.
        if prim.IsA(UsdSkel.Animation)
        and prim.GetCustomData().get("animeme")
        and prim.GetName() != "active"
    ]
    if not found:
        raise Unsuitable
    return chance.choice(found)


def _usd_nan(stage: Usd.Stage, chance: random.Random) -> None:
    weights = _animation(stage, chance)
    at = chance.choice(weights.GetTimeSamples())
    row = list(weights.Get(at))
    row[chance.randrange(len(row))] = chance.choice((float("nan"), float("inf")))
    weights.Set(row, at)


def _usd_negative(stage: Usd.Stage, chance: random.Random) -> None:
    weights = _animation(stage, chance)
    weights.Set(weights.Get(0.0), -chance.uniform(0.1, 1) * stage.GetTimeCodesPerSecond())


def _usd_fewer(stage: Usd.Stage, chance: random.Random) -> None:
    weights = _animation(stage, chance)
    at = chance.choice(weights.GetTimeSamples())
    weights.Set(list(weights.Get(at))[:-1], at)


def _usd_astray(stage: Usd.Stage, chance: random.Random) -> None:
    names = UsdSkel.Animation(_animation(stage, chance).GetPrim()).GetBlendShapesAttr()
    listed = list(names.Get())
    listed[chance.randrange(len(listed))] = "nobodysShape"
    names.Set(listed)


def _usd_edited(stage: Usd.Stage, chance: random.Random) -> None:
    from pxr import Gf, UsdGeom

    meshes = [prim for prim in stage.TraverseAll() if prim.IsA(UsdGeom.Mesh)]
    mesh = UsdGeom.Mesh(chance.choice(meshes))
    points = list(mesh.GetPointsAttr().Get())
    at = chance.randrange(len(points))
    points[at] = points[at] + Gf.Vec3f(0, chance.uniform(0.01, 0.1), 0)
    mesh.GetPointsAttr().Set(points)


def moved_name(target: Path) -> Path:
    """What a file that lies in the folder of another language is called there."""
    return target.with_stem(f"{target.stem}-moved")


def _other_language(output: Output, target: Path, chance: random.Random) -> None:
    parts = list(target.parts)
    at = next((i for i in range(len(parts) - 1, 0, -1) if parts[i] in output.languages), None)
    others = [language for language in output.languages if at and language != parts[at]]
    if at is None or not others:
        raise Unsuitable
    parts[at] = chance.choice(others)
    moved = moved_name(Path(*parts))
    moved.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(output.path, moved)


def _lost(output: Output, target: Path, chance: random.Random) -> None:
    lines = _lines(output)
    if len(lines) > 1:
        del lines[chance.randrange(len(lines))]
        rewritten(output, target, lines)


def _kind(codes: str, apply: Callable[[Output, Path, random.Random], None]) -> Kind:
    return Kind(frozenset(codes.split()), apply)


MISTIMED = "sync-lag sync-unrelated articulation-unrelated"
KINDS: Mapping[str, Kind] = {
    "cut off": _kind("asset-unreadable", _cut_off),
    "garbled head": _kind("asset-unreadable", _garbled),
    "shapes misspelt": _kind("rig-unknown rig-incomplete", _glb(_misspelt)),
    "source edited": _kind("source-changed", _either(_edited_source, _usd_edited)),
    "a weight is no number": _kind("weights-not-finite", _either(_nan, _usd_nan)),
    "times go back": _kind("times-not-increasing", _glb(_back)),
    "times before 0": _kind("times-negative", _either(_negative, _usd_negative)),
    "weights too few": _kind("weights-count", _either(_fewer, _usd_fewer)),
    "channel astray": _kind("animation-broken", _either(_astray, _usd_astray)),
    "a name twice": _kind("animation-name-twice", _glb(_twice)),
    "late start": _kind("times-late", _curves(_late)),
    "shifted 120 to 300 ms": _kind("sync-lag", _curves(_lag)),
    "another line's motion": _kind(f"{MISTIMED} animation-short animation-long", _another),
    "cut short": _kind("animation-short", _curves(_short)),
    "24 for 30 frames": _kind(f"animation-short animation-long {MISTIMED}", _curves(_rate)),
    "gain of a few percent": _kind("delivery-flat animation-still", _curves(_flat)),
    "shut before its end": _kind(f"speech-mouth-closed {MISTIMED}", _curves(_shut)),
    "beyond the range": _kind("weight-out-of-range", _curves(_beyond)),
    "one side lost": _kind("sides-differ", _curves(_one_side)),
    "one curve on two shapes": _kind("curves-alike", _curves(_copied)),
    "a frame sticks out": _kind("shape-pops", _curves(_spike)),
    "a jump": _kind("shape-too-fast", _curves(_jump)),
    "stuck": _kind("curve-stuck", _curves(_stuck)),
    "nothing moves": _kind("animation-still", _curves(_still)),
    "dense keys": _kind("keys-dense", _curves(_dense)),
    "noise": _kind(f"{MISTIMED} shape-too-fast", _curves(_noise)),
    "jaw on a timer": _kind(MISTIMED, _curves(_timer)),
    "another take": _kind("recording-changed", _other_take),
    "in another language": _kind("language-wrong", _other_language),
    "a line is lost": _kind("line-missing", _lost),
}  # fmt: skip
