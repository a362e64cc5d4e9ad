"""Print every figure of docs/alignment.md, from the data in ../shared.

    python tests/bench/alignment.py [times] [doubts] [voices] [prompts] [cost] [long]

Thresholds and weights were fitted on every other line (the 1st, 3rd, … by name), see
tests/bench/train_confidence.py; ``doubts`` uses the other lines only.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import soundfile
from damage import (
    GRID,
    MISMATCHED,
    PROMPT_LANGUAGES,
    SHARED,
    Case,
    RealLine,
    cases,
    grid_lines,
    prompt_lines,
)
from two_pass import TwoPass

from animeme.contracts import Alignment
from animeme.errors import InputError
from animeme.phones import SILENCE
from animeme_stages.align.aligner import OFFSET_S, PocketSphinxAligner
from animeme_stages.ingest.audio import read_speech

TEST_SEED = 7
ALIGNER = PocketSphinxAligner()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", choices=[[], *PARTS], default=[])
    for part in parser.parse_args().parts or PARTS:
        print(f"\n== {part}", flush=True)
        PARTS[part]()


def outcome(case: Case, voice: Path | None = None) -> tuple[str, float, str]:
    """Status, confidence (0 if refused) and what was found."""
    try:
        found = ALIGNER.align(
            read_speech(case.line.audio),
            " ".join(case.words),
            language=case.line.language,
            voice=voice,
        )
    except InputError as error:
        return "failed", 0.0, f"{error.code}: {error.problem}"
    said = "; ".join(f"{finding.code}: {finding.message}" for finding in found.findings)
    return "review" if found.findings else "ok", found.score or 0.0, said


def outcomes(found: Iterable[Case], voice: Path | None = None) -> list[tuple[str, float, str]]:
    with get_context("spawn").Pool() as pool:
        return pool.map(partial(outcome, voice=voice), list(found), chunksize=8)


def times() -> None:
    """Word and phone starts against others' labels."""
    reference = json.loads((GRID.parent / "word_times.json").read_text(encoding="utf-8"))
    off: list[tuple[int, float]] = []
    statuses: Counter[str] = Counter()
    for line in grid_lines():
        found = ALIGNER.align(read_speech(line.audio), " ".join(line.words), language="en")
        statuses["review" if found.findings else "ok"] += 1
        labels = [row for row in reference[line.id] if row[2] not in ("sil", "sp")]
        pairs = zip(found.track.words, labels, strict=True)
        off += [(at, word.start_s - row[0]) for at, (word, row) in enumerate(pairs)]
    print(f"grid-s1, {statuses.total()} right lines: {dict(statuses)}")
    place, shift = np.array(off).T
    for name, chosen in (("all words", place >= 0), ("all but the first", place > 0)):
        for what, less in (("as they are", 0.0), ("less 7.8 ms, which the corpus lacks", OFFSET_S)):
            print(f"grid-s1 word starts, {name}, {what}: {_spread(shift[chosen] - less)}")
    print(f"phone starts against hand labels: {_spread(_hand_labels(_ours))}")
    print(f"the same, PocketSphinx in two passes: {_spread(_hand_labels(_two_passes))}")


def _spread(off_s: np.ndarray[Any, np.dtype[np.float64]]) -> str:
    size = np.abs(off_s) - 1e-6
    return (
        f"n {len(off_s)}, median {np.median(size) * 1000:.1f} ms, "
        + ", ".join(
            f"{np.mean(size <= limit):.1%} ≤ {limit * 1000:.0f} ms" for limit in (0.02, 0.05)
        )
        + f", bias {np.median(off_s) * 1000:+.1f} ms"
    )


Starts = list[tuple[str, float]]
# What the labels have as one sound: (line, first phone, second phone).
JOINED = {("bobby", "P", "T"), ("mary", "AH", "L")}
SPOKEN = {"bobby": "bobby ripped the ledger", "mary": "mary rolled the barrel"}


