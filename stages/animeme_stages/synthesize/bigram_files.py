"""``bigrams`` documents: read, with what they extend, and written."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import numpy as np

from animeme import documents
from animeme.curves import Floats
from animeme.documents import suggestion
from animeme.documents.bigrams import BigramsDocument
from animeme.errors import InputError
from animeme.phones import SILENCE, plain_ipa
from animeme_stages.synthesize.bigram_set import COMMON, PAUSE, BigramSet, polygon

SCHEMA = "animeme.bigrams/1"
_FOLDER = files("animeme_stages.synthesize").joinpath("bigram_sets")
_SUFFIXES = (".json", ".toml")
# What holds where a set says nothing.
SPEED = 15.0
HOLD_S = 0.4
# A pause next to speech is felt for half of this.
PAUSE_HOLD_S = 0.2
# No set is built on more others than this.
_MOST_BASES = 16


@dataclass(frozen=True)
class DrawnSet:
    """An animator's bigrams with everything that they extend.

    Attributes:
        set_: the polygons, over poses.
        poses: pose → control → weight; a pose without an entry drives the control of its name.
        window_s, speed, hold_s: see `BigramsDocument`.
        credits: source and licence of every set that it is made of.
        owners: pair → the file or shipped name that it is from.
        name: for people.
    """

    set_: BigramSet
    poses: Mapping[str, Mapping[str, float]]
    window_s: float
    speed: float
    hold_s: float
    credits: str = ""
    owners: Mapping[str, str] | None = None
    name: str = ""

    @property
    def pause_hold_s(self) -> float:
        """A longer pause rests in its middle."""
        return min(PAUSE_HOLD_S, self.hold_s)

    def driven_by(self, pose: str) -> Mapping[str, float]:
        """Controls of a pose and their weights."""
        return self.poses.get(pose, {pose: 1.0})

    @cached_property
    def controls(self) -> tuple[str, ...]:
        """N names, in the order in which poses name them."""
        return tuple(dict.fromkeys(c for pose in self.set_.poses for c in self.driven_by(pose)))

    @cached_property
    def matrix(self) -> Floats:
        """Controls at weight 1 of each pose, shape (K, N)."""
        made = np.zeros((len(self.set_.poses), len(self.controls)))
        for row, pose in enumerate(self.set_.poses):
            for control, weight in self.driven_by(pose).items():
                made[row, self.controls.index(control)] = weight
        return made

    def to_json(self) -> dict[str, Any]:
        """A ``bigrams`` document that extends nothing."""
        limits = sorted((*sorted(pair), limit) for pair, limit in self.set_.limits.items())
        return {
            "schema": SCHEMA,
            "name": self.name,
            "source": self.credits,
            "phones": {name: list(symbols) for name, symbols in self.set_.classes.items()},
            "poses": {p: dict(self.driven_by(p)) for p in (*self.poses, *self.set_.poses)},
            "conflicts": [{"poses": [a, b], "limit": limit} for a, b, limit in limits],
            "priority": list(self.set_.priority),
            "window_s": self.window_s,
            "speed": self.speed,
            "hold_s": self.hold_s,
            "pairs": {p: {"curves": curves} for p, curves in self.set_.to_json().items()},
        }


def shipped_names() -> tuple[str, ...]:
    """Names of the shipped sets, sorted."""
    return tuple(sorted(Path(file.name).stem for file in _FOLDER.iterdir()
                        if file.name.endswith(_SUFFIXES)))  # fmt: skip


@lru_cache(maxsize=8)
def shipped_set(name: str) -> DrawnSet:
    """The shipped set called `name`; `shipped_names` lists them."""
    return _drawn(_chain(_shipped(name), name, ()))


def read_set(path: Path) -> DrawnSet:
    """The set in a ``bigrams`` document.

    Raises:
        InputError: it, or one that it extends, is broken or missing.
    """
    return _drawn(_chain(documents.read("bigrams", path), str(path), ()))


def find_set(name_or_file: str) -> DrawnSet:
    """A shipped set by name, or the one in a file.

    Raises:
        InputError: there is none, or it is broken.
    """
    if name_or_file in shipped_names():
        return shipped_set(name_or_file)
    if Path(name_or_file).suffix.lower() not in _SUFFIXES:
        raise _unknown(name_or_file, name_or_file)
    return read_set(Path(name_or_file))


def pose_names(name_or_file: str) -> frozenset[str]:
    """Poses that a set gives controls to.

    Raises:
        InputError: there is no such set, or it is broken.
    """
    return frozenset(find_set(name_or_file).poses)


def drawn_from_json(entry: Mapping[str, Any]) -> DrawnSet:
    """Read what `DrawnSet.to_json` gave.

    Raises:
        ValueError: it makes no sense.
    """
    try:
        document = BigramsDocument.model_validate(entry)
    except ValueError as error:
        raise ValueError(f"its bigrams make no sense: {error.args or error}") from error
    return _merged([("", document.model_dump(mode="json", by_alias=True))])


def write_set(document: Mapping[str, Any]) -> str:
    """The text of a ``bigrams`` document: a line for each pose of a pair, to be edited by hand."""
    head = {key: value for key, value in document.items() if key != "pairs"}
    text = json.dumps(head, ensure_ascii=False, indent=1).removesuffix("\n}")
    entries = []
    for pair, entry in document["pairs"].items():
        curves = ",\n".join(f"    {_text(p)}: {_text(keys)}" for p, keys in entry["curves"].items())
        note = f',\n   "note": {_text(entry["note"])}' if entry.get("note") else ""
        entries.append(f'  {_text(pair)}: {{"curves": {{\n{curves}\n   }}{note}}}')
    return f'{text},\n "pairs": {{\n' + ",\n".join(entries) + "\n }\n}\n"


def _text(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def _shipped(name: str) -> dict[str, Any]:
    (file,) = (f for f in _FOLDER.iterdir() if f.name in {name + s for s in _SUFFIXES})
    with as_file(file) as path:
        return documents.read("bigrams", path)


def _chain(document: dict[str, Any], place: str, above: tuple[str, ...]) -> list[tuple[str, Any]]:
    """The document and all that it extends, the first base first, each with its place."""
    base = document["extends"]
    if base is None:
        return [(place, document)]
    above = (*above, place)
    if base in shipped_names():
        found, where = _shipped(base), base
    else:
        if Path(base).suffix.lower() not in _SUFFIXES:
            raise _unknown(base, place)
        file = Path(place).parent / base
        found, where = documents.read("bigrams", file), str(file)
    if len(above) > _MOST_BASES or any(_same_file(where, seen) for seen in above):
        raise InputError(
            "bigrams-circular", f"extends itself by way of '{base}'", place=place,
            action="Let the first set of the chain extend nothing.",
        )  # fmt: skip
    return [*_chain(found, where, above), (place, document)]


def _same_file(one: str, other: str) -> bool:
    return one == other or Path(one).resolve() == Path(other).resolve()


def _unknown(name: str, place: str) -> InputError:
    return InputError(
        "bigrams-not-found",
        f"there is no set of bigrams '{name}'",
        place=place,
        action=f"{suggestion(name, shipped_names())} A file of your own ends in .json or .toml.",
    )


def _drawn(chain: Sequence[tuple[str, Any]]) -> DrawnSet:
    try:
        return _merged(chain)
    except ValueError as error:
        raise InputError(
            "bigrams-invalid", str(error), place=chain[-1][0],
            action="Correct the set; docs/bigrams.md says what it may hold.",
        ) from error  # fmt: skip


def _merged(chain: Sequence[tuple[str, Any]]) -> DrawnSet:
    """One set of all; what comes later goes before.

    Raises:
        ValueError: something makes no sense; says what.
    """
    classes: dict[str, tuple[str, ...]] = dict(COMMON)
    pairs: dict[str, Any] = {}
    owners: dict[str, str] = {}
    poses: dict[str, dict[str, float]] = {}
    limits: dict[frozenset[str], float] = {}
    priority: tuple[str, ...] = ()
    settings = {"window_s": 0.0, "speed": SPEED, "hold_s": HOLD_S}
    credits: dict[str, None] = {}
    for index, (place, document) in enumerate(chain):
        if document["phones"]:
            classes = _classes({} if index == 0 else classes, document["phones"])
        poses |= document["poses"]
        pairs |= document["pairs"]
        owners |= dict.fromkeys(document["pairs"], place)
        limits |= {frozenset(c["poses"]): c["limit"] for c in document["conflicts"]}
        priority = tuple(document["priority"]) or priority
        settings |= {k: document[k] for k in settings if document[k] is not None}
        said = "; ".join(filter(None, (document["source"], document["licence"])))
        credits |= {said: None} if said else {}
    names = dict.fromkeys(p for entry in pairs.values() for p in entry["curves"])
    ordered = (*(p for p in poses if p in names), *(p for p in names if p not in poses))
    strange = [p for p in (*priority, *(p for pair in limits for p in pair))
               if p not in names and p not in poses]  # fmt: skip
    if strange:
        raise ValueError(f"there is no pose '{strange[0]}' in it to give way or to conflict")
    made = BigramSet(_polygons(pairs, ordered, classes), ordered, classes, limits, priority)
    return DrawnSet(
        made, poses, settings["window_s"], settings["speed"], settings["hold_s"],
        " · ".join(credits), owners, chain[-1][1]["name"],
    )  # fmt: skip


def _classes(
    old: Mapping[str, tuple[str, ...]], new: Mapping[str, Sequence[str]]
) -> dict[str, tuple[str, ...]]:
    """The classes after a set has named some of them; a phone is in the last that names it."""
    named: dict[str, str] = {}
    for name, symbols in new.items():
        if name == PAUSE or not name or set(name) & set("|*+ "):
            raise ValueError(f"'{name}' cannot be a class of phones")
        for symbol in map(plain_ipa, symbols):
            if named.setdefault(symbol, name) != name or symbol in ("", SILENCE):
                raise ValueError(f"the phone '{symbol}' is in two classes, or none")
    kept = {n: tuple(s for s in symbols if s not in named) for n, symbols in old.items()}
    kept |= {name: tuple(dict.fromkeys(map(plain_ipa, symbols))) for name, symbols in new.items()}
    if not any(kept.values()):
        raise ValueError("its classes hold no phone")
    return kept


def _polygons(
    pairs: Mapping[str, Any], poses: Sequence[str], classes: Mapping[str, Any]
) -> dict[str, dict[str, list[tuple[float, float]]]]:
    found = {}
    for pair, entry in pairs.items():
        halves = pair.split("|")
        if len(halves) != 2:
            raise ValueError(f"'{pair}' is not a pair first|second")
        for half in halves:
            if half not in (PAUSE, "*") and half not in classes:
                raise ValueError(
                    f"'{half}' in the pair '{pair}' is no class of phones. "
                    f"{suggestion(half, (*classes, PAUSE))}"
                )
        found[pair] = {
            pose: polygon(pose, pair, points, poses) for pose, points in entry["curves"].items()
        }
    return found
