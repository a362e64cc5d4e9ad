"""From a folder of recordings and a job file to lines and a job."""

from __future__ import annotations

import json
import os
import unicodedata
from collections.abc import Sequence
from pathlib import Path

import pytest

from animeme.curve_options import CurveOptions
from animeme.dialogue import Line, find_lines
from animeme.documents import suggestion
from animeme.errors import JobError, Problem
from animeme.findings import Severity
from animeme.gathering import DialogueSource
from animeme.job import CharacterJob, Job, read_job


def folder_of(root: Path, files: Sequence[str]) -> Path:
    for name in files:
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"x")
    return root


def found(root: Path, files: Sequence[str], characters: Sequence[str] = ()) -> tuple[Line, ...]:
    return find_lines(folder_of(root, files), characters)


# Files in the folder → (language, character, id, recording, transcript) of each line.
LAYOUTS: dict[str, tuple[list[str], list[tuple[str, str, str, str, str]]]] = {
    "nothing": ([], []),
    "one line": (["en/a.wav", "en/a.txt"], [("en", "", "a", "en/a.wav", "en/a.txt")]),
    "a .lab beside it": (["en/a.flac", "en/a.lab"], [("en", "", "a", "en/a.flac", "en/a.lab")]),
    "upper case suffixes": (["en/a.WAV", "en/a.TXT"], [("en", "", "a", "en/a.WAV", "en/a.TXT")]),
    "languages": (
        ["en/a.wav", "en/a.txt", "de-AT/a.wav", "de-AT/a.txt"],
        [
            ("de-AT", "", "a", "de-AT/a.wav", "de-AT/a.txt"),
            ("en", "", "a", "en/a.wav", "en/a.txt"),
        ],
    ),
    "a character's folder": (
        ["en/ada/a.wav", "en/ada/a.txt"],
        [("en", "ada", "a", "en/ada/a.wav", "en/ada/a.txt")],
    ),
    "folders below a character's": (
        ["en/ada/act 1/a.wav", "en/ada/act 1/a.txt"],
        [("en", "ada", "act 1/a", "en/ada/act 1/a.wav", "en/ada/act 1/a.txt")],
    ),
    "a folder of nobody's": (
        ["en/act1/a.ogg", "en/act1/a.txt"],
        [("en", "", "act1/a", "en/act1/a.ogg", "en/act1/a.txt")],
    ),
    "a character's name further down": (
        ["en/act1/ada/a.wav", "en/act1/ada/a.txt"],
        [("en", "", "act1/ada/a", "en/act1/ada/a.wav", "en/act1/ada/a.txt")],
    ),
    "a line called like a character": (
        ["en/ada.wav", "en/ada.txt"],
        [("en", "", "ada", "en/ada.wav", "en/ada.txt")],
    ),
    "a character's name in another case": (
        ["en/Ada/a.wav", "en/Ada/a.txt"],
        [("en", "", "Ada/a", "en/Ada/a.wav", "en/Ada/a.txt")],
    ),
    "dots in a name": (
        ["en/a.v1.wav", "en/a.v1.txt", "en/a.v2.wav", "en/a.v2.txt"],
        [
            ("en", "", "a.v1", "en/a.v1.wav", "en/a.v1.txt"),
            ("en", "", "a.v2", "en/a.v2.wav", "en/a.v2.txt"),
        ],
    ),
    "unicode": (
        ["zh-Hans/第一幕/你好 😀.wav", "zh-Hans/第一幕/你好 😀.txt"],
        [
            (
                "zh-Hans",
                "",
                "第一幕/你好 😀",
                "zh-Hans/第一幕/你好 😀.wav",
                "zh-Hans/第一幕/你好 😀.txt",
            )
        ],
    ),
    "no transcript": (["en/a.wav"], [("en", "", "a", "en/a.wav", "en/a.txt")]),
    "no recording": (["en/a.txt"], [("en", "", "a", "en/a.wav", "en/a.txt")]),
    "no recording, dots": (["en/a.v1.lab"], [("en", "", "a.v1", "en/a.v1.wav", "en/a.v1.lab")]),
    "hidden files and folders": (
        [".git/a.wav", "en/.a.wav", "en/._a.txt", "en/.cache/a.wav", "en/b.wav", "en/b.txt"],
        [("en", "", "b", "en/b.wav", "en/b.txt")],
    ),
    "other files": (
        ["en/a.wav", "en/a.txt", "en/a.json", "en/README.md", "en/Thumbs.db", "lines.csv", "en/x"],
        [("en", "", "a", "en/a.wav", "en/a.txt")],
    ),
    "a folder with a recording's name": (
        ["en/x.wav/a.wav", "en/x.wav/a.txt"],
        [("en", "", "x.wav/a", "en/x.wav/a.wav", "en/x.wav/a.txt")],
    ),
    "the same id of a character and of everybody": (
        ["en/a.wav", "en/a.txt", "en/ada/a.wav", "en/ada/a.txt"],
        [
            ("en", "", "a", "en/a.wav", "en/a.txt"),
            ("en", "ada", "a", "en/ada/a.wav", "en/ada/a.txt"),
        ],
    ),
}


