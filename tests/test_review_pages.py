"""`animeme review` writes pages: what is in them, which lines get one, and what it refuses."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path
from typing import Any

import jsonschema
import pytest

import animeme
import animeme_schemas
from animeme.errors import InputError
from animeme.findings import Finding, RunReport, Severity
from animeme.reviewing import ReviewedLine, choose, when_of
from animeme_stages.review import html
from conftest import SAMPLE
from support.jobs import Capture
from support.jobs import animeme as command

NASTY = (
    'He said </script><script>document.title="owned"</script> "it\'s" <!-- & שלום 👍🏽 \u2028 ok'
)


def data_of(page: Path) -> Any:
    """What a page tells its script."""
    text = page.read_text(encoding="utf-8")
    (found,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', text, re.S)
    return json.loads(found)


@pytest.fixture(scope="module")
def pages(sample_run: tuple[RunReport, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Pages of one line of two characters."""
    output = tmp_path_factory.mktemp("review")
    written = animeme.review(sample_run[1], output, lines=["en/boat"])
    assert (written.lines, written.pages) == (36, 2)
    return output


def test_a_page_holds_sound_words_phones_curves_and_both_files(pages: Path) -> None:
    data = data_of(pages / "lines" / "ada" / "en" / "boat.html")
    line = data["line"]
    assert line["text"] == (SAMPLE / "dialogue" / "en" / "boat.txt").read_text().strip()
    assert [line["text"][a:b].lower() for *_, a, b in line["words"]][:2] == ["mama", "bought"]
    assert line["phones"][1][:2] == ["M", "m"]
    assert [take["file"] for take in line["takes"]] == ["en/ada.glb", "en/ada.usdc"]
    assert all("jawOpen" in take["names"] for take in line["takes"])
    assert (pages / line["audio"]).read_bytes() == (
        SAMPLE / "dialogue" / "en" / "boat.wav"
    ).read_bytes()


def test_the_list_has_every_line_and_links_to_those_with_a_page(pages: Path) -> None:
    rows = data_of(pages / "index.html")["index"]["rows"]
    linked = {(row[0], row[1]): row[8] for row in rows if row[8]}
    assert len(rows) == 36
    assert set(linked) == {("en/boat", "ada"), ("en/boat", "crab")}
    assert all((pages / href).is_file() for href in linked.values())


def test_the_same_review_has_the_same_bytes(
    pages: Path, sample_run: tuple[RunReport, Path], tmp_path: Path
) -> None:
    animeme.review(sample_run[1], tmp_path, lines=["en/boat"])
    files = sorted(p.relative_to(pages) for p in pages.rglob("*") if p.is_file())
    assert sorted(p.relative_to(tmp_path) for p in tmp_path.rglob("*") if p.is_file()) == files
    assert [(tmp_path / f).read_bytes() for f in files] == [(pages / f).read_bytes() for f in files]


def test_a_later_review_takes_away_what_it_does_not_write(
    sample_run: tuple[RunReport, Path], tmp_path: Path
) -> None:
    (tmp_path / "lines").mkdir()
    (tmp_path / "lines" / "mine.txt").write_text("mine")
    animeme.review(sample_run[1], tmp_path, lines=["de/boat"])
    animeme.review(sample_run[1], tmp_path, lines=["en/boat"])
    assert not (tmp_path / "lines" / "ada" / "de").exists()
    assert (tmp_path / "lines" / "ada" / "en" / "boat.html").is_file()
    assert (tmp_path / "lines" / "mine.txt").read_text() == "mine"


def test_one_file_holds_the_whole_sample_in_less_than_three_megabytes(
    sample_run: tuple[RunReport, Path], tmp_path: Path
) -> None:
    written = animeme.review(sample_run[1], tmp_path, single_file=True)
    assert written.size_bytes < 3e6
    assert sorted(p.name for p in tmp_path.iterdir()) == ["index.html", "review.json"]
    data = data_of(tmp_path / "index.html")
    assert len(data["lines"]) == 36
    assert all(sound.startswith("data:audio/ogg;base64,") for sound in data["sounds"].values())
    text = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert not re.findall(r"<(?:script|link|img)[^>]+(?:src|href)=\"(?!data:,)", text)


