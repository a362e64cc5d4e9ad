"""Our own ``alignment`` document."""

from __future__ import annotations

import json

from pydantic import ValidationError

from animeme.documents.lines import AlignmentDocument
from animeme.phones import PhoneTrack
from animeme_stages.align.interchange.source import Source
from animeme_stages.align.interchange.timings import DamagedError, Span, Timings


def matches(source: Source) -> bool:
    """Whether this is JSON that says it is an alignment of ours."""
    root = source.json
    return isinstance(root, dict) and str(root.get("schema")).startswith("animeme.alignment/")


def read(source: Source) -> Timings:
    """The words, phones and tags of the document.

    Raises:
        DamagedError: it is not valid.
    """
    try:
        document = AlignmentDocument.model_validate(source.json)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(map(str, first["loc"]))
        raise DamagedError(f"{place}: {first['msg'].lower()}") from None
    words = tuple(Span(word.text, word.start_s, word.end_s) for word in document.words)
    phones = tuple(Span(phone.symbol, phone.start_s, phone.end_s) for phone in document.phones)
    tags = tuple(Span(event.tag, event.time_s, event.time_s) for event in document.events)
    return Timings(words, phones, (), document.duration_s, "alignment", tags)


def write(track: PhoneTrack, name: str) -> str:
    """`track` as a document."""
    return json.dumps(track.to_document(), indent=1, ensure_ascii=False) + "\n"
