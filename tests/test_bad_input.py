"""Bad input, from outside: break one thing, read what people are told, mend it, see it work."""

from __future__ import annotations

import json
import os
import pickle
import shutil
import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
from pxr import Sdf, Usd, UsdGeom

from animeme import load_model
from support.jobs import SAMPLE, Ran, SmallJob, animeme, run_inline, small_job

GOOD, BAD = "en/boat", "en/five"
RATE_HZ = 16_000
Capture = pytest.CaptureFixture[str]


@pytest.fixture
def job(tmp_path: Path) -> SmallJob:
    """A crab with a line that stays sound and one to be broken."""
    return small_job(tmp_path / "job", GOOD, BAD)


def expect_success(job: SmallJob, ran: Ran) -> None:
    assert ran.code == 0, ran.err
    assert set(job.statuses().values()) == {"ok"}


def expect_refused(job: SmallJob, ran: Ran, *words: str) -> None:
    """Nothing could be done, nothing was written, and the message says all of `words`."""
    ran.says(*words)
    assert ran.code == 2
    assert ran.out == ""
    assert not job.output.exists()


# --- one bad line -------------------------------------------------------------------------------


@dataclass(frozen=True)
class BadLine:
    """One way to break a line, and what must be said about it.

    Attributes:
        id: of the case.
        spoil: does it, given the line's recording.
        code: of the finding.
        words: what, where and what to do, in the message.
    """

    id: str
    spoil: Callable[[Path], object]
    code: str
    words: tuple[str, ...]


def _text(content: bytes) -> Callable[[Path], object]:
    return lambda audio: audio.with_suffix(".txt").write_bytes(content)


def _bytes(content: bytes) -> Callable[[Path], object]:
    return lambda audio: audio.write_bytes(content)


def _cut(share: float) -> Callable[[Path], object]:
    def cut(audio: Path) -> None:
        data = audio.read_bytes()
        audio.write_bytes(data[: int(len(data) * share)])

    return cut


def _samples(count: int, level: float) -> Callable[[Path], object]:
    return lambda audio: soundfile.write(audio, np.full(count, level, np.float32), RATE_HZ, "FLOAT")


def _cut_flac(audio: Path) -> None:
    samples, rate_hz = soundfile.read(audio)
    flac = audio.with_suffix(".flac")
    soundfile.write(flac, samples, rate_hz)
    audio.unlink()
    _cut(0.5)(flac)


def _second_recording(audio: Path) -> None:
    samples, rate_hz = soundfile.read(audio)
    soundfile.write(audio.with_suffix(".flac"), samples, rate_hz)


def _second_transcript(audio: Path) -> None:
    shutil.copy(audio.with_suffix(".txt"), audio.with_suffix(".lab"))


