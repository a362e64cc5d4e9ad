"""What each result of a run depends on, in one place.

Every field of what a line's work is given is declared here, or a test fails: with the step whose
result is keyed on it, or with the reason why none is. A step's result depends on its own fields, on
the code of its plug-ins, and on the result of the step before it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, is_dataclass
from fractions import Fraction
from json.encoder import encode_basestring
from os.path import basename
from typing import Any, Literal

from animeme.store.digests import ABSENT

Step = Literal["align", "synthesize", "retarget"]
STEPS: tuple[Step, ...] = ("align", "synthesize", "retarget")


@dataclass(frozen=True)
class Value:
    """Keyed by its value.

    Attributes:
        step: whose result changes with it.
        cause: what people call it.
        also: another step, whose result changes with it too.
    """

    step: Step
    cause: str
    also: Step | None = None


@dataclass(frozen=True)
class File:
    """A path, keyed by the file's name and content; as `Value`."""

    step: Step
    cause: str
    also: Step | None = None


@dataclass(frozen=True)
class Elsewhere:
    """Keyed in a way of its own; `how` says which."""

    how: str


@dataclass(frozen=True)
class Unkeyed:
    """No result depends on it; `why` not."""

    why: str


Declared = Value | File | Elsewhere | Unkeyed
_NAME = Unkeyed("a name, given to results when they are taken up")
_PLACE = Unkeyed("where results are put")

LINE: dict[str, Declared] = {
    "id": _NAME,
    "language": Value("align", "language"),
    "character": _NAME,
    "audio_file": File("align", "audio"),
    "transcript_file": File("align", "text"),
    "timings_file": File("align", "timings"),
    "findings": Unkeyed("a line that its discovery found fault with is not worked on"),
    "side_cars": Elsewhere("per character that speaks the line, by `Keyring`"),
    "text": Value("align", "text"),
    "origin": Unkeyed("where findings point to, given to them when they are taken up"),
}
CONTEXT: dict[str, Declared] = {
    "targets": Elsewhere("each by itself: TARGET"),
    "aligner": Value("align", "aligner"),
    "lexicon": Elsewhere("what it has about the line's words: `animeme.store.lexicon`"),
    "voices": Elsewhere("the one file that is the line's, by `Keyring`"),
    "model": Elsewhere("each target's, by the files that it is made of, or by name and code"),
    "model_file": Elsewhere("as `model`"),
    "curves": Elsewhere("CURVES"),
    "output": _PLACE,
    "speak": Elsewhere("a line that is spoken is aligned by other code"),
    "store": _PLACE,
    "prefixes": Elsewhere("they are the keys"),
    "watched": Unkeyed("shows whether a file changed under the run"),
}
_SETTING = "curve settings"
CURVES: dict[str, Declared] = {
    "rate_hz": Value("synthesize", _SETTING, also="retarget"),
    "max_error": Value("retarget", _SETTING),
    "uniform": Value("retarget", _SETTING),
    "frame_rate": Value("retarget", _SETTING),
    "offset_s": Value("retarget", _SETTING),
    "preroll_s": Value("synthesize", _SETTING, also="retarget"),
    "export": Unkeyed("a file is keyed on what is to be exported beside it"),
}
TARGET: dict[str, Declared] = {
    "character": Unkeyed("a name, given to results when they are taken up; edits are keyed on it"),
    "asset": Elsewhere("shapes and weights at rest, by `target_parts`; the rest by its files"),
    "rig": Elsewhere("by its content, by `target_parts`"),
    "suffix": _PLACE,
    "assembly_suffix": _PLACE,
    "inputs": Elsewhere("by digest, where the asset is written"),
    "model": Elsewhere("by `model_files`, or by name and code"),
    "model_files": Elsewhere("by digest"),
    "layout": Elsewhere("where the asset is written"),
}
ITEM: dict[str, Declared] = {
    "line": Elsewhere("LINE"),
    "targets": Elsewhere("each target has a key of its own"),
    "spool": _PLACE,
    "number": _NAME,
    "keys": Elsewhere("they are the keys"),
    "stamps": Unkeyed("show whether a file changed under the run"),
}
JOB: dict[str, Declared] = {
    "name": _NAME,
    "source": _PLACE,
    "output": _PLACE,
    "cache": _PLACE,
    "dialogue": Elsewhere("LINE, for each line that is found there"),
    "speak": Elsewhere("CONTEXT"),
    "aligner": Elsewhere("CONTEXT"),
    "lexicon": Elsewhere("CONTEXT"),
    "model": Elsewhere("CONTEXT"),
    "model_file": Elsewhere("CONTEXT"),
    "voices": Elsewhere("CONTEXT"),
    "curves": Elsewhere("CURVES"),
    "characters": Elsewhere("TARGET"),
}
CHARACTER: dict[str, Declared] = {
    "name": _NAME,
    "assets": Elsewhere("TARGET"),
    "rig": Elsewhere("TARGET, as it is bound"),
    "layout": Elsewhere("TARGET"),
    "model": Elsewhere("TARGET"),
    "usdz": Elsewhere("a package is keyed on its assembly, and on the recordings in it"),
    "asset_root": Unkeyed("whether an asset can be read; the job file decides that anew"),
}

