"""Review pages in Chromium: they play, jump, mark and show what they ought to, and nothing else."""

from __future__ import annotations

import csv
import io
import json
import shutil
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

import animeme
import animeme_schemas
from animeme import registry
from animeme.findings import RunReport
from animeme_stages.review import html
from conftest import SAMPLE
from support.browser import Watched, chromium, inside_mouth
from test_review_pages import NASTY, crafted

DOUBT = {
    "severity": "warning", "code": "align-word-differs",
    "message": "'blue' does not fit the sound at 1.20–1.45 s", "place": "",
    "action": "Listen to it.", "line": "en/boat", "character": "ada", "ours": False,
}  # fmt: skip
CLOSURE = {**DOUBT, "message": "the lips stay open", "place": "2.00–2.06 s"}
OPEN_VOWELS = ("AA", "AO", "OW")
Watch = Callable[..., Watched]
slow = pytest.mark.slow


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Chromium with software rendering."""
    if html.head_script() is None:
        pytest.skip("the bundle of the 3D view is not built: python hatch_build.py")
    with chromium() as started:
        yield started


@pytest.fixture
def watch(browser: Any) -> Iterator[Callable[..., Watched]]:
    """Opens pages, and closes them behind the test."""
    with ExitStack() as opened:
        yield lambda file, **more: opened.enter_context(Watched(browser, file, **more))


@pytest.fixture(scope="module")
def pages(sample_run: tuple[RunReport, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sample's English lines; two findings are put into one that has none."""
    folder = tmp_path_factory.mktemp("browser")
    run = crafted(sample_run[1], folder / "run", status="review", findings=[DOUBT, CLOSURE])
    animeme.review(run, folder / "review", lines=["en/*"])
    return folder / "review"


def boat(pages: Path) -> Path:
    return pages / "lines" / "ada" / "en" / "boat.html"


@slow
def test_lips_are_shut_in_bilabials_and_open_in_vowels(watch: Watch, pages: Path) -> None:
    shown = watch(boat(pages))
    shown.wait_for_head()
    shown.page.click("text=Mouth")
    line = shown.page.evaluate("JSON.parse(document.getElementById('data').textContent).line")
    seen: dict[str, list[int]] = {"shut": [], "open": []}
    for symbol, ipa, start_s, end_s, _ in line["phones"]:
        kind = "shut" if ipa in "pbm" else "open" if symbol in OPEN_VOWELS else ""
        if kind and (kind == "shut" or len(seen["open"]) < 3):
            shown.seek((start_s + end_s) / 2)
            seen[kind].append(inside_mouth(shown.head()))
    assert len(seen["shut"]) == 8
    assert max(seen["shut"]) < 0.25 * min(seen["open"])
    shown.require_quiet()


@slow
def test_it_plays_in_time_with_the_sound_and_stops_at_the_end(watch: Watch, pages: Path) -> None:
    shown = watch(boat(pages))
    shown.wait_for_head()
    before = shown.head()
    shown.page.keyboard.press("Space")
    shown.wait_until(lambda: shown.time_s > 0.5)
    assert shown.page.get_attribute(".player .play", "aria-label") == "Pause"
    shown.page.keyboard.press("Space")
    stopped_s = shown.time_s
    shown.page.wait_for_timeout(200)
    assert shown.time_s == stopped_s
    assert np.abs(shown.head() - before).max() > 60
    shown.page.keyboard.press("Space")
    shown.wait_until(lambda: shown.page.get_attribute(".play", "aria-label") == "Play")
    assert shown.time_s == pytest.approx(2.7, abs=0.06)
    shown.require_quiet()


@slow
def test_the_head_shows_the_weights_that_are_in_the_file(watch: Watch, pages: Path) -> None:
    """The figures beside the curves are those of another reader of the same file."""
    written = animeme.load_character(SAMPLE / "ada.glb")
    shown = watch(boat(pages))
    shown.wait_for_head()
    run = pages.parent / "run"
    curves = registry.format_of(run / "en" / "ada.glb").read_animations(run / "en" / "ada.glb")
    for at_s in (0.4, 1.31, 1.83):
        shown.seek(at_s)
        shown.page.wait_for_timeout(120)
        chips = shown.page.locator(".chip[aria-pressed=true]").all_inner_texts()
        told = {name: float(value) for name, value in (chip.split("\n") for chip in chips)}
        assert set(told) <= set(written.shapes)
        weights = dict(zip(curves["boat"].names, curves["boat"].sample(at_s)[0], strict=True))
        assert told == {name: pytest.approx(weights[name], abs=0.006) for name in told}
    shown.require_quiet()