BAD_LINES = (
    BadLine(
        "no-transcript",
        lambda audio: audio.with_suffix(".txt").unlink(),
        "transcript-missing",
        ("has no transcript", "five.txt", "Write what is said"),
    ),
    BadLine(
        "no-recording", Path.unlink, "audio-missing", ("no such recording", "five.wav", "Deliver")
    ),
    BadLine("empty-text", _text(b""), "transcript-empty", ("empty", "five.txt", "Write what")),
    BadLine("blank-text", _text(b" \r\n\t"), "transcript-empty", ("empty", "five.txt")),
    BadLine("bom-only", _text(b"\xef\xbb\xbf"), "transcript-empty", ("empty", "five.txt")),
    BadLine(
        "punctuation", _text("… — ?! «»".encode()), "transcript-empty", ("no word", "Write what")
    ),
    BadLine("tags", _text(b"<sigh> [laughs]"), "transcript-empty", ("no word", "Write what")),
    BadLine(
        "latin-1",
        _text("Fünf große Bäume".encode("latin-1")),
        "transcript-unreadable",
        ("not UTF-8", "byte 1", "five.txt", "Save it as UTF-8"),
    ),
    BadLine(
        "binary-text", _text(bytes(range(256))), "transcript-unreadable", ("five.txt", "UTF-8")
    ),
    BadLine("zero-bytes", _bytes(b""), "audio-empty", ("no samples", "five.wav", "Export")),
    BadLine(
        "header-only", lambda a: _bytes(_header(a))(a), "audio-empty", ("no samples", "Export")
    ),
    BadLine("cut-header", _bytes(b"RIFF\x00\x00"), "audio-unreadable", ("five.wav", "Export")),
    BadLine("cut-half", _cut(0.5), "audio-truncated", ("cut off", "five.wav", "Copy or export")),
    BadLine("cut-last-byte", _cut(0.9999), "audio-truncated", ("cut off", "five.wav")),
    BadLine("cut-flac", _cut_flac, "audio-", ("five.flac", "xport")),
    BadLine("silent", _samples(RATE_HZ, 0.0), "audio-silent", ("silent", "five.wav", "level")),
    BadLine("too-short", _samples(RATE_HZ // 20, 0.5), "audio-too-short", ("50 ms", "five.wav")),
    BadLine("one-sample", _samples(1, 0.5), "audio-too-short", ("0 ms", "five.wav", "export")),
    BadLine("not-numbers", _samples(RATE_HZ, np.nan), "audio-unreadable", ("not numbers",)),
    BadLine(
        "text-as-wav",
        _bytes(b"Five little fishes, and not a sound.\n"),
        "audio-unreadable",
        ("cannot be decoded", "five.wav", "WAV or FLAC"),
    ),
    BadLine(
        "two-recordings",
        _second_recording,
        "line-duplicate",
        ("2 recordings", "five.flac", "five.wav", "Keep one"),
    ),
    BadLine(
        "two-transcripts",
        _second_transcript,
        "line-duplicate",
        ("2 transcripts", "five.lab", "five.txt", "Keep one"),
    ),
    BadLine(
        "book-for-a-line",
        _text(b"one two three four five six seven eight nine ten " * 9),
        "transcript-too-long",
        ("cannot be spoken", "five.wav", "longer recording"),
    ),
)


def _header(audio: Path) -> bytes:
    """A WAV header that promises no samples."""
    fmt = struct.pack("<HHIIHH", 1, 1, RATE_HZ, 2 * RATE_HZ, 2, 16)
    body = b"WAVEfmt " + struct.pack("<I", len(fmt)) + fmt + b"data" + struct.pack("<I", 0)
    return b"RIFF" + struct.pack("<I", len(body)) + body


@pytest.mark.parametrize("case", BAD_LINES, ids=lambda case: case.id)
def test_a_bad_line_fails_alone_and_works_once_mended(
    case: BadLine, job: SmallJob, capsys: Capture
) -> None:
    case.spoil(job.dialogue / f"{BAD}.wav")
    ran = run_inline(capsys, job)
    ran.says(BAD, case.code, *case.words)
    assert ran.code == 1
    assert job.statuses() == {GOOD: "ok", BAD: "failed"}
    (finding,) = job.findings(BAD)
    assert finding["code"].startswith(case.code)
    assert finding["action"]
    assert not finding["ours"]
    assert job.animations() == {"boat"}
    assert not (job.output / "alignments" / f"{BAD}.json").exists()

    for file in job.dialogue.glob(f"{BAD}.*"):
        file.unlink()
    job.line(BAD, like=BAD)
    expect_success(job, run_inline(capsys, job))
    assert job.animations() == {"boat", "five"}


def test_a_folder_of_an_unknown_language_fails_its_lines_and_no_others(
    job: SmallJob, capsys: Capture
) -> None:
    job.line("klingon/boat")
    ran = run_inline(capsys, job)
    ran.says("klingon/boat", "'klingon' is not a language", "Known languages: ar, cs, de")
    assert ran.code == 1
    assert job.statuses() == {GOOD: "ok", BAD: "ok", "klingon/boat": "failed"}
    assert not (job.output / "klingon").exists()

    (job.dialogue / "klingon").rename(job.dialogue / "en-GB")
    expect_success(job, run_inline(capsys, job))


def test_a_file_name_that_is_no_unicode_fails_at_most_its_own_line(
    job: SmallJob, capsys: Capture
) -> None:
    for suffix in (b".wav", b".txt"):
        name = os.fsencode(job.dialogue / BAD)
        os.rename(name + suffix, name.replace(b"five", b"f\xfcnf") + suffix)
    ran = run_inline(capsys, job)
    ran.says()
    assert ran.code in (0, 1)
    assert job.statuses()[GOOD] == "ok"
    assert "boat" in job.animations()


def test_a_name_too_long_for_our_files_fails_at_most_its_own_line(
    job: SmallJob, capsys: Capture
) -> None:
    """A recording's name may take all of a file system's 255 bytes; ours are made from it."""
    longest = "en/" + 83 * "あ"
    job.line(longest)
    ran = run_inline(capsys, job)
    ran.says()
    assert ran.code in (0, 1)
    assert job.statuses()[GOOD] == "ok"
    assert not any(finding["ours"] for finding in job.findings(longest))


def test_names_that_look_like_markup_are_shown_as_they_are(job: SmallJob, capsys: Capture) -> None:
    job.line("en/[red] take [/2]").write_bytes(b"")
    ran = run_inline(capsys, job)
    ran.says("en/[red] take [/2]", "[red] take [/2].wav", "audio-empty")
    assert ran.code == 1


def test_a_line_of_all_and_one_of_a_character_may_share_their_name(
    job: SmallJob, capsys: Capture
) -> None:
    """The character's own recording takes the place of the one for all."""
    job.line("en/crab/boat", like="en/moon")
    ran = run_inline(capsys, job)
    ran.says()
    assert ran.code == 0
    assert job.statuses() == {BAD: "ok", "en/crab/boat": "ok"}
    assert job.animations() == {"boat", "five"}


# --- assets -------------------------------------------------------------------------------------


def _cut_at(name: str, *, at: int | float) -> Callable[[Path], object]:
    """Write the first `at` bytes (or that share) of one of the sample's assets."""

    def write(path: Path) -> None:
        data = (SAMPLE / name).read_bytes()
        path.write_bytes(data[: at if isinstance(at, int) else int(at * len(data))])

    return write


def _honest_cut(path: Path) -> None:
    """A GLB that is cut off, with a header that says so."""
    data = (SAMPLE / "crab.glb").read_bytes()[:200_000]
    path.write_bytes(data[:8] + struct.pack("<I", len(data)) + data[12:])


def _glb(root: object) -> Callable[[Path], object]:
    text = root.encode() if isinstance(root, str) else json.dumps(root).encode()
    text += b" " * (-len(text) % 4)
    chunk = struct.pack("<II", len(text), 0x4E4F534A) + text
    return lambda path: path.write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(chunk)) + chunk)


