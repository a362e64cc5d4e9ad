"""One way to break a sound delivery for every code that a check may find."""

from __future__ import annotations

import json
import shutil
import struct
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import soundfile
from pxr import Sdf

from animeme import registry
from animeme.contracts import LineAnimation
from animeme.curves import CurveSet
from support.deliveries import (
    Curves,
    Json,
    edited,
    moved,
    opening,
    put_float,
    shapes,
    with_curves,
)
from support.gltf_build import face, glb
from support.good_delivery import LINE, NAMES, SECOND, Good
from support.jobs import SAMPLE


@dataclass(frozen=True)
class Case:
    """What `validate` is given."""

    path: Path
    options: Mapping[str, Any] = field(default_factory=dict)
    profile: str = ""


@dataclass(frozen=True)
class Break:
    """A damage.

    Attributes:
        make: the broken delivery or the mended one, from a sound one, in a folder.
        also: other codes that it may have, as this damage is one for those checks too.
    """

    make: Callable[[Good, Path, bool], Case]
    also: frozenset[str] = frozenset()


def _audio_s(path: Path) -> float:
    return float(soundfile.info(path).duration)


def _curves(change: Curves, **options: Any) -> Callable[[Good, Path, bool], Case]:
    """The first line after `change`, judged without its recording."""

    def make(good: Good, folder: Path, broken: bool) -> Case:
        target = folder / good.asset.name
        with_curves(good.asset, target, change if broken else _same, source=good.source)
        return Case(target, options)

    return make


def _heard(change: Curves, line: str = LINE) -> Callable[[Good, Path, bool], Case]:
    """A line after `change`, judged against its recording."""

    def make(good: Good, folder: Path, broken: bool) -> Case:
        name, target = line.rpartition("/")[2], folder / good.asset.name
        dialogue = folder / "dialogue" / "en"
        dialogue.mkdir(parents=True, exist_ok=True)
        for file in good.dialogue.glob(f"{line}.*"):
            shutil.copy(file, dialogue)
        length_s = _audio_s(dialogue / f"{name}.wav")
        with_curves(
            good.asset, target, change if broken else _same,
            name=name, length_s=length_s, source=good.source,
        )  # fmt: skip
        return Case(target, {"dialogue": dialogue.parent})

    return make


def _same(curves: CurveSet) -> CurveSet:
    return curves


def _stored(edit: Callable[[Json, bytearray], None]) -> Callable[[Good, Path, bool], Case]:
    """The file's JSON and data after `edit`."""

    def make(good: Good, folder: Path, broken: bool) -> Case:
        change = edit if broken else lambda *_: None
        return Case(edited(good.asset, folder / good.asset.name, change))

    return make


def _limited(text: str, mended: str = "") -> Callable[[Good, Path, bool], Case]:
    """The sound file, judged by a profile that it does not meet."""
    return lambda good, folder, broken: Case(good.asset, profile=text if broken else mended)


def _content(name: str, content: bytes) -> Callable[[Good, Path, bool], Case]:
    def make(good: Good, folder: Path, broken: bool) -> Case:
        if not broken:
            return Case(good.asset)
        (folder / name).write_bytes(content)
        return Case(folder / name)

    return make


def _accessor(document: Json, which: str) -> Json:
    index = document["animations"][-1]["samplers"][0][which]
    accessor: Json = document["accessors"][index]
    return accessor


def _fewer(document: Json, _: bytearray) -> None:
    _accessor(document, "output")["count"] -= 1


def _lost(document: Json, _: bytearray) -> None:
    document["animations"][-1]["channels"][0]["sampler"] = 99


def _packed(document: Json, _: bytearray) -> None:
    """Say that the weights of the last animation are compressed; nobody looks whether they are."""
    sampler = document["animations"][-1]["samplers"][0]
    accessor = document["accessors"][sampler["output"]]
    view = dict(document["bufferViews"][accessor["bufferView"]])
    view["extensions"] = {"EXT_meshopt_compression": {}}
    accessor["bufferView"] = len(document["bufferViews"])
    document["bufferViews"].append(view)


def _twice(document: Json, _: bytearray) -> None:
    document["animations"].append(document["animations"][-1])


def _keep_names(kept: Iterable[str]) -> Callable[[Json, bytearray], None]:
    def edit(document: Json, _: bytearray) -> None:
        for mesh in document["meshes"]:
            names = mesh.get("extras", {}).get("targetNames", [])
            if names:
                mesh["extras"]["targetNames"] = [n if n in kept else f"{n}Q" for n in names]

    return edit