def crafted(run: Path, target: Path, **changes: Any) -> Path:
    """A copy of a run, with members of one line's entry changed."""
    shutil.copytree(run, target)
    report = json.loads((target / "report.json").read_text(encoding="utf-8"))
    for entry in report["lines"]:
        if (entry["line"], entry["character"]) == ("en/boat", "ada"):
            entry.update(changes)
    (target / "report.json").write_text(json.dumps(report), encoding="utf-8")
    return target


def test_text_of_others_cannot_leave_its_place(
    sample_run: tuple[RunReport, Path], tmp_path: Path
) -> None:
    dialogue = tmp_path / "dialogue"
    shutil.copytree(SAMPLE / "dialogue", dialogue)
    (dialogue / "en" / "boat.txt").write_text(NASTY, encoding="utf-8")
    output = tmp_path / "review"
    animeme.review(sample_run[1], output, lines=["en/boat"], dialogue=dialogue)
    page = output / "lines" / "ada" / "en" / "boat.html"
    text = page.read_text(encoding="utf-8")
    assert data_of(page)["line"]["text"] == NASTY
    assert "<script>document" not in text
    assert "<!--" not in text
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', text)
    assert policy is not None
    assert "default-src &#x27;none&#x27;" in policy[1]
    assert "unsafe-inline" not in policy[1]
    nonces = set(re.findall(r'nonce="([^"]+)"', text))
    assert len(nonces) == 1
    assert f"script-src &#x27;nonce-{nonces.pop()}&#x27;" in policy[1]


def test_words_are_found_in_a_text_with_characters_beyond_16_bits(
    sample_run: tuple[RunReport, Path], tmp_path: Path
) -> None:
    dialogue = tmp_path / "dialogue"
    shutil.copytree(SAMPLE / "dialogue", dialogue)
    (dialogue / "en" / "boat.txt").write_text("👍" * 12, encoding="utf-8")
    animeme.review(sample_run[1], tmp_path / "review", lines=["en/boat"], dialogue=dialogue)
    line = data_of(tmp_path / "review" / "lines" / "ada" / "en" / "boat.html")["line"]
    assert line["words"][0][3:] == [0, 8]  # four characters of two units each


def test_a_line_without_files_or_recording_still_gets_a_page(
    sample_run: tuple[RunReport, Path], tmp_path: Path
) -> None:
    run = crafted(sample_run[1], tmp_path / "run", status="failed", outputs=[])
    (run / "run.jsonl").unlink()
    (run / "alignments" / "en" / "boat.json").unlink()
    animeme.review(run, tmp_path / "review", lines=["en/boat"])
    line = data_of(tmp_path / "review" / "lines" / "ada" / "en" / "boat.html")["line"]
    assert (line["audio"], line["takes"], line["phones"]) == (None, [], [])
    assert any("--dialogue" in remark for remark in line["remarks"])


def test_a_damaged_asset_costs_its_own_line_the_head_alone(
    sample_run: tuple[RunReport, Path], tmp_path: Path
) -> None:
    run = crafted(sample_run[1], tmp_path / "run", outputs=["en/ada.glb"])
    (run / "en" / "ada.glb").write_bytes(b"glTF nonsense")
    written = animeme.review(run, tmp_path / "review", lines=["en/boat"])
    assert written.pages == 2
    line = data_of(tmp_path / "review" / "lines" / "ada" / "en" / "boat.html")["line"]
    assert line["takes"] == []
    assert any("en/ada.glb cannot be shown" in remark for remark in line["remarks"])


def test_a_delivered_file_is_shown_with_its_findings(
    sample_run: tuple[RunReport, Path], tmp_path: Path
) -> None:
    animeme.review(sample_run[1] / "en" / "crab.glb", tmp_path, lines=["boat"])
    data = data_of(tmp_path / "index.html")["index"]
    assert len(data["rows"]) == 6
    (page,) = (tmp_path / "lines" / "crab" / "en").iterdir()
    line = data_of(page)["line"]
    assert line["audio"] is None
    assert line["takes"][0]["file"] == "crab.glb"
    assert line["duration_s"] > 2.0


