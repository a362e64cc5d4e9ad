"""Every document animeme reads or writes: its fields, its schema, its one door.

A document says what it is in its member ``schema``: ``animeme.<kind>/<n>``. The types here are the
source; the files in ``schemas/`` are generated from them by ``make schemas`` and kept true by a
test.
"""

from __future__ import annotations

import difflib
import json
import tomllib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import replace
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from animeme.document_base import Document, Number, Seconds
from animeme.edits_document import EditsDocument
from animeme.errors import InputError, Problem
from animeme.places import Places
from animeme.timing import FrameRate


def _as_list(value: Any) -> Any:
    return [value] if isinstance(value, str) else value


OneOrMore = Annotated[
    list[str],
    BeforeValidator(_as_list, json_schema_input_type=str | list[str]),
    Field(min_length=1),
]


class JobSection(Document):
    """The job itself."""

    name: str = Field(min_length=1, description="What reports call it.")
    output: str = Field("out", description="Output folder, relative to the job file.")
    cache: str | None = Field(
        None,
        min_length=1,
        description="Folder of results that runs share, relative to the job file; the user's "
        "own by default.",
    )


class ColumnsSection(Document):
    """Headers of a sheet's columns; those with usual names are found without."""

    id: str | None = None
    audio: str | dict[str, str] | None = Field(
        None, description="Header of the recordings' paths, or language → header."
    )
    character: str | None = None
    language: str | None = None
    text: str | dict[str, str] | None = Field(
        None, description="Header of the transcripts, or language → header."
    )
    notes: str | None = None


class DialogueSection(Document):
    """Where the recordings and their transcripts are: a folder, sheets, or both."""

    root: str | None = Field(
        None,
        description="Folder of <language>/[character/]<line>.<audio> with .txt or .lab beside, "
        "relative to the job file; with `manifest`, where its recordings are searched too.",
    )
    manifest: OneOrMore | None = Field(
        None,
        description="Lists of the lines, relative to the job file: CSV, TSV, XLSX, ODS, a "
        "manifest document, or what `preset` names. Their paths are relative to the list.",
    )
    columns: ColumnsSection = ColumnsSection()  # type: ignore[call-arg]
    preset: Literal["cryengine", "fmod", "prefix", "suffix", "unreal", "wwise"] | None = Field(
        None,
        description="Who wrote the list; or how files below `root` bear their language: before or "
        "after the name (EN_line.wav, line_de.wav).",
    )
    texts: OneOrMore | None = Field(
        None, description="Translations to join by id (.po, .xlf), relative to the job file."
    )
    language: str | None = Field(
        None, description="Of lines, lists and translations that do not say theirs."
    )
    speak: bool = Field(
        False, strict=True, description="Let espeak-ng speak transcripts without a recording."
    )


class AlignSection(Document):
    """How phones are found."""

    aligner: str = Field("pocketsphinx", description="A registered aligner.")
    lexicon: str | None = Field(
        None, description="Pronunciations of your own, relative to the job file."
    )
    voices: str | None = Field(
        None,
        description="Folder of voices that `animeme voice` learned, or one voice for all lines, "
        "relative to the job file.",
    )


class ModelSection(Document):
    """What turns phones into curves."""

    name: str = Field("dam", description="A registered model, as shipped.")
    file: str | None = Field(
        None, description="A model document, or a set of bigrams, in place of `name`."
    )


def _known_rate(value: Any) -> Any:
    FrameRate.parse(value)
    return value


class CurvesSection(Document):
    """How curves are sampled, placed in time and handed out."""

    rate_hz: Annotated[Number, Field(gt=0, le=1000)] = Field(
        60.0, description="Sampling rate of the motion, and of uniform keys."
    )
    max_error: Annotated[Number, Field(ge=0, le=0.5)] = Field(
        0.002, description="Largest error that dropping keys may cause, in weight units."
    )
    keys: Literal["reduced", "uniform"] = Field(
        "reduced",
        description="As few keys as `max_error` allows, or one per frame of `frame_rate`, else of "
        "`rate_hz`.",
    )
    frame_rate: Annotated[float | str, AfterValidator(_known_rate)] | None = Field(
        None,
        description='Frames of uniform keys and of time codes: 23.976, 24, 25, 29.97, "29.97df", '
        '30, 48, 50, 59.94, "59.94df" or 60.',
    )
    offset_s: Annotated[Number, Field(ge=-60, le=60)] = Field(
        0.0, description="Shift of the motion against the audio; positive is later."
    )
    preroll_s: Annotated[Number, Field(ge=0, le=60)] = Field(
        0.0, description="How long before the audio the animation starts."
    )
    export: list[str] = Field(
        [], description='Curve files to write as well: "livelink-csv", "csv", "json", "npz".'
    )