def _hand_labels(aligned: Callable[[Path, str], Starts]) -> Any:
    """Our phone starts less those of the two hand-labelled sentences, seconds."""
    folder = SHARED / "phone-labels"
    off: list[float] = []
    for name, labels in (("bobby", "bobby_phones.TextGrid"), ("mary", "mary.TextGrid")):
        ours: Starts = []
        for phone, start_s in aligned(folder / f"{name}.wav", SPOKEN[name]):
            if not (ours and (name, ours[-1][0], phone) in JOINED):
                ours.append((phone, start_s))
        starts = _labelled(folder / labels)
        assert len(ours) == len(starts), (ours, starts)
        off += [start_s - at_s for (_, start_s), at_s in zip(ours, starts, strict=True)]
    return np.array(off)


def _labelled(path: Path) -> list[float]:
    from praatio import textgrid

    grid = textgrid.openTextgrid(str(path), includeEmptyIntervals=False)
    tier = next(name for name in grid.tierNames if "phone" in name)
    return [entry.start for entry in grid.getTier(tier).entries if entry.label.strip()]


def _ours(audio: Path, text: str) -> Starts:
    track = ALIGNER.align(read_speech(audio), text, language="en").track
    return [(p.symbol, p.start_s) for p in track.phones if p.symbol != SILENCE]


def _two_passes(audio: Path, text: str) -> Starts:
    found = TwoPass().align(read_speech(audio).samples, text.split())
    assert found is not None
    return [(name, start * 0.01 + OFFSET_S) for *_, phones in found for name, start, _ in phones]


def doubts() -> None:
    """Wrong transcripts, on lines that nothing was fitted on."""
    sets: list[tuple[str, tuple[RealLine, ...], int]] = [("grid-s1", grid_lines()[1::2], 2)]
    sets += [(f"prompts {tag}", prompt_lines(tag)[1::2], 3) for tag in PROMPT_LANGUAGES]
    for name, lines, each in sets:
        damaged = list(cases(lines, TEST_SEED, each))
        print(f"{name}, {len(lines)} lines that nothing was fitted on:")
        _print_doubts(damaged, outcomes(damaged))


def voices() -> None:
    """The same with a voice that the other half of each speaker's lines taught."""
    sets: list[tuple[str, tuple[RealLine, ...], int]] = [("grid-s1", grid_lines(), 2)]
    sets += [(f"prompts {tag}", prompt_lines(tag), 3) for tag in PROMPT_LANGUAGES]
    with tempfile.TemporaryDirectory() as folder:
        for name, lines, each in sets:
            for share in (1, 8) if name == "grid-s1" else (1,):
                voice = Path(folder) / f"{name} {share}.voice"
                teaching = lines[:: 2 * share]
                started = time.process_time()
                learned = ALIGNER.learn_voice(
                    ((read_speech(line.audio), " ".join(line.words)) for line in teaching),
                    voice,
                    language=lines[0].language,
                )
                used_s = time.process_time() - started
                print(f"{name}, a voice of {learned}, {used_s:.0f} CPU-s, {_size(voice)}:")
                damaged = list(cases(lines[1::2], TEST_SEED, each))
                _print_doubts(damaged, outcomes(damaged, voice))


def _size(path: Path) -> str:
    return f"{path.stat().st_size / 1e6:.1f} MB"


def _print_doubts(damaged: Sequence[Case], found: Sequence[tuple[str, float, str]]) -> None:
    kinds: dict[str, list[tuple[str, float]]] = {}
    for case, (status, score, _) in zip(damaged, found, strict=True):
        kinds.setdefault(case.kind, []).append((status, score))
    for kind, rows in kinds.items():
        statuses = Counter(status for status, _ in rows)
        flagged = 1 - statuses["ok"] / len(rows)
        print(f"  {kind}: {flagged:.1%} not ok of {len(rows)} {dict(statuses)}")
    right = np.array([score for _, score in kinds["right"]])
    print("  ROC (false alarms: share found)")
    for alarms in (0.005, 0.01, 0.02, 0.05):
        bar = np.quantile(right, alarms)
        shares = ", ".join(
            f"{kind} {np.mean([score <= bar for _, score in rows]):.1%}"
            for kind, rows in kinds.items()
            if kind != "right"
        )
        print(f"    {alarms:.1%}: {shares}")