def _plain_usd(path: Path) -> None:
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.Mesh.Define(stage, "/face")
    stage.GetRootLayer().Save()


PLAIN_MESH: dict[str, Any] = {"primitives": [{"attributes": {}}]}
BAD_ASSETS = (
    *(
        pytest.param("cut.glb", _cut_at("crab.glb", at=at), "", id=f"glb-cut-at-{at}")
        for at in (0, 1, 4, 11, 12, 19, 20, 88, 0.25, 0.5, 0.9999)
    ),
    *(
        pytest.param("cut.usdc", _cut_at("crab.usdc", at=at), "", id=f"usd-cut-at-{at}")
        for at in (0, 1, 8, 88, 0.25, 0.5, 0.9999)
    ),
    pytest.param("honest.glb", _honest_cut, "leaves the file", id="glb-cut-header-agrees"),
    pytest.param("text.glb", _glb("{ not JSON"), "holds no JSON", id="glb-no-json"),
    pytest.param("list.glb", _glb([1, 2]), "not an object", id="glb-json-list"),
    pytest.param("one.glb", _glb({"asset": {"version": "1.0"}}), "only 2.x", id="glb-version-1"),
    pytest.param(
        "plain.glb",
        _glb({"asset": {"version": "2.0"}, "nodes": [{"mesh": 0}], "meshes": [PLAIN_MESH]}),
        "no mesh with morph targets",
        id="glb-no-targets",
    ),
    pytest.param(
        "broken.glb",
        _glb({"asset": {"version": "2.0"}, "nodes": [{"mesh": 7}], "meshes": [PLAIN_MESH]}),
        "points at no mesh",
        id="glb-no-such-mesh",
    ),
    pytest.param(
        "empty.glb",
        _glb({"asset": {"version": "2.0"}}),
        "no mesh with morph targets",
        id="glb-empty",
    ),
    pytest.param("plain.usda", _plain_usd, "no mesh has blendshapes", id="usd-no-blendshapes"),
    pytest.param(
        "text.usda",
        lambda path: path.write_text("#usda 1.0\ndef Mesh {"),
        "cannot be read as USD",
        id="usd-syntax",
    ),
    pytest.param(
        "image.usdc",
        lambda path: path.write_bytes(b"\x89PNG\r\n\x1a\n" * 99),
        "cannot be read as USD",
        id="usd-is-png",
    ),
)


