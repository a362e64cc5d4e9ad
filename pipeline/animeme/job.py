"""The job file: read, validated as a whole, frozen."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pydantic import ValidationError

from animeme import registry
from animeme.curve_options import CurveOptions
from animeme.documents import problems_of, suggestion
from animeme.documents.job import (
    CurvesSection,
    DialogueSection,
    JobDocument,
    ModelSection,
)
from animeme.errors import InputError, JobError, PluginError, Problem
from animeme.gathering import DialogueSource
from animeme.languages import find_tag, language_tag
from animeme.manifest import PRESETS, Columns
from animeme.timing import FrameRate

Layout = Literal["per-character", "per-line", "animation-only", "vrma"]


@dataclass(frozen=True)
class ModelChoice:
    """A model: as shipped, by name, unless there is a file."""

    name: str
    file: Path | None


@dataclass(frozen=True)
class CharacterJob:
    """One character of a job.

    Attributes:
        name: in the job.
        assets: its files, one per format.
        rig: "auto", a shipped profile's name, or a file relative to the job.
        layout: one file per language, one per line, or per line a file of animation alone.
        model: its own, None for the job's.
        usdz: pack all languages of a USD asset into one file.
        asset_root: folder that the layers of a USD asset must be in; its own if None.
    """

    name: str
    assets: tuple[Path, ...]
    rig: str
    layout: Layout
    model: ModelChoice | None = None
    usdz: bool = False
    asset_root: Path | None = None


@dataclass(frozen=True)
class Job:
    """A validated job; every path absolute or relative to the working folder.

    Attributes:
        name: what reports call it.
        source: the job file.
        output: output folder.
        cache: folder of the store, None for the user's.
        dialogue: where the lines come from.
        speak: speak transcripts that have no recording.
        aligner: name of the aligner.
        lexicon: pronunciations of the user's, or None.
        voices: folder of learned voices, or one voice for all, or None.
        model: name of the model, used if there is no `model_file`.
        model_file: model document, or None.
        curves: how they are sampled, placed and handed out.
        characters: in the job file's order.
    """

    name: str
    source: Path
    output: Path
    cache: Path | None
    dialogue: DialogueSource
    speak: bool
    aligner: str
    lexicon: Path | None
    voices: Path | None
    model: str
    model_file: Path | None
    curves: CurveOptions
    characters: tuple[CharacterJob, ...]

    @property
    def folder(self) -> Path:
        """The job file's folder, where its relative paths start."""
        return self.source.parent


def read_job(path: Path, *, output: Path | None = None, check: bool = True) -> Job:
    """Read and validate a job file.

    Args:
        path: the TOML file.
        output: output folder in place of the job's own.
        check: look also at the files and plug-ins that it names, as `check_job` does.

    Raises:
        JobError: everything that is wrong with it, each with its TOML path.
    """
    data = _parse(path)
    problems: list[Problem] = []
    try:
        document = JobDocument.model_validate(data)
    except ValidationError as error:
        problems = problems_of(error, JobDocument)
    if check or problems:
        misshapen = {problem.path for problem in problems}
        problems += [p for p in _problems(data, path.parent) if p.path not in misshapen]
    if problems:
        raise JobError(str(path), sorted(dict.fromkeys(problems), key=lambda p: p.path))
    return _job(document, path, output)


def check_job(job: Job) -> None:
    """Look at the files and plug-ins that a job names.

    Raises:
        JobError: everything that is wrong with them, each with its TOML path.
    """
    read_job(job.source)