def prompts() -> None:
    """The five languages' prompts, line by line where something is wrong."""
    for tag in PROMPT_LANGUAGES:
        lines = prompt_lines(tag)
        found = outcomes(Case(line, "right", line.words) for line in lines)
        print(f"{tag}: {dict(Counter(status for status, *_ in found))}")
        for line, (status, score, said) in zip(lines, found, strict=True):
            if status != "ok":
                known = " (known: transcript and recording differ)"
                mark = known if (tag, line.id) in MISMATCHED else ""
                print(f"  {line.id}: {status}, {score:.2f}, {said}{mark}")


def cost() -> None:
    """CPU of the whole command against a plain loop of two passes, alternately."""
    loop, command = [], []
    for _ in range(3):
        loop.append(_cpu_s([sys.executable, __file__, "--loop"]))
        with tempfile.TemporaryDirectory() as folder:
            argument = ["align", str(GRID), "--output", folder, "--workers", "1", "--json"]
            command.append(_cpu_s([str(Path(sys.executable).with_name("animeme")), *argument]))
    print(f"two-pass loop, its own CPU-seconds without decoding files: {_loop_own()}")
    print(f"two-pass loop, the whole process: {loop}")
    print(f"animeme align, the whole command: {command}")
    print(f"ratio of medians: {np.median(command) / np.median(loop):.2f}")


def _cpu_s(command: list[str]) -> float:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        command,
        check=False,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=_environment(),
    )
    assert done.returncode in (0, 1), command
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return round(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, 1)


def _environment() -> dict[str, str]:
    return os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


def _loop_own() -> float:
    """CPU-seconds of the two passes over all 700 lines, their samples in memory."""
    lines = [(read_speech(line.audio).samples, line.words) for line in grid_lines()]
    started = time.process_time()
    decoder = TwoPass()
    for samples, words in lines:
        decoder.align(samples, words)
    return round(time.process_time() - started, 1)


def _loop() -> None:
    decoder = TwoPass()
    for line in grid_lines():
        samples, _ = soundfile.read(line.audio, dtype="int16")
        decoder.align(samples, line.words)


def long() -> None:
    """Memory and cost of long recordings, each in its own process."""
    with tempfile.TemporaryDirectory() as folder:
        for minutes in (5, 10, 30):
            audio, text = Path(folder) / f"{minutes}.wav", Path(folder) / f"{minutes}.txt"
            _long_recording(minutes * 60, audio, text)
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            command = [sys.executable, __file__, "--one", str(audio), str(text)]
            done = subprocess.run(
                command, capture_output=True, text=True, check=True, env=_environment()
            )
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            used_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
            print(f"{minutes} minutes: {used_s:.1f} CPU-s, {done.stdout.strip()}")


def _long_recording(length_s: int, audio: Path, text: Path) -> None:
    """Lines of grid-s1 one after the other."""
    samples, words, total = [], [], 0
    for line in grid_lines() * 2:
        samples.append(read_speech(line.audio).samples)
        words += line.words
        total += len(samples[-1])
        if total >= length_s * 16_000:
            break
    soundfile.write(audio, np.concatenate(samples), 16_000)
    text.write_text(" ".join(words), encoding="utf-8")


def _one(audio: Path, text: Path) -> None:
    found: Alignment = ALIGNER.align(read_speech(audio), text.read_text(), language="en")
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    words = len(found.track.words)
    print(f"{words} words, peak memory {peak_mb:.0f} MB, findings {len(found.findings)}")


PARTS: dict[str, Callable[[], None]] = {
    "times": times,
    "doubts": doubts,
    "voices": voices,
    "prompts": prompts,
    "cost": cost,
    "long": long,
}

if __name__ == "__main__":
    if sys.argv[1:2] == ["--loop"]:
        _loop()
    elif sys.argv[1:2] == ["--one"]:
        _one(Path(sys.argv[2]), Path(sys.argv[3]))
    else:
        main()