class CharacterSection(Document):
    """One character."""

    asset: OneOrMore = Field(
        description="The character's file, or its file in each format, relative to the job file."
    )
    rig: str = Field("auto", description='"auto", a shipped profile, or a rig document.')
    layout: Literal["per-character", "per-line", "animation-only", "vrma"] = Field(
        "per-character",
        description="One file per language with all lines; a file per line; or per line a file of "
        "animation alone, as a GLB (animation-only) or for VRM avatars (vrma).",
    )
    model: ModelSection | None = Field(None, description="In place of the job's.")
    asset_root: str | None = Field(
        None,
        description="Folder that the layers of a USD asset must be in, relative to the job file; "
        "the asset's own if absent.",
    )
    usdz: bool = Field(
        False, strict=True, description="Also pack a USD asset's languages into one .usdz file."
    )


class JobDocument(Document):
    """A job: characters, dialogue, and how to bring them together."""

    schema_: Literal["animeme.job/1"] = Field("animeme.job/1", alias="schema")
    job: JobSection
    dialogue: DialogueSection
    align: AlignSection = AlignSection()  # type: ignore[call-arg]
    model: ModelSection = ModelSection()  # type: ignore[call-arg]
    curves: CurvesSection = CurvesSection()  # type: ignore[call-arg]
    characters: Annotated[dict[str, CharacterSection], Field(min_length=1)]


class DriveEntry(Document):
    """One shape that a control moves."""

    shape: str = Field(description="Shape name, as in the asset or in the rig's usual spelling.")
    gain: Number = Field(1.0, description="Shape weight per unit of the control.")


class CorrectiveEntry(Document):
    """A shape that follows others."""

    of: list[str] = Field(description="The shapes it follows; none: it is not moved.")
    rule: Literal["product", "minimum"] = Field(
        "product", description="Its weight is their product, or the least of them."
    )


class TotalEntry(Document):
    """Shapes that exclude each other."""

    shapes: Annotated[list[str], Field(min_length=2)]
    most: Annotated[Number, Field(ge=0)] = Field(
        1.0, description="What they weigh together at most; beyond it, all shrink alike."
    )


class RigDocument(Document):
    """A rig profile: what drives which shapes. A `*` in a name stands for Left and for Right."""

    schema_: Literal["animeme.rig/2"] = Field(alias="schema")
    name: str = Field(description="The profile's name.")
    family: str = Field("", description="For people: the rig family or character it describes.")
    extends: str | None = Field(
        None,
        description="A shipped profile, or a rig document beside this one: entries here replace "
        "its entries of the same name, an empty one removes it.",
    )
    detect_at: Annotated[int, Field(ge=1, strict=True)] | None = Field(
        None,
        description="How many of the shapes that speech moves make a rig one of this family.",
    )
    marks: list[str] = Field(
        default_factory=list,
        description="Shapes that nothing moves, but that tell rigs of this family from others.",
    )
    controls: dict[str, list[DriveEntry]] = Field(
        default_factory=dict, description="Control → the shapes it drives; weights add up."
    )
    poses: dict[str, dict[str, Number]] = Field(
        default_factory=dict,
        description="Shape → what the face shows at weight 1, in ARKit's controls (without Left or "
        "Right: both). The weights are the mixture that comes nearest to the model's controls.",
    )
    rest: str | None = Field(None, description="The pose that takes what the others leave of 1.")
    limits: dict[str, tuple[Number, Number]] = Field(
        default_factory=dict, description="Shape → [lowest, highest] weight; [0, 1] if absent."
    )
    totals: list[TotalEntry] = Field(default_factory=list)
    ceilings: dict[str, str] = Field(
        default_factory=dict, description="Shape → the shape whose weight it may not exceed."
    )
    correctives: dict[str, CorrectiveEntry] = Field(default_factory=dict)
    fallbacks: dict[str, list[DriveEntry]] = Field(
        default_factory=dict,
        description="Shape → those that stand in for it; the first that the rig has is taken.",
    )
    aliases: dict[str, list[str]] = Field(
        default_factory=dict, description="Shape → other names that rigs give it."
    )


class WordEntry(Document):
    """One spoken word."""

    text: str
    start_s: Seconds
    end_s: Seconds
    source: tuple[int, int] = Field(description="Character positions in the transcript.")


