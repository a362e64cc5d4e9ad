"""Fit ``confidence.json``: how sure an alignment is, from lines with right and damaged transcripts.

    python tests/bench/train_confidence.py [--jobs 2]

Trains on every other line (the 1st, 3rd, … by name) of grid-s1 and of the prompts; tests/bench/
alignment.py tests on the others. The score of a line is the log-sum-exp of linear scores of its
places, fitted by maximum likelihood with a quadratic penalty (multiple-instance logistic
regression): it is told that a transcript is wrong, never where.
"""

from __future__ import annotations

import argparse
import json
import pickle
from collections.abc import Iterable, Mapping, Sequence
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from damage import (
    MISMATCHED,
    PROMPT_LANGUAGES,
    Case,
    RealLine,
    cases,
    grid_lines,
    prompt_lines,
)
from numpy.typing import NDArray
from scipy.optimize import minimize

from animeme_stages.align import confidence
from animeme_stages.align.acoustic.adaptation import adapted
from animeme_stages.align.acoustic.hear import Heard, UnsayableError, hear
from animeme_stages.align.acoustic.model import AcousticModel, acoustic_model
from animeme_stages.align.aligner import sounds_of, spoken_words
from animeme_stages.align.confidence import (
    FURTHEST,
    Table,
    calibration_from,
    measures,
    pooled,
    surplus,
    usual_values,
)
from animeme_stages.align.language import language as language_of
from animeme_stages.align.voice import Example, observed
from animeme_stages.ingest.audio import read_speech

Doubles = NDArray[np.float64]
SEED = 2026
EACH = 3
# Lines that the second voice of the English speaker is learned from; the first has all of a half.
# What is fitted has to serve voices of little and of much speech.
FEW = 120
PENALTY = 3e-3
# How much each kind of transcript counts.
SHARE = {"right": 1.0, "another": 0.1, "two removed": 0.2}
SHARE_OF_OTHERS = 0.6
# Right lines of training that may be above a language's threshold.
FALSE_ALARMS = {"en": 0.008, "mapped": 0.02, "en-voice": 0.012, "mapped-voice": 0.02}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--keep", type=Path, help="What was heard: read if there, else written.")
    options = parser.parse_args()
    everything: dict[str, Found] = {}
    if options.keep and options.keep.exists():
        everything = pickle.loads(options.keep.read_bytes())
    for family in sorted(FALSE_ALARMS.keys() - everything.keys()):
        everything[family] = _heard(family, options.jobs)
        if options.keep:
            options.keep.write_bytes(pickle.dumps(everything))
    families = {family: fit(family, everything[family]) for family in FALSE_ALARMS}
    document = {
        "about": "Fitted by tests/bench/train_confidence.py on half of GRID (Cooke et al. 2006, "
        "CC BY 4.0) speaker s1 and of the Asterisk core sounds (CC BY-SA 3.0; ru: CC BY 3.0): "
        "statistics of how phones fit, no recordings.",
        "families": families,
    }
    path = Path(confidence.__file__).with_suffix(".json")
    path.write_text(_compact(document) + "\n", encoding="utf-8")
    print(f"{path.name}: {path.stat().st_size} bytes")


Found = list[tuple[str, str, Heard | None]]
"""(speaker, kind, what was heard: None where the words cannot be said in the time).

A speaker is a language and, where the voice was learned, which part of its lines is judged.
"""


def _heard(family: str, jobs: int) -> Found:
    """What is heard in a family's lines of training."""
    general, of_voices = family.removesuffix("-voice"), family.endswith("-voice")
    prompts = {
        language: [
            line for line in prompt_lines(language)[::2] if (language, line.id) not in MISMATCHED
        ]
        for language in PROMPT_LANGUAGES
        if (language == "en") == (general == "en")
    }
    grid = grid_lines()[::2] if general == "en" else ()
    with get_context("spawn").Pool(jobs) as pool:
        if not of_voices:
            sets = [*((grid,) if grid else ()), *prompts.values()]
            return pool.map(_found, [c for s in sets for c in cases(s, SEED, EACH)], chunksize=16)
        # Each half of a speaker's lines is judged by a voice that the other half taught.
        halves = [(f"prompts {language}", s[::2], s[1::2]) for language, s in prompts.items()]
        speakers = [(f"{name} 1", second, first) for name, first, second in halves]
        speakers += [(f"{name} 2", first, second) for name, first, second in halves]
        if grid:
            speakers += [
                ("grid 1", grid[1::2], grid[::2]),
                ("grid 2", grid[: 2 * FEW : 2], grid[1::2]),
            ]
        parts = pool.map(_found_with_voice, speakers, chunksize=1)
        return [row for part in parts for row in part]


