"""Lines from sheets."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import pytest

from animeme import documents
from animeme.errors import InputError
from animeme.findings import Severity
from animeme.gathering import DialogueSource, gather
from animeme.manifest import Columns, manifest_document
from support.lists import codes, folder_of, gathered, spoken
from support.schemas import validate

AUDIO = ["en/a.wav", "en/b.wav", "de/a.wav", "de/b.wav"]
ROWS = [
    ["id", "language", "audio", "text"],
    ["a", "en", "en/a.wav", "Hello, you."],
    ["a", "de", "de/a.wav", 'Das "Ä".'],
    ["b", "en", "en/b.wav", "Two\nlines"],
    ["b", "de", "de/b.wav", "Zwei"],
]
EXPECTED = {
    "de/a": ("de/a.wav", 'Das "Ä".'),
    "de/b": ("de/b.wav", "Zwei"),
    "en/a": ("en/a.wav", "Hello, you."),
    "en/b": ("en/b.wav", "Two\nlines"),
}


def delimited(sign: str, rows: list[list[str]] = ROWS) -> str:
    def cell(text: str) -> str:
        quoted = text.replace('"', '""')
        return f'"{quoted}"' if set(text) & {sign, '"', "\n"} else text

    return "".join(sign.join(map(cell, row)) + "\r\n" for row in rows)


FILES: dict[str, tuple[str, bytes]] = {
    "commas": ("lines.csv", delimited(",").encode()),
    "byte order mark": ("lines.csv", delimited(",").encode("utf-8-sig")),
    "semicolons": ("lines.csv", delimited(";").encode()),
    "a line that says what separates": ("lines.csv", ("sep=;\r\n" + delimited(";")).encode()),
    "tabs": ("lines.tsv", delimited("\t").encode()),
    "tabs in a .csv": ("lines.csv", delimited("\t").encode()),
    "UTF-16": ("lines.csv", delimited("\t").encode("utf-16")),
    "UTF-16 without mark": ("lines.txt", delimited("\t").encode("utf-16-le")),
    "a title above": ("lines.csv", (",,,\r\nProject X,,,\r\n" + delimited(",")).encode()),
}


@pytest.mark.parametrize("case", FILES)
def test_every_spelling_of_a_sheet_is_read(case: str, tmp_path: Path) -> None:
    folder_of(tmp_path, AUDIO)
    name, data = FILES[case]
    found = gathered(tmp_path, data, name)
    assert spoken(found, tmp_path) == EXPECTED
    assert found.findings == ()
    assert all(line.findings == () for line in found.lines)


def workbook(path: Path, sheets: dict[str, list[list[str | float]]]) -> Path:
    """An XLSX file, as small as one may be."""
    main = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
    kinds = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
    package = "http://schemas.openxmlformats.org/package/2006"
    with zipfile.ZipFile(path, "w") as packed:
        parts = "".join(
            f'<Override PartName="/xl/worksheets/s{n}.xml" ContentType="application/vnd.'
            'openxmlformats-officedocument.spreadsheetml.worksheet+xml"/>'
            for n in range(len(sheets))
        )
        packed.writestr(
            "[Content_Types].xml",
            f'<Types xmlns="{package}/content-types"><Default Extension="rels" ContentType='
            '"application/vnd.openxmlformats-package.relationships+xml"/><Override PartName='
            '"/xl/workbook.xml" ContentType="application/vnd.openxmlformats-officedocument.'
            f'spreadsheetml.sheet.main+xml"/>{parts}</Types>',
        )
        packed.writestr(
            "_rels/.rels",
            f'<Relationships xmlns="{package}/relationships"><Relationship Id="r" Type='
            f'"{kinds}/officeDocument" Target="xl/workbook.xml"/></Relationships>',
        )
        names = "".join(
            f'<sheet name="{name}" sheetId="{n + 1}" r:id="r{n}"/>' for n, name in enumerate(sheets)
        )
        packed.writestr(
            "xl/workbook.xml",
            f'<workbook xmlns="{main}" xmlns:r="{kinds}"><sheets>{names}</sheets></workbook>',
        )
        links = "".join(
            f'<Relationship Id="r{n}" Type="{kinds}/worksheet" Target="worksheets/s{n}.xml"/>'
            for n in range(len(sheets))
        )
        packed.writestr(
            "xl/_rels/workbook.xml.rels",
            f'<Relationships xmlns="{package}/relationships">{links}</Relationships>',
        )
        for n, rows in enumerate(sheets.values()):
            text = ""
            for r, row in enumerate(rows, 1):
                cells = "".join(
                    f'<c r="{chr(65 + c)}{r}"><v>{cell}</v></c>'
                    if isinstance(cell, float)
                    else f'<c r="{chr(65 + c)}{r}" t="inlineStr"><is><t>{cell}</t></is></c>'
                    for c, cell in enumerate(row)
                )
                text += f'<row r="{r}">{cells}</row>'
            packed.writestr(
                f"xl/worksheets/s{n}.xml",
                f'<worksheet xmlns="{main}"><sheetData>{text}</sheetData></worksheet>',
            )
    return path


def test_a_workbook_is_read_sheet_by_sheet(tmp_path: Path) -> None:
    folder_of(tmp_path, ["12.wav", "b.wav", "c.wav"])
    path = workbook(
        tmp_path / "lines.xlsx",
        {
            "Read me": [["Project"], ["of ours"]],
            "Act 1": [["Line ID", "File", "Dialogue"], [12.0, "12.wav", "Twelve."]],
            "Act 2": [["Title"], ["Line ID", "File", "Dialogue"], ["b", "b.wav", "Bee."]],
        },
    )
    found = gather(DialogueSource(None, (path,), language="en"))
    assert spoken(found, tmp_path) == {"en/12": ("12.wav", "Twelve."), "en/b": ("b.wav", "Bee.")}
    assert [line.origin for line in found.lines] == [f"{path}:Act 1:2", f"{path}:Act 2:3"]
    assert codes(found.findings) == ["recording-surplus"]


HEADERS = [
    ("id", "audio", "character", "text"),
    ("Line ID", "File Name", "Speaker", "Transcript"),
    ("KEY", "Wav", "Actor", "Dialogue"),
    ("string_id", "Audio File", "Character Name", "Line"),
]


@pytest.mark.parametrize("headers", HEADERS)
def test_usual_headers_are_known(headers: tuple[str, ...], tmp_path: Path) -> None:
    folder_of(tmp_path, ["x.wav"])
    text = f"{','.join(headers)},Status\nhello,x.wav,ada,Hi.,done\n"
    found = gathered(tmp_path, text, language="en")
    assert spoken(found, tmp_path) == {"en/ada/hello": ("x.wav", "Hi.")}


def test_a_job_may_name_the_columns(tmp_path: Path) -> None:
    folder_of(tmp_path, ["x.wav", "y.wav"])
    text = "Nummer,Ton,Ton DE,Wort,Wort DE\nhello,x.wav,y.wav,Hi.,Hallo.\n"
    columns = Columns(
        {"id": "Nummer"}, {"en": "Wort", "de": "Wort DE"}, {"en": "Ton", "German": "ton de"}
    )
    found = gathered(tmp_path, text, columns=columns)
    assert spoken(found, tmp_path) == {
        "de/hello": ("y.wav", "Hallo."),
        "en/hello": ("x.wav", "Hi."),
    }
    with pytest.raises(InputError, match=r"has no column 'Nummr'.*Did you mean 'Nummer'"):
        gathered(tmp_path, text, columns=Columns({"id": "Nummr"}))


@pytest.mark.parametrize(
    "headers",
    ["en,de", "English,German", "text_en,text_de", "Text (en),Text (de)", "EN text,DE text"],
)
def test_a_column_for_each_language(headers: str, tmp_path: Path) -> None:
    folder_of(tmp_path, ["vo/en/a.wav", "vo/German/a.flac", "vo/en/b.wav"])
    text = f"id,file,{headers}\na,a.wav,Hello.,Hallo.\nb,b.wav,Two.,\n"
    found = gathered(tmp_path, text, root=tmp_path / "vo")
    assert spoken(found, tmp_path) == {
        "de/a": ("vo/German/a.flac", "Hallo."),
        "en/a": ("vo/en/a.wav", "Hello."),
        "en/b": ("vo/en/b.wav", "Two."),
    }
    (finding,) = found.findings
    assert finding.code == "line-language-missing"
    assert "1 of 2 lines are in en and not in de: b" in finding.message


def test_a_region_is_found_where_only_its_language_is_named(tmp_path: Path) -> None:
    folder_of(tmp_path, ["vo/en/a.wav", "vo/es/a.wav"])
    text = "id,English,Spanish (Spain)\na,Hello.,Hola.\n"
    found = gathered(tmp_path, text, root=tmp_path / "vo")
    assert spoken(found, tmp_path) == {
        "en/a": ("vo/en/a.wav", "Hello."),
        "es-ES/a": ("vo/es/a.wav", "Hola."),
    }
    assert found.findings == ()


def test_recordings_are_found_however_their_paths_are_spelt(tmp_path: Path) -> None:
    folder_of(tmp_path, ["VO/Act1/Hello.WAV", "VO/Act1/bye.flac", "VO/Act1/z.wav"])
    rows = "audio,text\nvo\\act1\\hello.wav,Hi\nVO/Act1/bye.wav,Bye\n./VO/Act1/z,Zed\n"
    found = gathered(tmp_path, rows, language="en")
    assert spoken(found, tmp_path) == {
        "en/vo/act1/hello": ("VO/Act1/Hello.WAV", "Hi"),
        "en/VO/Act1/bye": ("VO/Act1/bye.flac", "Bye"),
        "en/VO/Act1/z": ("VO/Act1/z.wav", "Zed"),
    }


def test_without_paths_recordings_are_found_by_id(tmp_path: Path) -> None:
    folder_of(tmp_path / "vo", ["en/ada/a.wav", "en/b.wav", "de/b.wav"])
    rows = "id,who,lang,text\na,ada,EN,Hi\nb,ada,en,Two\nb,,German,Zwei\n"
    found = gathered(tmp_path, rows, root=tmp_path / "vo")
    assert spoken(found, tmp_path) == {
        "de/b": ("vo/de/b.wav", "Zwei"),
        "en/ada/a": ("vo/en/ada/a.wav", "Hi"),
        "en/ada/b": ("vo/en/b.wav", "Two"),
    }


def test_a_file_beside_the_recording_fills_an_empty_text(tmp_path: Path) -> None:
    folder_of(tmp_path, ["a.wav", "a.txt", "b.wav"])
    found = gathered(tmp_path, "audio,text\na.wav,\nb.wav,\n", language="en")
    assert [line.text for line in found.lines] == [None, ""]
    assert found.lines[0].transcript.is_file()


def test_what_does_not_fit_together_is_reported(tmp_path: Path) -> None:
    folder_of(tmp_path, ["vo/a.wav", "vo/b.wav", "vo/extra.wav", "vo/extra2.wav"])
    rows = (
        "id,audio,lang,text\na,vo/a.wav,en,A\na,vo/b.wav,en,B\nc,vo/b.wav,en,B\nc2,vo/b.wav,en,B\n"
        ",,en,lost\n../up,x.wav,en,x\nd,x.wav,Germn,x\ne,gone.wav,en,E\n"
    )
    found = gathered(tmp_path, rows)
    by_key = {line.key: line for line in found.lines}
    assert list(by_key) == ["en/a", "en/c", "en/c2", "en/e"]
    assert codes(by_key["en/a"].findings) == ["line-duplicate"]
    assert by_key["en/a"].findings[0].severity == Severity.ERROR
    assert "lines.csv:2" in by_key["en/a"].findings[0].message
    assert codes(by_key["en/c"].findings) == ["recording-shared"]
    assert "en/c2" in by_key["en/c"].findings[0].message
    assert by_key["en/e"].findings == ()
    assert by_key["en/e"].audio == tmp_path / "gone.wav"
    assert codes(found.findings) == [
        "manifest-row-unusable",
        "manifest-row-unusable",
        "language-unknown",
        "recording-surplus",
    ]
    assert found.findings[2].place.endswith("lines.csv:8")
    assert "Did you mean 'German' (de)?" in found.findings[2].action
    assert "2 recordings are in no list: extra.wav, extra2.wav" in found.findings[3].message


def test_lines_of_strangers_are_left_out(tmp_path: Path) -> None:
    folder_of(tmp_path, ["a.wav", "b.wav", "c.wav"])
    rows = "audio,character,text\na.wav,ADA,x\nb.wav,Bob,x\nc.wav,,x\n"
    found = gathered(tmp_path, rows, language="en", characters=["ada", "bo"])
    assert [line.key for line in found.lines] == ["en/ada/a", "en/c"]
    (finding,) = found.findings
    assert (finding.code, finding.severity) == ("character-unknown", Severity.INFO)
    assert "Did you mean 'bo'?" in finding.action


def test_a_language_that_nobody_says_is_one_finding(tmp_path: Path) -> None:
    folder_of(tmp_path, ["x/a.wav"])
    found = gathered(tmp_path, "audio,text\nx/a.wav,Hi\nx/b.wav,Bye\n", "x.csv")
    assert found.lines == ()
    assert codes(found.findings) == ["language-missing"]
    told = gathered(tmp_path, "audio,text\nx/a.wav,Hi\n", "lines_fr.csv")
    assert [line.key for line in told.lines] == ["fr/x/a"]


def test_a_manifest_document_comes_back(tmp_path: Path) -> None:
    folder_of(tmp_path, AUDIO)
    found = gathered(tmp_path, delimited(","))
    document = manifest_document(found.lines, tmp_path)
    validate("manifest", document)
    again = gathered(tmp_path, json.dumps(document), "lines.json")
    assert spoken(again, tmp_path) == EXPECTED
    documents.read("manifest", tmp_path / "lines.json")


@pytest.mark.parametrize(
    ("name", "data", "code"),
    [
        ("lines.csv", b"", "manifest-columns"),
        ("lines.csv", b"a,b\n1,2\n", "manifest-columns"),
        ("lines.csv", "id,text\na,\xe4\n".encode("latin-1"), "manifest-encoding"),
        ("lines.csv", b'id,text\na,"open\n', "manifest-damaged"),
        ("lines.csv", b"id,text\na\0,b\n", "manifest-damaged"),
        ("lines.xlsx", b"PK\x03\x04 no zip", "manifest-damaged"),
        ("lines.xlsx", b"", "manifest-damaged"),
        ("lines.json", b"[]", "document-unreadable"),
        ("lines.json", b'{"schema": "animeme.rig/2"}', "document-kind"),
        ("list.wsources", b"<x/>", "manifest-damaged"),
        ("list.wsources", b'<!DOCTYPE x [<!ENTITY a "b">]><x>&a;</x>', "manifest-damaged"),
    ],
)
def test_a_broken_list_is_refused(name: str, data: bytes, code: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        gathered(tmp_path, data, name)
    assert caught.value.code == code
    assert str(tmp_path / name) in caught.value.place
