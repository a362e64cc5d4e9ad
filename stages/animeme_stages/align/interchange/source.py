"""A timing file's content, read once: its text, its lines, its JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NoReturn

from animeme.errors import InputError
from animeme_stages.align.interchange.timings import DamagedError

LARGEST_BYTES = 16 * 2**20
"""Larger files are refused: an hour of phones takes 6 MB in the wordiest of the formats."""

_MARKS = (
    (b"\xef\xbb\xbf", "utf-8"),
    (b"\xff\xfe", "utf-16-le"),
    (b"\xfe\xff", "utf-16-be"),
)


@dataclass(frozen=True, eq=False)
class Source:
    """What readers get.

    Attributes:
        stem: the file's name without suffix, by which some formats tell recordings apart.
        text: the content, decoded, without byte order mark, line ends as LF.
    """

    stem: str
    text: str

    def lines(self) -> Iterator[tuple[int, str]]:
        """Numbered lines that are not blank.

        Raises:
            DamagedError: the last line has no line end, so that part of it may be missing.
        """
        if not self.text.endswith("\n"):
            raise DamagedError("the last line has no line end, so part of it may be missing")
        for number, line in enumerate(self.text.split("\n"), start=1):
            if line.strip():
                yield number, line

    @cached_property
    def first_line(self) -> str:
        """The first line that is not blank, stripped."""
        return self.text.lstrip().split("\n", 1)[0].strip()

    @cached_property
    def json(self) -> Any:
        """The content as JSON.

        Raises:
            DamagedError: it is not one complete JSON text.
        """
        return parse_json(self.text)


def read_source(path: Path) -> Source:
    """The content of the file at `path`: UTF-8, or UTF-16 with or without byte order mark.

    Raises:
        InputError: missing, too large, not Unicode text, or cut short within a character.
    """
    data = _read(path)
    encoding, mark = _encoding(data)
    try:
        text = data[mark:].decode(encoding)
    except UnicodeDecodeError as error:
        if error.reason in ("unexpected end of data", "truncated data"):
            raise damaged(path, "it ends within a character") from None
        raise InputError(
            "timings-encoding",
            f"is not Unicode text (byte {error.start + mark})",
            place=str(path),
            action="Save it as UTF-8; an old code page cannot be told from the file alone.",
        ) from None
    if "\0" in text:
        raise damaged(path, "it holds NUL characters")
    return Source(path.stem, text.replace("\r\n", "\n").replace("\r", "\n"))


def damaged(path: Path, problem: str) -> InputError:
    """The error of a file that is broken or only half there."""
    return InputError(
        "timings-damaged",
        f"cannot be used: {problem}",
        place=str(path),
        action="Export the timings again, or take the file away to have the line aligned.",
    )


def parse_json(text: str) -> Any:
    """Strict JSON: no NaN, no doubled members, no depth that would exhaust the stack.

    Raises:
        DamagedError: `text` is not that.
    """
    try:
        return json.loads(text, parse_constant=_no_constant, object_pairs_hook=_members)
    except DamagedError:
        raise
    except (ValueError, RecursionError) as error:
        raise DamagedError(f"it is not complete JSON ({str(error)[:80]})") from None


def is_cut_json(text: str) -> bool:
    """Whether a JSON text breaks off at its end, rather than being no JSON in the middle.

    Example:
        >>> is_cut_json('{"a": [1, 2'), is_cut_json('{"a": 1} // a remark'), is_cut_json("{}")
        (True, False, False)
    """
    try:
        json.loads(text)
    except json.JSONDecodeError as error:
        # A cut literal ("fals") or escape is complained about where it starts.
        return error.msg.startswith("Unterminated") or error.pos >= len(text.rstrip()) - 5
    except (ValueError, RecursionError):
        return False
    return False


def mapping(value: Any, place: str) -> dict[str, Any]:
    """`value` if it is a JSON object.

    Raises:
        DamagedError: it is something else.
    """
    if not isinstance(value, dict):
        raise DamagedError(f"{place} is not an object")
    return value


def listing(value: Any, place: str) -> list[Any]:
    """`value` if it is a JSON array.

    Raises:
        DamagedError: it is something else.
    """
    if not isinstance(value, list):
        raise DamagedError(f"{place} is not a list")
    return value


def string(value: Any, place: str) -> str:
    """`value` if it is a JSON string.

    Raises:
        DamagedError: it is something else.
    """
    if not isinstance(value, str):
        raise DamagedError(f"{place} is not a string")
    return value


def number(value: Any, place: str) -> float:
    """A JSON number, or the text of a decimal number, as a finite float.

    Raises:
        DamagedError: `value` is neither.
    """
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise DamagedError(f"{place} is not a number")
    try:
        result = float(value)
    except (ValueError, OverflowError):
        raise DamagedError(f"{place} is not a number ({str(value)[:40]!r})") from None
    if not math.isfinite(result) or (isinstance(value, str) and "_" in value):
        raise DamagedError(f"{place} is not a finite number")
    return result


def _read(path: Path) -> bytes:
    try:
        with path.open("rb") as stream:
            data = stream.read(LARGEST_BYTES + 1)
    except OSError as error:
        raise InputError(
            "timings-unreadable",
            f"cannot be read: {error.strerror or error}",
            place=str(path),
            action="Check the file's name and permissions.",
        ) from error
    if len(data) > LARGEST_BYTES:
        raise InputError(
            "timings-too-large",
            f"is larger than {LARGEST_BYTES // 2**20} MB",
            place=str(path),
            action="Give the timings of one recording, not of a corpus.",
        )
    return data


def _encoding(data: bytes) -> tuple[str, int]:
    """The codec and how many bytes of byte order mark precede the text."""
    for mark, codec in _MARKS:
        if data.startswith(mark):
            return codec, len(mark)
    # Every format here starts with an ASCII character, so a zero byte tells UTF-16's order.
    if len(data) > 1 and data[0] and not data[1]:
        return "utf-16-le", 0
    if len(data) > 1 and data[1] and not data[0]:
        return "utf-16-be", 0
    return "utf-8", 0


def _no_constant(name: str) -> NoReturn:
    raise DamagedError(f"{name} is not JSON")


def _members(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    members = dict(pairs)
    if len(members) != len(pairs):
        raise DamagedError("an object has a member twice")
    return members
