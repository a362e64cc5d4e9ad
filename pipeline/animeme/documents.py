"""Every document animeme reads or writes: its fields, its schema, its one door.

A document says what it is in its member ``schema``: ``animeme.<kind>/<n>``. The types here are the
source; the files in ``schemas/`` are generated from them by ``make schemas`` and kept true by a
test.
"""

from __future__ import annotations

import difflib
import json
import tomllib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from animeme.errors import InputError, Problem

Seconds = Annotated[float, Field(ge=0, allow_inf_nan=False, strict=True)]
Number = Annotated[float, Field(allow_inf_nan=False, strict=True)]


class Document(BaseModel):
    """Base of all documents: frozen, and strangers among the members are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)


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


class DialogueSection(Document):
    """Where the recordings are."""

    root: str = Field(
        description="Folder of <language>/[character/]<line>.<audio> with .txt or .lab beside, "
        "relative to the job file."
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


class ModelSection(Document):
    """What turns phones into curves."""

    name: str = Field("dam", description="A registered model, as shipped.")
    file: str | None = Field(None, description="A model document, in place of `name`.")


class CurvesSection(Document):
    """How curves are sampled."""

    rate_hz: Annotated[Number, Field(gt=0, le=1000)] = 60.0
    max_error: Annotated[Number, Field(ge=0, le=0.5)] = Field(
        0.002, description="Largest error that dropping keys may cause, in weight units."
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


class RigDocument(Document):
    """A rig profile: which control drives which shapes."""

    schema_: Literal["animeme.rig/1"] = Field(alias="schema")
    name: str = Field(description="The profile's name.")
    family: str = Field("", description="For people: the rig family or character it describes.")
    controls: dict[str, list[DriveEntry]] = Field(
        description="Control → the shapes it drives; weights add up."
    )
    limits: dict[str, tuple[Number, Number]] = Field(
        default_factory=dict, description="Shape → [lowest, highest] weight; [0, 1] if absent."
    )
    ceilings: dict[str, str] = Field(
        default_factory=dict, description="Shape → the shape whose weight it may not exceed."
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
    events: list[EventEntry] = []


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


KINDS: dict[str, type[BaseModel]] = {
    "align-report": AlignReportDocument,
    "alignment": AlignmentDocument,
    "curves": CurvesDocument,
    "job": JobDocument,
    "model": ModelDocument,
    "report": ReportDocument,
    "rig": RigDocument,
}


def parse_file(path: Path) -> dict[str, Any]:
    """The content of a ``.json`` or ``.toml`` file whose top level is an object.

    Raises:
        InputError: it is missing or broken.
    """
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
    data = parse_file(path)
    expected = f"animeme.{kind}/1"
    if data.get("schema") != expected:
        raise InputError(
            "document-kind",
            f"says schema = {data.get('schema')!r}, not {expected!r}",
            place=str(path),
            action="Give the right kind of document; a newer version needs a newer animeme.",
        )
    try:
        return KINDS[kind].model_validate(data).model_dump(mode="json", by_alias=True)
    except ValidationError as error:
        problems = "; ".join(str(problem) for problem in problems_of(error, KINDS[kind]))
        raise InputError(
            "document-invalid",
            problems,
            place=str(path),
            action=f"`animeme schema {kind}` prints what it may hold.",
        ) from error


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
        fields = getattr(document, "model_fields", {})
        if step in fields:
            document = fields[step].annotation
        else:  # a key of a mapping or a place in a list: go on with what these hold
            document = next(reversed(get_args(document)), None)
    fields = getattr(document, "model_fields", {})
    return [field.alias or name for name, field in fields.items()]


def schema_text(kind: str) -> str:
    """The JSON Schema of a kind of document, as the file in ``schemas/`` holds it."""
    schema = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": f"animeme.{kind}/1",
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