def test_a_delivered_file_is_heard_where_its_dialogue_is_given(
    sample_run: tuple[RunReport, Path], tmp_path: Path
) -> None:
    dialogue = tmp_path / "dialogue" / "en"
    dialogue.mkdir(parents=True)
    for suffix in (".wav", ".txt"):
        shutil.copy(SAMPLE / "dialogue" / "en" / f"boat{suffix}", dialogue)
    (dialogue / "moon.wav").write_bytes(b"no sound")
    (dialogue / "moon.txt").write_text("Who knew")
    file = sample_run[1] / "en" / "ada.glb"
    animeme.review(file, tmp_path / "out", lines=["en/*"], dialogue=dialogue.parent)
    lines = {
        name: data_of(tmp_path / "out" / "lines" / "ada" / "en" / f"{name}.html")["line"]
        for name in ("boat", "moon")
    }
    assert (tmp_path / "out" / lines["boat"]["audio"]).is_file()
    assert [word[0] for word in lines["boat"]["words"]][:2] == ["mama", "bought"]
    assert lines["moon"]["audio"] is None
    assert any("cannot be heard" in remark for remark in lines["moon"]["remarks"])
    assert len(lines["moon"]["takes"]) == 1


LINES = tuple(
    ReviewedLine(key, "ada", key[:2], status, 1.0, findings, score)  # type: ignore[arg-type]
    for key, status, findings, score in [
        ("de/a", "ok", (), -3.0),
        ("de/b", "ok", (), -9.0),
        ("en/a", "review", (Finding(Severity.WARNING, "x", ""),), -2.0),
        ("en/ada/c", "failed", (Finding(Severity.ERROR, "y", ""),), None),
    ]
)


@pytest.mark.parametrize(
    ("globs", "worst", "kept"),
    [
        ((), None, ["de/a", "de/b", "en/a", "en/ada/c"]),
        (("de/*",), None, ["de/a", "de/b"]),
        (("a",), None, ["de/a", "en/a"]),
        (("c", "b"), None, ["de/b", "en/ada/c"]),
        ((), 1, ["en/ada/c"]),
        ((), 3, ["de/b", "en/a", "en/ada/c"]),
        (("de/*",), 1, ["de/b"]),
    ],
)
def test_globs_and_worst_choose_lines(
    globs: tuple[str, ...], worst: int | None, kept: list[str]
) -> None:
    assert [line.key for line in choose(LINES, globs, worst)] == kept


@pytest.mark.parametrize(
    ("place", "message", "when"),
    [
        ("", "'boat' does not fit the sound at 1.20–1.45 s", (1.2, 1.45)),
        ("0.27–0.33 s", "the lips stay open", (0.27, 0.33)),
        ("", "more seems to be said between 'a' and 'b', around 2.05 s", (2.05, 2.05)),
        ("", "it moves from 1 to 2.5 s", (1.0, 2.5)),
        ("a.wav", "lasts 3.00 s, and the animation 2.00 s", None),
    ],
)
def test_findings_say_when(place: str, message: str, when: tuple[float, float] | None) -> None:
    assert when_of(Finding(Severity.WARNING, "x", message, place=place)) == when


@pytest.mark.parametrize("suffix", ["", "json"])
def test_what_cannot_be_reviewed_is_refused(
    suffix: str, sample_run: tuple[RunReport, Path], tmp_path: Path, capsys: Capture
) -> None:
    for arguments, code in [
        ((str(tmp_path / "none"),), "asset-missing"),
        ((str(sample_run[1]), "--lines", "nope*"), "selection-empty"),
        ((str(sample_run[1]), "--dialogue", str(tmp_path / "none")), "dialogue-missing"),
        ((str(SAMPLE / "ada.glb"),), "review-empty"),
    ]:
        more = ("--json",) if suffix else ()
        ran = command(capsys, "review", *arguments, "--output", str(tmp_path / "out"), *more)
        assert ran.code == 2
        assert code in ran.err
        assert "Traceback" not in ran.err
        assert not (tmp_path / "out").exists()


def test_an_output_that_is_a_file_is_refused(
    sample_run: tuple[RunReport, Path], tmp_path: Path
) -> None:
    (tmp_path / "out").write_text("mine")
    with pytest.raises(InputError, match="cannot be written"):
        animeme.review(sample_run[1], tmp_path / "out", lines=["en/boat"])
    assert (tmp_path / "out").read_text() == "mine"


def test_a_page_of_somebody_else_is_not_overwritten(
    sample_run: tuple[RunReport, Path], tmp_path: Path
) -> None:
    (tmp_path / "index.html").write_text("mine")
    with pytest.raises(InputError, match="no review's"):
        animeme.review(sample_run[1], tmp_path, lines=["en/boat"])
    assert [path.name for path in tmp_path.iterdir()] == ["index.html"]
    assert (tmp_path / "index.html").read_text() == "mine"
    (tmp_path / "index.html").unlink()
    for _ in range(2):
        animeme.review(sample_run[1], tmp_path, lines=["en/boat"])


