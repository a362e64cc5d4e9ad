"""How long a review of ten thousand lines takes, and how quick its list is.

A run of so many lines would take an hour: its output is laid out here from the sample's, with the
files that a run of one character in five languages leaves. Chromium opens the list.

    python tests/bench/review.py [--lines 10000] [--worst 200] [--folder /tmp/review-bench]
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from importlib.metadata import version
from pathlib import Path
from typing import Any

import animeme
from animeme import registry
from animeme.contracts import LineAnimation

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT / "tests")]

SAMPLE = ROOT / "sample_assets"
LANGUAGES = ("de", "en", "es", "fr", "it")
CODES = ("align-word-differs", "align-rate", "bilabials-open")


def lay_out(folder: Path, count: int) -> Path:
    """The output folder of a run of `count` lines, its job and its dialogue."""
    small = folder / "small"
    animeme.run(SAMPLE / "job.toml", output=small, cache=False)
    ids = sorted(path.stem for path in (SAMPLE / "dialogue" / "en").glob("*.wav"))
    form = registry.format_named("gltf")
    character = form.load(SAMPLE / "ada.glb")
    known = form.read_animations(small / "en" / "ada.glb")
    run = folder / "run"
    entries = []
    for language in LANGUAGES:
        source = language if language in ("de", "en", "es") else "en"
        animations = []
        for number in range(count // len(LANGUAGES)):
            base, name = ids[number % len(ids)], f"scene{number // 100:02}/line{number:04}"
            key = f"{language}/{name}"
            for suffix in (".wav", ".txt"):
                recorded = SAMPLE / "dialogue" / source / f"{base}{suffix}"
                link(recorded, folder / "dialogue" / f"{key}{suffix}")
            link(small / "alignments" / source / f"{base}.json", run / "alignments" / f"{key}.json")
            animations.append(LineAnimation(name, language, known[base], known[base].duration_s))
            entries.append(entry(key, language, number))
        form.write(character, animations, run / language / "ada.glb")
    job = folder / "job.toml"
    job.write_text(
        '[job]\nname = "ten thousand"\noutput = "run"\n[dialogue]\nroot = "dialogue"\n'
        f'[characters.ada]\nasset = "{SAMPLE / "ada.glb"}"\n'
    )
    start = {"event": "start", "job": "ten thousand", "file": str(job)}
    (run / "run.jsonl").write_text(json.dumps(start) + "\n")
    report = {
        "schema": "animeme.report/1", "animeme": version("animeme"), "job": "ten thousand",
        "exit_code": 1, "totals": {}, "audio_s": 1.0, "findings": [],
        "lines": sorted(entries, key=lambda each: each["line"]), "outputs": [],
    }  # fmt: skip
    (run / "report.json").write_text(json.dumps(report))
    return run


def link(source: Path, target: Path) -> None:
    """The same file once more."""
    target.parent.mkdir(parents=True, exist_ok=True)
    os.link(source, target) if source.stat().st_dev == target.parent.stat().st_dev else (
        shutil.copyfile(source, target)
    )


def entry(key: str, language: str, number: int) -> dict[str, Any]:
    """A line of the report; one in ten is for review, one in fifty has failed."""
    status = "failed" if number % 50 == 7 else "review" if number % 10 == 3 else "ok"
    severity = {"failed": "error", "review": "warning"}.get(status)
    finding = {
        "severity": severity, "code": CODES[number % 3], "place": "", "action": "Listen to it.",
        "message": "'boat' does not fit the sound at 1.20–1.45 s", "line": key,
        "character": "ada", "ours": False,
    }  # fmt: skip
    return {
        "line": key, "language": language, "character": "ada", "audio_s": 3.1, "status": status,
        "findings": [finding] if severity else [],
        "outputs": [f"{language}/ada.glb"],
    }  # fmt: skip


def write(run: Path, output: Path, worst: int) -> tuple[float, float]:
    """Seconds that the command takes, start to end, by the clock and of a processor."""
    before = time.perf_counter()
    cpu = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [sys.executable, "-c", "from animeme.cli import main; main()", "review", str(run),
         "--output", str(output), "--worst", str(worst)],
        check=True, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu_s = used.ru_utime + used.ru_stime - cpu.ru_utime - cpu.ru_stime
    return time.perf_counter() - before, cpu_s


def open_list(output: Path) -> None:
    """Print how quick the list is."""
    from support.browser import Watched, chromium

    with chromium() as browser, Watched(browser, output / "index.html") as shown:
        page = shown.page
        page.wait_for_selector(".body .row-line")
        page.reload()
        page.wait_for_selector(".body .row-line")
        shown.settle()
        loaded = page.evaluate("performance.getEntriesByType('navigation')[0].duration")
        painted = page.evaluate("performance.getEntriesByType('paint').at(-1).startTime")
        print(f"list: shown after {painted / 1e3:.2f} s, loaded after {loaded / 1e3:.2f} s")
        page.click("text=With a page")
        for name, act in {
            "search": "i => { const s = document.querySelector('[type=search]');"
            " s.value = 'boat 12'; s.dispatchEvent(new Event('input')); }",
            "all again": "i => { const s = document.querySelector('[type=search]');"
            " s.value = ''; s.dispatchEvent(new Event('input')); }",
            "sort": "i => document.querySelectorAll('.head button')[5].click()",
            "scroll": "i => { document.querySelector('.list').scrollTop = 200000; }",
        }.items():
            took = page.evaluate(
                f"""async () => {{ const t = performance.now(); ({act})();
                await new Promise(r => requestAnimationFrame(() => requestAnimationFrame(r)));
                return performance.now() - t; }}"""
            )
            print(f"list: {name} {took:.0f} ms, drawn")
        rows = page.locator(".body .row-line").count()
        print(f"list: {rows} rows in the page at once")
        shown.require_quiet()


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--lines", type=int, default=10_000)
    parser.add_argument("--worst", type=int, default=200)
    parser.add_argument("--folder", type=Path, help="kept, and used again if it is there")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = asked.folder or Path(scratch)
        run = folder / "run"
        if not (run / "report.json").is_file():
            run = lay_out(folder, asked.lines)
        output = folder / "review"
        shutil.rmtree(output, ignore_errors=True)
        took_s, cpu_s = write(run, output, asked.worst)
        files = [path for path in output.rglob("*") if path.is_file()]
        size = sum(path.stat().st_size for path in files)
        shared = len(list((output / "assets").iterdir()))
        print(
            f"pages: {asked.worst} of {asked.lines} lines in {took_s:.1f} s "
            f"({cpu_s:.1f} s of a processor), {len(files)} files, {size / 1e6:.1f} MB, "
            f"{shared} of them shared by all"
        )
        print(f"list: {(output / 'index.html').stat().st_size / 1e6:.1f} MB")
        open_list(output)


if __name__ == "__main__":
    main()