def _rename_node(document: Json, _: bytearray) -> None:
    document["nodes"][0]["name"] = "somebody else"


def _beyond(document: Json, _: bytearray) -> None:
    size = document["buffers"][0]["byteLength"]
    document["bufferViews"].append({"buffer": 0, "byteOffset": size, "byteLength": 8})


def _wrong_bound(document: Json, _: bytearray) -> None:
    _accessor(document, "input")["max"] = [99.0]


def _against_source(good: Good, folder: Path, broken: bool) -> Case:
    case = _stored(_rename_node)(good, folder, broken)
    return Case(case.path, {"against": good.source})


def _without_default(good: Good, folder: Path, broken: bool) -> Case:
    target = folder / "ada.usdc"
    shutil.copy(SAMPLE / "ada.usdc", target)
    if broken:
        layer = Sdf.Layer.FindOrOpen(str(target))
        layer.ClearDefaultPrim()
        layer.Save()
    return Case(target)


def _languages(change: Callable[[Good, Path], None], **options: Any) -> Any:
    """The whole delivery after `change`, by both languages."""

    def make(good: Good, folder: Path, broken: bool) -> Case:
        here = folder / "delivery"
        for language in ("en", "de"):
            target = here / language / good.asset.name
            target.parent.mkdir(parents=True, exist_ok=True)
            with_curves(
                good.asset, target, _same,
                source=good.source, language=language,
            )  # fmt: skip
        if broken:
            change(good, here)
        kept = {key: getattr(good, name) for key, name in options.items()}
        return Case(here, kept)

    return make


def _german_english(good: Good, here: Path) -> None:
    shutil.copy(here / "en" / good.asset.name, here / "de" / good.asset.with_stem("bob").name)


def _lack(good: Good, here: Path) -> None:
    """English gets another line more."""
    form = registry.format_of(good.asset)
    curves = form.read_animations(good.asset)
    lines = [LineAnimation(n, "en", c, c.duration_s) for n, c in curves.items()]
    form.write(form.load(good.source), lines, here / "en" / good.asset.name)


def _ordered(good: Good, folder: Path, broken: bool) -> Case:
    """One line is delivered where the dialogue has two."""
    target = folder / good.asset.name
    if broken:
        with_curves(good.asset, target, _same, source=good.source, length_s=_boat_s(good))
    else:
        shutil.copy(good.asset, target)
    dialogue = folder / "dialogue"
    shutil.copytree(good.dialogue / "en", dialogue / "en", dirs_exist_ok=True)
    return Case(target, {"dialogue": dialogue})


def _unasked(good: Good, folder: Path, broken: bool) -> Case:
    """Two lines are delivered where the dialogue has one."""
    target = folder / good.asset.name
    if broken:
        shutil.copy(good.asset, target)
    else:
        with_curves(good.asset, target, _same, source=good.source, length_s=_boat_s(good))
    return Case(target, {"dialogue": good.one})


def _boat_s(good: Good) -> float:
    return _audio_s(good.one / f"{LINE}.wav")


def _other_take(good: Good, folder: Path, broken: bool) -> Case:
    target = folder / good.asset.name
    length_s = _boat_s(good) + (0.1 if broken else 0.0)
    with_curves(good.asset, target, _same, source=good.source, length_s=length_s)
    return Case(target, {"dialogue": good.one})


def _in_silence(good: Good, folder: Path, broken: bool) -> Case:
    """The recording ends with two seconds of silence, in which the mouth goes on."""
    dialogue = folder / "dialogue" / "en"
    dialogue.mkdir(parents=True, exist_ok=True)
    samples, rate_hz = soundfile.read(good.one / f"{LINE}.wav")
    speech_s = len(samples) / rate_hz
    soundfile.write(dialogue / "boat.wav", np.append(samples, np.zeros(2 * rate_hz)), rate_hz)
    aligned = json.loads((good.one / f"{LINE}.json").read_text(encoding="utf-8"))
    last = aligned["phones"][-1]
    aligned["duration_s"] = last["end_s"] = speech_s + 2.0
    (dialogue / "boat.txt").write_bytes((good.one / f"{LINE}.txt").read_bytes())
    (dialogue / "boat.TextGrid").write_text(_text_grid(aligned), encoding="utf-8")

    def longer(curves: CurveSet) -> CurveSet:
        at_s = np.arange(0.0, speech_s + 2.0, 1 / 60)
        weights = curves.sample(at_s)
        after = at_s > speech_s
        weights[after] = 0.0
        if broken:
            jaw = curves.names.index("jawOpen")
            weights[after, jaw] = 0.12 - 0.12 * np.cos(2 * np.pi * (at_s[after] - speech_s))
        return CurveSet(at_s, curves.names, weights)

    target = folder / good.asset.name
    with_curves(good.asset, target, longer, source=good.source, length_s=speech_s + 2.0)
    return Case(target, {"dialogue": dialogue.parent})


