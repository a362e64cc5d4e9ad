"""Damaged lists: they are read or refused, and nothing else comes of it."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from animeme.errors import InputError
from animeme.gathering import DialogueSource, gather
from animeme.listing import _NOT_IN_NAMES
from support.lists import folder_of
from test_list_presets import PO, UNREAL, XLIFF_1, XLIFF_2, cryengine
from test_manifest import delimited, workbook

ROUNDS = 100
SPREADSHEET = cryengine([["AUDIO_FILENAME", "ACTOR LINE"], ["a", "Hello."], ["", "x"]])
WSOURCES = '<ExternalSourcesList><Source Path="en\\a.wav"/><Source/></ExternalSourcesList>'
DOCUMENT = (
    '{"schema": "animeme.manifest/1", "lines": [{"id": "a", "language": "en", "audio": "a.wav"}]}'
)
# Name → (content, preset); translations have the preset "texts".
LISTS: dict[str, tuple[bytes, str]] = {
    "lines.csv": (delimited(",").encode(), ""),
    "wide.csv": (delimited("\t").encode("utf-16"), ""),
    "unreal.csv": (UNREAL.encode(), "unreal"),
    "list.xml": (SPREADSHEET.encode(), "cryengine"),
    "keys.txt": (b"a, en/a.wav\nb, en/b.wav\n", "fmod"),
    "list.wsources": (WSOURCES.encode(), "wwise"),
    "lines.json": (DOCUMENT.encode(), ""),
    "x_de.po": (PO.encode(), "texts"),
    "x.xlf": (XLIFF_1.encode(), "texts"),
    "y.xlf": (XLIFF_2.encode(), "texts"),
}
_PIECES = (b"", b'"', b",", b"\n", b"\0", b"\xff\xfe", b"..", b"/", b"<", b"&", b"\xc3", b"9" * 20)


def damage(data: bytes, chance: random.Random) -> bytes:
    for _ in range(chance.randint(1, 4)):
        at = chance.randrange(len(data) + 1)
        end = min(len(data), at + chance.choice((0, 1, 2, 8, 64)))
        piece = chance.choice((*_PIECES, bytes([chance.randrange(256)]), data[at:end] * 2))
        data = data[:at] + piece + data[end:]
        if chance.random() < 0.1:
            data = data[: chance.randrange(len(data) + 1)]
    return data


def read(path: Path, preset: str) -> None:
    """Gather from a damaged list; what can be used names files below their folders."""
    texts = preset == "texts"
    source = DialogueSource(
        path.parent / "vo",
        () if texts else (path,),
        preset="" if texts else preset,
        texts=(path,) if texts else (),
    )
    refused: InputError | None = None
    try:
        found = gather(source)
    except InputError as error:
        refused = error
    if refused is not None:
        assert refused.action
        assert str(path) in refused.place
        return
    keys = [line.key for line in found.lines]
    assert keys == sorted(set(keys))
    for line in found.lines:
        assert ".." not in line.id.split("/")
        assert not _NOT_IN_NAMES.search(line.id)
        assert not line.id.startswith("/")


@pytest.mark.parametrize("name", LISTS)
def test_a_damaged_list_is_read_or_refused(name: str, tmp_path: Path) -> None:
    folder_of(tmp_path / "vo", ["en/a.wav", "de/a.wav", "a.wav"])
    data, preset = LISTS[name]
    path = tmp_path / name
    for seed in range(ROUNDS):
        path.write_bytes(damage(data, random.Random(f"{name} {seed}")))
        read(path, preset)


def test_a_damaged_workbook_is_read_or_refused(tmp_path: Path) -> None:
    folder_of(tmp_path / "vo", ["en/a.wav"])
    rows: list[list[str | float]] = [["id", "en", "de"], ["a", "Hello", "Hallo"], [2.0, "x", "y"]]
    data = workbook(tmp_path / "whole.xlsx", {"one": rows}).read_bytes()
    path = tmp_path / "lines.xlsx"
    for seed in range(ROUNDS):
        path.write_bytes(damage(data, random.Random(seed)))
        read(path, "")


def test_a_workbook_of_a_newer_zip_is_refused_until_it_is_exported_again(tmp_path: Path) -> None:
    folder_of(tmp_path / "vo", ["en/a.wav"])
    path = workbook(tmp_path / "lines.xlsx", {"one": [["id", "en"], ["a", "Hello"]]})
    source = DialogueSource(tmp_path / "vo", (path,))
    whole = path.read_bytes()
    newer = bytearray(whole)
    newer[newer.index(b"PK\x01\x02") + 6] = 99  # the version that its first part needs
    path.write_bytes(newer)
    with pytest.raises(InputError, match=r"zip file version 9\.9.*manifest-damaged"):
        gather(source)
    path.write_bytes(whole)
    assert [line.key for line in gather(source).lines] == ["en/a"]