@pytest.mark.parametrize("case", LAYOUTS)
def test_folders_become_lines(case: str, tmp_path: Path) -> None:
    files, expected = LAYOUTS[case]
    lines = found(tmp_path, files, ["ada", "bob"])
    assert [
        (
            line.language,
            line.character,
            line.id,
            line.audio.relative_to(tmp_path).as_posix(),
            line.transcript.relative_to(tmp_path).as_posix(),
        )
        for line in lines
    ] == expected
    assert all(line.findings == () for line in lines)
    assert len({line.key for line in lines}) == len(lines)


def test_lines_are_sorted_and_do_not_depend_on_the_order_of_creation(tmp_path: Path) -> None:
    files = [f"{tag}/{name}{s}" for tag in ("es", "en") for name in ["c10", "a", "B", "b/1"]
             for s in (".wav", ".txt")]  # fmt: skip
    there = found(tmp_path / "one", files, ["b"])
    back = found(tmp_path / "two", files[::-1], ["b"])
    keys = [line.key for line in there]
    assert keys == sorted(keys)
    assert keys == [line.key for line in back]
    assert find_lines(tmp_path / "one", ["b"]) == there


@pytest.mark.parametrize(
    ("files", "message"),
    [
        (["en/a.wav", "en/a.flac", "en/a.txt"], "has 2 recordings: a.flac, a.wav"),
        (["en/a.wav", "en/a.txt", "en/a.lab"], "has 2 transcripts: a.lab, a.txt"),
        (["en/a.wav", "en/a.WAV", "en/a.txt"], "has 2 recordings: a.WAV, a.wav"),
    ],
)
def test_what_is_there_twice_is_an_error_of_that_line(
    files: list[str], message: str, tmp_path: Path
) -> None:
    (line,) = found(tmp_path, files)
    (finding,) = line.findings
    assert finding.severity == Severity.ERROR
    assert finding.code == "line-duplicate"
    assert finding.message == message
    assert finding.action


def test_both_may_be_there_twice(tmp_path: Path) -> None:
    (line,) = found(tmp_path, ["en/a.wav", "en/a.flac", "en/a.txt", "en/a.lab"])
    assert len(line.findings) == 2


def test_a_name_that_a_mac_decomposed_is_the_same_name(tmp_path: Path) -> None:
    composed, apart = "é", unicodedata.normalize("NFD", "é")
    (line,) = found(tmp_path, [f"en/{composed}.wav", f"en/{apart}.txt"])
    assert line.audio.is_file()
    assert line.transcript.is_file()


def test_a_character_that_a_mac_decomposed_is_the_same_character(tmp_path: Path) -> None:
    apart = unicodedata.normalize("NFD", "zoé")
    (line,) = found(tmp_path, [f"en/{apart}/a.wav", f"en/{apart}/a.txt"], ["zoé"])
    assert line.character == "zoé"


@pytest.mark.skipif(os.name == "nt", reason="needs the right to make links")
def test_links_to_files_count_and_broken_ones_do_not(tmp_path: Path) -> None:
    real = folder_of(tmp_path / "elsewhere", ["a.wav"]) / "a.wav"
    root = folder_of(tmp_path / "root", ["en/a.txt"])
    (root / "en" / "a.wav").symlink_to(real)
    (root / "en" / "b.wav").symlink_to(tmp_path / "nowhere.wav")
    assert [line.key for line in find_lines(root, [])] == ["en/a"]


# Jobs

MINIMAL = """
[job]
name = "sample"
[dialogue]
root = "dialogue"
[characters.ada]
asset = "ada.glb"
"""


