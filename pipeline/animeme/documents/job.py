"""The job document: characters, dialogue, and how to bring them together."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field

from animeme.documents.base import Document, Number, OneOrMore
from animeme.timing import FrameRate


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