def _found(case: Case, model: AcousticModel | None = None) -> tuple[str, str, Heard | None]:
    samples = read_speech(case.line.audio).samples
    try:
        heard = hear(model or acoustic_model(), samples, _sounds(case))
    except UnsayableError:
        return case.line.language, case.kind, None
    return case.line.language, case.kind, heard


def _sounds(case: Case) -> list[list[tuple[str, ...]]]:
    words = spoken_words(" ".join(case.words), language_of(case.line.language), case.line.id)
    return [sounds_of(word) for word in words]


def _found_with_voice(speaker: tuple[str, Sequence[RealLine], Sequence[RealLine]]) -> Found:
    """Lines that are heard with a voice that other lines taught."""
    name, teaching, judged = speaker
    model = adapted(acoustic_model(), observed(examples(teaching))).of(acoustic_model())
    return [(name, *_found(case, model)[1:]) for case in cases(judged, SEED, EACH)]


def examples(lines: Sequence[RealLine]) -> list[Example]:
    """Right lines, to learn a voice from."""
    made = []
    for line in lines:
        case = Case(line, "right", line.words)
        samples = read_speech(line.audio).samples
        heard = hear(acoustic_model(), samples, _sounds(case))
        made.append(Example(samples, _sounds(case), heard.senones))
    return made


def fit(family: str, found: Found) -> dict[str, Any]:
    """The calibration of a family, in its JSON form."""
    right: dict[str, list[Heard]] = {}
    for speaker, kind, heard in found:
        if kind == "right" and heard:
            right.setdefault(speaker, []).append(heard)
    general = usual_values([heard for lines in right.values() for heard in lines])
    of_voices = family.endswith("-voice")
    usual = {
        speaker: usual_values(lines, general) if of_voices else general
        for speaker, lines in right.items()
    }
    lines = [(who, kind, *measures(heard, usual[who])) for who, kind, heard in found if heard]
    words, gaps = _stacked([line[2] for line in lines]), _stacked([line[3] for line in lines])
    scales = [(table.mean(axis=0), table.std(axis=0) + 1e-6) for table in (words, gaps)]
    sizes = [len(line[2]["without"]) for line in lines]
    kinds = [kind for _, kind, *_ in lines]
    weights = _fitted(kinds, sizes, words, gaps, scales)
    data: dict[str, Any] = {
        "usual": {str(phone): [*value.log_length, *value.loss] for phone, value in general.items()},
        "words": _table(lines[0][2], scales[0], weights[0]),
        "gaps": _table(lines[0][3], scales[1], weights[1]),
        "share": round(weights[2], 4),
        "thresholds": {"": 0.0},
    }
    rough = calibration_from(data)
    scored: dict[str, list[tuple[str, float]]] = {}
    for speaker, kind, word_rows, gap_rows in lines:
        line_score = pooled(rough.words(word_rows), rough.gaps(gap_rows), rough.share)
        scored.setdefault(speaker, []).append((kind, line_score))
    if of_voices:
        thresholds = _of_voices(family, scored)
        data["thresholds"] = {"": round(next(iter(thresholds.values()))[1], 3)}
        _print(family, scored, {speaker: sum(parts) for speaker, parts in thresholds.items()})
    else:
        data["thresholds"] = _thresholds(family, scored)
        _print(family, scored, data["thresholds"])
    return data


def _stacked(tables: Sequence[Table]) -> Doubles:
    return np.vstack([np.column_stack(list(table.values())) for table in tables])