def job_file(folder: Path, text: str = MINIMAL, files: Sequence[str] = ()) -> Path:
    folder_of(folder, ["dialogue/en/a.wav", "ada.glb", *files])
    path = folder / "job.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_minimal_job_gets_every_default(tmp_path: Path) -> None:
    path = job_file(tmp_path)
    assert read_job(path) == Job(
        name="sample",
        source=path,
        output=tmp_path / "out",
        cache=None,
        dialogue=DialogueSource(tmp_path / "dialogue"),
        speak=False,
        aligner="pocketsphinx",
        lexicon=None,
        voices=None,
        model="dam",
        model_file=None,
        curves=CurveOptions(rate_hz=60.0, max_error=0.002),
        characters=(CharacterJob("ada", (tmp_path / "ada.glb",), "auto", "per-character"),),
    )


def test_every_setting_of_a_full_job_counts(tmp_path: Path) -> None:
    text = """
    schema = "animeme.job/1"
    [job]
    name = "voll 😀"
    output = "build/out"
    [dialogue]
    root = "./dialogue"
    [align]
    aligner = "pocketsphinx"
    [model]
    name = "cohen-massaro"
    [curves]
    rate_hz = 30
    max_error = 0
    [characters.zoe]
    asset = ["ada.glb", "zoe.usda"]
    rig = "arkit"
    layout = "per-line"
    [characters."Ada Löve"]
    asset = "ada.glb"
    """
    job = read_job(job_file(tmp_path, text, ["zoe.usda"]))
    assert job.name == "voll 😀"
    assert job.output == tmp_path / "build" / "out"
    assert (job.curves.rate_hz, job.curves.max_error) == (30.0, 0.0)
    assert job.characters == (
        CharacterJob("zoe", (tmp_path / "ada.glb", tmp_path / "zoe.usda"), "arkit", "per-line"),
        CharacterJob("Ada Löve", (tmp_path / "ada.glb",), "auto", "per-character"),
    )
    assert job.folder == tmp_path


def test_the_caller_may_choose_the_output(tmp_path: Path) -> None:
    assert read_job(job_file(tmp_path), output=tmp_path / "x").output == tmp_path / "x"


def test_absolute_paths_stay(tmp_path: Path) -> None:
    elsewhere = folder_of(tmp_path / "else", ["en/a.wav"])
    text = MINIMAL.replace('"dialogue"', json.dumps(str(elsewhere)))
    assert read_job(job_file(tmp_path / "job", text)).dialogue.root == elsewhere


