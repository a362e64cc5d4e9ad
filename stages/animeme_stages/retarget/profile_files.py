"""Rig documents: shipped ones and a studio's own, read and made whole."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

from animeme import documents
from animeme.errors import InputError
from animeme.places import Places
from animeme.rig import Corrective, Drive, RigProfile, Total

_FOLDER = files("animeme_stages.retarget").joinpath("profiles")
# Tables whose entries a document takes over from the one that it extends.
_TABLES = ("controls", "poses", "limits", "ceilings", "correctives", "fallbacks", "aliases")
_SIDES = ("Left", "Right")


def profile_names() -> tuple[str, ...]:
    """Names of the shipped profiles, sorted."""
    names = (file.name for file in _FOLDER.iterdir())
    return tuple(sorted(n.removesuffix(".toml") for n in names if n.endswith(".toml")))


@lru_cache(maxsize=32)
def shipped_profile(name: str) -> RigProfile:
    """The shipped profile called `name`."""
    with as_file(_FOLDER.joinpath(f"{name}.toml")) as path:
        return read_profile(path)


@lru_cache(maxsize=1)
def arkit_controls() -> tuple[str, ...]:
    """The 52 controls that models speak in and poses are described in."""
    return tuple(_both_sides(documents.read("rig", Path(str(_FOLDER / "arkit.toml")))["controls"]))


def is_file(rig: str) -> bool:
    """Whether a rig is named by a file and not by a shipped profile's name."""
    return Path(rig).suffix.lower() in (".toml", ".json")


def read_profile(path: Path) -> RigProfile:
    """A profile from a rig document and those that it extends.

    Raises:
        InputError: the file, or one that it extends, is no sound rig document.
    """
    return _profile(_whole(path, ()))


def _whole(path: Path, above: tuple[Path, ...]) -> dict[str, Any]:
    """A sound document with `*` written out, on top of what it extends."""
    data = documents.read("rig", path)
    for table in _TABLES:
        data[table] = _both_sides(data[table])
    base = data.pop("extends")
    if base is not None:
        _inherit(data, _base(base, path, (*above, path.resolve())))
    places = Places(path)
    problems = [f"{places.of(*keys)}: {text}" for keys, text in _problems(data)]
    if problems:
        raise InputError(
            "document-invalid",
            "; ".join(problems),
            place=str(path),
            action="Complete the profile; `animeme rig ASSET` lists the character's shapes.",
        )
    return data


def _inherit(data: dict[str, Any], base: Mapping[str, Any]) -> None:
    """Fill `data` up with what `base` has, but for what is about shapes that are moved no more."""
    own = {table: set(data[table]) for table in _TABLES}
    for table in _TABLES:
        gone = {name for name, entry in data[table].items() if _empties(entry)}
        merged = {**base[table], **data[table]}
        data[table] = {name: entry for name, entry in merged.items() if name not in gone}
    if data["rest"] is None and (
        base["rest"] in data["poses"] or base["rest"] not in base["poses"]
    ):
        data["rest"] = base["rest"]
    data["detect_at"] = data["detect_at"] or base["detect_at"]
    data["marks"] = data["marks"] or base["marks"]
    moved = _moved(data)
    if not data["totals"]:
        kept = ([s for s in total["shapes"] if s in moved] for total in base["totals"])
        groups = zip(base["totals"], kept, strict=True)
        data["totals"] = [{**total, "shapes": s} for total, s in groups if len(s) > 1]
    needs: dict[str, Callable[[str, Any], list[str]]] = {
        "limits": lambda shape, _: [shape],
        "ceilings": lambda shape, ceiling: [shape, ceiling],
        "correctives": lambda _, entry: entry["of"],
        "fallbacks": lambda shape, _: [shape],
        "aliases": lambda shape, _: [shape],
    }
    for table, shapes in needs.items():
        known = moved | set(data["correctives"])
        data[table] = {
            name: entry
            for name, entry in data[table].items()
            if name in own[table] or known.issuperset(shapes(name, entry))
        }


def _moved(data: Mapping[str, Any]) -> set[str]:
    """Shapes that a control, a pose or the rest moves."""
    driven = {entry["shape"] for entries in data["controls"].values() for entry in entries}
    return driven | set(data["poses"]) | ({data["rest"]} - {None})


def _base(base: str, path: Path, above: tuple[Path, ...]) -> dict[str, Any]:
    if base in profile_names():
        with as_file(_FOLDER.joinpath(f"{base}.toml")) as shipped:
            return _whole(shipped, above)
    place = Places(path).of("extends")
    if not is_file(base):
        raise InputError(
            "rig-not-found",
            f"{place}: there is no rig profile '{base:.80}'",
            place=str(path),
            action=f"{documents.suggestion(base, profile_names())} "
            "A file of your own ends in .toml or .json.",
        )
    file = path.parent / base
    try:
        circular = file.resolve() in above
    except (OSError, ValueError, RuntimeError):
        circular = False  # reading it says what is wrong
    if circular:
        raise InputError(
            "document-invalid",
            f"{place}: '{base:.80}' extends this file in turn",
            place=str(path),
            action="Extend a profile that does not come back to this one.",
        )
    return _whole(file, above)


