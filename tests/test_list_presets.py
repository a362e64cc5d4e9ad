"""Lists that other programs write, and names that bear their language."""

from __future__ import annotations

from pathlib import Path

import pytest

from animeme.errors import InputError
from animeme.gathering import DialogueSource, gather
from support.lists import codes, folder_of, gathered, spoken

UNREAL = (
    '"SpokenDialogue","VoiceActorDirection","AudioFileName","DialogueAsset","IsRecorded",'
    '"SpeakingVoice","TargetVoices"\r\n'
    '"Hallo, ""Ada"".","leise","A0_1.wav","/Game/D/Hello.Hello","True","Ada","(""Bob"")"\r\n'
    '"Und nun?","","A0_2.wav","/Game/D/Now.Now","False","Ada","(""Bob"")"\r\n'
)


def test_unreals_dialogue_script(tmp_path: Path) -> None:
    folder_of(tmp_path, ["L10N/de/A0_1.wav"])
    found = gathered(tmp_path, UNREAL, "L10N/de/Dialogue.csv", preset="unreal")
    assert spoken(found, tmp_path) == {
        "de/Ada/A0_1": ("L10N/de/A0_1.wav", 'Hallo, "Ada".'),
        "de/Ada/A0_2": ("L10N/de/A0_2.wav", "Und nun?"),
    }
    assert not found.lines[1].audio.exists()


def cryengine(rows: list[list[str]]) -> str:
    """An XML spreadsheet, with a cell left out here and there as Excel does."""
    text = ""
    for row in rows:
        text += "<Row>"
        gap = False
        for index, cell in enumerate(row, 1):
            place = f' ss:Index="{index}"' if gap else ""
            gap = not cell
            if cell:
                text += f'<Cell{place}><Data ss:Type="String">{cell}</Data></Cell>'
        text += "</Row>"
    return (
        '<?xml version="1.0"?><Workbook xmlns="urn:schemas-microsoft-com:office:spreadsheet" '
        'xmlns:ss="urn:schemas-microsoft-com:office:spreadsheet"><Worksheet ss:Name="Sheet1">'
        f"<Table>{text}</Table></Worksheet></Workbook>"
    )


def test_cryengines_recording_list(tmp_path: Path) -> None:
    folder_of(tmp_path, ["german/dialog/ai/hello.wav", "german/dialog/bye.wav"])
    data = cryengine(
        [
            ["PICK UP", "AUDIO_FILENAME", "CHARACTER NAME", "ENGLISH DIALOGUE", "TRANSLATION"],
            ["final", "ai/hello", "Nomad", "Hello.", "Hallo."],
            ["", "bye", "Nomad", "Bye.", ""],
        ]
    )
    found = gathered(
        tmp_path, data, "german/dialog_recording_list.xml", preset="cryengine", root=None
    )
    assert spoken(found, tmp_path) == {
        "de/Nomad/ai/hello": ("german/dialog/ai/hello.wav", "Hallo."),
        "de/Nomad/bye": ("german/dialog/bye.wav", "Bye."),
    }


def test_fmods_keys_say_what_a_file_is_called(tmp_path: Path) -> None:
    folder_of(tmp_path, ["EN/en_welcome.ogg", "EN/sub/bye.ogg", "JP/jp_welcome.ogg"])
    (tmp_path / "EN" / "en_welcome.txt").write_text("Welcome.")
    english = tmp_path / "EN" / "keys.txt"
    english.write_text("welcome, en_welcome.ogg\nbye, sub/bye.ogg\n\nlost, lost.ogg\n")
    japanese = tmp_path / "JP" / "keys.txt"
    japanese.write_text("welcome, jp_welcome.ogg\n")
    found = gather(DialogueSource(None, (english, japanese)))
    assert spoken(found, tmp_path) == {
        "en/bye": ("EN/sub/bye.ogg", None),
        "en/lost": ("EN/lost.ogg", None),
        "en/welcome": ("EN/en_welcome.ogg", None),
        "ja/welcome": ("JP/jp_welcome.ogg", None),
    }
    assert found.lines[2].transcript.is_file()
    assert codes(found.findings) == ["line-language-missing"]