def test_without_the_bundle_the_page_says_how_to_have_it(
    sample_run: tuple[RunReport, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("animeme_stages.review.html.head_script", lambda: None)
    written = animeme.review(sample_run[1], tmp_path, lines=["en/boat"])
    assert not written.head
    assert "pip install --editable ." in written.remarks[0]
    line = data_of(tmp_path / "lines" / "ada" / "en" / "boat.html")["line"]
    assert written.remarks[0] in line["remarks"]
    assert line["takes"][0]["asset"] is None
    assert [p.name for p in (tmp_path / "assets").iterdir()] != []
    assert not (tmp_path / "assets" / "head.js").exists()


def test_marks_have_a_schema() -> None:
    marks = {"line": "en/boat", "character": "ada", "mark": "fix", "note": "late"}
    document = {"schema": "animeme.marks/1", "marks": [marks]}
    jsonschema.validate(document, animeme_schemas.load("marks"))
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(
            {**document, "marks": [{**marks, "mark": "?"}]}, animeme_schemas.load("marks")
        )


def test_a_strange_asset_is_shown_without_its_head(
    sample_run: tuple[RunReport, Path], tmp_path: Path
) -> None:
    if html.head_script() is None:
        pytest.skip("the bundle of the 3D view is not built: python hatch_build.py")
    run = tmp_path / "run"
    shutil.copytree(sample_run[1], run)
    glb = (run / "en" / "crab.glb").read_bytes()
    # A material that refers to a texture which is not there: the curves are sound all the same.
    strange = glb.replace(b'"baseColorFactor":[', b'"baseColorTexture":{"index":7},"q":[', 1)
    text, rest = strange[20:], len(strange) - len(glb)
    length = int.from_bytes(glb[12:16], "little")
    document = text[: length + rest].rstrip()
    document += b" " * (-len(document) % 4)
    body = strange[20 + length + rest :]
    size = 20 + len(document) + len(body)
    head = glb[:8] + size.to_bytes(4, "little") + len(document).to_bytes(4, "little") + glb[16:20]
    (run / "en" / "crab.glb").write_bytes(head + document + body)
    animeme.review(run, tmp_path / "out", lines=["en/boat"])
    line = data_of(tmp_path / "out" / "lines" / "crab" / "en" / "boat.html")["line"]
    assert line["takes"][0]["asset"] is None
    assert line["takes"][0]["names"]
    assert any("The head of en/crab.glb cannot be shown" in text for text in line["remarks"])


@pytest.mark.slow
def test_every_layout_is_shown_with_its_head(tmp_path: Path) -> None:
    dialogue = tmp_path / "dialogue" / "en"
    dialogue.mkdir(parents=True)
    for suffix in (".wav", ".txt"):
        shutil.copy(SAMPLE / "dialogue" / "en" / f"boat{suffix}", dialogue)
    (tmp_path / "job.toml").write_text(
        '[job]\nname = "layouts"\n[dialogue]\nroot = "dialogue"\n'
        "[curves]\npreroll_s = 0.25\nframe_rate = 24\n"
        f'[characters.clip]\nasset = "{SAMPLE / "ada.glb"}"\nlayout = "animation-only"\n'
        f'[characters.line]\nasset = ["{SAMPLE / "ada.glb"}", "{SAMPLE / "ada.usdc"}"]\n'
        'layout = "per-line"\n'
    )
    animeme.run(tmp_path / "job.toml", output=tmp_path / "run")
    animeme.review(tmp_path / "run", tmp_path / "out")
    shown = {
        name: data_of(tmp_path / "out" / "lines" / name / "en" / "boat.html")["line"]
        for name in ("clip", "line")
    }
    takes = [take for line in shown.values() for take in line["takes"]]
    assert [take["file"].rpartition("/")[2] for take in takes] == [
        "boat.glb", "boat.glb", "boat.usdc",
    ]  # fmt: skip
    assert {take["audio_start_s"] for take in takes} == {0.25}
    assert {line["frame_hz"] for line in shown.values()} == {24.0}
    # The clip, which has no meshes, is shown on the asset that it was made for.
    assert takes[0]["asset"] == takes[1]["asset"]
    assert takes[0]["names"] == takes[1]["names"]
