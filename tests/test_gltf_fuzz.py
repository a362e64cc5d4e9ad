"""Mutated glTF: an InputError or a sound output, quickly, and nothing written on failure."""

from __future__ import annotations

import copy
import json
import random
import struct
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from animeme.errors import InputError
from support.gltf_build import BIN_KIND, TRIANGLE, Json, add_weights_animation, face, glb, mesh
from support.gltf_kit import FORMAT, line, saved, speech

QUICK, THOROUGH = 150, 12_000
# A hang, on a machine that does much else besides. The issue allows 5 s.
PATIENCE_S = 5.0
NASTY: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 2, 7, 2**31, 2**53, 10**30, -(2**63), 0.5, -0.0, 1e308, "", "x",
    "../x", "//host/x", "file:///etc/hostname", "data:,", "data:;base64,!!", "\0", "é" * 50, [], {},
    [[]], [{}], {"": {}}, [None] * 9, [0] * 9, {"animeme": {}}, {"animeme": {"line": "hello"}},
)  # fmt: skip


def seeds(folder: Path) -> list[tuple[Json, bytes]]:
    """Documents and binaries that hold everything that is looked at."""
    plain = face(
        nodes=[{"mesh": 0, "name": "face"}, {"mesh": 1, "weights": [0.5]}, {"children": [0]}],
        meshes=[mesh(2, ["jawOpen", "aa"]), mesh(1, None, primitives=2)],
        extensions={
            "VRMC_vrm": {
                "humanoid": {"humanBones": {"hips": {"node": 2}}},
                "expressions": {
                    "preset": {"aa": {"morphTargetBinds": [{"node": 0, "index": 1, "weight": 1}]}}
                },
            },
            "VRM": {
                "blendShapeMaster": {
                    "blendShapeGroups": [
                        {"presetName": "a", "binds": [{"mesh": 1, "index": 0, "weight": 100}]}
                    ]
                }
            },
        },
        images=[{"uri": "skin.png"}],
    )
    saved(folder / "skin.png", b"picture")
    binary = add_weights_animation(plain, TRIANGLE, "wave", [[0, 0], [1, 0]])
    plain["accessors"][-1]["sparse"] = {
        "count": 1,
        "indices": {"bufferView": 0, "componentType": 5121},
        "values": {"bufferView": 0, "byteOffset": 4},
    }
    source = saved(folder / "seed.glb", glb(plain, (BIN_KIND, binary), (b"XTRA", b"1234")))
    # An output of ours is looked at more closely than anything else.
    FORMAT.write(FORMAT.load(source), [line(speech(["jawOpen"]), "bye")], folder / "ours.glb")
    data = (folder / "ours.glb").read_bytes()
    (length,) = struct.unpack_from("<I", data, 12)
    ours = json.loads(data[20 : 20 + length])
    return [(plain, binary), (ours, data[28 + length :][: ours["buffers"][0]["byteLength"]])]


def places(value: Any) -> list[tuple[Any, Any]]:
    """Every (container, key) of a document."""
    found: list[tuple[Any, Any]] = []
    pending = [value]
    while pending:
        item = pending.pop()
        keys = item.keys() if isinstance(item, dict) else range(len(item))
        for key in keys:
            found.append((item, key))
            if isinstance(item[key], dict | list):
                pending.append(item[key])
    return found


def mutated_json(document: Json, chance: random.Random) -> str:
    document = json.loads(json.dumps(document))
    for _ in range(chance.choice((1, 1, 1, 2, 4))):
        item, key = chance.choice(places(document) or [({}, "asset")])
        kind = chance.randrange(5)
        if kind == 0:
            del item[key]
        elif kind == 1:
            item[key] = json.loads(json.dumps(chance.choice(places(document))[0]))
        elif kind == 2 and isinstance(item[key], int):
            item[key] += chance.choice((-1, 1, 4, 2**31, 10**12))
        else:
            # A copy: later mutations change what is in the document.
            item[key] = copy.deepcopy(chance.choice(NASTY))
    text = json.dumps(document, ensure_ascii=chance.random() < 0.5)
    if chance.random() < 0.02:
        depth = chance.choice((200, 900, 5000, 100_000))
        text = text[:-1] + ',"deep":' + "[" * depth + "]" * depth + "}"
    if chance.random() < 0.1:
        cut = chance.randrange(len(text))
        text = text[:cut] + chance.choice(("", "{", "]", '"', ",", "\\", "1e999")) + text[cut + 1 :]
    return text


