"""Some of the lines."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from animeme.dialogue import Line
from animeme.errors import InputError
from animeme.selection import Selection, read_changed, select


def line(key: str) -> Line:
    language, *character, name = key.split("/", 2)
    audio = Path("vo", f"{key}.wav")
    return Line(name, language, "".join(character), str(audio), str(audio.with_suffix(".txt")))


KEYS = ("de/ada/act1/a", "de/bob/act1/b", "en-US/ada/act1/a", "en/ada/act2/c")
COMMON = Line("all", "en", "", "vo/en/all.wav", "vo/en/all.txt")
LINES = (*map(line, KEYS), COMMON)
CASES: dict[str, tuple[Selection, list[str]]] = {
    "all": (Selection(), [li.key for li in LINES]),
    "a language": (
        Selection(languages=("English",)),
        ["en-US/ada/act1/a", "en/ada/act2/c", "en/all"],
    ),
    "a region": (Selection(languages=("en_us",)), ["en-US/ada/act1/a"]),
    "a character": (Selection(characters=("bob",)), ["de/bob/act1/b", "en/all"]),
    "ids": (Selection(patterns=("act1/*",)), list(KEYS[:3])),
    "keys": (Selection(patterns=("de/*", "*/all")), ["de/ada/act1/a", "de/bob/act1/b", "en/all"]),
    "both": (Selection(("de",), ("ada",)), ["de/ada/act1/a"]),
    "changed": (
        Selection(changed=("de/ada/act1/a", "vo/en/all.txt", "other.md")),
        ["de/ada/act1/a", "en/all"],
    ),
    "nothing changed": (Selection(changed=()), []),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_lines_are_selected(case: str) -> None:
    selection, keys = CASES[case]
    assert [li.key for li in select(LINES, selection)] == keys
    assert selection.everything == (case == "all")


@pytest.mark.parametrize(
    ("selection", "place"),
    [
        (Selection(languages=("de", "fr")), "--language"),
        (Selection(characters=("eva",)), "--character"),
        (Selection(patterns=("act9/*",)), "--lines"),
    ],
)
def test_what_fits_nothing_is_an_error(selection: Selection, place: str) -> None:
    with pytest.raises(InputError) as caught:
        select(LINES, selection)
    assert (caught.value.code, caught.value.place) == ("selection-empty", place)


def test_a_list_of_changes_is_read(tmp_path: Path) -> None:
    path = tmp_path / "changed.txt"
    path.write_bytes(b"\xef\xbb\xbfvo/en/all.wav\r\n\r\n de/ada/act1/a \r\n")
    assert read_changed(path) == ("vo/en/all.wav", "de/ada/act1/a")
    with pytest.raises(InputError):
        read_changed(tmp_path / "none")


MARKS = (("en/boat", "fix"), ("en/five", "good"), ("de/boat", "fix"), ("en/boat", "fix"))


def test_of_a_review_pages_marks_those_to_fix_are_the_list(tmp_path: Path) -> None:
    document = {
        "schema": "animeme.marks/1",
        "job": "sample",
        "marks": [{"line": k, "character": "ada", "mark": m, "note": 'a "b"'} for k, m in MARKS],
    }
    (tmp_path / "marks.json").write_text(json.dumps(document), encoding="utf-8")
    rows = [f'{key},ada,{mark},"a ""b"", c"' for key, mark in MARKS]
    table = "\r\n".join(["line,character,mark,note", *rows])
    (tmp_path / "marks.csv").write_text(table, encoding="utf-8-sig")
    (tmp_path / "list.csv").write_text("vo/en/boat.wav\n", encoding="utf-8")
    assert read_changed(tmp_path / "marks.json") == ("en/boat", "de/boat")
    assert read_changed(tmp_path / "marks.csv") == ("en/boat", "de/boat")
    assert read_changed(tmp_path / "list.csv") == ("vo/en/boat.wav",)


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("marks.json", '{"schema": "animeme.report/1"}', "no document of marks"),
        ("marks.json", '{"schema": "animeme.marks/1", "marks": [{"line": "a"}]}', "mark 1 needs"),
        ("marks.json", '{"schema": "animeme.marks/1", "marks": [7]}', "mark 1 needs"),
        ("marks.json", "[", "cannot be read|Expecting value"),
        ("marks.csv", "line,character,mark,note\na,ada,maybe,\n", "mark 1 needs"),
        ("marks.csv", "line,character,mark,note\na\n", "mark 1 needs"),
    ],
)
def test_broken_marks_are_refused(name: str, text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=words):
        read_changed(tmp_path / name)