def _empties(entry: Any) -> bool:
    """Whether an entry says that an inherited one is gone."""
    return entry in ("", [], {}) or (isinstance(entry, dict) and entry.get("of") == [])


def _both_sides(table: Mapping[str, Any]) -> dict[str, Any]:
    """A table with an entry for each side where a name has a ``*``."""
    made: dict[str, Any] = {}
    for name, entry in table.items():
        for side in _SIDES if "*" in name else ("",):
            made[name.replace("*", side)] = _sided(entry, side)
    return made


def _sided(entry: Any, side: str) -> Any:
    """The entry of one side; where no side is meant, a ``*`` in a list stands for both in turn."""
    if isinstance(entry, str):
        return entry.replace("*", side)
    if isinstance(entry, dict):
        return {key: _sided(value, side) for key, value in entry.items()}
    if isinstance(entry, list):
        return [
            _sided(item, side or each)
            for item in entry
            for each in (_SIDES if not side and _has_star(item) else ("",))
        ]
    return entry


def _has_star(item: Any) -> bool:
    text = item.get("shape", "") if isinstance(item, dict) else item
    return isinstance(text, str) and "*" in text


def _profile(data: Mapping[str, Any]) -> RigProfile:
    return RigProfile(
        name=data["name"],
        drives={c: _drives(entries) for c, entries in data["controls"].items()},
        limits={shape: (low, high) for shape, (low, high) in data["limits"].items()},
        ceilings=dict(data["ceilings"]),
        poses={shape: _pose(pose) for shape, pose in data["poses"].items()},
        rest=data["rest"] or "",
        correctives={
            shape: Corrective(tuple(entry["of"]), entry["rule"])
            for shape, entry in data["correctives"].items()
        },
        totals=tuple(Total(tuple(entry["shapes"]), entry["most"]) for entry in data["totals"]),
        fallbacks={shape: _drives(entries) for shape, entries in data["fallbacks"].items()},
        aliases={shape: tuple(names) for shape, names in data["aliases"].items()},
        detect_at=data["detect_at"] or 1,
        marks=tuple(data["marks"]),
    )


def _drives(entries: list[dict[str, Any]]) -> tuple[Drive, ...]:
    return tuple(Drive(entry["shape"], entry["gain"]) for entry in entries)


def _pose(pose: Mapping[str, float]) -> dict[str, float]:
    """A pose by side: a control without Left or Right that has sides stands for both."""
    known = arkit_controls()
    return {
        side: value
        for control, value in pose.items()
        for side in ([control] if control in known else [control + side for side in _SIDES])
    }


def _problems(data: Mapping[str, Any]) -> Iterator[tuple[tuple[str, ...], str]]:
    """What is wrong with a profile beyond its form: where, and what."""
    moved = _moved(data)
    if not moved:
        yield ("controls",), "no control drives any shape, and there are no poses"
        return
    for shape, (low, high) in data["limits"].items():
        if low > high:
            yield ("limits", shape), f"limits with low above high: {shape}"
    known = moved | set(data["correctives"])
    for table in ("limits", "ceilings", "fallbacks", "aliases"):
        for shape in data[table]:
            if shape not in known:
                yield (table, shape), _stray(shape, known)
    named: list[tuple[tuple[str, ...], str]] = [
        (("ceilings", s), ceiling) for s, ceiling in data["ceilings"].items()
    ]
    named += [(("totals",), s) for entry in data["totals"] for s in entry["shapes"]]
    named += [(("correctives", s), o) for s, e in data["correctives"].items() for o in e["of"]]
    for keys, shape in named:
        if shape not in moved:
            yield keys, _stray(shape, moved)
    for shape, entry in data["correctives"].items():
        if shape in moved:
            yield ("correctives", shape), "is moved by a control or a pose as well"
        if not entry["of"]:
            yield ("correctives", shape), "follows no shape"
    controls = arkit_controls()
    # jawLeft and mouthLeft are movements to a side, not halves of one.
    sided = {c.removesuffix("Left") for c in controls if c.endswith("Left")} - {"jaw", "mouth"}
    for shape, pose in data["poses"].items():
        for control in pose:
            if control not in controls and control not in sided:
                advice = documents.suggestion(control, (*controls, *sided))
                yield ("poses", shape), f"'{control:.80}' is no control of ARKit's. {advice:.120}"


def _stray(shape: str, known: set[str]) -> str:
    return f"nothing drives: {shape:.80}. {documents.suggestion(shape, known):.120}"