def mutated_bytes(data: bytes, chance: random.Random) -> bytes:
    changed = bytearray(data)
    for _ in range(chance.choice((1, 2, 8))):
        at = chance.randrange(len(changed) or 1)
        kind = chance.randrange(5)
        if kind == 0:
            changed[at : at + 1] = bytes([chance.randrange(256)])
        elif kind == 1:
            del changed[at : at + chance.choice((1, 4, 100))]
        elif kind == 2:
            changed[at:at] = chance.randbytes(chance.choice((1, 4, 64)))
        elif kind == 3 and len(changed) > 32:
            header = chance.choice((4, 8, 12, 16))
            number = chance.choice((0, 1, 4, 2**31, 2**32 - 1, len(changed), chance.getrandbits(9)))
            struct.pack_into("<I", changed, header, number)
        else:
            struct.pack_into("<I", changed, 8, len(changed)) if len(changed) > 12 else None
    if chance.random() < 0.5 and len(changed) > 12:
        struct.pack_into("<I", changed, 8, len(changed))  # so that more than the header is read
    return bytes(changed)


def mutation(bases: list[tuple[Json, bytes]], chance: random.Random) -> tuple[str, bytes]:
    """Suffix and content of a file."""
    document, binary = chance.choice(bases)
    kind = chance.randrange(4)
    if kind == 0:
        whole = glb(document, (BIN_KIND, binary), (b"XTRA", b"1234"))
        return ".glb", mutated_bytes(whole, chance)
    text = mutated_json(document, chance)
    if kind == 1:
        return ".gltf", text.encode("utf-8", "surrogatepass")
    encoded = text.encode("utf-8", "surrogatepass").decode("utf-8", "replace")
    return chance.choice((".glb", ".vrm")), glb(encoded, (BIN_KIND, binary), (b"XTRA", b"1234"))


def attempts(source: Path, out: Path) -> list[Callable[[], object]]:
    """Everything that a user may do with a file."""

    def write(layout: str) -> None:
        character = FORMAT.load(source)
        form = FORMAT.for_layout(layout, character)
        target = out / f"out{form.output_suffix(source)}"

        def verify(path: Path) -> None:  # as a run does
            assert form.harm(character, path) == []
            assert "hello" in {name.removesuffix("_en") for name in form.read_animations(path)}

        form.write(character, [line(speech(character.shapes[:1]))], target, verify=verify)

    return [
        lambda: write("per-line"),
        lambda: write("animation-only"),
        lambda: write("vrma"),
        lambda: FORMAT.read_animations(source),
        lambda: FORMAT.stored(FORMAT.load(source)),
        lambda: FORMAT.strip(source, out / f"stripped{source.suffix}"),
    ]


def fuzz(folder: Path, count: int, seed: int) -> None:
    bases = seeds(folder)
    for number in range(count):
        suffix, data = mutation(bases, random.Random(seed * 1_000_003 + number))
        source = saved(folder / f"fuzz{suffix}", data)
        for which, attempt in enumerate(attempts(source, folder / "out")):
            started = time.perf_counter()
            before = set((folder / "out").rglob("*"))
            try:
                attempt()
            except InputError:
                left = {p for p in (folder / "out").rglob("*") if p.is_file()} - before
                assert left == set(), f"mutation {number}, attempt {which} left {left}"
            except Exception as error:
                raise AssertionError(f"seed {seed}, mutation {number}, attempt {which}") from error
            assert time.perf_counter() - started < PATIENCE_S, f"mutation {number} hangs"
            assert source.read_bytes() == data
            for path in (folder / "out").glob("*"):
                path.unlink() if path.is_file() else None
        source.unlink()


def test_mutations_raise_nothing_but_input_errors(tmp_path: Path) -> None:
    fuzz(tmp_path, QUICK, seed=1)


@pytest.mark.slow
@pytest.mark.parametrize("part", range(4))
def test_many_mutations_raise_nothing_but_input_errors(part: int, tmp_path: Path) -> None:
    fuzz(tmp_path, THOROUGH // 4, seed=2 + part)
