"""Cells of sheets: CSV in the spellings of spreadsheets, and workbooks."""

from __future__ import annotations

import csv
import io
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from animeme.errors import InputError

WORKBOOK_SUFFIXES = (".xlsx", ".xlsm", ".xlsb", ".xls", ".ods")
DELIMITERS = ",;\t|"

LARGEST_BYTES = 256 * 2**20
"""A million lines of dialogue are half of it."""
_MOST_CELLS = 3 * 10**7


@dataclass(frozen=True)
class Table:
    """Cells of one sheet, stripped.

    Attributes:
        name: of the sheet in its workbook, "" for a CSV file.
        rows: number in the file (from 1) and cells of each row that is not blank.
    """

    name: str
    rows: tuple[tuple[int, tuple[str, ...]], ...]


def read_tables(path: Path) -> tuple[Table, ...]:
    """The sheets of a file.

    Raises:
        InputError: it is damaged, too large, or not Unicode text.
        OSError: it cannot be read.
    """
    if path.suffix.lower() in WORKBOOK_SUFFIXES:
        return _read_workbook(path)
    return (Table("", _read_csv(path)),)


def decoded(path: Path) -> str:
    """The text of a file: as its byte order mark says, UTF-16 without one, or UTF-8.

    Raises:
        InputError: it is neither, or too large.
        OSError: it cannot be read.
    """
    if path.stat().st_size > LARGEST_BYTES:
        damaged(path, f"it is larger than {LARGEST_BYTES >> 20} MiB")
    data = path.read_bytes()
    marks = ((b"\xef\xbb\xbf", "utf-8-sig"), (b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16"))
    encoding = next((name for mark, name in marks if data.startswith(mark)), "")
    if not encoding:  # half of the bytes of Western text in UTF-16 are 0
        head = data[:256]
        even, odd = head[::2].count(0), head[1::2].count(0)
        wide = 4 * (even + odd) > len(head)
        encoding = "utf-8" if not wide else "utf-16-le" if odd > even else "utf-16-be"
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError as error:
        raise InputError(
            "manifest-encoding",
            f"is not Unicode text (byte {error.start})",
            place=str(path),
            action="Save it as UTF-8: a spreadsheet calls that 'CSV UTF-8'.",
        ) from None
    if "\0" in text:
        damaged(path, "it holds NUL characters")
    return text


def damaged(path: Path, problem: str) -> NoReturn:
    """Refuse a file.

    Raises:
        InputError: always.
    """
    raise InputError(
        "manifest-damaged",
        f"cannot be used: {problem}",
        place=str(path),
        action="Export it again.",
    )


def _read_csv(path: Path) -> tuple[tuple[int, tuple[str, ...]], ...]:
    text = decoded(path)
    delimiter = _delimiter(text, path)
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, strict=True)
    rows: list[tuple[int, tuple[str, ...]]] = []
    number = 1
    try:
        for cells in reader:
            stripped = tuple(cell.strip() for cell in cells)
            if any(stripped) and not (number == 1 and text.startswith("sep=")):
                rows.append((number, stripped))
            number = reader.line_num + 1
    except csv.Error as error:
        damaged(path, f"line {reader.line_num}: {error}")
    return tuple(rows)


def _delimiter(text: str, path: Path) -> str:
    """What separates the cells: as its first line says, or what it has most of outside quotes."""
    first, _, rest = text.partition("\n")
    if first.strip().lower().startswith("sep=") and len(first.strip()) == 5:
        return first.strip()[-1]
    if path.suffix.lower() in (".tsv", ".tab"):
        return "\t"
    # Titles may stand above the header: the first lines together.
    bare = "".join(f"{first}\n{rest}"[:4096].split('"')[::2])
    return max(DELIMITERS, key=lambda sign: (min(bare.count(sign), 10**6), sign == ","))


def _read_workbook(path: Path) -> tuple[Table, ...]:
    # Imported here: jobs without a workbook do without.
    from python_calamine import CalamineError, CalamineWorkbook

    tables = []
    try:
        _require_small(path)
        with CalamineWorkbook.from_path(str(path)) as book:
            for name in book.sheet_names:
                sheet = book.get_sheet_by_name(name)
                if sheet.total_height * sheet.total_width > _MOST_CELLS:
                    damaged(path, f"its sheet '{name[:40]}' has cells too far from its corner")
                cells = sheet.to_python(skip_empty_area=False)
                rows = ((n, tuple(map(_cell_text, row))) for n, row in enumerate(cells, 1))
                tables.append(Table(name, tuple(row for row in rows if any(row[1]))))
    # zipfile raises NotImplementedError where a part says that it needs a newer version of zip.
    except (CalamineError, ValueError, NotImplementedError, zipfile.BadZipFile) as error:
        damaged(path, f"it is no complete workbook ({str(error)[:80]})")
    return tuple(tables)


def _require_small(path: Path) -> None:
    """Refuse a packed workbook that would not fit into memory."""
    if path.stat().st_size > LARGEST_BYTES:
        damaged(path, f"it is larger than {LARGEST_BYTES >> 20} MiB")
    if zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as packed:
            if sum(part.file_size for part in packed.infolist()) > 4 * LARGEST_BYTES:
                damaged(path, "it unpacks to more than a sheet of dialogue could hold")


def _cell_text(cell: object) -> str:
    if isinstance(cell, float) and cell.is_integer():
        return str(int(cell))  # an id 12 is 12.0 to a spreadsheet
    return str(cell).strip()