@pytest.mark.parametrize(("name", "write", "word"), BAD_ASSETS)
def test_a_job_whose_every_asset_is_damaged_is_refused(
    name: str, write: Callable[[Path], object], word: str, job: SmallJob, capsys: Capture
) -> None:
    write(job.folder / name)
    job.sections["characters.crab"]["asset"] = name
    ran = run_inline(capsys, job)
    expect_refused(job, ran, "characters.crab", name, word, "xport")


def test_a_damaged_asset_mended_works(job: SmallJob, capsys: Capture) -> None:
    _cut_at("crab.glb", at=0.5)(job.folder / "crab.glb")
    expect_refused(job, run_inline(capsys, job), "crab.glb")
    job.asset("crab.glb")
    expect_success(job, run_inline(capsys, job))


def test_every_damaged_asset_of_a_job_is_named(job: SmallJob, capsys: Capture) -> None:
    for name in ("one", "two"):
        (job.folder / f"{name}.glb").write_bytes(b"glTF")
        job.sections[f"characters.{name}"] = {"asset": f"{name}.glb"}
    del job.sections["characters.crab"]
    expect_refused(job, run_inline(capsys, job), "2 problems", "one.glb", "two.glb", "Export")


def test_a_damaged_asset_costs_only_its_own_character(job: SmallJob, capsys: Capture) -> None:
    job.sections["characters.twin"] = {"asset": "twin.glb", "rig": "crab.rig.toml"}
    _cut_at("crab.glb", at=0.5)(job.folder / "twin.glb")
    ran = run_inline(capsys, job)
    ran.says("twin.glb", "asset-unreadable", "Export or copy the asset again")
    assert ran.code == 1
    assert job.statuses("crab") == {GOOD: "ok", BAD: "ok"}
    assert job.statuses("twin") == {GOOD: "failed", BAD: "failed"}
    assert job.report()["outputs"] == ["en/crab.glb"]
    assert not (job.output / "en" / "twin.glb").exists()

    shutil.copy(job.folder / "crab.glb", job.folder / "twin.glb")
    expect_success(job, run_inline(capsys, job))
    assert job.animations("en/twin.glb") == {"boat", "five"}


def test_a_character_with_one_damaged_asset_of_two_delivers_neither(
    job: SmallJob, capsys: Capture
) -> None:
    job.sections["characters.twin"] = {
        "asset": ["twin.glb", "twin.usdc"],
        "rig": "crab.rig.toml",
    }
    shutil.copy(job.folder / "crab.glb", job.folder / "twin.glb")
    _cut_at("crab.usdc", at=0.5)(job.folder / "twin.usdc")
    ran = run_inline(capsys, job)
    ran.says("twin.usdc", "asset-unreadable")
    assert ran.code == 1
    assert job.report()["outputs"] == ["en/crab.glb"]
    assert set(job.statuses("twin").values()) == {"failed"}


# --- the job file -------------------------------------------------------------------------------


@dataclass(frozen=True)
class BadJob:
    """One mistake in a job file: table and key to set, and what must be said."""

    id: str
    table: str
    key: str
    value: Any
    words: tuple[str, ...]


