"""``animeme strip``: the source comes back byte for byte, or the file stays as it is."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

import animeme as package
from animeme.errors import InputError
from animeme_stages.write.usd import UsdFormat
from support.gltf_build import (
    BIN_KIND,
    TRIANGLE,
    Json,
    add_weights_animation,
    bin_of,
    data_uri,
    document_of,
    face,
    glb,
    split_glb,
    text_of,
)
from support.gltf_kit import FORMAT, external_buffer, face_glb, gltf_with_files, line, saved, speech
from support.jobs import SAMPLE, Capture, animeme


def spoken(source: Path, target: Path, *names: str) -> Path:
    lines = [line(speech(["jawOpen"], seed=i), n) for i, n in enumerate(names or ("hello", "bye"))]
    FORMAT.write(FORMAT.load(source), lines, target)
    return target


def test_a_file_is_stripped_in_place(tmp_path: Path, capsys: Capture) -> None:
    source = face_glb(tmp_path / "in")
    target = spoken(source, tmp_path / "out.glb")
    ran = animeme(capsys, "strip", target, "--json")
    assert ran.code == 0
    assert json.loads(ran.out)["animations"] == ["hello", "bye"]
    assert target.read_bytes() == source.read_bytes()
    animeme(capsys, "strip", target).says("nothing to take out", "strip-nothing")


def test_a_file_is_stripped_to_another_place(tmp_path: Path, capsys: Capture) -> None:
    source = face_glb(tmp_path / "in")
    target = spoken(source, tmp_path / "out.glb")
    before = target.read_bytes()
    ran = animeme(capsys, "strip", target, "--output", tmp_path / "deep" / "back.glb")
    assert ran.code == 0
    assert "2 animations" in ran.out
    assert target.read_bytes() == before
    assert (tmp_path / "deep" / "back.glb").read_bytes() == source.read_bytes()


@pytest.mark.parametrize("name", ["ada.glb", "crab.glb"])
def test_the_samples_come_back_through_the_api(name: str, tmp_path: Path) -> None:
    character = FORMAT.load(SAMPLE / name)
    target = tmp_path / name
    FORMAT.write(character, [line(speech(character.shapes[:5]))], target)
    assert package.strip(target) == ("hello",)
    assert target.read_bytes() == (SAMPLE / name).read_bytes()


def test_the_buffer_beside_a_gltf_goes_with_its_animations(tmp_path: Path) -> None:
    source = gltf_with_files(tmp_path / "in")
    saved(tmp_path / "in" / "face.bin", TRIANGLE)
    saved(tmp_path / "in" / "skin.png", b"picture")
    target = spoken(source, tmp_path / "out" / "face.gltf")
    FORMAT.strip(target, target)
    files = {p.name: p.read_bytes() for p in (tmp_path / "out").iterdir()}
    assert files == {p.name: p.read_bytes() for p in (tmp_path / "in").iterdir()}


def test_the_buffer_stays_where_another_asset_refers_to_it(tmp_path: Path) -> None:
    source = saved(tmp_path / "in" / "face.gltf", external_buffer(tmp_path / "in"))
    target = spoken(source, tmp_path / "out" / "face.gltf")
    copy = saved(tmp_path / "out" / "copy.gltf", target.read_bytes())
    FORMAT.strip(target, target)
    assert FORMAT.read_animations(copy).keys() == {"hello", "bye"}


def padded(count: int) -> str:
    """A face with NULs behind it, to a multiple of four."""
    text = json.dumps(face()) + "\0" * count
    return text + "\0" * (-len(text) % 4)


ODD: dict[str, Callable[[], bytes]] = {
    "NUL padding": lambda: glb(padded(9), (BIN_KIND, TRIANGLE)),
    "much NUL padding": lambda: glb(padded(900), (BIN_KIND, TRIANGLE)),
    "wide padding": lambda: glb(json.dumps(face()) + " \n" * 40, (BIN_KIND, TRIANGLE)),
    "space before": lambda: glb(" \n" + json.dumps(face()), (BIN_KIND, TRIANGLE)),
    "byteLength of another form": lambda: glb(
        json.dumps(face()).replace('"byteLength": 36}]', '"byteLength" : 3.6e1}]', 1),
        (BIN_KIND, TRIANGLE),
    ),
    "space in lists": lambda: glb(
        json.dumps(face(animations=[]), indent=3).replace("[]", "[ \t]"), (BIN_KIND, TRIANGLE)
    ),
    "twin lists": lambda: glb(
        json.dumps(face())[:-1] + ', "animations": [], "animations": [ ]}', (BIN_KIND, TRIANGLE)
    ),
    "non-ASCII": lambda: glb(
        json.dumps(face(extras="é😀\u2028"), ensure_ascii=False), (BIN_KIND, TRIANGLE)
    ),
}


@pytest.mark.parametrize("case", ODD)
def test_every_byte_of_an_odd_source_comes_back(case: str, tmp_path: Path) -> None:
    source = saved(tmp_path / "face.glb", ODD[case]())
    target = spoken(source, tmp_path / "out.glb")
    FORMAT.strip(target, target)
    assert target.read_bytes() == source.read_bytes()


def rebuilt(path: Path, edit: Callable[[Json], object]) -> bytes:
    document = document_of(path)
    edit(document)
    return glb(json.dumps(document, indent=2), *split_glb(path.read_bytes())[1])


EDITS: dict[str, Callable[[Path], bytes]] = {
    "written anew": lambda p: rebuilt(p, lambda d: None),
    "a name changed": lambda p: rebuilt(p, lambda d: d["nodes"][0].update(name="mask")),
    "an animation added": lambda p: glb(
        text_of(p).rstrip().replace('"animations":[', '"animations":[{"channels":[]},', 1),
        *split_glb(p.read_bytes())[1],
    ),
    "one of ours dropped": lambda p: rebuilt(p, lambda d: d["animations"].pop(0)),
    "an old byte changed": lambda p: glb(
        text_of(p), (BIN_KIND, b"\7" + (bin_of(p) or b"")[1:])
    ),
    "bytes cut": lambda p: glb(text_of(p), (BIN_KIND, (bin_of(p) or b"")[:16])),
    "a chunk added": lambda p: glb(
        text_of(p), *split_glb(p.read_bytes())[1], (b"XTRA", b"1234")
    ),
    "the note dropped": lambda p: rebuilt(p, lambda d: d["bufferViews"][-1].pop("extras")),
    "the note broken": lambda p: rebuilt(
        p, lambda d: d["bufferViews"][-1]["extras"].update(animeme={"lists": 7})
    ),
    "the note enormous": lambda p: rebuilt(
        p, lambda d: d["bufferViews"][-1]["extras"]["animeme"].update(json_bytes=10**15)
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", EDITS)
def test_a_file_that_was_edited_since_is_refused_and_kept(
    case: str, tmp_path: Path, capsys: Capture
) -> None:
    target = spoken(face_glb(tmp_path / "in"), tmp_path / "out" / "face.glb")
    whole = target.read_bytes()
    edited = EDITS[case](target)
    target.write_bytes(edited)
    ran = animeme(capsys, "strip", target)
    assert ran.code == 2
    ran.says("strip-edited", "hello" if "dropped" not in case else "bye", str(target))
    assert [p.read_bytes() for p in target.parent.iterdir()] == [edited]
    target.write_bytes(whole)
    assert animeme(capsys, "strip", target).code == 0


def test_other_peoples_animations_stay(tmp_path: Path) -> None:
    document = face()
    binary = add_weights_animation(document, TRIANGLE, "wave", [[0, 0], [1, 0]])
    source = face_glb(tmp_path / "in", document, binary)
    target = spoken(source, tmp_path / "out.glb")
    FORMAT.strip(target, target)
    assert [a["name"] for a in document_of(target)["animations"]] == ["wave"]


def test_a_usd_layer_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="strip-layer") as caught:
        UsdFormat().strip(SAMPLE / "ada.usdc", tmp_path / "back.usdc")
    assert "Delete the layer" in caught.value.action
    assert list(tmp_path.iterdir()) == []


def test_what_is_no_asset_is_refused(tmp_path: Path, capsys: Capture) -> None:
    animeme(capsys, "strip", tmp_path / "none.glb").says("asset-unreadable")
    saved(tmp_path / "broken.glb", b"glTF")
    animeme(capsys, "strip", tmp_path / "broken.glb").says("asset-unreadable")
    animeme(capsys, "strip", saved(tmp_path / "a.txt", b"")).says("asset-format-unknown")


# Runs upon runs


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_runs_upon_runs_give_what_one_run_gives(suffix: str, tmp_path: Path) -> None:
    if suffix == ".glb":
        source = face_glb(tmp_path / "in")
    else:
        source = saved(tmp_path / "in" / "face.gltf", external_buffer(tmp_path / "in"))
    lines = [line(speech(["jawOpen"], seed=i), f"line{i}") for i in range(4)]
    once = tmp_path / "once" / f"face{suffix}"
    FORMAT.write(FORMAT.load(source), lines, once)
    over = tmp_path / "over" / f"face{suffix}"
    FORMAT.write(FORMAT.load(source), lines[:1], over)
    for _ in range(10):
        for one in lines:
            FORMAT.write(FORMAT.load(over), [one], over)
    if suffix == ".glb":
        assert over.read_bytes() == once.read_bytes()
    assert {p.name: p.stat().st_size for p in over.parent.iterdir()}.keys() == {
        p.name for p in once.parent.iterdir()
    }
    sizes = [
        sum(p.stat().st_size for p in folder.iterdir() if p.suffix == ".bin")
        for folder in (once.parent, over.parent)
    ]
    assert sizes[0] == sizes[1]
    assert FORMAT.read_animations(over) == FORMAT.read_animations(once)
    FORMAT.strip(over, tmp_path / "back" / f"face{suffix}")
    assert (tmp_path / "back" / f"face{suffix}").read_bytes() == source.read_bytes()


def test_a_file_edited_between_runs_is_the_new_source(tmp_path: Path) -> None:
    first = spoken(face_glb(tmp_path / "in"), tmp_path / "first.glb")
    edited = saved(
        tmp_path / "edited.glb", rebuilt(first, lambda d: d["nodes"][0].update(name="mask"))
    )
    over = spoken(edited, tmp_path / "over.glb", "hello")
    sizes = set()
    for _ in range(10):
        FORMAT.write(FORMAT.load(over), [line(speech(["mouthClose"]), "hello")], over)
        sizes.add(over.stat().st_size)
    assert len(sizes) == 1
    assert FORMAT.harm(FORMAT.load(edited), over) == []
    assert FORMAT.read_animations(over).keys() == {"hello", "bye"}
    assert "mouthClose" in FORMAT.read_animations(over)["hello"].names
    FORMAT.strip(over, over)
    assert over.read_bytes() == edited.read_bytes()


def test_harm_notices_that_an_earlier_line_was_lost(tmp_path: Path) -> None:
    source = face_glb(tmp_path / "in")
    first = spoken(source, tmp_path / "first.glb", "hello", "bye")
    other = spoken(source, tmp_path / "other.glb", "hello")
    assert any("'bye'" in sentence for sentence in FORMAT.harm(FORMAT.load(first), other))


def test_what_verify_refuses_leaves_the_old_files_together(tmp_path: Path) -> None:
    document = face(buffers=[{"byteLength": 36, "uri": data_uri(TRIANGLE)}])
    source = saved(tmp_path / "in" / "face.gltf", document)
    target = spoken(source, tmp_path / "out" / "face.gltf")
    before = {p: p.read_bytes() for p in target.parent.iterdir()}

    def refuse(_: Path) -> None:
        raise InputError("no", "no", place="", action="")

    with pytest.raises(InputError):
        FORMAT.write(FORMAT.load(source), [line(speech(["jawOpen"]))], target, verify=refuse)
    assert {p: p.read_bytes() for p in target.parent.iterdir()} == before
    with pytest.raises(InputError):
        FORMAT.write(
            FORMAT.load(source), [line(speech(["jawOpen"]))], tmp_path / "new" / "a.gltf",
            verify=refuse,
        )  # fmt: skip
    assert list((tmp_path / "new").iterdir()) == []