@slow
def test_keys_step_jump_loop_zoom_and_mark(watch: Watch, pages: Path) -> None:
    shown = watch(boat(pages))
    keys = shown.page.keyboard
    keys.press("ArrowRight")
    keys.press("ArrowRight")
    shown.settle()
    assert shown.time_s == pytest.approx(2 / 30, abs=0.006)
    keys.press("n")
    shown.settle()
    assert shown.time_s == pytest.approx(1.2, abs=0.006)
    assert "does not fit" in shown.page.inner_text("[role=status].unseen")
    keys.press("n")
    shown.settle()
    assert shown.time_s == pytest.approx(2.0, abs=0.006)
    keys.press("Shift+N")
    shown.settle()
    assert shown.time_s == pytest.approx(1.2, abs=0.006)
    width = shown.page.evaluate("document.querySelector('.rows').offsetWidth")
    keys.press("+")
    assert shown.page.evaluate("document.querySelector('.rows').offsetWidth") > 1.4 * width
    keys.press("[")
    keys.press("Shift+ArrowRight")
    keys.press("]")
    keys.press("Space")
    shown.page.wait_for_timeout(1600)  # three times through, at least
    assert 1.15 < shown.time_s < 1.75
    keys.press("f")
    assert shown.page.get_attribute(".fix", "aria-pressed") == "true"
    keys.press("?")
    assert shown.page.is_visible(".help")
    shown.require_quiet()


@slow
def test_marks_are_kept_and_exported(watch: Watch, pages: Path) -> None:
    shown = watch(boat(pages))
    shown.page.keyboard.press("f")
    shown.page.keyboard.press("m")
    shown.page.keyboard.type('late, "blue"\nsays Zoë')
    got = {}
    for kind in ("JSON", "CSV"):
        with shown.page.expect_download() as download:
            shown.page.click(f"text=Export {kind}")
        got[kind] = Path(download.value.path()).read_bytes().decode("utf-8")
    document = json.loads(got["JSON"])
    jsonschema.validate(document, animeme_schemas.load("marks"))
    note = 'late, "blue"\nsays Zoë'
    assert document["marks"] == [
        {"line": "en/boat", "character": "ada", "mark": "fix", "note": note}
    ]
    rows = list(csv.reader(io.StringIO(got["CSV"], newline="")))
    assert rows == [["line", "character", "mark", "note"], ["en/boat", "ada", "fix", note]]
    shown.page.goto((pages / "index.html").as_uri())
    assert shown.page.inner_text(".marked.fix") == "fix"
    shown.require_quiet()


def test_the_list_sorts_searches_and_opens_by_keyboard(watch: Watch, pages: Path) -> None:
    shown = watch(pages / "index.html")
    page = shown.page
    first = ".body .row-line >> nth=0"
    assert "en/boat" in page.inner_text(first)  # the one that is for review
    page.click("text=With a page")
    assert "36 lines" in page.inner_text(".filters")
    page.click(".head >> text=Language")
    assert "de/" in page.inner_text(first)
    page.click(".head >> text=Language")
    assert "es/" in page.inner_text(first)
    assert page.get_attribute(".head .language", "aria-sort") == "descending"
    page.keyboard.press("/")
    page.keyboard.type("blue boat ada")
    assert "1 of 36 lines" in page.inner_text(".filters")
    page.keyboard.press("Enter")
    page.wait_for_url("**/lines/ada/en/boat.html")
    page.keyboard.press("i")
    page.wait_for_url("**/index.html")
    page.wait_for_selector(first)
    page.keyboard.press("/")
    page.keyboard.type("moon ada")
    page.keyboard.press("ArrowDown")
    page.keyboard.press("j")
    page.keyboard.press("Enter")
    page.wait_for_url("**/moon.html")
    shown.require_quiet()