BAD_JOBS = (
    BadJob("model", "model", "name", "cohen-masaro", ("model.name", "mean 'cohen-massaro'?")),
    BadJob("model-far", "model", "name", "zzz", ("model.name", "Known: bigram, cohen-massaro")),
    BadJob("aligner", "align", "aligner", "pocketsfinx", ("align.aligner", "mean 'pocketsphinx'?")),
    BadJob("rig", "characters.crab", "rig", "arkti", ("characters.crab.rig", "mean 'arkit'?")),
    BadJob(
        "rig-file",
        "characters.crab",
        "rig",
        "crab.rgi.toml",
        ("characters.crab.rig", "no such file", "crab.rgi.toml"),
    ),
    BadJob("key", "curves", "rate_hs", 60, ("curves.rate_hs", "mean 'rate_hz'?")),
    BadJob("section", "curve", "rate_hz", 60, ("curve: unknown key", "mean 'curves'?")),
    BadJob(
        "character-key",
        "characters.crab",
        "layuot",
        "per-line",
        ("characters.crab.layuot", "mean 'layout'?"),
    ),
    BadJob("job-key", "job", "nmae", "x", ("job.nmae", "mean 'name'?")),
    BadJob("word-for-number", "curves", "rate_hz", "fast", ("curves.rate_hz", "'fast'", "number")),
    BadJob("zero-rate", "curves", "rate_hz", 0, ("curves.rate_hz", "greater than 0")),
    BadJob("huge-error", "curves", "max_error", 2.0, ("curves.max_error", "0.5", "2.0")),
    BadJob("name-empty", "job", "name", "", ("job.name", "at least 1")),
    BadJob("output-list", "job", "output", ["out"], ("job.output", "string")),
    BadJob(
        "layout",
        "characters.crab",
        "layout",
        "per-scene",
        ("characters.crab.layout", "per-line", "'per-scene'"),
    ),
    BadJob("no-root", "dialogue", "root", "dialog", ("dialogue.root", "no folder 'dialog'")),
    BadJob(
        "no-asset",
        "characters.crab",
        "asset",
        "carb.glb",
        ("characters.crab.asset", "no file 'carb.glb'", "start at the job file"),
    ),
    BadJob("asset-none", "characters.crab", "asset", [], ("characters.crab.asset", "at least 1")),
    BadJob("asset-number", "characters.crab", "asset", 3, ("characters.crab.asset",)),
    BadJob(
        "asset-format",
        "characters.crab",
        "asset",
        "crab.fbx",
        ("characters.crab.asset", "no format takes '.fbx'", ".glb", ".usdc"),
    ),
    BadJob(
        "asset-folder",
        "characters.crab",
        "asset",
        "folder.glb",
        ("characters.crab.asset", "folder.glb"),
    ),
    BadJob(
        "assets-clash",
        "characters.crab",
        "asset",
        ["crab.glb", "dialogue/../crab.glb"],
        ("characters.crab.asset", "one file", "two characters"),
    ),
    BadJob(
        "path-as-name", "characters.a/b", "asset", "crab.glb", ("characters.a/b", "file's name")
    ),
    BadJob("no-model-file", "model", "file", "m.json", ("model.file", "m.json", "no such file")),
)


@pytest.mark.parametrize("case", BAD_JOBS, ids=lambda case: case.id)
def test_a_mistake_in_the_job_file_is_named_by_its_path(
    case: BadJob, job: SmallJob, capsys: Capture
) -> None:
    (job.folder / "folder.glb").mkdir()
    sound = {table: dict(keys) for table, keys in job.sections.items()}
    job.sections.setdefault(case.table, {})[case.key] = case.value
    ran = run_inline(capsys, job)
    expect_refused(job, ran, str(job.file), "1 problem\n", *case.words)

    job.sections = sound
    expect_success(job, run_inline(capsys, job))


@pytest.mark.parametrize("table", ["job", "dialogue", "characters.crab"])
def test_a_missing_section_is_named(table: str, job: SmallJob, capsys: Capture) -> None:
    del job.sections[table]
    expect_refused(job, run_inline(capsys, job), f"{table.split('.')[0]}: missing")