class PhoneEntry(Document):
    """One phone, or a pause with the symbol `sil`."""

    symbol: str
    start_s: Seconds
    end_s: Seconds
    score: Number | None = Field(None, description="Mean log score per 10 ms frame.")


class EventEntry(Document):
    """An inline tag of the transcript, at the moment that it stands for."""

    tag: str = Field(min_length=1, description="Without its brackets.")
    time_s: Seconds
    source: tuple[int, int] = Field(description="Character positions in the transcript.")


class AlignmentDocument(Document):
    """Phones and words of one recording, without gaps, and the tags among them."""

    schema_: Literal["animeme.alignment/1"] = Field(alias="schema")
    language: str = Field(description="BCP-47 tag.")
    inventory: Literal["arpabet", "ipa"]
    duration_s: Seconds
    words: list[WordEntry]
    phones: list[PhoneEntry]
    events: list[EventEntry] = Field([])


class CurvesDocument(Document):
    """Named curves over one time axis, linear between keys."""

    schema_: Literal["animeme.curves/1"] = Field(alias="schema")
    times_s: list[Number]
    curves: dict[str, list[Number]]


class ModelDocument(BaseModel):
    """A model: its name, parameters and whatever tables it learned."""

    model_config = ConfigDict(extra="allow", frozen=True, populate_by_name=True)

    schema_: Literal["animeme.model/1"] = Field(alias="schema")
    model: str = Field(description="Name of the registered model that reads this document.")
    config: dict[str, Any] = Field(description="The model's parameters.")


Key = tuple[Annotated[Number, Field(ge=0, le=1)], Number]


class BigramEntry(Document):
    """The curves of one pair of phones."""

    curves: dict[str, Annotated[list[Key], Field(min_length=2)]] = Field(
        description="Pose → keys [time, weight] of its control polygon; 0 is where the first phone "
        "starts, 1 where the second ends. A pose that is not here rests."
    )
    note: str = Field("", description="For people.")


class ConflictEntry(Document):
    """Two poses that do not go together."""

    poses: tuple[str, str]
    limit: Number = Field(description="Largest sum of their weights; 2 where nothing is said.")


class BigramsDocument(Document):
    """Curves that an animator draws for pairs of phones, over poses of a face."""

    schema_: Literal["animeme.bigrams/1"] = Field(alias="schema")
    name: str = Field("", description="For people.")
    extends: str | None = Field(
        None,
        description="A set that this one changes: a file, relative to this one, or a shipped name.",
    )
    source: str = Field("", description="Where the curves come from.")
    licence: str = Field("", description="On what terms they may be used.")
    note: str = Field("", description="For people.")
    phones: dict[str, list[str]] = Field(
        default_factory=dict,
        description="Class → its phones in IPA. A phone that is named here leaves the class that "
        "it had. The 21 common classes if nothing is said; `_` is a pause.",
    )
    poses: dict[str, dict[str, Number]] = Field(
        default_factory=dict,
        description="Pose → controls and their weights at weight 1. A pose that is not here drives "
        "the control of its own name.",
    )
    conflicts: list[ConflictEntry] = Field(default_factory=list)
    priority: list[str] = Field(
        default_factory=list, description="Poses, the one that gives way most easily first."
    )
    window_s: Annotated[Number, Field(ge=0, le=1)] | None = Field(
        None, description="Maxima of a pose that are this near are joined; 0 if nothing is said."
    )
    speed: Annotated[Number, Field(gt=0)] | None = Field(
        None, description="Largest change of a weight per second; 15 if nothing is said."
    )
    hold_s: Annotated[Number, Field(gt=0)] | None = Field(
        None, description="Longer phones hold their middle; 0.4 if nothing is said."
    )
    pairs: dict[str, BigramEntry] = Field(
        default_factory=dict, description='"first|second" → what moves.'
    )


class ListedLineEntry(Document):
    """One line in one language."""

    id: str = Field(description="Of the line, the same in every language; `/` separates folders.")
    audio: str = Field("", description="Its recording, relative to this document.")
    character: str = Field("", description="Who says it; empty for every character of the job.")
    language: str = Field("", description="BCP-47 tag; empty if the job or the path says it.")
    text: str | None = Field(
        None, description="What is said; null if a .txt beside the recording says it."
    )
    notes: str = Field("", description="For people.")


class ManifestDocument(Document):
    """A list of lines: what every sheet comes down to."""

    schema_: Literal["animeme.manifest/1"] = Field(alias="schema")
    lines: list[ListedLineEntry]


