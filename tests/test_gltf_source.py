"""A source is read once for many files, and what is on disk still counts."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from unittest.mock import patch

import pytest

from animeme.errors import InputError
from animeme_stages.ingest.glb import open_container
from animeme_stages.write import gltf_source
from animeme_stages.write.glb import pieces
from animeme_stages.write.gltf_source import source_of
from support.gltf_build import BIN_KIND, TRIANGLE, bin_of, face, glb, split_glb
from support.gltf_kit import FORMAT, animate, face_glb, line, saved, speech


@pytest.fixture(autouse=True)
def settled() -> Iterator[None]:
    """Sources count as written a while ago, so that they are kept."""
    with patch.object(gltf_source, "telling", return_value=True):
        yield


def replaced(path: Path, binary: bytes) -> None:
    """Put another file of the same size in the place of one."""
    saved(path.with_suffix(".new"), glb(face(), (BIN_KIND, binary))).replace(path)


def test_an_asset_is_opened_once_for_all_files(tmp_path: Path) -> None:
    source = face_glb(tmp_path)
    assert source_of(source) is source_of(source)


def test_what_is_kept_is_bounded(tmp_path: Path) -> None:
    folders = [tmp_path / str(number) for number in range(5)]
    for folder in folders:
        source_of(face_glb(folder))
    assert len(gltf_source._known) == gltf_source._ASSETS


def test_a_source_that_changed_is_read_again(tmp_path: Path) -> None:
    source = face_glb(tmp_path)
    animate(source, tmp_path / "1.glb")
    other = bytes(b ^ 1 for b in TRIANGLE)
    replaced(source, other)
    animate(source, tmp_path / "2.glb")
    assert (bin_of(tmp_path / "2.glb") or b"").startswith(other)
    # What was made before is of another source now.
    found = FORMAT.harm(FORMAT.load(source), tmp_path / "1.glb")
    assert any("binary" in sentence for sentence in found)


def test_a_source_that_was_just_written_is_not_kept(tmp_path: Path) -> None:
    source = face_glb(tmp_path)
    with patch.object(gltf_source, "telling", return_value=False):
        assert source_of(source) is not source_of(source)
        animate(source, tmp_path / "out.glb")


def test_an_output_is_judged_by_its_bytes_on_disk(tmp_path: Path) -> None:
    source, target = face_glb(tmp_path), tmp_path / "out.glb"
    animate(source, target)
    character = FORMAT.load(source)
    text, [(kind, data)] = split_glb(target.read_bytes())
    target.write_bytes(glb(text, (kind, data[:5] + b"\xff" + data[6:])))
    assert any("binary" in sentence for sentence in FORMAT.harm(character, target))
    FORMAT.write(character, [line(speech(character.shapes[:1]))], target)
    assert FORMAT.harm(character, target) == []


def test_a_long_binary_chunk_is_copied_from_disk_to_the_same_bytes(tmp_path: Path) -> None:
    source = face_glb(tmp_path)
    animate(source, tmp_path / "kept.glb")
    with patch.object(gltf_source, "_MOST_KEPT", 8), patch.dict(gltf_source._known, clear=True):
        assert source_of(source).kept == ()
        animate(source, tmp_path / "copied.glb")
    assert (tmp_path / "copied.glb").read_bytes() == (tmp_path / "kept.glb").read_bytes()


def test_a_source_that_is_cut_off_while_it_is_read_is_refused(tmp_path: Path) -> None:
    source = face_glb(tmp_path)
    chunk = open_container(source).bin
    assert chunk is not None
    source.write_bytes(source.read_bytes()[:-8])
    with source.open("rb") as stream, pytest.raises(InputError, match="cut off") as caught:
        list(pieces(stream, chunk))
    assert caught.value.code == "asset-unreadable"