def test_everything_wrong_with_a_job_is_said_at_once(job: SmallJob, capsys: Capture) -> None:
    (job.folder / "model.json").write_text("{")
    (job.folder / "broken.rig.toml").write_text('schema = "animeme.rig/9"\n')
    job.sections = {
        "job": {"nam": "small"},
        "dialogue": {"root": "nowhere"},
        "align": {"aligner": "pocketsfinx"},
        "model": {"name": "cohen", "file": "model.json"},
        "curves": {"rate_hz": -1, "max_error": "tiny", "smooth": True},
        "characters.crab": {"asset": "no.glb", "rig": "broken.rig.toml", "layout": "per-scene"},
        "characters.ada": {"rig": "arkti", "lyaout": "per-line"},
        "characters.bob": {"asset": "bob.fbx"},
        "extras": {"anything": 1},
    }
    paths = (
        "job.name",
        "job.nam",
        "dialogue.root",
        "align.aligner",
        "model.name",
        "model.file",
        "curves.rate_hz",
        "curves.max_error",
        "curves.smooth",
        "characters.crab.asset",
        "characters.crab.rig",
        "characters.crab.layout",
        "characters.ada.asset",
        "characters.ada.rig",
        "characters.ada.lyaout",
        "characters.bob.asset",
        "extras",
    )
    ran = run_inline(capsys, job)
    expect_refused(job, ran, f"{len(paths)} problems", *(f"\n  {path}: " for path in paths))


def test_every_missing_asset_of_a_character_is_named(job: SmallJob, capsys: Capture) -> None:
    job.sections["characters.crab"]["asset"] = ["no.glb", "nor.usdc"]
    expect_refused(job, run_inline(capsys, job), "'no.glb'", "'nor.usdc'")


@pytest.mark.parametrize(
    ("content", "word"),
    [
        pytest.param(b"[job\nname = 1", "line 1", id="syntax"),
        pytest.param(b"[job]\nname = 'a'\nname = 'b'\n", "line 3", id="key-twice"),
        pytest.param("[job]\nname = 'größe'".encode("latin-1"), "utf-8", id="latin-1"),
        pytest.param(b"\x89PNG\r\n\x1a\n", "utf-8", id="png"),
    ],
)
def test_a_file_that_is_no_toml_is_refused(
    content: bytes, word: str, tmp_path: Path, capsys: Capture
) -> None:
    (tmp_path / "job.toml").write_bytes(content)
    ran = animeme(capsys, "run", tmp_path / "job.toml")
    ran.says("job.toml", "not readable TOML", word)
    assert ran.code == 2


@pytest.mark.parametrize("content", [b"", b"# nothing\n", b"job = 3\n"])
def test_a_job_without_anything_in_it_is_refused(
    content: bytes, tmp_path: Path, capsys: Capture
) -> None:
    (tmp_path / "job.toml").write_bytes(content)
    ran = animeme(capsys, "run", tmp_path / "job.toml")
    ran.says("  job: ", "  dialogue: missing", "  characters: missing")
    assert ran.code == 2


@pytest.mark.parametrize("keep", ["", "en", ".hidden/boat.wav", "en/readme.pdf", "stray.wav"])
def test_a_job_without_any_line_is_refused(keep: str, job: SmallJob, capsys: Capture) -> None:
    shutil.rmtree(job.dialogue)
    target = job.dialogue / keep
    if target.suffix:
        target.parent.mkdir(parents=True)
        target.touch()
    else:
        target.mkdir(parents=True)
    file = job.write()
    ran = animeme(capsys, "run", file)
    expect_refused(job, ran, "dialogue.root", "no recording", "<language>/<line>.wav")


@pytest.mark.parametrize("name", ["missing.toml", "."])
def test_a_job_file_that_is_not_there_is_refused(
    name: str, tmp_path: Path, capsys: Capture
) -> None:
    ran = animeme(capsys, "run", tmp_path / name)
    ran.says(str(tmp_path / name))
    assert ran.code == 2
    assert list(tmp_path.iterdir()) == []


# --- models and rigs ----------------------------------------------------------------------------


class _Bomb:
    """A pickle that leaves a trace when it is loaded."""

    def __reduce__(self) -> tuple[Any, ...]:
        return os.mkdir, ("exploded",)


def _model_text(**changes: Any) -> str:
    return json.dumps({**load_model("cohen-massaro").to_document(), **changes})