class FindingEntry(Document):
    """One remark."""

    severity: Literal["info", "warning", "error"]
    code: str = Field(description="Permanent code.")
    message: str
    place: str
    action: str
    line: str
    character: str
    ours: bool = Field(description="The fault is animeme's or a plug-in's, not the input's.")


class LineEntry(Document):
    """How one line of one character ended."""

    line: str = Field(description="<language>/<line>.")
    language: str
    character: str
    audio_s: Seconds
    status: Literal["ok", "review", "failed"]
    findings: list[FindingEntry]
    outputs: list[str] = Field(description="Files that hold it, relative to the output folder.")


class ReportDocument(Document):
    """The result of a run."""

    schema_: Literal["animeme.report/1"] = Field(alias="schema")
    animeme: str = Field(description="Version that ran.")
    job: str
    exit_code: int
    totals: dict[str, dict[str, int]] = Field(
        description="Character → how many of its lines are ok, review and failed."
    )
    audio_s: Seconds
    findings: list[FindingEntry] = Field(description="Those that concern no single line.")
    lines: list[LineEntry]
    outputs: list[str] = Field(description="Delivered files, relative to the output folder.")


class AlignedLineEntry(Document):
    """How the alignment of one line ended."""

    id: str = Field(description="Path below the aligned folder, without suffix.")
    status: Literal["ok", "review", "failed"]
    codes: list[str] = Field(description="Codes of its findings, the worst first, each once.")
    score: Annotated[Number, Field(ge=0, le=1)] | None = Field(
        description="The aligner's confidence; null where it has none, or the line failed."
    )
    language: str = Field(description="BCP-47 tag.")
    audio_s: Seconds = Field(description="Length of the recording, 0 if it could not be read.")
    output: str | None = Field(
        description="File of its timings, relative to the output folder; null if none was written."
    )
    findings: list[FindingEntry]


class AlignTotals(Document):
    """Sums over all lines."""

    lines: int
    ok: int
    review: int
    failed: int
    audio_s: Seconds
    cpu_s: Seconds = Field(description="CPU time of the process and its workers.")


class AlignReportDocument(Document):
    """How the alignment of a folder of lines ended; the same bytes each time but for `cpu_s`."""

    schema_: Literal["animeme.align-report/1"] = Field(alias="schema")
    animeme: str = Field(description="Version that ran.")
    exit_code: int
    totals: AlignTotals
    lines: list[AlignedLineEntry] = Field(description="Sorted by id.")


class RehearsalTotals(Document):
    """How much a run would have to do."""

    lines: int
    stale: int = Field(description="Lines that would be worked on.")
    files: int
    unwritten: int = Field(description="Asset files that would be written.")


class StaleLineEntry(Document):
    """A line that would be worked on."""

    line: str = Field(description="<language>/<line>.")
    causes: list[str] = Field(description="What has changed of it, or `new`.")


class RehearsalDocument(Document):
    """What a run would do."""

    schema_: Literal["animeme.rehearsal/1"] = Field(alias="schema")
    animeme: str = Field(description="Version that would run.")
    job: str
    totals: RehearsalTotals
    causes: dict[str, int] = Field(description="Cause → how many lines it makes stale.")
    lines: list[StaleLineEntry]
    files: list[str] = Field(
        description="Asset files that would be written, relative to the output folder."
    )


class CacheDocument(Document):
    """A store, or what became of it."""

    schema_: Literal["animeme.cache/1"] = Field(alias="schema")
    store: str = Field(description="Its folder.")
    results: int | None = Field(None, description="How many results it has.")
    bytes: int | None = Field(None, description="Size of all that is left.")
    oldest: str | None = Field(None, description="When the longest unused was used, in UTC.")
    newest: str | None = Field(None, description="When the last one was used, in UTC.")
    index: str | None = Field(None, description="This machine's index of it.")
    index_bytes: int | None = None
    damaged: list[str] | None = Field(None, description="Keys of results that were removed.")
    removed: int | None = Field(None, description="How many results were removed.")
    freed_bytes: int | None = None


LimitValue = Number | str | list[str]
Reason = Annotated[str, Field(min_length=8)]