def _text_grid(aligned: Mapping[str, Any]) -> str:
    """A tier of phones, as Praat writes it."""
    end_s, phones = aligned["phones"][-1]["end_s"], aligned["phones"]
    rows = "".join(
        f'{p["start_s"]}\n{p["end_s"]}\n"{"" if p["symbol"] == "sil" else p["symbol"]}"\n'
        for p in phones
    )
    head = 'File type = "ooTextFile"\nObject class = "TextGrid"\n\n'
    tier = f'"IntervalTier"\n"phones"\n0\n{end_s}\n{len(phones)}\n{rows}'
    return f"{head}0\n{end_s}\n<exists>\n1\n{tier}"


def _at_phones(symbols: str, part: float) -> Callable[[Good, Path, bool], Case]:
    """The jaw is held at a part of its range during these phones of the second line."""

    def make(good: Good, folder: Path, broken: bool) -> Case:
        text = (good.dialogue / f"{SECOND}.json").read_text(encoding="utf-8")
        spans = [
            (p["start_s"], p["end_s"])
            for p in json.loads(text)["phones"]
            if p["symbol"] in symbols.split()
        ]

        def held(times_s: Any, jaw: Any) -> Any:
            near = [(times_s > a - 0.04) & (times_s < b + 0.04) for a, b in spans]
            return np.where(np.any(near, axis=0), part * jaw.max(), jaw)

        return _heard(opening(held), SECOND)(good, folder, broken)

    return make


def _cut(factor: float) -> Curves:
    def change(curves: CurveSet) -> CurveSet:
        at_s = np.arange(0.0, curves.duration_s * factor, 1 / 60)
        return CurveSet(at_s, curves.names, curves.sample(at_s))

    return change


def _sampled(rate_hz: float) -> Curves:
    def change(curves: CurveSet) -> CurveSet:
        at_s = np.arange(np.ceil(curves.duration_s * rate_hz) + 1) / rate_hz
        return CurveSet(at_s, curves.names, curves.sample(at_s))

    return change


def _off_frames(good: Good, folder: Path, broken: bool) -> Case:
    target = folder / good.asset.name
    rate_hz = 60.0 if broken else 24.0
    with_curves(good.asset, target, _sampled(rate_hz), source=good.source)
    return Case(target, profile='[limits.frame-rate]\nrate = "24"')


def _scaled(by: float) -> Curves:
    return lambda c: CurveSet(c.times_s, c.names, c.weights * by)


def _one_side(curves: CurveSet) -> CurveSet:
    """Of a shape that moves on both sides only the left side moves."""
    left = next(n for n in curves.names if n.endswith(("Left", "_L")) and "Stretch" in n)
    right = left.replace("Left", "Right").replace("_L", "_R")
    return shapes(**{left: SLOW, right: {0.0: 0.0}})(curves)


def _first_key(by_s: float) -> Curves:
    return lambda c: CurveSet(c.times_s + by_s, c.names, c.weights)


def _silenced(times_s: Any, jaw: Any) -> Any:
    return np.where(times_s > times_s[-1] - 1.1, 0.0, jaw)


def _noise(times_s: Any, _: Any) -> Any:
    return np.interp(times_s, np.arange(0, 9, 0.1), np.random.default_rng(3).uniform(0, 0.6, 90))


def _garbage(good: Good, folder: Path, broken: bool) -> Case:
    content = bytearray(good.asset.read_bytes())
    if broken:
        struct.pack_into("<I", content, 12, 7)  # the length of the JSON
    (folder / good.asset.name).write_bytes(content)
    return Case(folder / good.asset.name)


