"""Files beside a glTF come along, and none is taken from or written to elsewhere."""

from __future__ import annotations

from pathlib import Path

import pytest

from animeme.errors import InputError
from support.gltf_build import TRIANGLE, data_uri, document_of, face
from support.gltf_kit import (
    FORMAT,
    animate,
    external_buffer,
    face_glb,
    gltf_with_files,
    line,
    saved,
    speech,
)


@pytest.mark.parametrize(
    ("uri", "name"),
    [
        ("skin.png", "skin.png"),
        ("textures/deep/skin.png", "textures/deep/skin.png"),
        ("./skin.png", "skin.png"),
        ("my%20skin.png", "my skin.png"),
        ("my skin.png", "my skin.png"),
        ("caf%C3%A9.png", "café.png"),
        ("café.png", "café.png"),
        ("a%23b.png", "a#b.png"),
        ("a..b/..c.png", "a..b/..c.png"),
        ("100%25.png", "100%.png"),
    ],
)
def test_files_of_a_gltf_come_along_to_the_same_place(uri: str, name: str, tmp_path: Path) -> None:
    source = gltf_with_files(tmp_path / "in", image=uri)
    saved(tmp_path / "in" / "face.bin", TRIANGLE)
    saved(tmp_path / "in" / name, b"picture")
    target = tmp_path / "out" / "face.gltf"
    animate(source, target)
    written = {p.relative_to(target.parent).as_posix() for p in target.parent.rglob("*.*")}
    assert (target.parent / name).read_bytes() == b"picture"
    assert (target.parent / "face.bin").read_bytes() == TRIANGLE
    new = document_of(target)["buffers"][-1]["uri"]
    files = {path for path in written if (target.parent / path).is_file()}
    assert files == {"face.gltf", "face.bin", name, new}


def test_every_file_written_is_reported(tmp_path: Path) -> None:
    source = gltf_with_files(tmp_path / "in")
    saved(tmp_path / "in" / "face.bin", TRIANGLE)
    saved(tmp_path / "in" / "skin.png", b"picture")
    target = tmp_path / "out" / "face.gltf"
    written = FORMAT.write(FORMAT.load(source), [line(speech(["jawOpen"]))], target)
    assert sorted(written) == sorted(p for p in target.parent.rglob("*") if p.is_file())


@pytest.mark.parametrize("name", ["a b", "a#1", "a?b", "a%20b", "50%", "é😀", "a.b.c", "a+b&c"])
def test_the_new_buffer_is_found_whatever_the_output_is_called(name: str, tmp_path: Path) -> None:
    source = saved(
        tmp_path / "in" / "face.gltf",
        face(buffers=[{"byteLength": 36, "uri": data_uri(TRIANGLE)}]),
    )
    animate(source, tmp_path / "out" / f"{name}.gltf")


def test_a_gltf_in_its_own_folder_needs_no_copies(tmp_path: Path) -> None:
    source = saved(tmp_path / "face.gltf", external_buffer(tmp_path))
    animate(source, tmp_path / "talking.gltf")
    assert (tmp_path / "face.bin").read_bytes() == TRIANGLE


def test_a_new_export_of_the_asset_replaces_what_the_last_run_copied(tmp_path: Path) -> None:
    source = gltf_with_files(tmp_path / "in")
    saved(tmp_path / "in" / "face.bin", TRIANGLE)
    saved(tmp_path / "in" / "skin.png", b"first")
    animate(source, tmp_path / "out" / "face.gltf")
    saved(tmp_path / "in" / "skin.png", b"second")
    animate(source, tmp_path / "out" / "face.gltf")
    assert (tmp_path / "out" / "skin.png").read_bytes() == b"second"


def test_a_new_export_replaces_what_all_files_of_one_asset_share(tmp_path: Path) -> None:
    source = gltf_with_files(tmp_path / "in")
    saved(tmp_path / "in" / "face.bin", TRIANGLE)
    for picture in (b"first", b"second"):
        saved(tmp_path / "in" / "skin.png", picture)
        for name in ("line1", "line2", "line3"):
            animate(source, tmp_path / "out" / f"{name}.gltf")
        assert (tmp_path / "out" / "skin.png").read_bytes() == picture


def test_a_new_export_of_a_glb_replaces_the_image_beside_it(tmp_path: Path) -> None:
    source = face_glb(tmp_path / "in", face(images=[{"uri": "skin.png"}]))
    for picture in (b"first", b"second"):
        saved(tmp_path / "in" / "skin.png", picture)
        animate(source, tmp_path / "out" / "face.glb")
        assert (tmp_path / "out" / "skin.png").read_bytes() == picture


