"""Profiles of checks: which run, how bad what they find is, and with what thresholds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from animeme import documents, registry
from animeme.delivery import DeliveryCheck, Limit
from animeme.documents import suggestion
from animeme.errors import JobError, PluginError, Problem
from animeme.findings import Severity
from animeme.places import Places

KIND = "check-profile"
# A profile may build upon another, and that upon a third; more is a circle.
_DEEPEST = 16


@dataclass(frozen=True)
class CheckProfile:
    """What a delivery is judged by.

    Attributes:
        name: as it was asked for.
        excluded: id of a check, or a code → why it is left out.
        severities: code → severity, where it is not as shipped.
        limits: check → limit → value, where it is not as shipped.
        lines: name of an animation → ``<language>/<line>``.
    """

    name: str
    excluded: Mapping[str, str] = field(default_factory=dict)
    severities: Mapping[str, Severity] = field(default_factory=dict)
    limits: Mapping[str, Mapping[str, Limit]] = field(default_factory=dict)
    lines: Mapping[str, str] = field(default_factory=dict)

    def limits_of(self, check: DeliveryCheck) -> dict[str, Limit]:
        """Every limit of a check with its value."""
        shipped = {name: spec.value for name, spec in check.limits.items()}
        return {**shipped, **self.limits.get(check.id, {})}


def read_profile(name: str, checks: Mapping[str, DeliveryCheck]) -> CheckProfile:
    """The profile called `name`, or the one in the file `name`.

    Raises:
        InputError: the file cannot be read.
        JobError: it names checks, codes or limits that there are not, with every one.
        PluginError: there is no profile of that name.
    """
    found = CheckProfile(name)
    for path in reversed(_chain(name)):
        document = documents.read(KIND, path)
        _require_known(document, path, checks)
        limits = {
            check: {**found.limits.get(check, {}), **_frozen(values)}
            for check, values in document["limits"].items()
        }
        found = CheckProfile(
            name,
            {**found.excluded, **document["exclude"]},
            {
                **found.severities,
                **{code: Severity.parse(label) for code, label in document["severities"].items()},
            },
            {**found.limits, **limits},
            {**found.lines, **document["lines"]},
        )
    return found


def _chain(name: str) -> list[Path]:
    """The file of a profile, that of what it builds upon, and so on."""
    files = [_file(name, Path())]
    while extends := documents.read(KIND, files[-1])["extends"]:
        files.append(_file(extends, files[-1].parent))
        if len(files) > _DEEPEST:
            problem = Problem("extends", "the profiles build upon each other in a circle")
            raise JobError(str(files[0]), [problem])
    return files


def _file(name: str, folder: Path) -> Path:
    if name.lower().endswith((".toml", ".json")):
        return folder / name
    known = registry.plugins(registry.PROFILES)
    if name not in known:
        action = f"{suggestion(name, known)} A file's name ends in .toml."
        raise PluginError(registry.PROFILES, name, "", "there is no such profile", action)
    shipped: Path = known[name].load()()
    return shipped


def _frozen(values: Mapping[str, Any]) -> dict[str, Limit]:
    return {k: tuple(v) if isinstance(v, list) else v for k, v in values.items()}


def _require_known(
    document: Mapping[str, Any], path: Path, checks: Mapping[str, DeliveryCheck]
) -> None:
    """Refuse names of checks, codes and limits that there are not."""
    places = Places(path)
    codes = {code for check in checks.values() for code in check.codes}
    problems = []
    for name in document["exclude"]:
        if name not in codes | checks.keys():
            tip = suggestion(name, sorted(codes | checks.keys()))
            problems.append(Problem(places.of("exclude", name), "no check, and no code", tip))
    for code in document["severities"]:
        if code not in codes:
            tip = suggestion(code, sorted(codes))
            problems.append(Problem(places.of("severities", code), "no such code", tip))
    for check, values in document["limits"].items():
        known = checks[check].limits if check in checks else {}
        if check not in checks:
            tip = suggestion(check, sorted(checks))
            problems.append(Problem(places.of("limits", check), "no such check", tip))
            continue
        for limit, value in values.items():
            where = places.of("limits", check, limit)
            if limit not in known:
                tip = suggestion(limit, known)
                problems.append(Problem(where, f"'{check}' has no such limit", tip))
            elif _kind(value) != _kind(known[limit].value):
                problems.append(Problem(where, f"has to be a {_kind(known[limit].value)}"))
    if problems:
        raise JobError(str(path), problems)


def _kind(value: Any) -> str:
    return {float: "number", int: "number", str: "text"}.get(type(value), "list")
