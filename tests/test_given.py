"""What a user gives beside the recording: timings and pronunciations of their own."""

from __future__ import annotations

from pathlib import Path

import pytest

import animeme
from animeme.cli import main
from animeme.phones import SILENCE, Phone, PhoneTrack
from animeme_stages.align.interchange import read_timings, track_from, write_timings
from conftest import SAMPLE
from support.jobs import SmallJob, run_inline

Capture = pytest.CaptureFixture[str]
BOAT = SAMPLE / "dialogue" / "en" / "boat.wav"
TEXT = BOAT.with_suffix(".txt").read_text(encoding="utf-8")


@pytest.fixture
def job(tmp_path: Path) -> SmallJob:
    made = SmallJob(tmp_path)
    made.asset("crab.glb")
    made.asset("crab.rig.toml")
    made.line("en/boat")
    made.sections = {
        "job": {"name": "given", "output": "out"},
        "dialogue": {"root": "dialogue"},
        "characters.crab": {"asset": "crab.glb", "rig": "crab.rig.toml"},
    }
    return made


def aligned(job: SmallJob) -> PhoneTrack:
    timings = read_timings(job.output / "alignments" / "en" / "boat.json")
    return track_from(timings, language="en", duration_s=timings.end_s)


def test_timings_beside_a_recording_are_used(job: SmallJob, capsys: Capture) -> None:
    """Even without a transcript: they say what is spoken."""
    duration_s = animeme.align(BOAT, TEXT).track.duration_s
    phones = (
        Phone(SILENCE, 0.0, 0.5),
        Phone("M", 0.5, 1.0),
        Phone("AA", 1.0, duration_s - 0.25),
        Phone(SILENCE, duration_s - 0.25, duration_s),
    )
    track = PhoneTrack("en", "arpabet", phones)
    write_timings(track, job.dialogue / "en" / "boat.TextGrid", "textgrid")
    (job.dialogue / "en" / "boat.txt").unlink()
    job.write()
    assert run_inline(capsys, job).code == 0
    assert [phone.symbol for phone in aligned(job).phones] == [SILENCE, "M", "AA", SILENCE]
    assert [f["code"] for f in job.findings("en/boat")] == ["timings-used"]


def test_timings_that_leave_speech_out_are_flagged(job: SmallJob, capsys: Capture) -> None:
    duration_s = animeme.align(BOAT, TEXT).track.duration_s
    phones = (Phone("M", 0.0, 0.6), Phone(SILENCE, 0.6, duration_s))
    track = PhoneTrack("en", "arpabet", phones)
    write_timings(track, job.dialogue / "en" / "boat.TextGrid", "textgrid")
    job.write()
    assert run_inline(capsys, job).code == 0
    assert "align-untranscribed" in [f["code"] for f in job.findings("en/boat")]
    assert job.statuses() == {"en/boat": "review"}


def test_half_written_timings_fail_their_line(job: SmallJob, capsys: Capture) -> None:
    path = job.dialogue / "en" / "boat.TextGrid"
    write_timings(animeme.align(BOAT, TEXT).track, path, "textgrid")
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    job.write()
    ran = run_inline(capsys, job)
    ran.says("en/boat", "boat.TextGrid", "timings-damaged")
    assert ran.code == 1
    path.write_bytes(whole)
    assert run_inline(capsys, job).code == 0


def test_a_lexicon_goes_before_the_dictionary(job: SmallJob, capsys: Capture) -> None:
    (job.folder / "names.lex").write_text("MAMA  P AA P AA\n", encoding="utf-8")
    job.sections["align"] = {"lexicon": "names.lex"}
    job.write()
    run_inline(capsys, job)
    assert [p.symbol for p in aligned(job).phones if p.symbol != SILENCE][:4] == ["P", "AA"] * 2


def test_an_edited_lexicon_counts_at_once(job: SmallJob, capsys: Capture) -> None:
    """Also within one process, which has read it before."""
    job.sections["align"] = {"lexicon": "names.lex"}
    job.write()
    for line, first in (("MAMA  P AA P AA\n", "P"), ("MAMA  B AA B AA T\n", "B")):
        (job.folder / "names.lex").write_text(line, encoding="utf-8")
        run_inline(capsys, job)
        assert next(p.symbol for p in aligned(job).phones if p.symbol != SILENCE) == first


@pytest.mark.parametrize(
    ("content", "said"), [(None, "names.lex"), ("MAMA  M XX\n", "names.lex:1")]
)
def test_a_broken_lexicon_is_named(
    job: SmallJob, capsys: Capture, content: str | None, said: str
) -> None:
    if content:
        (job.folder / "names.lex").write_text(content, encoding="utf-8")
    job.sections["align"] = {"lexicon": "names.lex"}
    job.write()
    ran = run_inline(capsys, job)
    ran.says("align.lexicon", said)
    assert ran.code == 2
    assert not job.output.exists()


@pytest.mark.parametrize("form", ["textgrid", "ctm", "phone-ctm", "rhubarb-tsv", "alignment"])
def test_align_writes_other_tools_formats(form: str, tmp_path: Path, capsys: Capture) -> None:
    suffix = {"textgrid": ".TextGrid", "alignment": ".json", "rhubarb-tsv": ".tsv"}.get(
        form, ".ctm"
    )
    output = tmp_path / f"boat{suffix}"
    with pytest.raises(SystemExit) as ended:
        main(["align", str(BOAT), TEXT, "--output", str(output), "--format", form])
    assert ended.value.code == 0
    assert read_timings(output).end_s > 2.0