def _fitted(
    kind_of: Sequence[str],
    sizes: Sequence[int],
    words: Doubles,
    gaps: Doubles,
    scales: Sequence[tuple[Doubles, Doubles]],
) -> tuple[tuple[Doubles, float], tuple[Doubles, float], float]:
    """Weights and bias of words and of gaps, and the share of the mean of words."""
    standard = [
        np.clip((table - mean) / deviation, -FURTHEST, FURTHEST)
        for table, (mean, deviation) in zip((words, gaps), scales, strict=True)
    ]
    count = np.array(sizes)
    of_word, of_gap = (
        np.repeat(np.arange(len(sizes)), count),
        np.repeat(np.arange(len(sizes)), count + 1),
    )
    kinds = np.array(kind_of)
    wrong = (kinds != "right").astype(float)
    counts = np.zeros(len(sizes))
    for kind in set(kinds):
        counts[kinds == kind] = SHARE.get(kind, SHARE_OF_OTHERS / 2) / (kinds == kind).sum()
    width = words.shape[1]
    extra = np.array([surplus(2 * size + 1) for size in sizes])

    def loss(free: Doubles) -> tuple[float, Doubles]:
        share = free[-1]
        by_word = standard[0] @ free[1 : 1 + width] + free[0]
        by_gap = standard[1] @ free[2 + width : -1] + free[1 + width]
        highest = np.full(len(sizes), -np.inf)
        np.maximum.at(highest, of_word, by_word)
        np.maximum.at(highest, of_gap, by_gap)
        word_part, gap_part = np.exp(by_word - highest[of_word]), np.exp(by_gap - highest[of_gap])
        total = np.bincount(of_word, word_part) + np.bincount(of_gap, gap_part)
        mean = np.bincount(of_word, by_word) / count
        line = highest + np.log(total) - extra + share * mean
        slope = counts * (1 / (1 + np.exp(-line)) - wrong)
        word_slope = slope[of_word] * (word_part / total[of_word] + share / count[of_word])
        gap_slope = slope[of_gap] * gap_part / total[of_gap]
        gradient = np.concatenate(
            [
                [word_slope.sum()],
                standard[0].T @ word_slope,
                [gap_slope.sum()],
                standard[1].T @ gap_slope,
                [slope @ mean],
            ]
        )
        kept = free.copy()
        kept[[0, 1 + width]] = 0.0
        value = (counts * (np.logaddexp(0, line) - wrong * line)).sum() + PENALTY * kept @ kept
        return float(value), gradient + 2 * PENALTY * kept

    start = np.zeros(3 + width + gaps.shape[1])
    start[[0, 1 + width]] = -2.0
    best = minimize(loss, start, jac=True, method="L-BFGS-B", options={"maxiter": 1000}).x
    return (
        (best[1 : 1 + width], best[0]),
        (best[2 + width : -1], best[1 + width]),
        float(best[-1]),
    )


def _table(
    names: Iterable[str], scale: tuple[Doubles, Doubles], weights: tuple[Doubles, float]
) -> dict[str, Any]:
    rows = zip(names, *scale, weights[0], strict=True)
    return {
        "measures": {name: [round(float(value), 4) for value in row] for name, *row in rows},
        "bias": round(float(weights[1]), 4),
    }


def _thresholds(family: str, scored: Mapping[str, Sequence[tuple[str, float]]]) -> dict[str, float]:
    """Per language, and over all languages for those without lines."""
    right = {
        language: np.array([score for kind, score in rows if kind == "right"])
        for language, rows in scored.items()
    }
    everyone = np.concatenate(list(right.values()))
    allowed = 1 - FALSE_ALARMS[family]
    # Few lines say little about their own tail: each language's own is led towards the common one.
    common = float(np.quantile(everyone - everyone.mean(), allowed))
    found = {language: round(float(rows.mean()) + common, 3) for language, rows in right.items()}
    return {"": round(float(everyone.mean()) + common, 3), **found}


def _of_voices(
    family: str, scored: Mapping[str, Sequence[tuple[str, float]]]
) -> dict[str, tuple[float, float]]:
    """Per speaker the median of right lines, and how far above it the threshold is for all."""
    right = {
        speaker: np.array([score for kind, score in rows if kind == "right"])
        for speaker, rows in scored.items()
    }
    medians = {speaker: float(np.median(rows)) for speaker, rows in right.items()}
    above = np.concatenate([rows - medians[speaker] for speaker, rows in right.items()])
    bar = float(np.quantile(above, 1 - FALSE_ALARMS[family]))
    return {speaker: (median, bar) for speaker, median in medians.items()}


def _print(
    family: str,
    scored: Mapping[str, Sequence[tuple[str, float]]],
    thresholds: Mapping[str, float],
) -> None:
    for language, rows in scored.items():
        kinds: dict[str, list[bool]] = {}
        for kind, line_score in rows:
            kinds.setdefault(kind, []).append(line_score > thresholds[language])
        shares = ", ".join(f"{kind} {np.mean(hits):.1%}" for kind, hits in kinds.items())
        print(f"{family} {language} (trained on): {shares}")


def _compact(document: Any) -> str:
    """JSON with a row per line."""
    text = json.dumps(document, indent=1)
    out: list[str] = []
    for line in text.split("\n"):
        bare = line.strip()
        inside = out and out[-1].rstrip().endswith(("[", ",")) and "[" in out[-1]
        number = bare.rstrip(",").lstrip("-").replace(".", "").replace("e-", "").isdigit()
        if inside and (number or bare in ("]", "],")):
            out[-1] += bare if bare.startswith("]") or out[-1].endswith("[") else " " + bare
        else:
            out.append(line)
    return "\n".join(out)


if __name__ == "__main__":
    main()