BAD_MODELS = (
    pytest.param(_model_text()[:2000].encode(), ("model.file",), id="truncated"),
    pytest.param(b"", ("model.file",), id="empty"),
    pytest.param(b"[]", ("not an object",), id="list"),
    pytest.param(
        _model_text(schema="animeme.model/2").encode(),
        ("animeme.model/2", "newer animeme"),
        id="future-version",
    ),
    pytest.param(
        _model_text(schema="animeme.rig/1").encode(), ("animeme.rig/1", "right kind"), id="a-rig"
    ),
    pytest.param(_model_text(model="cohen").encode(), ("'cohen'", "cohen-massaro"), id="unknown"),
    pytest.param(_model_text(groups=[]).encode(), ("not a cohen-massaro model",), id="no-groups"),
    pytest.param(_model_text(config=3).encode(), ("config",), id="wrong-member"),
    pytest.param(pickle.dumps(_Bomb()), ("model.file",), id="pickle"),
    pytest.param(b"[" * 100_000, ("model.file",), id="nested-deeply"),
)


@pytest.mark.parametrize(("content", "words"), BAD_MODELS)
def test_a_broken_model_file_is_refused(
    content: bytes,
    words: tuple[str, ...],
    job: SmallJob,
    capsys: Capture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(job.folder)
    (job.folder / "hero.json").write_bytes(content)
    job.sections["model"] = {"file": "hero.json"}
    ran = run_inline(capsys, job)
    expect_refused(job, ran, "model.file", "hero.json", *words)
    assert not (job.folder / "exploded").exists()

    (job.folder / "hero.json").write_text(_model_text())
    expect_success(job, run_inline(capsys, job))


RIG = (SAMPLE / "crab.rig.toml").read_text(encoding="utf-8")
BAD_RIGS = (
    pytest.param(RIG[:300], ("end of document",), id="truncated"),
    pytest.param("", ("schema", "animeme.rig/1"), id="empty"),
    pytest.param(RIG.replace("rig/1", "rig/2"), ("animeme.rig/2", "newer animeme"), id="future"),
    pytest.param(
        RIG.replace("gain = 0.4 }]", "gian = 0.4 }]", 1),
        ("controls.jawOpen.1.gian", "Did you mean 'gain'?"),
        id="typo",
    ),
    pytest.param(
        RIG.replace('"MawGape", gain = 1.4', '"MawGape", gain = "much"'),
        ("controls.jawOpen.0.gain", "'much'", "animeme schema rig"),
        id="word-for-number",
    ),
    pytest.param(
        RIG.replace('"MawGape", gain = 1.4', '"MawGape", gain = nan'),
        ("controls.jawOpen.0.gain", "finite"),
        id="nan",
    ),
    pytest.param(
        'schema = "animeme.rig/1"\nname = "x"\n[controls]\n',
        ("no control drives any shape", "animeme rig"),
        id="drives-nothing",
    ),
    pytest.param(RIG + 'Nope = "MawGape"\n', ("Nope", "nothing drives"), id="stray-ceiling"),
    pytest.param(
        RIG + "[limits]\nMawGape = [1.0, 0.0]\n", ("low above high", "MawGape"), id="limits-swapped"
    ),
    pytest.param(
        'schema = "animeme.rig/1"\nname = "x"\ncontrols = []\n', ("controls",), id="list-for-table"
    ),
)


@pytest.mark.parametrize(("content", "words"), BAD_RIGS)
def test_a_broken_rig_document_is_refused(
    content: str, words: tuple[str, ...], job: SmallJob, capsys: Capture
) -> None:
    (job.folder / "crab.rig.toml").write_text(content, encoding="utf-8")
    ran = run_inline(capsys, job)
    expect_refused(job, ran, "characters.crab.rig", *words)

    job.asset("crab.rig.toml")
    expect_success(job, run_inline(capsys, job))


def test_a_broken_rig_document_is_named(job: SmallJob, capsys: Capture) -> None:
    (job.folder / "crab.rig.toml").write_text(RIG[:300], encoding="utf-8")
    expect_refused(job, run_inline(capsys, job), "characters.crab.rig", "crab.rig.toml")


def test_a_rig_of_another_character_is_refused(job: SmallJob, capsys: Capture) -> None:
    job.sections["characters.crab"]["rig"] = "arkit"
    ran = run_inline(capsys, job)
    expect_refused(job, ran, "characters.crab", "'arkit'", "Choose another profile")


def test_a_rig_that_nobody_knows_is_refused_with_the_way_on(job: SmallJob, capsys: Capture) -> None:
    del job.sections["characters.crab"]["rig"]
    ran = run_inline(capsys, job)
    expect_refused(job, ran, "characters.crab", "no known rig family", "animeme rig", "--draft")


# --- the output folder --------------------------------------------------------------------------


@pytest.mark.parametrize(
    "output",
    [
        pytest.param("occupied", id="is-a-file"),
        pytest.param("occupied/below", id="below-a-file"),
        pytest.param("occupied/far/below", id="far-below-a-file"),
        pytest.param("/proc/animeme", id="proc"),
    ],
)
def test_an_output_folder_that_cannot_be_made_is_refused(
    output: str, job: SmallJob, capsys: Capture
) -> None:
    (job.folder / "occupied").write_text("mine")
    job.sections["job"]["output"] = output
    ran = run_inline(capsys, job)
    expect_refused(job, ran, output, "cannot be written", "Choose another output folder")

    job.sections["job"]["output"] = "out"
    expect_success(job, run_inline(capsys, job))


@pytest.mark.parametrize("name", ["en", "alignments"])
def test_a_file_in_the_way_of_an_output_folder_fails_the_lines(
    name: str, job: SmallJob, capsys: Capture
) -> None:
    """A file where a folder belongs is nobody's fault but the folder's: no report to us."""
    job.output.mkdir()
    (job.output / name).write_text("mine")
    ran = run_inline(capsys, job)
    ran.says("cannot be written", name, "Choose another output folder")
    assert "please report it" not in ran.err
    assert ran.code == 1
    assert set(job.statuses().values()) == {"failed"}
    assert (job.output / name).read_text() == "mine"

    (job.output / name).unlink()
    expect_success(job, run_inline(capsys, job))


@pytest.mark.parametrize("name", ["run.jsonl", "report.json", "summary.md"])
def test_a_folder_in_the_way_of_a_report_is_named(
    name: str, job: SmallJob, capsys: Capture
) -> None:
    (job.output / name).mkdir(parents=True)
    ran = run_inline(capsys, job)
    ran.says(name, "cannot be written", "Choose another output folder")
    assert ran.code == 2
    (job.output / name).rmdir()
    expect_success(job, run_inline(capsys, job))


def _glb_in_language_folder(job: SmallJob) -> str:
    (job.folder / "en").mkdir()
    shutil.move(job.folder / "crab.glb", job.folder / "en" / "crab.glb")
    return "en/crab.glb"


def _usda_beside_the_job(job: SmallJob) -> str:
    Sdf.Layer.FindOrOpen(str(SAMPLE / "crab.usdc")).Export(str(job.folder / "crab.usda"))
    return "crab.usda"


@pytest.mark.parametrize("place", [_glb_in_language_folder, _usda_beside_the_job])
def test_an_asset_is_never_overwritten(
    place: Callable[[SmallJob], str], job: SmallJob, capsys: Capture
) -> None:
    asset = place(job)
    job.sections["characters.crab"]["asset"] = asset
    job.sections["job"]["output"] = "."
    before = (job.folder / asset).read_bytes()
    ran = run_inline(capsys, job, sources_kept=False)
    assert (job.folder / asset).read_bytes() == before
    ran.says(asset)
    assert ran.code == 2


# --- the command line ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        pytest.param(("run", "JOB", "--workers", "0"), ("--workers", "x>=1"), id="no-workers"),
        pytest.param(("run", "JOB", "--workers", "two"), ("--workers", "'two'"), id="word"),
        pytest.param(("run", "JOB", "--executor", "cloud"), ("'cloud'", "inline"), id="executor"),
        pytest.param(("run", "JOB", "--fail-on", "doubt"), ("'doubt'", "warning"), id="fail-on"),
        pytest.param(("run", "JOB", "--otput", "x"), ("--otput", "--output"), id="option"),
        pytest.param(("run",), ("Missing argument 'JOB'", "--help"), id="no-job"),
        pytest.param(("rnu", "JOB"), ("'rnu'", "--help"), id="command"),
        pytest.param(("--verbos",), ("--verbos", "--help"), id="group-option"),
    ],
)
def test_a_wrong_command_line_is_refused(
    arguments: tuple[str, ...], words: tuple[str, ...], job: SmallJob, capsys: Capture
) -> None:
    file = str(job.write())
    ran = animeme(capsys, *(file if part == "JOB" else part for part in arguments))
    expect_refused(job, ran, *words)