@pytest.mark.parametrize("root", ['Root="Voices"', 'Root="d:\\Project\\Voices"', ""])
def test_wwises_external_sources(root: str, tmp_path: Path) -> None:
    folder_of(tmp_path, ["Voices/English(US)/a.wav", "Voices/German/a.wav", "English(US)/a.wav"])
    data = (
        f'<?xml version="1.0" encoding="UTF-8"?><ExternalSourcesList SchemaVersion="1" {root}>'
        '<Source Path="English(US)\\a.wav" Conversion="Default" Destination="a_en"/>'
        '<Source Path="German\\a.wav" Conversion="Default"/></ExternalSourcesList>'
    )
    found = gathered(tmp_path, data, "list.wsources", root=tmp_path / "Voices")
    assert [line.key for line in found.lines] == ["de/a", "en-US/a"]
    assert found.lines[0].audio.is_file()
    assert found.lines[0].audio.parent.name == "German"


AFFIXED = {
    "prefix": ["EN_line01.wav", "EN_line01.txt", "de-line01.wav", "zh_Hans_line01.wav", "x.wav"],
    "suffix": ["line01_EN.wav", "line01_EN.txt", "line01.de.wav", "line01_zh_Hans.wav", "x.wav"],
}


@pytest.mark.parametrize("where", AFFIXED)
def test_names_may_bear_their_language(where: str, tmp_path: Path) -> None:
    folder_of(tmp_path, [*AFFIXED[where], *(f"ada/act1/{name}" for name in AFFIXED[where][2:3])])
    found = gather(DialogueSource(tmp_path, preset=where), ["ada"])
    assert [line.key for line in found.lines] == [
        "de/ada/act1/line01",
        "de/line01",
        "en/line01",
        "zh-Hans/line01",
    ]
    assert found.lines[2].transcript.name == AFFIXED[where][1]
    (left, *_) = found.findings
    assert (left.code, "1 files have no language" in left.message) == ("language-missing", True)
    told = gather(DialogueSource(tmp_path, preset=where, language="fr"), ["ada"])
    assert "fr/x" in [line.key for line in told.lines]


def test_folders_may_be_named_as_people_name_languages(tmp_path: Path) -> None:
    folder_of(tmp_path, ["English(US)/a.wav", "jp/a.wav", "zh_CN/a.wav"])
    found = gather(DialogueSource(tmp_path))
    assert [line.key for line in found.lines] == ["en-US/a", "ja/a", "zh-CN/a"]
    assert codes(found.findings) == []


def test_two_folders_of_one_language_do_not_hide_each_other(tmp_path: Path) -> None:
    folder_of(tmp_path, ["en/a.wav", "English/a.wav", "English/b.wav"])
    a, b = gather(DialogueSource(tmp_path)).lines
    assert codes(a.findings) == ["line-duplicate"]
    assert codes(b.findings) == []


