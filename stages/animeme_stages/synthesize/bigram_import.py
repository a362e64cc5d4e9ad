"""Curve sets as they were published with the 2013 paper, to ``bigrams`` documents."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from animeme import documents
from animeme.documents import suggestion
from animeme.errors import InputError
from animeme.findings import Finding, Severity
from animeme.phones import ARPABET_TO_IPA
from animeme_stages.synthesize.bigram_files import (
    SCHEMA,
    pose_names,
    shipped_names,
)
from animeme_stages.synthesize.bigram_set import COMMON, PAUSE, BigramSet

# More phones, pairs or curves than this are counted, not named.
_NAMED = 8
_PAUSES = frozenset({"_", "sil", "pau", "sp", "spn"})


def import_bigrams(
    path: Path,
    *,
    phones: Mapping[str, str],
    poses: str | None = None,
    source: str = "",
    licence: str = "",
) -> tuple[dict[str, Any], tuple[Finding, ...]]:
    """The ``bigrams`` document of a published set.

    Args:
        path: JSON with ``{"diphones": {"l|ow": {"open": [[t, weight], …]}}}``.
        phones: name in the file → common class, for names that are neither a class nor ARPAbet.
        poses: shipped name or file of the set whose poses these are; None finds a shipped one.
        source, licence: of the curves.

    Returns:
        The document, and what could not be taken over.

    Raises:
        InputError: the file is no such set, or nothing in it can be used.
    """
    for name, target in phones.items():
        if target not in (*COMMON, PAUSE):
            raise InputError(
                "bigrams-class", f"'{target}' is no common phone, for '{name}' to become",
                place="--map", action=suggestion(target, (*COMMON, PAUSE)),
            )  # fmt: skip
    table = _diphones(path)
    findings: list[Finding] = []
    pairs = _pairs(table, phones, findings, str(path))
    if not pairs:
        raise InputError(
            "bigrams-empty", "has no pair that could be used", place=str(path),
            action="Give it phones of the common set or of ARPAbet, or say what they are: "
            "--map NAME=CLASS.",
        )  # fmt: skip
    used = dict.fromkeys(pose for entry in pairs.values() for pose in entry["curves"])
    base = poses if poses is not None else _base_for(used)
    known = pose_names(base) if base else frozenset()
    findings += _about_poses([pose for pose in used if pose not in known], str(path))
    document: dict[str, Any] = {"schema": SCHEMA, "name": path.stem}
    if base:
        document["extends"] = base
    document |= {"source": source or path.name, "licence": licence, "pairs": pairs}
    return document, tuple(findings)


def _diphones(path: Path) -> dict[str, Any]:
    data = documents.parse_file(path)
    table = data.get("diphones")
    if isinstance(table, dict) and all(isinstance(entry, dict) for entry in table.values()):
        return table
    own = data.get("schema") == SCHEMA
    raise InputError(
        "bigrams-format",
        "is a set of bigrams already" if own else 'has no table "diphones" of pairs and poses',
        place=str(path),
        action="Use it as it is: name it as the job's [model] file."
        if own
        else 'Give a file with {"diphones": {"l|ow": {"open": [[time, weight], …]}}}.',
    )


def _pairs(
    table: Mapping[str, Any], phones: Mapping[str, str], findings: list[Finding], place: str
) -> dict[str, Any]:
    """Pair of common phones → its entry, sorted."""
    found: dict[str, tuple[str, Any]] = {}
    strange: dict[str, list[str]] = defaultdict(list)
    twice: list[str] = []
    broken: list[str] = []
    # A pair that has a common name goes before one that is mapped to it.
    for pair in sorted(table, key=lambda p: (_is_foreign(p), p)):
        halves = pair.split("|")
        classes = [_class_of(half, phones) for half in halves]
        unknown = [half for half, name in zip(halves, classes, strict=True) if name is None]
        if len(halves) != 2 or unknown:
            for half in unknown or [pair]:
                strange[half].append(pair)
            continue
        target = "|".join(name for name in classes if name is not None)
        if target in found:
            twice.append(f"{pair} (there is {found[target][0]})")
            continue
        curves = {}
        for pose, points in table[pair].items():
            keys = _keys(points)
            if keys is None:
                broken.append(f"{pose} in {pair}")
            else:
                curves[pose] = keys
        found[target] = pair, {"curves": curves, **_note(pair, target)}
    findings += _about(strange, twice, broken, place)
    return {target: entry for target, (_, entry) in sorted(found.items())}


def _note(pair: str, target: str) -> dict[str, str]:
    return {} if pair == target else {"note": f"imported from {pair}"}


def _is_foreign(pair: str) -> bool:
    return any(half not in COMMON and half != PAUSE for half in pair.split("|"))


def _class_of(name: str, phones: Mapping[str, str]) -> str | None:
    if name in phones:
        return phones[name]
    if name in COMMON:
        return name
    if name.lower() in _PAUSES:
        return PAUSE
    ipa = ARPABET_TO_IPA.get(name.upper())
    return BigramSet({}, ()).class_of(ipa) if ipa else None


def _keys(points: Any) -> list[list[float]] | None:
    """Keys within 0 and 1, as hand-drawn ones often are not quite; None if they make no sense."""
    try:
        keys = [[min(max(float(t), 0.0), 1.0), float(w)] for t, w in points]
    except (TypeError, ValueError):
        return None
    times = [t for t, _ in keys]
    usable = len(keys) >= 2 and times == sorted(times) and times[0] < times[-1]
    return keys if usable and all(math.isfinite(w) for _, w in keys) else None


def _base_for(poses: Iterable[str]) -> str | None:
    """The shipped poses that know most of `poses`, None if they know none of them."""
    wanted = set(poses)
    candidates = [name for name in shipped_names() if name.endswith("-poses")]
    best = max(candidates, key=lambda name: len(wanted & pose_names(name)))
    return best if wanted & pose_names(best) else None


def _about(
    strange: Mapping[str, list[str]], twice: list[str], broken: list[str], place: str
) -> Iterator[Finding]:
    if strange:
        each = ", ".join(f"'{name}' ({len(pairs)} pairs)" for name, pairs in strange.items())
        yield Finding(
            Severity.WARNING, "bigrams-phone-unmapped",
            f"phones of no common class, and the pairs with them, were left out: {each}",
            place=place, action="Say which class they are: --map NAME=CLASS.",
        )  # fmt: skip
    if twice:
        yield Finding(
            Severity.WARNING, "bigrams-pair-twice",
            f"pairs that became one that is there already were left out: {_listed(twice)}",
            place=place, action="Nothing, unless these are the better ones.",
        )  # fmt: skip
    if broken:
        yield Finding(
            Severity.WARNING, "bigrams-curve-broken",
            f"curves without two finite keys in the order of time were left out: {_listed(broken)}",
            place=place, action="Draw them again.",
        )  # fmt: skip


def _about_poses(poses: list[str], place: str) -> Iterator[Finding]:
    if poses:
        yield Finding(
            Severity.WARNING, "bigrams-pose-unknown",
            f"poses that no shipped table knows drive a control of their name: {_listed(poses)}",
            place=place,
            action="Give them controls in the set's \"poses\", or a rig profile with these names.",
        )  # fmt: skip


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + more
