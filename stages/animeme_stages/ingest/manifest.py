"""Lists of lines as people and other programs write them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path, PureWindowsPath

from animeme.dialogue import AUDIO_SUFFIXES
from animeme.manifest import Columns, Manifest, Row
from animeme_stages.ingest.safe_xml import read_xml
from animeme_stages.ingest.sheet_columns import rows_of
from animeme_stages.ingest.sheets import Table, damaged, decoded, read_tables

_MOST_ROWS, _MOST_COLUMNS = 2**20, 2**10


def read_manifest(path: Path, columns: Columns, preset: str) -> Manifest:
    """See `animeme.manifest.read_manifest`.

    Raises:
        InputError: it cannot be used.
        OSError: it cannot be read.
    """
    if preset == "wwise" or (not preset and path.suffix.lower() == ".wsources"):
        return _wsources(path)
    if preset == "fmod" or (not preset and path.name.lower() == "keys.txt"):
        return Manifest(path, tuple(_keys(path)))
    if preset == "cryengine" and path.suffix.lower() == ".xml":
        tables = tuple(_spreadsheet(path))
    else:
        tables = read_tables(path)
    # CryENGINE's paths start at the folder "dialog" beside the list.
    bases = tuple(path.parent / name for name in ("dialog", "Dialog") if preset == "cryengine")
    return Manifest(path, tuple(rows_of(tables, path, columns, preset)), bases)


def _wsources(path: Path) -> Manifest:
    """An External Sources List of Wwise: recordings only."""
    root = read_xml(path)
    if root.tag != "ExternalSourcesList":
        damaged(path, f"its root is <{root.tag[:40]}>, not <ExternalSourcesList>")
    rows = tuple(
        Row(f"{path}:Source {number}", audio=source.get("Path", "").strip())
        for number, source in enumerate(root.iter("Source"), 1)
    )
    said = root.get("Root", "").strip()
    # The list was written on a machine whose drives we need not have.
    base = Path(said.replace("\\", "/"))
    bases = (base,) if said and not PureWindowsPath(said).drive else ()
    return Manifest(path, rows, tuple(path.parent / base for base in bases))


def _keys(path: Path) -> Iterator[Row]:
    """``keys.txt`` beside the files of an FMOD audio table: a key and a path in each line."""
    for number, line in enumerate(decoded(path).splitlines(), 1):
        if not line.strip():
            continue
        first, comma, second = (part.strip().strip('"') for part in line.partition(","))
        if not second and comma:
            yield Row(f"{path}:{number}", id=first)
            continue
        if not comma:
            first, second = "", first
        elif first.lower().endswith(AUDIO_SUFFIXES) > second.lower().endswith(AUDIO_SUFFIXES):
            first, second = second, first
        yield Row(f"{path}:{number}", id=first, audio=second)


def _spreadsheet(path: Path) -> Iterator[Table]:
    """The sheets of an XML spreadsheet (Excel 2003), which CryENGINE keeps its lists in."""
    root = read_xml(path)
    if root.tag != "Workbook":
        damaged(path, f"its root is <{root.tag[:40]}>, not <Workbook>")
    for sheet in root.iter("Worksheet"):
        rows: list[tuple[int, tuple[str, ...]]] = []
        number = 0
        for row in sheet.iter("Row"):
            number = _index(row.get("Index"), number, path, _MOST_ROWS)
            cells: list[str] = []
            for cell in row.iter("Cell"):
                at = _index(cell.get("Index"), len(cells), path, _MOST_COLUMNS)
                cells += [""] * (at - 1 - len(cells))
                cells.append(
                    "".join("".join(data.itertext()) for data in cell.iter("Data")).strip()
                )
            if any(cells):
                rows.append((number, tuple(cells)))
        yield Table(sheet.get("Name", ""), tuple(rows))


def _index(said: str | None, before: int, path: Path, most: int) -> int:
    """A row's or cell's place, from 1: as it says, or behind the one before."""
    if said is None:
        return before + 1
    digits = said.isascii() and said.isdigit() and len(said) < 9
    if not digits or not before < int(said) <= most:
        damaged(path, f"a row or cell has the place '{said[:40]}'")
    return int(said)