def _parse(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        raise JobError(str(path), [Problem("", "there is no such job file")]) from None
    except (OSError, ValueError, RecursionError) as error:
        raise JobError(str(path), [Problem("", f"is not readable TOML: {error}")]) from error


def _job(document: JobDocument, path: Path, output: Path | None) -> Job:
    folder = path.parent
    characters = tuple(
        CharacterJob(
            name,
            tuple(folder / asset for asset in section.asset),
            section.rig,
            section.layout,
            model=_model_choice(section.model, folder),
            usdz=section.usdz,
            asset_root=folder / section.asset_root if section.asset_root is not None else None,
        )
        for name, section in document.characters.items()
    )
    model_file = folder / document.model.file if document.model.file else None
    return Job(
        name=document.job.name,
        source=path,
        output=_named(output or folder / document.job.output),
        cache=folder / Path(document.job.cache).expanduser() if document.job.cache else None,
        dialogue=_dialogue(document.dialogue, folder),
        speak=document.dialogue.speak,
        aligner=document.align.aligner,
        lexicon=folder / document.align.lexicon if document.align.lexicon else None,
        voices=folder / document.align.voices if document.align.voices else None,
        model=document.model.name,
        model_file=model_file,
        curves=_curves(document.curves),
        characters=characters,
    )


def _named(folder: Path) -> Path:
    """The folder; the working folder by its whole path: below ``.``, paths are not ``./…``."""
    return folder if folder.parts else Path.cwd()


def _dialogue(section: DialogueSection, folder: Path) -> DialogueSource:
    columns = section.columns.model_dump(exclude_none=True)
    texts, audios = (
        columns.pop(role) if isinstance(columns.get(role), dict) else {}
        for role in ("text", "audio")
    )
    return DialogueSource(
        folder / section.root if section.root is not None else None,
        tuple(folder / name for name in section.manifest or ()),
        Columns(columns, texts, audios),
        section.preset or "",
        tuple(folder / name for name in section.texts or ()),
        find_tag(section.language or "") or "",
    )


def _model_choice(section: ModelSection | None, folder: Path) -> ModelChoice | None:
    if section is None:
        return None
    return ModelChoice(section.name, folder / section.file if section.file else None)


def _curves(section: CurvesSection) -> CurveOptions:
    return CurveOptions(
        section.rate_hz,
        section.max_error,
        section.keys == "uniform",
        None if section.frame_rate is None else FrameRate.parse(section.frame_rate),
        section.offset_s,
        section.preroll_s,
        tuple(dict.fromkeys(section.export)),
    )


def _problems(data: Mapping[str, Any], folder: Path) -> Iterator[Problem]:
    """What is wrong with the job's values, however much of its form is wrong too."""
    yield from _dialogue_problems(data, folder)
    yield from _unknown_plugin(registry.ALIGNERS, "align.aligner", _text(data, "align", "aligner"))
    lexicon = _text(data, "align", "lexicon")
    if lexicon is not None:
        yield from _lexicon_problems(folder / lexicon)
    yield from _model_problems("model", data, folder)
    yield from _export_problems(data)
    characters = data.get("characters")
    for name, section in characters.items() if isinstance(characters, dict) else ():
        if not name.isprintable() or not name.strip(".") or set(name) & set('/\\:*?"<>|'):
            yield Problem(f"characters.{name}", "the name cannot be a file's name")
        if isinstance(section, dict):
            yield from _character_problems(f"characters.{name}", section, folder)


def _dialogue_problems(data: Mapping[str, Any], folder: Path) -> Iterator[Problem]:
    section = data.get("dialogue")
    if not isinstance(section, dict):
        return
    root = _text(data, "dialogue", "root")
    if root is not None and not (folder / root).is_dir():
        yield Problem(
            "dialogue.root", f"there is no folder '{root}'", "Paths start at the job file."
        )
    if "root" not in section and "manifest" not in section:
        yield Problem("dialogue.root", "missing", "Name the folder of recordings, or a `manifest`.")
    for key in ("manifest", "texts"):
        names = section.get(key)
        for name in [names] if isinstance(names, str) else names if isinstance(names, list) else ():
            if isinstance(name, str) and not (folder / name).is_file():
                yield Problem(
                    f"dialogue.{key}", f"there is no file '{name}'", "Paths start at the job file."
                )
    preset = section.get("preset")
    needed = "manifest" if preset in PRESETS else "root"
    if preset in (*PRESETS, "prefix", "suffix") and needed not in section:
        yield Problem("dialogue.preset", f"'{preset}' needs `{needed}`")
    columns = section.get("columns")
    tables = columns.values() if isinstance(columns, dict) else ()
    said = [tag for table in tables if isinstance(table, dict) for tag in table]
    for name in (section.get("language"), *said):
        try:
            language_tag(name) if isinstance(name, str) else None
        except InputError as error:
            yield Problem("dialogue.language", error.problem, error.action)


def _text(data: Mapping[str, Any], section: str, key: str) -> str | None:
    table = data.get(section)
    value = table.get(key) if isinstance(table, dict) else None
    return value if isinstance(value, str) else None


def _unknown_plugin(group: str, path: str, name: str | None) -> Iterator[Problem]:
    known = registry.plugins(group)
    if name is not None and name not in known:
        kind = group.removeprefix("animeme.").removesuffix("s")
        yield Problem(path, f"there is no {kind} '{name}'", suggestion(name, known))


def _model_problems(path: str, table: Mapping[str, Any], folder: Path) -> Iterator[Problem]:
    """What is wrong with the section `model` of the job or of a character."""
    yield from _unknown_plugin(registry.MODELS, f"{path}.name", _text(table, "model", "name"))
    name = _text(table, "model", "file")
    if name is None:
        return
    file = folder / name
    try:
        registry.load_model(file=file)
    except InputError as error:
        yield Problem(f"{path}.file", f"{error.place}: {error.problem}", error.action)
    except PluginError as error:
        yield Problem(f"{path}.file", f"{file}: {error}")


def _export_problems(data: Mapping[str, Any]) -> Iterator[Problem]:
    curves = data.get("curves")
    export = curves.get("export") if isinstance(curves, dict) else None
    known = registry.stage("curve-files")()
    for index, kind in enumerate(export if isinstance(export, list) else ()):
        if isinstance(kind, str) and kind not in known:
            path = f"curves.export.{index}"
            yield Problem(path, f"there is no kind of curve file '{kind}'", suggestion(kind, known))


def _lexicon_problems(file: Path) -> Iterator[Problem]:
    try:
        registry.stage("check-lexicon")(file)
    except InputError as error:
        yield Problem("align.lexicon", f"{error.place}: {error.problem}", error.action)


def _character_problems(path: str, section: Mapping[str, Any], folder: Path) -> Iterator[Problem]:
    assets = section.get("asset")
    assets = [assets] if isinstance(assets, str) else assets
    suffixes: dict[str, str] = {}
    joins = False
    for asset in assets if isinstance(assets, list) else ():
        if not isinstance(asset, str):
            continue
        file = folder / asset
        try:
            suffix = registry.format_of(file).output_suffix(file)
        except InputError as error:
            yield Problem(f"{path}.asset", f"'{asset}': {error.problem}", error.action)
            continue
        if not file.is_file():
            yield Problem(
                f"{path}.asset", f"there is no file '{asset}'", "Paths start at the job file."
            )
        if suffix in suffixes:
            clash = f"'{suffixes[suffix]}' and '{asset}' would be written to one file"
            yield Problem(f"{path}.asset", clash, "Make them two characters.")
        suffixes[suffix] = asset
        joins |= bool(registry.format_of(file).assembly_suffix)
    root = section.get("asset_root")
    if isinstance(root, str):
        yield from _root_problems(f"{path}.asset_root", folder / root, assets, folder)
    if section.get("usdz") is True and section.get("layout") == "per-line":
        action = "Leave 'layout' out, or 'usdz'."
        yield Problem(f"{path}.usdz", "a file per line cannot be packed into one", action)
    elif section.get("usdz") is True and suffixes and not joins:
        action = "Add the character's USD file to 'asset', or leave 'usdz' out."
        yield Problem(f"{path}.usdz", "no asset of the character is USD", action)
    yield from _model_problems(f"{path}.model", section, folder)
    rig = section.get("rig")
    if isinstance(rig, str):
        yield from _rig_problems(f"{path}.rig", rig, folder)


def _root_problems(path: str, root: Path, assets: Any, folder: Path) -> Iterator[Problem]:
    for asset in assets if isinstance(assets, list) else ():
        file = folder / asset if isinstance(asset, str) else root
        if not file.resolve().is_relative_to(root.resolve()):
            yield Problem(path, f"'{asset}' is not below it", "It holds the asset and its layers.")


def _rig_problems(path: str, rig: str, folder: Path) -> Iterator[Problem]:
    try:
        registry.stage("read-rig")(rig, folder)
    except InputError as error:
        yield Problem(path, f"{error.place}: {error.problem}", error.action)


def model_files(job: Job) -> Iterator[Path | None]:
    """Files of the job's model and of its characters' own; None for those as shipped."""
    yield job.model_file
    yield from (character.model.file for character in job.characters if character.model)
