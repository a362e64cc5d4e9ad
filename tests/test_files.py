"""Files that are brought up to date part by part."""

from __future__ import annotations

from pathlib import Path
from unittest.mock import patch

import pytest
from hypothesis import given
from hypothesis import strategies as st

from animeme import files
from animeme.errors import InputError
from animeme.files import let_go, update_text

PARTS = st.lists(st.text(st.characters(codec="utf-8"), max_size=20), max_size=8)


@given(before=PARTS | st.none(), after=PARTS, block=st.integers(1, 30))
def test_a_file_becomes_its_parts_whatever_it_was(
    tmp_path_factory: pytest.TempPathFactory,
    before: list[str] | None,
    after: list[str],
    block: int,
) -> None:
    path = tmp_path_factory.mktemp("update") / "report.txt"
    if before is not None:
        path.write_bytes("".join(before).encode())
    with patch.object(files, "_BLOCK", block):
        update_text(path, after)
    assert path.read_bytes() == "".join(after).encode()
    assert [*path.parent.iterdir()] == [path]


@given(parts=PARTS, block=st.integers(1, 30))
def test_a_file_that_says_so_already_is_left_alone(
    tmp_path_factory: pytest.TempPathFactory, parts: list[str], block: int
) -> None:
    path = tmp_path_factory.mktemp("update") / "report.txt"
    with patch.object(files, "_BLOCK", block):
        update_text(path, parts)
        before = files.stamp(path)
        update_text(path, ["".join(parts)])
    assert files.stamp(path) == before


def test_parts_that_fail_leave_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "report.txt"
    path.write_text("old")

    def parts() -> object:
        yield "ne"
        raise LookupError("no more")

    with pytest.raises(LookupError):
        update_text(path, parts())  # type: ignore[arg-type]
    assert path.read_text() == "old"
    assert [*tmp_path.iterdir()] == [path]


def test_a_folder_in_its_place_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "report.txt").mkdir()
    with pytest.raises(InputError) as caught:
        update_text(tmp_path / "report.txt", ["new"])
    assert caught.value.code == "output-unwritable"


@pytest.mark.parametrize("size", [10, (1 << 22) + 1])
def test_a_file_that_is_let_go_is_as_it_was(tmp_path: Path, size: int) -> None:
    path = tmp_path / "head.glb"
    path.write_bytes(bytes(size))
    let_go(path)
    assert path.read_bytes() == bytes(size)
    let_go(tmp_path / "not there")