PROP = glb(face(meshes=[{"primitives": [{"attributes": {}}]}]))
SLOW = {0.0: 0.0, 0.8: 0.4, 1.6: 0.0}
TWITCH = {0.0: 0.0, 0.5: 0.0, 0.533: 0.55, 0.566: 0.0}
JUMP = {0.0: 0.0, 0.5: 0.0, 0.51: 0.9, 1.6: 0.0}


def _break(make: Callable[[Good, Path, bool], Case], also: str = "") -> Break:
    return Break(make, frozenset(also.split()))


# Checks that hear the same fault; which of them depends on how bad it is.
UNRELATED = "articulation-unrelated sync-unrelated sync-lag"
BREAKS: Mapping[str, Break] = {
    "animation-broken": _break(_stored(_lost)),
    "animation-compressed": _break(_stored(_packed)),
    "animation-long": _break(_heard(_cut(1.6))),
    "animation-name-twice": _break(_stored(_twice)),
    "animation-short": _break(_heard(_cut(0.85))),
    "animation-still": _break(_curves(_scaled(0.0))),
    "articulation-unrelated": _break(_heard(opening(lambda t, _: t / t[-1])), "sync-unrelated"),
    "asset-no-blendshapes": _break(_content("prop.glb", PROP)),
    "asset-unreadable": _break(_garbage),
    "asset-unusable": _break(_content("hero.fbx", b"Kaydara FBX Binary")),
    "bilabials-open": _break(_heard(opening(lambda t, jaw: 0.3 + 0.4 * jaw))),
    "curve-stuck": _break(_curves(shapes(mouthShrugUpper={0.0: 0.5}))),
    "curves-alike": _break(_curves(shapes(mouthShrugUpper=SLOW, jawForward=SLOW))),
    "delivery-flat": _break(_heard(opening(lambda t, jaw: jaw * 0.07))),
    "file-kind-refused": _break(_limited('[limits.file-kind]\nsuffixes = [".vrm"]')),
    "file-too-large": _break(_limited("[limits.file-size]\nmost_mib = 0.001")),
    "gltf-invalid": _break(_stored(_wrong_bound)),
    "gltf-refused": _break(_stored(_beyond)),
    "keys-dense": _break(_curves(_sampled(250.0))),
    "keys-off-frames": _break(_off_frames),
    "labiodentals-open": _break(_at_phones("F V", 0.9), UNRELATED),
    "language-lacks-line": _break(_languages(_lack)),
    "language-wrong": _break(_languages(_german_english)),
    "line-missing": _break(_ordered),
    "line-surplus": _break(_unasked),
    "recording-changed": _break(_other_take),
    "rig-incomplete": _break(_stored(_keep_names(NAMES[:8])), "curves-alike"),
    "rig-unknown": _break(_stored(_keep_names(())), "curves-alike"),
    "shape-pops": _break(_curves(shapes(mouthShrugUpper=TWITCH))),
    "shape-too-fast": _break(_curves(shapes(mouthShrugUpper=JUMP))),
    "shapes-conflict": _break(_curves(shapes(mouthClose={0.0: 0.0, 0.8: 0.9, 1.6: 0.0}))),
    "shapes-missing": _break(_limited('[limits.rig-shapes]\nrequired = ["jawOpen", "snout"]')),
    "sides-differ": _break(_curves(_one_side)),
    "silence-moving": _break(_in_silence),
    "source-changed": _break(_against_source),
    "speech-mouth-closed": _break(_heard(opening(_silenced)), UNRELATED),
    "sync-lag": _break(_heard(moved(0.09))),
    "sync-unrelated": _break(_heard(opening(_noise)), "articulation-unrelated"),
    "times-late": _break(_curves(_first_key(0.4))),
    "times-negative": _break(_stored(put_float("input", 0, -0.5))),
    "times-not-increasing": _break(_stored(put_float("input", 2, 0.0))),
    "usd-invalid": _break(_without_default),
    "vowels-closed": _break(_at_phones("AA AE AH AO AW AY", 0.0), UNRELATED),
    "weight-out-of-range": _break(_curves(shapes(mouthShrugUpper={0.0: 0.0, 0.8: 1.4, 1.6: 0.0}))),
    "weights-count": _break(_stored(_fewer)),
    "weights-not-finite": _break(_stored(put_float("output", 3, float("nan")))),
}  # fmt: skip
# Codes of which the test is written out, as they are about no file.
ELSEWHERE = frozenset({"reader-failed"})