@slow
@pytest.mark.parametrize("single", [False, True], ids=["pages", "single-file"])
def test_text_of_others_is_shown_and_runs_nothing(
    watch: Watch, sample_run: tuple[RunReport, Path], tmp_path: Path, single: bool
) -> None:
    dialogue = tmp_path / "dialogue"
    shutil.copytree(SAMPLE / "dialogue", dialogue)
    (dialogue / "en" / "boat.txt").write_text(NASTY, encoding="utf-8")
    bad = {**DOUBT, "message": f"<img src=x onerror=alert(1)> {NASTY}"}
    run = crafted(sample_run[1], tmp_path / "run", findings=[bad])
    animeme.review(
        run, tmp_path / "out", lines=["en/boat"], dialogue=dialogue, single_file=single
    )  # fmt: skip
    page = tmp_path / "out" / "index.html" if single else boat(tmp_path / "out")
    shown = watch(page, anchor="#ada/en/boat" if single else "")
    shown.wait_for_head()
    assert NASTY.split() == shown.page.inner_text(".transcript").split()
    assert bad["message"].split()[:4] == shown.page.inner_text(".message").split()[:4]
    assert shown.page.title() != "owned"
    assert shown.page.locator("img").count() == 0
    # What the policy is for: a script that got in all the same does not run.
    shown.page.evaluate(
        """() => { const s = document.createElement('script'); s.text = 'document.title = "owned"';
        document.body.append(s); document.body.insertAdjacentHTML('beforeend',
        '<img src=x onerror="document.title=`owned`">'); }"""
    )
    shown.settle()
    assert shown.page.title() != "owned"
    assert any("Content Security Policy" in complaint for complaint in shown.complaints)


@slow
def test_one_file_plays_and_turns_from_line_to_line(
    watch: Watch, sample_run: tuple[RunReport, Path], tmp_path: Path
) -> None:
    animeme.review(sample_run[1], tmp_path, single_file=True)
    shown = watch(tmp_path / "index.html")
    shown.page.click("a:has-text('en/moon') >> nth=0")
    shown.wait_for_head()
    shown.page.keyboard.press("Space")
    shown.wait_until(lambda: shown.time_s > 0.3)
    shown.page.keyboard.press("j")
    shown.page.wait_for_selector("h1:has-text('en/think')")
    shown.wait_for_head()
    shown.page.keyboard.press("i")
    shown.page.wait_for_selector(".table")
    shown.require_quiet()


@slow
def test_two_runs_are_seen_and_heard_on_one_clock(
    watch: Watch, sample_run: tuple[RunReport, Path], tmp_path: Path
) -> None:
    other, dialogue = tmp_path / "other", tmp_path / "dialogue" / "en"
    dialogue.mkdir(parents=True)
    for suffix in (".wav", ".txt"):
        shutil.copy(SAMPLE / "dialogue" / "en" / f"boat{suffix}", dialogue)
    (tmp_path / "job.toml").write_text(
        '[job]\nname = "other"\n[dialogue]\nroot = "dialogue"\n[model]\nname = "cohen-massaro"\n'
        f'[characters.ada]\nasset = "{SAMPLE / "ada.glb"}"\n'
    )
    animeme.run(tmp_path / "job.toml", output=other)
    animeme.review(sample_run[1], tmp_path / "out", lines=["en/boat"], against=other)
    shown = watch(boat(tmp_path / "out"))
    shown.wait_for_head(heads=2)
    names = shown.page.locator(".stage .names span").all_inner_texts()
    assert [name[0] for name in names] == ["A", "B"]
    shown.page.click("text=Mouth")
    shown.seek(1.38)
    left, right = np.array_split(shown.head()[60:-60], 2, axis=1)
    assert np.abs(left[:, : right.shape[1]] - right).max() > 60  # not the same mouth
    assert " | " in shown.page.inner_text(".chip[aria-pressed=true] >> nth=0")
    shown.require_quiet()


@slow
def test_without_webgl_all_but_the_head_works(watch: Watch, pages: Path) -> None:
    shown = watch(boat(pages), webgl=False)
    shown.page.wait_for_selector(".stage.none")
    assert "no WebGL" in shown.page.inner_text(".stage")
    shown.page.keyboard.press("n")
    shown.settle()
    assert shown.time_s == pytest.approx(1.2, abs=0.006)


@slow
@pytest.mark.parametrize("name", ["ada.usdc", "crab.glb"])
def test_every_sample_head_moves(
    watch: Watch, sample_run: tuple[RunReport, Path], tmp_path: Path, name: str
) -> None:
    run = sample_run[1]
    animeme.review(run, tmp_path, lines=["en/boat"])
    page = tmp_path / "lines" / name.partition(".")[0] / "en" / "boat.html"
    shown = watch(page)
    shown.wait_for_head()
    shown.page.click(f".files >> text=en/{name}")
    shown.page.wait_for_selector(f".names:has-text('{name}')")
    shown.settle()
    pictures = []
    for at_s in (0.27, 2.2):
        shown.seek(at_s)
        pictures.append(shown.head())
    assert np.abs(pictures[0] - pictures[1]).max() > 60
    shown.require_quiet()
