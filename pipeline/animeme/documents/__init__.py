"""Every document animeme reads or writes: its fields, its schema, its one door.

A document says what it is in its member ``schema``: ``animeme.<kind>/<n>``. The types here are the
source; the files in ``schemas/`` are generated from them by ``make schemas`` and kept true by a
test.
"""

from __future__ import annotations

import difflib
import json
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import replace
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError

from animeme.errors import InputError, Problem
from animeme.places import Places

_read_files: ContextVar[list[Path] | None] = ContextVar("_read_files", default=None)


def parse_file(path: Path) -> dict[str, Any]:
    """The content of a ``.json`` or ``.toml`` file whose top level is an object.

    Raises:
        InputError: it is missing or broken.
    """
    noted = _read_files.get()
    if noted is not None:
        noted.append(path)
    try:
        text = path.read_text(encoding="utf-8")
        data = tomllib.loads(text) if path.suffix.lower() == ".toml" else json.loads(text)
    except FileNotFoundError:
        raise _unreadable(path, "there is no such file") from None
    except (OSError, ValueError, RecursionError) as error:
        raise _unreadable(path, str(error)) from error
    if not isinstance(data, dict):
        raise _unreadable(path, "its top level is not an object")
    return data


@contextmanager
def reading() -> Iterator[list[Path]]:
    """Note which files are read as documents meanwhile: one may be built on others."""
    outer = _read_files.get()
    noted: list[Path] = []
    token = _read_files.set(noted)
    try:
        yield noted
    finally:
        _read_files.reset(token)
        if outer is not None:
            outer.extend(noted)


def kind_of(path: Path) -> str:
    """The kind of document that a file says it is, "" if it says none.

    Raises:
        InputError: it is missing or broken.
    """
    schema = str(parse_file(path).get("schema", ""))
    return schema.removeprefix("animeme.").partition("/")[0]


def read(kind: str, path: Path) -> dict[str, Any]:
    """Read and validate a document.

    Args:
        kind: one of `animeme.documents.kinds.KINDS`.
        path: a ``.json`` or ``.toml`` file.

    Returns:
        The document as plain data, every default filled in.

    Raises:
        InputError: missing, broken, of another kind or version, or with wrong members; all at once.
    """
    data = _upgraded(kind, path, parse_file(path))
    document = type_of(kind)
    try:
        return document.model_validate(data).model_dump(mode="json", by_alias=True)
    except ValidationError as error:
        places = Places(path)
        problems = "; ".join(
            str(replace(problem, path=places.of(problem.path)))
            for problem in problems_of(error, document)
        )
        raise InputError(
            "document-invalid",
            problems,
            place=str(path),
            action=f"`animeme schema {kind}` prints what it may hold.",
        ) from error


def type_of(kind: str) -> type[BaseModel]:
    """The type of a kind of document."""
    from animeme.documents.kinds import KINDS  # all of them; many a run reads its job and no other

    return KINDS[kind]


def _upgraded(kind: str, path: Path, data: dict[str, Any]) -> dict[str, Any]:
    """`data` as a document of the present version."""
    from animeme.documents.kinds import UPGRADES, VERSIONS

    said = data.get("schema")
    for version in range(1, VERSIONS[kind] + 1):
        if said == f"animeme.{kind}/{version}":
            data = UPGRADES[kind, version](data) if version < VERSIONS[kind] else data
            said = f"animeme.{kind}/{version + 1}" if version < VERSIONS[kind] else said
    expected = f"animeme.{kind}/{VERSIONS[kind]}"
    if said != expected:
        raise InputError(
            "document-kind",
            f"says schema = {said!r:.80}, not {expected!r}",
            place=str(path),
            action="Give the right kind of document; a newer version needs a newer animeme.",
        )
    return {**data, "schema": expected}


def problems_of(error: ValidationError, document: type[BaseModel]) -> list[Problem]:
    """One `Problem` for each error of pydantic's, with dotted paths and near spellings."""
    problems = []
    for entry in error.errors(include_url=False):
        path = ".".join(map(str, entry["loc"]))
        if entry["type"] == "extra_forbidden":
            known = _members(document, entry["loc"][:-1])
            action = suggestion(str(entry["loc"][-1]), known)
            problems.append(Problem(path, "unknown key", action))
        elif entry["type"] == "missing":
            problems.append(Problem(path, "missing", "Add it; README.md shows a whole document."))
        else:
            message = entry["msg"].rstrip(".").lower()
            problems.append(Problem(path, f"{message} (it is {entry['input']!r:.80})"))
    return problems


def suggestion(name: str, known: Iterable[str]) -> str:
    """Advise the known name that is close to `name`, or list all of them."""
    by_lower = {candidate.lower(): candidate for candidate in sorted(known)}
    close = difflib.get_close_matches(name.lower(), list(by_lower), 1)
    if close:
        return f"Did you mean '{by_lower[close[0]]}'?"
    return f"Known: {', '.join(by_lower.values()) or 'none'}."


def _members(document: Any, path: Sequence[int | str]) -> list[str]:
    """Names of the members that `document` allows at `path`."""
    for step in path:
        fields = {f.alias or n: f for n, f in getattr(document, "model_fields", {}).items()}
        if step in fields:
            document = fields[step].annotation
        else:  # a kind in a union, by its tag; else a key of a mapping or a place in a list
            held = get_args(document)
            tagged = (kind for kind in held if _has_tag(kind, step))
            document = next(tagged, held[-1] if held else None)
        document = _bare(document)
    fields = getattr(document, "model_fields", {})
    return [field.alias or name for name, field in fields.items()]


def _bare(annotation: Any) -> Any:
    """The type itself, without remarks on it, and without None."""
    while True:
        held = [kind for kind in get_args(annotation) if kind is not type(None)]
        union = get_origin(annotation) in (Union, UnionType)
        if get_origin(annotation) is not Annotated and not (union and len(held) == 1):
            return annotation
        annotation = held[0]


def _has_tag(kind: Any, tag: int | str) -> bool:
    if get_origin(kind) is Annotated:
        return any(getattr(remark, "tag", None) == tag for remark in kind.__metadata__)
    do = getattr(kind, "model_fields", {}).get("do")
    return do is not None and tag in get_args(do.annotation)


def schema_text(kind: str) -> str:
    """The JSON Schema of a kind of document, as the file in ``schemas/`` holds it."""
    from animeme.documents.kinds import VERSIONS

    schema = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": f"animeme.{kind}/{VERSIONS[kind]}",
        **type_of(kind).model_json_schema(by_alias=True),
    }
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"


def _unreadable(path: Path, problem: str) -> InputError:
    return InputError(
        "document-unreadable",
        problem.rstrip("."),
        place=str(path),
        action="Check the file's name and content.",
    )
