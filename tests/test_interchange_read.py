"""Every golden file reads as written beside it; formats are told apart."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from animeme.errors import InputError
from animeme_stages.align.interchange import (
    FORMATS,
    Span,
    Timings,
    kind_of,
    read_timings,
)
from animeme_stages.align.interchange.source import LARGEST_BYTES
from animeme_stages.align.interchange.timings import DamagedError
from support.timing_files import FOLDER, NAMES, expected, same

NAN, INF = float("nan"), float("inf")


def put(folder: Path, name: str, content: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def refused(path: Path) -> InputError:
    with pytest.raises(InputError) as caught:
        read_timings(path)
    assert caught.value.place == str(path)
    return caught.value


@pytest.mark.parametrize("name", NAMES)
def test_a_golden_file_reads_as_expected(name: str) -> None:
    timings = read_timings(FOLDER / name)
    assert same(timings, expected(name)), timings
    assert timings.source in FORMATS


def test_every_golden_file_has_an_expectation() -> None:
    kept = {path.name for path in FOLDER.iterdir()} - {"expected.json", ".gitattributes"}
    assert kept == set(NAMES)
    assert {expected(name)["source"] for name in NAMES} == {
        name for name, form in FORMATS.items() if form.read
    }


@pytest.mark.parametrize("name", NAMES)
def test_content_tells_the_format_where_the_suffix_does_not(name: str, tmp_path: Path) -> None:
    path = tmp_path / f"{Path(name).stem}.timings"
    shutil.copyfile(FOLDER / name, path)
    assert same(read_timings(path), expected(name))


def test_real_textgrids(shared: Path) -> None:
    folder = shared / "data" / "phone-labels"
    mary = read_timings(folder / "mary.TextGrid")
    assert [word.label for word in mary.words] == ["mary", "rolled", "the", "barrel"]
    assert "".join(phone.label for phone in mary.phones) == "məriroldθəbœrl"
    assert mary.duration_s == 1.869687
    words = read_timings(folder / "bobby_words.TextGrid")
    assert [word.label for word in words.words] == ["BOBBY", "RIPPED", "THE", "LEDGER"]
    assert words.phones == ()
    phones = read_timings(folder / "bobby_phones.TextGrid").phones
    assert " ".join(p.label for p in phones if p.label) == (
        "B AA1 B IY0 R IH1 PT DH AH0 L EH1 JH ER0"
    )
    assert phones[1].start_s == 0.06469123242311078


# What is not a timing file


@pytest.mark.parametrize(
    ("name", "content", "code", "message"),
    [
        ("a.TextGrid", b"", "timings-damaged", "empty"),
        ("a.TextGrid", b" \n", "timings-damaged", "empty"),
        ("a.TextGrid", b"ooBinaryFile\x08TextGrid", "timings-damaged", "binary"),
        (
            "a.TextGrid",
            '"ooTextFile"\n"\xfc"'.encode("latin-1"),
            "timings-encoding",
            "byte 14",
        ),
        ("a.TextGrid", "ooText\0", "timings-damaged", "NUL"),
        ("a.TextGrid", 'File type = "ooTextFile"\n"Pitch"\n', "timings-damaged", "does not start"),
        ("a.xyz", "what is this?\n", "timings-unknown", "textgrid, elan, webvtt"),
        ("a.json", "{}", "timings-unknown", "whisper"),
        ("a.json", '{"segments": [', "timings-damaged", "not complete JSON"),
        ("a.json", '{"segments": NaN}', "timings-damaged", "NaN"),
        ("a.json", "[" * 100_000, "timings-damaged", "not complete JSON"),
        ("a.jsonl", '{"time":', "timings-damaged", "not complete JSON"),
        ("a.json", '{"tiers": {}, "tiers": {}, "end": 1}', "timings-damaged", "twice"),
        ("a.json", '{"tiers": {}, "end": 1}', "timings-damaged", "no tier"),
        ("a.json", '{"tiers": {}}', "timings-damaged", "end is not a number"),
        ("a.json", '{"segments": []}', "timings-damaged", "no word"),
        ("a.json", '{"words": [{"word": "a"}], "text": "a"}', "timings-damaged", "has a time"),
        ("a.json", '{"mouthCues": [{"start": 0, "end": 1, "value": "Q"}]}', "timings-damaged", "Q"),
        ("a.lab", "hello world\n", "timings-damaged", "line 1"),
        ("a.lab", "#!MLF!#\n", "timings-damaged", "master label"),
        ("a.lab", "0 900000 a\n500000 2000000 b\n", "timings-damaged", "overlaps"),
        ("c.ctm", "a 1 0 0.5 one\nb 1 0 0.5 one\n", "timings-damaged", "it has 'a', 'b'"),
        ("c.ctm", "c 1 0 0.5 one\nc 2 0 0.5 one\n", "timings-damaged", "2 channels"),
        ("a.ctm", "a 1 0.5 0.5 two\na 1 0 0.5 one\n", "timings-damaged", "overlaps 'two'"),
        ("a.ctm", "a 1 1e999 0.5 two\n", "timings-damaged", "finite"),
        ("a.ctm", "a 1 -1 0.5 two\n", "timings-damaged", "leaves the recording"),
        ("a.ctm", "a 1 0 0.5 two", "timings-damaged", "no line end"),
        ("a.tsv", "0.00\tX\n0.50\tB\n", "timings-damaged", "closing"),
        ("a.vtt", "WEBVTT\n\n00:00.000 -->\nhi\n", "timings-damaged", "line 3"),
        ("a.vtt", "WEBVTT\n\n00:00.000 --> 00:01.000\n", "timings-damaged", "no text"),
        ("a.vtt", "00:00.000 --> 00:01.000\nhi\n", "timings-damaged", "WEBVTT"),
        ("a.srt", "1\n00:00:00,000 --> 00:00:01\nhi\n", "timings-damaged", "line 2"),
        ("a.srt", "1\n00:00:00,000 --> 00:00:01,000\n<i\n", "timings-damaged", "tag"),
    ],
)
def test_what_cannot_be_read_says_why(
    name: str, content: str | bytes, code: str, message: str, tmp_path: Path
) -> None:
    error = refused(put(tmp_path, name, content))
    assert error.code == code
    assert message in str(error)


def test_a_missing_file_and_a_folder_are_refused(tmp_path: Path) -> None:
    assert refused(tmp_path / "none.TextGrid").code == "timings-unreadable"
    assert refused(tmp_path).code == "timings-unreadable"


def test_a_huge_file_is_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "huge.json"
    with path.open("wb") as stream:
        stream.truncate(LARGEST_BYTES * 64)
    assert refused(path).code == "timings-too-large"


# TextGrid's declared sizes


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("size = 10", "size = 9"),
        ("size = 10", "size = 11"),
        ("size = 10", "size = 999999999"),
        ("size = 10", "size = -1"),
        ("size = 2 ", "size = 1 "),
        ("size = 2 ", "size = 3 "),
        ("xmax = 1.2 \ntiers", "tiers"),
        ("xmin = 0 \nxmax = 1.2 \ntiers", "xmin = 5 \nxmax = 6.2 \ntiers"),
        ("xmax = 1.2 \ntiers", "xmax = 0.5 \ntiers"),
        ("<exists>", "<absent>"),
        ('text = "D"', 'text = "D'),
        ('"IntervalTier"', '"Harmonicity"'),
    ],
)
def test_a_textgrid_that_contradicts_itself_is_refused(old: str, new: str, tmp_path: Path) -> None:
    text = (FOLDER / "long.TextGrid").read_text(encoding="utf-8")
    assert old in text
    assert refused(put(tmp_path, "a.TextGrid", text.replace(old, new, 1))).code == "timings-damaged"


def test_a_textgrid_may_have_comments(tmp_path: Path) -> None:
    text = (FOLDER / "long.TextGrid").read_text(encoding="utf-8")
    text = text.replace("xmin = 0 \n", "xmin = 0 ! of 99 seconds\n", 1)
    assert same(read_timings(put(tmp_path, "a.TextGrid", text)), expected("long.TextGrid"))


# XML that attacks


def _with_doctype(doctype: str) -> str:
    text = (FOLDER / "elan.eaf").read_text(encoding="utf-8")
    return text.replace("<ANNOTATION_DOCUMENT", f"{doctype}\n<ANNOTATION_DOCUMENT", 1).replace(
        "hello<", "&e9;<", 1
    )


LAUGHS = "".join(f'<!ENTITY e{n} "{f"&e{n - 1};" * 10}">' for n in range(1, 10))


@pytest.mark.parametrize(
    "doctype",
    [
        f'<!DOCTYPE x [<!ENTITY e0 "ha">{LAUGHS}]>',
        '<!DOCTYPE x [<!ENTITY e9 SYSTEM "file:///etc/hostname">]>',
        '<!DOCTYPE x SYSTEM "http://localhost:9/x.dtd">',
    ],
)
def test_xml_entities_are_never_expanded(doctype: str, tmp_path: Path) -> None:
    error = refused(put(tmp_path, "a.eaf", _with_doctype(doctype)))
    assert error.code == "timings-damaged"
    assert "document type declaration" in str(error)


def test_deep_xml_is_refused(tmp_path: Path) -> None:
    path = put(tmp_path, "a.eaf", "<ANNOTATION_DOCUMENT>" + "<a>" * 1_000_000)
    assert "nested" in str(refused(path))


# What a file beside a recording is meant to be


@pytest.mark.parametrize("name", NAMES)
def test_every_golden_file_is_known_for_what_it_is(name: str) -> None:
    kind = "mouth shapes" if name.startswith("rhubarb") else "timings"
    assert kind_of(FOLDER / name) == kind


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.lab", "Hello world\n"),
        ("a.lab", ""),
        ("a.lab", "2 4 six eight\n"),
        ("a.txt", "0 1 a\n"),
        ("a.csv", "time_s,lip_gap\n0.0,0.1\n"),
        ("a.json", '{"speaker": "ada", "take": 3}'),
        ("a.json", '{"segments": [{"id": 1}], "text": "Hello", "words": ["Hello"]}'),
        ("a.json", "[1, 2, 3]"),
        ("a.json", '{"take": 3} // the good one of them'),
        ("a.json", "no JSON at all"),
        ("a.jsonl", '{"take": 3}\n'),
        ("a.tsv", "start\tend\ttext\n0\t900\thello\n"),
        ("a.tsv", ""),
    ],
)
def test_what_has_no_timings_is_told_from_what_has(name: str, text: str, tmp_path: Path) -> None:
    assert kind_of(put(tmp_path, name, text)) == "other"


@pytest.mark.parametrize("name", [n for n in NAMES if n.endswith((".json", ".jsonl"))])
def test_half_a_json_file_of_timings_is_not_nobodys(name: str, tmp_path: Path) -> None:
    """So that it is refused, and its line not aligned as if it had none."""
    whole = (FOLDER / name).read_text(encoding="utf-8")
    first = whole.split("\n")[0] if name.endswith(".jsonl") else whole
    for share in (0.0, 0.3, 0.5, 0.9):
        path = put(tmp_path, name, first[: int(len(first) * share)].rstrip())
        assert kind_of(path) == "timings", share


# The value type


def test_small_overlaps_are_settled() -> None:
    timings = Timings((Span("a", -0.0005, 0.5), Span("b", 0.4995, 1.0005)), (), (), 1.0, "ctm")
    assert timings.words == (Span("a", 0.0, 0.5), Span("b", 0.5, 1.0))


@pytest.mark.parametrize(
    "words",
    [
        (Span("a", 0.0, 0.5), Span("b", 0.498, 1.0)),
        (Span("a", 0.5, 0.5),),
        (Span("a", 0.5, 0.4),),
        (Span("a", NAN, 0.4),),
        (Span("a", 0.1, INF),),
        (Span("a", 0.5, 1.002),),
        (Span("a", -0.002, 0.5),),
        (Span("\ud800", 0.0, 0.5),),
        (),
    ],
)
def test_broken_timings_cannot_be_made(words: tuple[Span, ...]) -> None:
    with pytest.raises(DamagedError):
        Timings(words, (), (), 1.0, "ctm")


@pytest.mark.parametrize("duration_s", [0.0, -1.0, NAN, INF])
def test_a_length_is_positive(duration_s: float) -> None:
    with pytest.raises(DamagedError):
        Timings((Span("a", 0.0, 0.1),), (), (), duration_s, "ctm")


def test_viseme_events_are_in_order() -> None:
    with pytest.raises(DamagedError):
        Timings((), (), (Span("0", 0.5, 0.5), Span("1", 0.4, 0.4)), None, "azure")


@pytest.mark.parametrize(
    ("name", "text"),
    [
        (
            "a.srt",
            "1\n00:00:00,900 --> 00:00:01,500\nHi\n\n2\n00:00:01,300 --> 00:00:05,000\nthere\n\n"
            "3\n00:00:06,000 --> 00:00:07,000\nyou\n",
        ),
        (
            "a.vtt",
            "WEBVTT\n\n00:00.900 --> 00:01.500\nHi\n\n00:01.300 --> 00:05.000\nthere\n\n"
            "00:06.000 --> 00:07.000\nyou\n",
        ),
    ],
)
def test_subtitles_beside_each_other_are_one(name: str, text: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    words = read_timings(path).words
    assert [(w.label, w.start_s, w.end_s) for w in words] == [
        ("Hi there", 0.9, 5.0),
        ("you", 6.0, 7.0),
    ]