class CheckProfileDocument(Document):
    """What delivered files are judged by; see docs/checks.md for names of checks and codes."""

    schema_: Literal["animeme.check-profile/1"] = Field(alias="schema")
    title: str = Field("", description="What it is for.")
    extends: str = Field(
        "", description="A profile, or a file beside this one, that it builds upon."
    )
    exclude: dict[str, Reason] = Field(
        default_factory=dict, description="Check or code → why it is left out."
    )
    severities: dict[str, Literal["info", "warning", "error"]] = Field(
        default_factory=dict, description="Code → severity, in place of the check's own."
    )
    limits: dict[str, dict[str, LimitValue]] = Field(
        default_factory=dict, description="Check → limit → value, in place of the check's own."
    )
    lines: dict[str, str] = Field(
        default_factory=dict, description="Name of an animation → its line, <language>/<line>."
    )


class ComplaintEntry(FindingEntry):
    """One remark about a delivered file."""

    check: str = Field(description="Id of the check that made it.")
    file: str
    start_s: Number | None = Field(description="On the animation's time axis; null: no time.")
    end_s: Number | None


class SkippedEntry(Document):
    """A check that could not judge something."""

    check: str
    file: str
    line: str
    reason: str


class JudgedLineEntry(Document):
    """An animation that was judged."""

    animation: str
    line: str = Field(description="<language>/<line>; the animation's name if that is not known.")


class JudgedFileEntry(Document):
    """How one file was judged."""

    file: str
    status: Literal["ok", "review", "failed"]
    lines: list[JudgedLineEntry]
    findings: list[ComplaintEntry]


class ValidationTotals(Document):
    """Counts."""

    files: int
    lines: int
    errors: int
    warnings: int
    infos: int
    skipped: int
    accepted: int


class ValidationDocument(Document):
    """How delivered files were judged."""

    schema_: Literal["animeme.validation/1"] = Field(alias="schema")
    animeme: str = Field(description="Version that ran.")
    profile: str
    exit_code: int
    totals: ValidationTotals
    checks: list[str] = Field(description="Ids of the checks that were asked.")
    excluded: dict[str, str] = Field(description="Check or code → why it was left out.")
    findings: list[ComplaintEntry] = Field(description="Those that concern no single file.")
    files: list[JudgedFileEntry]
    skipped: list[SkippedEntry]
    accepted: list[ComplaintEntry] = Field(description="Those that the baseline knows.")


KINDS: dict[str, type[BaseModel]] = {
    "align-report": AlignReportDocument,
    "alignment": AlignmentDocument,
    "bigrams": BigramsDocument,
    "cache": CacheDocument,
    "check-profile": CheckProfileDocument,
    "curves": CurvesDocument,
    "edits": EditsDocument,
    "job": JobDocument,
    "manifest": ManifestDocument,
    "model": ModelDocument,
    "rehearsal": RehearsalDocument,
    "report": ReportDocument,
    "rig": RigDocument,
    "validation": ValidationDocument,
}
VERSIONS = {**dict.fromkeys(KINDS, 1), "rig": 2}
"""The version of each kind that is written now."""
# (kind, version) → what makes a document of it one of the next version.
_UPGRADES: dict[tuple[str, int], Callable[[dict[str, Any]], dict[str, Any]]] = {
    ("rig", 1): lambda data: data,  # version 2 only added members
}


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
        kind: one of `KINDS`.
        path: a ``.json`` or ``.toml`` file.

    Returns:
        The document as plain data, every default filled in.

    Raises:
        InputError: missing, broken, of another kind or version, or with wrong members; all at once.
    """
    data = _upgraded(kind, path, parse_file(path))
    try:
        return KINDS[kind].model_validate(data).model_dump(mode="json", by_alias=True)
    except ValidationError as error:
        places = Places(path)
        problems = "; ".join(
            str(replace(problem, path=places.of(problem.path)))
            for problem in problems_of(error, KINDS[kind])
        )
        raise InputError(
            "document-invalid",
            problems,
            place=str(path),
            action=f"`animeme schema {kind}` prints what it may hold.",
        ) from error


def _upgraded(kind: str, path: Path, data: dict[str, Any]) -> dict[str, Any]:
    """`data` as a document of the present version."""
    said = data.get("schema")
    for version in range(1, VERSIONS[kind] + 1):
        if said == f"animeme.{kind}/{version}":
            data = _UPGRADES[kind, version](data) if version < VERSIONS[kind] else data
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
    schema = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": f"animeme.{kind}/{VERSIONS[kind]}",
        **KINDS[kind].model_json_schema(by_alias=True),
    }
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"


def _unreadable(path: Path, problem: str) -> InputError:
    return InputError(
        "document-unreadable",
        problem.rstrip("."),
        place=str(path),
        action="Check the file's name and content.",
    )
