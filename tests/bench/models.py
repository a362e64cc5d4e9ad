"""Held-out error of every model on captured speech: the figures of docs/models.md.

    python tests/bench/models.py ../shared/data/grid-s1/lines --words --json models.json

Folds go by line; with --words, whole words are held out instead (every line that has one is out of
training), and scored inside those words only. Alignment is the slow part; --tracks keeps it.
"""

from __future__ import annotations

import argparse
import copy
import itertools
import json
import pickle
import time
from pathlib import Path
from typing import Any

import numpy as np

import animeme
from animeme.dataset import CapturedLine, Dataset, folds
from animeme.phones import Phone, PhoneTrack
from animeme.scoring import RATE_HZ, captured_recall, judge
from animeme.training import parse_model
from animeme_stages.synthesize.contacts import Contacts

FOUR = ("lip_gap", "lip_width", "jaw_drop", "lower_lip")
BASE = "dam:degree=0,modes=none,normalise=no,spread=lengths,sigma=1,contacts=no"
MODELS = {
    "dam": "dam",
    "dam, no contacts": "dam",
    "dam, one mode": "dam:modes=none,contacts=no",
    "dam 2012, one mode": "dam:modes=none,normalise=no,spread=lengths,sigma=1,contacts=no",
    "dam 2012, affinity": "dam:modes=affinity,normalise=no,spread=lengths,sigma=1,contacts=no",
    "dam-2009": "dam-2009",
    "CM (degree 0)": BASE,
    "CM (degree 0, normalised)": "dam:degree=0,modes=none,contacts=no",
    "cohen-massaro, fitted": "cohen-massaro",
    "mmm": "mmm",
    "mmm, statistics": "mmm:steps=0",
    "bigram": "bigram",
}
# The same fitted model without the contacts that are laid over its motion.
BARE = ("dam, no contacts",)
# Tracks of this many phones show that synthesis takes time in proportion to length.
LENGTHS = (10, 100, 1000, 10000)
SLOW = ("dam 2012, affinity", "dam-2009", "dam 2012, one mode")


def inside_words(line: CapturedLine, words: frozenset[str]) -> np.ndarray:
    """Which frames lie in one of `words`."""
    at = np.zeros(len(line.times_s), dtype=bool)
    for word in line.track.words:
        if word.text in words:
            at |= (line.times_s >= word.start_s) & (line.times_s < word.end_s)
    return at


def word_splits(dataset: Dataset, count: int) -> list[frozenset[str]]:
    """Sets of words to hold out: every 12th of all words, from different starts."""
    words = sorted({word.text for line in dataset.lines for word in line.track.words})
    return [frozenset(words[k * 4 :: 12]) for k in range(count)]