PO = """msgid ""
msgstr "Content-Type: text/plain; charset=UTF-8\\nLanguage: de_AT\\n"

#: a
msgctxt "Dialogue,a"
msgid "Hello."
msgstr "Grüß dich."

#, fuzzy
msgid "b"
msgstr "Zwei"

msgid "c"
msgstr ""

msgid "nobody"
msgstr "Niemand"

#~ msgid "d"
#~ msgstr "alt"
"""
XLIFF_1 = """<?xml version="1.0"?><xliff version="1.2"
xmlns="urn:oasis:names:tc:xliff:document:1.2"><file original="x" source-language="en"
target-language="de-AT"><body>
<trans-unit id="1" resname="a"><source>Hello.</source><target>Grüß <g id="1">dich</g>.
<ph id="2">&lt;br/&gt;</ph></target></trans-unit>
<group><trans-unit id="b"><source>Two</source><target state="needs-translation">Zwei</target>
</trans-unit></group><trans-unit id="c"><source>Three</source><target/></trans-unit>
<trans-unit id="nobody"><source>No</source><target>Niemand</target></trans-unit>
</body></file></xliff>"""
XLIFF_2 = """<?xml version="1.0"?><xliff version="2.1" srcLang="en" trgLang="de-AT"
xmlns="urn:oasis:names:tc:xliff:document:2.0"><file id="f"><unit id="u1" name="a">
<segment state="final"><source>Hello.</source><target>Grüß <pc id="1">dich</pc><ph id="2"/>.
</target></segment></unit><unit id="b"><segment state="initial"><source>Two</source>
<target>Zwei</target>
</segment></unit><unit id="c"><segment><source>Three</source></segment></unit>
<unit id="nobody"><segment><source>No</source><target>Niemand</target></segment></unit>
</file></xliff>"""


@pytest.mark.parametrize(("name", "data"), [("x.po", PO), ("x.xlf", XLIFF_1), ("x.xliff", XLIFF_2)])
def test_texts_join_by_id(name: str, data: str, tmp_path: Path) -> None:
    folder_of(tmp_path, ["de-AT/act/a.wav", "de-AT/b.wav", "de-AT/c.wav", "de-AT/c.txt"])
    path = tmp_path / name
    path.write_text(data, encoding="utf-8")
    found = gather(DialogueSource(tmp_path, texts=(path,)))
    assert {line.key: line.text for line in found.lines} == {
        "de-AT/act/a": "Grüß dich.",
        "de-AT/b": "Zwei",
        "de-AT/c": None,
    }
    assert codes(found.lines[1].findings) == ["text-unfinished"]
    idle = [finding for finding in found.findings if "in de-AT" in finding.message]
    assert codes(idle) == ["text-without-line"]
    assert "nobody" in idle[0].message


def test_a_sheet_gets_the_languages_of_its_translations(tmp_path: Path) -> None:
    folder_of(tmp_path, ["vo/en/a.wav", "vo/de-AT/a.wav"])
    path = tmp_path / "x.po"
    path.write_text(PO, encoding="utf-8")
    rows = "id,text\na,Hello.\nb,Two\n"
    found = gathered(tmp_path, rows, texts=(path,), root=tmp_path / "vo", language="en")
    assert spoken(found, tmp_path) == {
        "de-AT/a": ("vo/de-AT/a.wav", "Grüß dich."),
        "de-AT/b": ("vo/de-AT/b.wav", "Zwei"),
        "en/a": ("vo/en/a.wav", "Hello."),
        "en/b": ("vo/b.wav", "Two"),
    }


@pytest.mark.parametrize(
    ("name", "data", "code"),
    [
        ("x.po", 'msgid "a"\nmsgstr "b\n', "manifest-damaged"),
        ("x.po", 'msgid "a"\nmsgstr "b"\n', "language-missing"),
        ("xx.po", PO.replace("de_AT", "klingon"), "language-unknown"),
        ("x.xlf", XLIFF_1[:400], "manifest-damaged"),
        ("x.xlf", "<!DOCTYPE xliff [<!ENTITY e SYSTEM 'file:///etc/passwd'>]>" + XLIFF_1[21:],
         "manifest-damaged"),
        ("x.xlf", "<xliff>" * 100, "manifest-damaged"),
        ("x.docx", "?", "texts-unknown"),
    ],
)  # fmt: skip
def test_a_broken_translation_is_refused(name: str, data: str, code: str, tmp_path: Path) -> None:
    folder_of(tmp_path, ["vo/en/a.wav"])
    path = tmp_path / name
    path.write_text(data, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        gather(DialogueSource(tmp_path / "vo", texts=(path,)))
    assert caught.value.code == code
    assert name in caught.value.place
