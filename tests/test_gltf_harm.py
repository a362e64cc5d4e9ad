"""``harm()`` names what was lost."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from support.gltf_build import (
    BIN_KIND,
    TRIANGLE,
    Json,
    add_weights_animation,
    bin_of,
    face,
    glb,
    split_glb,
)
from support.gltf_kit import FORMAT, animate, gltf_with_files, saved


def damaged_glb(target: Path, edit: Callable[[str], str], binary: bytes | None = None) -> None:
    text, chunks = split_glb(target.read_bytes())
    changed = edit(text)
    if binary is not None:
        chunks = [(BIN_KIND, binary), *chunks[1:]]
    else:
        assert changed != text
    target.write_bytes(glb(changed, *chunks))


def edited(edit: Callable[[Json], object]) -> Callable[[str], str]:
    def apply(text: str) -> str:
        document = json.loads(text)
        edit(document)
        return json.dumps(document)

    return apply


TEXT_DAMAGE: dict[str, tuple[Callable[[str], str], str]] = {
    "number reformatted": (lambda t: t.replace('"scene": 0', '"scene": 0.0', 1), "/scene"),
    "number with fewer zeros": (lambda t: t.replace("1.50", "1.5", 1), "/extras/n"),
    "value changed": (edited(lambda d: d["nodes"][0].update(name="mask")), "/nodes/0/name"),
    "a node was moved": (
        edited(lambda d: d["nodes"][0].update(translation=[0, 1, 0])),
        "/nodes/0/translation",
    ),
    "null dropped": (edited(lambda d: d["extras"].pop("z")), "/extras/z"),
    "element removed": (edited(lambda d: d["scenes"].pop()), "/scenes"),
    "inner element removed": (edited(lambda d: d["extras"]["list"].pop()), "/extras/list"),
    "elements swapped": (edited(lambda d: d["extras"]["list"].reverse()), "/extras/list/0"),
    "member removed": (edited(lambda d: d.pop("extensions")), "/extensions"),
    "object became a list": (edited(lambda d: d.update(extensions=[])), "/extensions"),
    "true became 1": (edited(lambda d: d["extras"].update(flag=1)), "/extras/flag"),
    "their animation changed": (
        edited(lambda d: d["animations"][0].update(name="wink")),
        "/animations/0/name",
    ),
    "buffer 0 shorter than it was": (
        edited(lambda d: d["buffers"][0].update(byteLength=8)),
        "/buffers/0/byteLength",
    ),
}


def rich_source(folder: Path) -> Path:
    document = face(
        extensions={"VENDOR_x": {}},
        extras={"z": None, "list": [1, 2], "flag": True, "n": 111},
        scenes=[{"nodes": [0]}, {}],
    )
    binary = add_weights_animation(document, TRIANGLE, "blink", [[0, 0], [1, 0.5]])
    text = json.dumps(document).replace("111", "1.50")
    return saved(folder / "face.glb", glb(text, (BIN_KIND, binary), (b"XTRA", b"12345678")))


@pytest.mark.parametrize("case", TEXT_DAMAGE)
def test_harm_names_the_value_that_changed(case: str, tmp_path: Path) -> None:
    edit, pointer = TEXT_DAMAGE[case]
    source, target = rich_source(tmp_path), tmp_path / "out.glb"
    animate(source, target)
    damaged_glb(target, edit)
    assert any(pointer in sentence for sentence in FORMAT.harm(FORMAT.load(source), target))


def flipped(data: bytes, at: int) -> bytes:
    return data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :]


@pytest.mark.parametrize("at", [0, 17, -1])
def test_harm_names_the_binary_chunk_when_an_old_byte_changed(at: int, tmp_path: Path) -> None:
    source, target = rich_source(tmp_path), tmp_path / "out.glb"
    animate(source, target)
    old = bin_of(source) or b""
    damaged_glb(target, lambda t: t, flipped(bin_of(target) or b"", at % len(old)))
    assert any("binary" in sentence for sentence in FORMAT.harm(FORMAT.load(source), target))


def test_harm_names_a_binary_chunk_that_was_cut_or_dropped(tmp_path: Path) -> None:
    source, target = rich_source(tmp_path), tmp_path / "out.glb"
    animate(source, target)
    text, chunks = split_glb(target.read_bytes())
    for rest in ([(BIN_KIND, chunks[0][1][:16]), chunks[1]], [chunks[1]], []):
        target.write_bytes(glb(text, *rest))
        assert any("binary" in sentence for sentence in FORMAT.harm(FORMAT.load(source), target))


def test_harm_names_another_chunk_that_was_lost_changed_or_lengthened(tmp_path: Path) -> None:
    source, target = rich_source(tmp_path), tmp_path / "out.glb"
    animate(source, target)
    text, (binary, (kind, data)) = split_glb(target.read_bytes())
    for rest in ([], [(kind, b"12345679")], [(b"OTHR", data)], [(kind, data + b"1234")]):
        target.write_bytes(glb(text, binary, *rest))
        assert any("chunk" in sentence for sentence in FORMAT.harm(FORMAT.load(source), target))


@pytest.mark.parametrize("damage", ["changed", "gone"])
@pytest.mark.parametrize("name", ["face.bin", "skin.png"])
def test_harm_names_a_file_that_was_lost_or_changed(name: str, damage: str, tmp_path: Path) -> None:
    source = gltf_with_files(tmp_path / "in")
    saved(tmp_path / "in" / "face.bin", TRIANGLE)
    saved(tmp_path / "in" / "skin.png", b"picture")
    target = tmp_path / "out" / "face.gltf"
    animate(source, target)
    copy = target.parent / name
    if damage == "gone":
        copy.unlink()
    else:
        copy.write_bytes(flipped(copy.read_bytes(), 3))
    assert any(name in sentence for sentence in FORMAT.harm(FORMAT.load(source), target))