Parts = dict[str, str]
"""Cause → what is keyed of it; causes are what people are told of."""


def parts_of(step: Step, subject: Any, table: Mapping[str, Declared], files: Files) -> Parts | None:
    """What of a subject's fields a step's result is keyed on; None if a file cannot be read."""
    parts: Parts = {}
    for name, declared in table.items():
        if isinstance(declared, Value | File) and step in (declared.step, declared.also):
            value = getattr(subject, name)
            if isinstance(declared, File):
                path = str(value) if value is not None else ""
                digest = files(path) if path else ABSENT
                if digest is None:
                    return None
                text = f"{basename(path)} {digest}" if path else "-"
            else:
                text = canonical(value)
            parts[declared.cause] = (
                f"{parts[declared.cause]}\n{text}" if declared.cause in parts else text
            )
    return parts


class Files:
    """Digest of a file by path; a callable, so that what it looked at is known afterwards.

    Args:
        look: gives digest and stamp.
    """

    def __init__(self, look: Any) -> None:
        self._look = look
        self.stamps: list[tuple[str, str]] = []

    def __call__(self, path: str) -> str | None:
        """The digest; the stamp goes to `stamps`."""
        digest: str | None
        digest, stamped = self._look(path)
        self.stamps.append((path, stamped))
        return digest


def target_parts(target: Any) -> Parts:
    """What the curves of a target depend on: its bound rig, its asset's shapes and their rest."""
    asset = target.asset
    return {
        "rig": canonical(target.rig),
        "asset": canonical([asset.shapes, dict(asset.canonical), asset.rest_weights()]),
    }


def key_of(kind: str, parts: Mapping[str, str] | Iterable[str]) -> str:
    """The key of a result: SHA-256 of its kind and of all that it is made from."""
    content = list(parts.items()) if isinstance(parts, Mapping) else list(parts)
    return hashlib.sha256(
        json.dumps([kind, content]).encode("utf-8", "surrogateescape")
    ).hexdigest()


def canonical(value: Any) -> str:
    """A value as text that is the same in every process; order counts."""
    if isinstance(value, str):  # most are
        return encode_basestring(value)
    if value is None:
        return "null"
    plain = asdict(value) if is_dataclass(value) and not isinstance(value, type) else value
    return _encoded(plain)


def _as_text(value: Any) -> str:
    if isinstance(value, Fraction):
        return str(value)
    raise TypeError(f"{type(value).__name__} has no canonical text")


_encoded = json.JSONEncoder(ensure_ascii=False, separators=(",", ":"), default=_as_text).encode