def test_an_image_that_a_glb_of_another_asset_uses_is_not_replaced(tmp_path: Path) -> None:
    first = face_glb(tmp_path / "a", face(images=[{"uri": "skin.png"}]))
    second = gltf_with_files(tmp_path / "b")
    saved(tmp_path / "b" / "face.bin", TRIANGLE)
    for folder in ("a", "b"):
        saved(tmp_path / folder / "skin.png", b"same")
    animate(first, tmp_path / "out" / "a.glb")
    animate(second, tmp_path / "out" / "b.gltf")
    saved(tmp_path / "b" / "skin.png", b"new")
    with pytest.raises(InputError, match="asset-file-clash"):
        animate(second, tmp_path / "out" / "b.gltf")
    assert (tmp_path / "out" / "skin.png").read_bytes() == b"same"


def test_two_assets_whose_files_clash_do_not_overwrite_each_other(tmp_path: Path) -> None:
    for folder, picture in (("a", b"first"), ("b", b"second")):
        gltf_with_files(tmp_path / folder)
        saved(tmp_path / folder / "face.bin", TRIANGLE)
        saved(tmp_path / folder / "skin.png", picture)
    out = tmp_path / "out"
    animate(tmp_path / "a" / "face.gltf", out / "a.gltf")
    before = {path: path.read_bytes() for path in out.iterdir()}
    with pytest.raises(InputError, match="asset-file-clash"):
        animate(tmp_path / "b" / "face.gltf", out / "b.gltf")
    assert {path: path.read_bytes() for path in out.iterdir()} == before


@pytest.mark.parametrize("link", ["file", "folder", "circle"])
def test_a_link_that_leaves_the_folder_is_refused(link: str, tmp_path: Path) -> None:
    saved(tmp_path / "else" / "face.bin", TRIANGLE)
    source = gltf_with_files(tmp_path / "in", buffer="a/face.bin", image="skin.png")
    saved(tmp_path / "in" / "skin.png", b"picture")
    folder = tmp_path / "in" / "a"
    if link == "folder":
        folder.symlink_to(tmp_path / "else")
    else:
        folder.mkdir()
        target = tmp_path / "else" if link == "file" else folder
        (folder / "face.bin").symlink_to(target / "face.bin")
    character = FORMAT.load(source)
    with pytest.raises(InputError, match="asset-uri-refused"):
        FORMAT.write(character, [line(speech(["jawOpen"]))], tmp_path / "out" / "face.gltf")
    assert not (tmp_path / "out").exists()
    folder.unlink() if link == "folder" else (folder / "face.bin").unlink()
    saved(tmp_path / "in" / "real.bin", TRIANGLE)
    folder.mkdir(exist_ok=True)
    (folder / "face.bin").symlink_to(tmp_path / "in" / "real.bin")
    animate(source, tmp_path / "out" / "face.gltf")


REFUSED_URIS = {
    "absolute": "/etc/hostname",
    "parent": "../secret.bin",
    "parent within": "a/../../secret.bin",
    "parent that stays inside": "a/../face.bin",
    "encoded parent": "%2e%2e/secret.bin",
    "encoded parent and slash": "%2E%2E%2Fsecret.bin",
    "encoded absolute": "%2fetc%2fhostname",
    "http": "http://example.com/face.bin",
    "https upper case": "HTTPS://example.com/face.bin",
    "host without scheme": "//example.com/face.bin",
    "file": "file:///etc/hostname",
    "file relative": "file:face.bin",
    "backslash parent": "..\\secret.bin",
    "backslash": "a\\face.bin",
    "encoded backslash": "%5C%5Chost%5Cface.bin",
    "drive": "C:/face.bin",
    "drive with backslash": "C:\\face.bin",
    "encoded drive": "C%3A/face.bin",
    "empty": "",
    "the folder": ".",
    "broken host": "http://[face.bin",
    "NUL": "face%00.bin",
    "NUL as it is": "face\0.bin",
}


@pytest.mark.parametrize("where", ["buffer", "image", "glb image"])
@pytest.mark.parametrize("case", REFUSED_URIS)
def test_a_uri_that_leaves_the_folder_is_refused_and_nothing_is_written(
    case: str, where: str, tmp_path: Path
) -> None:
    uri = REFUSED_URIS[case]
    saved(tmp_path / "secret.bin", TRIANGLE)
    saved(tmp_path / "in" / "face.bin", TRIANGLE)
    saved(tmp_path / "in" / "skin.png", b"picture")
    (tmp_path / "in" / "a").mkdir()
    if where == "glb image":
        source = face_glb(tmp_path / "in", face(images=[{"uri": uri}]))
    else:
        source = gltf_with_files(tmp_path / "in", **{where: uri})
    character = FORMAT.load(source)
    target = tmp_path / "out" / source.name
    with pytest.raises(InputError) as caught:
        FORMAT.write(character, [line(speech(["jawOpen"]))], target)
    assert caught.value.code == "asset-uri-refused"
    assert caught.value.place == str(source)
    assert not target.parent.exists() or not list(target.parent.iterdir())
