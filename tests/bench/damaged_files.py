"""Kinds of damage to delivered files: bytes, structure, names, and where they lie."""

from __future__ import annotations

import random
import shutil
import struct
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel

from bench.damage_kinds import Kind, Output, Unsuitable, kind, lines_of, rewritten
from support.deliveries import edited, float_of


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
    lines = lines_of(output)
    if len(lines) > 1:
        del lines[chance.randrange(len(lines))]
        rewritten(output, target, lines)


KINDS: Mapping[str, Kind] = {
    "cut off": kind("asset-unreadable", _cut_off),
    "garbled head": kind("asset-unreadable", _garbled),
    "shapes misspelt": kind("rig-unknown rig-incomplete", _glb(_misspelt)),
    "source edited": kind("source-changed", _either(_edited_source, _usd_edited)),
    "a weight is no number": kind("weights-not-finite", _either(_nan, _usd_nan)),
    "times go back": kind("times-not-increasing", _glb(_back)),
    "times before 0": kind("times-negative", _either(_negative, _usd_negative)),
    "weights too few": kind("weights-count", _either(_fewer, _usd_fewer)),
    "channel astray": kind("animation-broken", _either(_astray, _usd_astray)),
    "a name twice": kind("animation-name-twice", _glb(_twice)),
    "in another language": kind("language-wrong", _other_language),
    "a line is lost": kind("line-missing", _lost),
}  # fmt: skip
