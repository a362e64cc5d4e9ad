"""Plug-ins: found through entry points, loaded when first used.

Groups: ``animeme.models``, ``animeme.formats``, ``animeme.aligners``, ``animeme.line_checks``,
``animeme.asset_checks``, ``animeme.delivery_checks``, ``animeme.stages`` (the steps between them),
``animeme.profiles`` (of checks: functions that give their files) and ``animeme.reports``. The name
of the entry point is the name that jobs and command lines use.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import Distribution, EntryPoint, entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Any

from animeme import documents
from animeme.documents import suggestion
from animeme.errors import InputError, PluginError

if TYPE_CHECKING:
    from animeme.contracts import Aligner, Check, Format, Model

MODELS = "animeme.models"
FORMATS = "animeme.formats"
ALIGNERS = "animeme.aligners"
LINE_CHECKS = "animeme.line_checks"
ASSET_CHECKS = "animeme.asset_checks"
DELIVERY_CHECKS = "animeme.delivery_checks"
STAGES = "animeme.stages"
PROFILES = "animeme.profiles"
REPORTS = "animeme.reports"
# A group per kind of work that a check is part of: what is made anew when a check changes, and
# what a worker imports, is that group's alone.
SUBJECTS = {
    LINE_CHECKS: ("line",),
    ASSET_CHECKS: ("asset",),
    DELIVERY_CHECKS: ("deliveries", "delivery", "performance"),
}
GROUPS = (MODELS, FORMATS, ALIGNERS, *SUBJECTS, STAGES, PROFILES, REPORTS)


@dataclass(frozen=True)
class Plugin:
    """An entry point and the distribution that brought it, in its version."""

    group: str
    name: str
    distribution: str
    version: str
    entry_point: EntryPoint

    def load(self) -> Any:
        """Import it.

        Raises:
            PluginError: the import failed; says which distribution to mend.
        """
        try:
            return self.entry_point.load()
        except Exception as error:
            raise PluginError(
                self.group,
                self.name,
                self.distribution,
                f"failed to load: {type(error).__name__}: {error}",
                "Mend or uninstall that distribution.",
            ) from error


@cache
def _installed() -> Mapping[str, tuple[EntryPoint, ...]]:
    """Our groups' entry points: the metadata of all that is installed is read once."""
    everything = entry_points()
    ours = {group for group in everything.groups if group.startswith("animeme.")}
    return {group: tuple(everything.select(group=group)) for group in sorted({*GROUPS, *ours})}


def strange_groups() -> tuple[str, ...]:
    """Groups that somebody's plug-ins are registered under, and that nothing asks for."""
    return tuple(group for group in _installed() if group not in GROUPS)


@cache
def plugins(group: str) -> dict[str, Plugin]:
    """All plug-ins of a group by name, sorted.

    Raises:
        PluginError: two distributions claim one name.
    """
    found: dict[str, Plugin] = {}
    for entry in _installed()[group]:
        distribution, version = _brought_by(entry.dist) if entry.dist else ("", "")
        other = found.get(entry.name)
        if other and other.entry_point.value != entry.value:
            raise PluginError(
                group,
                entry.name,
                distribution,
                f"the name is also claimed by {other.distribution}",
                "Uninstall one of the two.",
            )
        found[entry.name] = Plugin(group, entry.name, distribution, version, entry)
    return dict(sorted(found.items()))


@cache
def _brought_by(distribution: Distribution) -> tuple[str, str]:
    """Name and version of a distribution: its metadata is parsed whenever it is asked for."""
    metadata = distribution.metadata
    return metadata["Name"], metadata["Version"]


def find(group: str, name: str) -> Plugin:
    """The plug-in called `name`.

    Raises:
        PluginError: there is none; says which there are.
    """
    known = plugins(group)
    if name in known:
        return known[name]
    raise PluginError(group, name, "", "there is no such plug-in", suggestion(name, known))


@cache
def aligner(name: str) -> Aligner:
    """The aligner called `name`, made once per process."""
    made: Aligner = find(ALIGNERS, name).load()()
    return made


def model_type(name: str) -> type[Model]:
    """The model class called `name`."""
    loaded: type[Model] = find(MODELS, name).load()
    return loaded


@cache
def format_named(name: str) -> Format:
    """The format called `name`."""
    made: Format = find(FORMATS, name).load()()
    return made


def format_of(path: Path) -> Format:
    """The format that takes files with `path`'s suffix.

    Raises:
        InputError: none does.
    """
    suffixes: list[str] = []
    for candidate in map(format_named, plugins(FORMATS)):  # those behind the right one stay unread
        if path.suffix.lower() in candidate.suffixes:
            return candidate
        suffixes += candidate.suffixes
    raise InputError(
        "asset-format-unknown",
        f"no format takes '{path.suffix}' files",
        place=str(path),
        action=f"Deliver the character as one of {', '.join(sorted(suffixes))}.",
    )


@cache
def checks(group: str) -> tuple[Check, ...]:
    """The checks of a group, by id: `LINE_CHECKS`, `ASSET_CHECKS` or `DELIVERY_CHECKS`.

    Raises:
        PluginError: one cannot be loaded, or judges what its group is not asked about.
    """
    made = [check_of(plugin) for plugin in plugins(group).values()]
    return tuple(sorted(made, key=lambda check: check.id))


def check_of(plugin: Plugin) -> Check:
    """The check that a plug-in of such a group is; raises as `checks`."""
    made: Check = plugin.load()()
    subject = getattr(made, "subject", None)
    if subject in SUBJECTS[plugin.group]:
        return made
    own = [group for group, subjects in SUBJECTS.items() if subject in subjects]
    known = ", ".join(f"'{name}'" for name in SUBJECTS[plugin.group])
    raise PluginError(
        plugin.group,
        plugin.name,
        plugin.distribution,
        f"its subject is {subject!r}, and checks of this group judge {known}",
        f"Register it under {own[0]}." if own else "Correct its subject.",
    )


@cache
def stage(name: str) -> Callable[..., Any]:
    """The step called `name`; `animeme.contracts` says what each takes and gives."""
    step: Callable[..., Any] = find(STAGES, name).load()
    return step


def load_model(name: str | None = None, *, file: Path | None = None) -> Model:
    """A model as shipped, by name, or the one in a file.

    The file is a ``model`` document, or of the kind that a model says it `reads`: an animator's
    bigrams, for one.

    Raises:
        PluginError: no such model is registered.
        InputError: the document is broken, or the model works only when fitted.
    """
    if file is None:
        return model_type(name or "").default()
    kind_of_file = documents.kind_of(file)
    if kind_of_file not in ("", "model"):
        for name in plugins(MODELS):
            if getattr(model_type(name), "reads", "") == kind_of_file:
                return model_type(name).from_file(file)  # type: ignore[attr-defined, no-any-return]
    document = documents.read("model", file)
    kind = model_type(document["model"])
    try:
        return kind.from_document(document)
    except ValueError as error:
        raise InputError(
            "model-invalid",
            str(error),
            place=str(file),
            action="Train or export the model again.",
        ) from error