def splits(dataset: Dataset, arguments: argparse.Namespace) -> list[tuple[Dataset, Dataset, str]]:
    """Lines to fit and lines to judge by."""
    if arguments.words:
        found = []
        for words in word_splits(dataset, arguments.folds):
            has = [any(w.text in words for w in line.track.words) for line in dataset.lines]
            fitted = [line for line, out in zip(dataset.lines, has, strict=True) if not out]
            judged = []
            for line, out in zip(dataset.lines, has, strict=True):
                if out:
                    at = inside_words(line, words)
                    if at.any():
                        values = np.where(at[:, None], line.values, np.nan)
                        judged.append(CapturedLine(line.id, line.track, line.times_s, values))
            name = " ".join(sorted(words))
            found.append((dataset.subset(fitted), dataset.subset(judged), name))
        return found
    parts = folds(dataset, 5)[: arguments.folds]
    return [
        (
            dataset.subset([line for i, line in enumerate(dataset.lines) if i not in set(held)]),
            dataset.subset([dataset.lines[i] for i in held]),
            f"fold {number + 1}",
        )
        for number, held in enumerate(parts)
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--words", action="store_true")
    parser.add_argument("--folds", type=int, default=5)
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--lengths", action="store_true", help="time synthesis by length, too")
    parser.add_argument("--fast", action="store_true", help="leave out the slowest models")
    parser.add_argument("--tracks", type=Path, help="pickle of the read dataset, made if absent")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    if arguments.tracks and arguments.tracks.exists():
        dataset = pickle.loads(arguments.tracks.read_bytes())
    else:
        dataset = animeme.read_dataset(arguments.folder, workers=2)
        if arguments.tracks:
            arguments.tracks.write_bytes(pickle.dumps(dataset))
    names = [
        name
        for name in MODELS
        if (not arguments.only or name in arguments.only) and not (arguments.fast and name in SLOW)
    ]
    table: dict[str, list[dict[str, float]]] = {name: [] for name in names}
    for fitted, judged, label in splits(dataset, arguments):
        own = captured_recall(judged) if not arguments.words else None
        print(f"{label}: {len(fitted.lines)} lines fitted, {len(judged.lines)} judged, {own}")
        models: dict[str, tuple[Any, float]] = {}
        for name in names:
            if MODELS[name] not in models:
                started = time.process_time()
                model = animeme.train(fitted, *parse_model(MODELS[name]))
                models[MODELS[name]] = (model, time.process_time() - started)
            model, cpu_s = models[MODELS[name]]
            if name in BARE:
                model = copy.copy(model)
                model.contacts_ = Contacts()
            score, _ = judge(model, judged)
            size = len(json.dumps(model.to_document()))
            row = {k: float(v or np.nan) for k, v in score.rmse.items()}
            row |= {
                "closed": float(score.closure_recall or 0.0),
                "train_cpu_s": cpu_s,
                "us_per_phone": score.synthesis_us_per_phone,
                "bytes": size,
            }
            table[name].append(row)
            cells = " ".join(f"{row[k]:.4f}" for k in dataset.controls)
            print(f"  {name:26} {cells} {row['closed']:.3f} {cpu_s:6.1f} s", flush=True)
        if arguments.lengths and "dam" in models:
            report_lengths(models["dam"][0], dataset)
    report(table, dataset.controls)
    if arguments.json:
        arguments.json.write_text(json.dumps(table, indent=1))


def long_track(dataset: Dataset, phones: int) -> PhoneTrack:
    """The lines of `dataset` one after another, until there are so many phones."""
    found: list[Phone] = []
    start_s = 0.0
    for line in itertools.cycle(dataset.lines):
        for phone in line.track.phones[: phones - len(found)]:
            end_s = start_s + phone.duration_s
            found.append(Phone(phone.symbol, start_s, end_s))
            start_s = end_s
        if len(found) == phones:
            break
    first = dataset.lines[0].track
    return PhoneTrack(first.language, first.inventory, tuple(found))


def report_lengths(model: Any, dataset: Dataset) -> None:
    """CPU time of synthesis by the length of what is said; the least of several runs."""
    for phones in LENGTHS:
        track = long_track(dataset, phones)
        took_s = []
        for _ in range(max(2, 1000 // phones)):
            started = time.process_time()
            model.synthesize(track, rate_hz=RATE_HZ)
            took_s.append(time.process_time() - started)
        each_us = 1e6 * min(took_s) / phones
        print(
            f"  {phones} phones, {track.duration_s:.0f} s: {each_us:.1f} µs per phone, "
            f"{each_us / len(dataset.controls):.2f} per phone and control",
            flush=True,
        )


def report(table: dict[str, list[dict[str, float]]], controls: tuple[str, ...]) -> None:
    """Means over the folds, and ratios to each baseline."""
    means = {
        n: {k: float(np.mean([r[k] for r in rows])) for k in rows[0]} for n, rows in table.items()
    }
    print("\nmodel | " + " | ".join(controls) + " | closed | training, CPU s | µs/phone | kB")
    for name, row in means.items():
        cells = " | ".join(f"{row[k]:.4f}" for k in controls)
        print(
            f"{name} | {cells} | {row['closed']:.1%} | {row['train_cpu_s']:.0f} | "
            f"{row['us_per_phone']:.0f} | {row['bytes'] / 1000:.0f}"
        )
    print("\nmean of ratios over " + ", ".join(FOUR))
    for base in ("CM (degree 0)", "CM (degree 0, normalised)", "cohen-massaro, fitted", "mmm"):
        if base in means:
            for name, row in means.items():
                ratio = np.mean([row[k] / means[base][k] for k in FOUR])
                print(f"  {name} / {base}: {ratio:.3f}")


if __name__ == "__main__":
    main()