def test_paths_are_relative_to_the_job_and_not_to_the_caller(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    job_file(tmp_path / "job")
    monkeypatch.chdir(tmp_path)
    job = read_job(Path("job/job.toml"))
    assert job.dialogue.root == Path("job/dialogue")
    assert job.characters[0].assets == (Path("job/ada.glb"),)


def test_a_byte_order_mark_does_not_matter(tmp_path: Path) -> None:
    path = job_file(tmp_path)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert read_job(path).name == "sample"


def problems_of(folder: Path, text: str) -> dict[str, Problem]:
    with pytest.raises(JobError) as caught:
        read_job(job_file(folder, text))
    return {problem.path: problem for problem in caught.value.problems}


PROBLEMS: dict[str, tuple[str, str, str, str]] = {
    "misspelt section": ("[job]", "[jobb]", "jobb", "Did you mean 'job'?"),
    "misspelt member": ('root = "', 'rot = "', "dialogue.rot", "Did you mean 'root'?"),
    "misspelt member of a character": (
        "asset = ",
        'rigg = "auto"\nasset = ',
        "characters.ada.rigg",
        "Did you mean 'rig'?",
    ),
    "far off": (
        'root = "',
        'xyzzy = 1\nroot = "',
        "dialogue.xyzzy",
        "Known: columns, language, manifest, preset, root, ",
    ),
    "no folder": ('"dialogue"', '"dialog"', "dialogue.root", "Paths start at the job file."),
    "no asset": ('"ada.glb"', '"eva.glb"', "characters.ada.asset", "Paths start at the job file."),
    "no list": (
        'root = "',
        'manifest = "lines.csv"\nroot = "',
        "dialogue.manifest",
        "Paths start at the job file.",
    ),
    "unknown language": (
        'root = "',
        'language = "Germn"\nroot = "',
        "dialogue.language",
        "Did you mean 'German' (de)?",
    ),
    "misspelt column": (
        'root = "',
        'columns = {txt = "a"}\nroot = "',
        "dialogue.columns.txt",
        "Did you mean 'text'?",
    ),
    "unknown format": (
        '"ada.glb"',
        '"ada.fbx"',
        "characters.ada.asset",
        "Deliver the character as one of .glb, .gltf, ",
    ),
    "unknown rig": (
        "asset = ",
        'rig = "ARKti"\nasset = ',
        "characters.ada.rig",
        "Did you mean 'arkit'?",
    ),
    "unknown model": (
        "[job]",
        '[model]\nname = "cohen_massaro"\n[job]',
        "model.name",
        "Did you mean 'cohen-massaro'?",
    ),
    "unknown aligner": (
        "[job]",
        '[align]\naligner = "pocketsfinx"\n[job]',
        "align.aligner",
        "Did you mean 'pocketsphinx'?",
    ),
    "two files that would become one": (
        '"ada.glb"',
        '["ada.glb", "sub/ada.glb"]',
        "characters.ada.asset",
        "Make them two characters.",
    ),
}


@pytest.mark.parametrize("case", PROBLEMS)
def test_a_problem_has_its_place_and_what_to_do(case: str, tmp_path: Path) -> None:
    old, new, place, action = PROBLEMS[case]
    folder_of(tmp_path, ["sub/ada.glb", "ada.fbx"])
    problems = problems_of(tmp_path, MINIMAL.replace(old, new, 1))
    assert action in problems[place].action


@pytest.mark.parametrize(
    ("old", "new", "place", "message"),
    [
        ('name = "sample"', 'name = ""', "job.name", "at least 1 character"),
        ('name = "sample"', "name = 5", "job.name", "valid string (it is 5)"),
        ("[job]", "[curves]\nrate_hz = 0\n[job]", "curves.rate_hz", "greater than 0"),
        ("[job]", "[curves]\nrate_hz = inf\n[job]", "curves.rate_hz", "finite"),
        ("[job]", '[curves]\nrate_hz = "60"\n[job]', "curves.rate_hz", "number"),
        ("[job]", "[curves]\nrate_hz = nan\n[job]", "curves.rate_hz", ""),
        ("[job]", "[curves]\nmax_error = -1\n[job]", "curves.max_error", "greater than or equal"),
        ('asset = "ada.glb"', "asset = []", "characters.ada.asset", "at least 1 item"),
        ('asset = "ada.glb"', "", "characters.ada.asset", "missing"),
        ("[characters.ada]", '[characters."a/b"]', "characters.a/b", "cannot be a file's name"),
        ("[characters.ada]", '[characters.""]', "characters.", "cannot be a file's name"),
        ("[characters.ada]", '[characters.".."]', "characters...", "cannot be a file's name"),
        ("[characters.ada]", '[characters."a\\u0000b"]', "characters.a\0b", "cannot be a file"),
        ("[characters.ada]", '[characters."a\\nb"]', "characters.a\nb", "cannot be a file's name"),
    ],
)
def test_a_wrong_value_is_named(
    old: str, new: str, place: str, message: str, tmp_path: Path
) -> None:
    problems = problems_of(tmp_path, MINIMAL.replace(old, new, 1))
    assert message in problems[place].message


def test_all_problems_come_at_once_sorted_by_place(tmp_path: Path) -> None:
    text = '[jobb]\n[dialogue]\nroot = "none"\n[curves]\nrate_hz = "x"\n[characters.a]\nrig = "no"'
    problems = problems_of(tmp_path, text)
    assert list(problems) == sorted(problems)
    assert {
        "job",
        "jobb",
        "dialogue.root",
        "curves.rate_hz",
        "characters.a.asset",
        "characters.a.rig",
    } <= set(problems)


@pytest.mark.parametrize(
    "data", [b"[job", b"\xff\xfe[job]", b"a = 1\na = 2", b"a = " + b"[" * 5000]
)
def test_what_is_no_toml_is_one_problem(data: bytes, tmp_path: Path) -> None:
    path = tmp_path / "job.toml"
    path.write_bytes(data)
    with pytest.raises(JobError, match="not readable TOML"):
        read_job(path)


def test_a_missing_job_says_so(tmp_path: Path) -> None:
    with pytest.raises(JobError, match="there is no such job file"):
        read_job(tmp_path / "job.toml")
    with pytest.raises(JobError):
        read_job(tmp_path)


@pytest.mark.parametrize(
    ("name", "known", "advice"),
    [
        ("rootz", ["root", "manifest"], "Did you mean 'root'?"),
        ("ROOT", ["root"], "Did you mean 'root'?"),
        ("Arkit", ["arkit", "vrm"], "Did you mean 'arkit'?"),
        ("x", ["b", "a"], "Known: a, b."),
        ("x", [], "Known: none."),
        ("", ["a"], "Known: a."),
    ],
)
def test_advice_is_the_nearest_name_or_all_of_them(
    name: str, known: list[str], advice: str
) -> None:
    assert suggestion(name, known) == advice
