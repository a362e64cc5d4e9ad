"""Changes by hand to a line's motion: offsets, muted curves, replaced ranges.

They are kept in a document beside the recording, which we only ever read, and are applied anew each
time the motion is made. An edit that has lost its meaning is left out and said so.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from animeme import documents
from animeme.curves import CurveSet, Floats
from animeme.documents.edits import Edit, EditsDocument, MuteEdit, OffsetEdit, ReplaceEdit
from animeme.findings import Finding, Severity
from animeme.moments import Range, StaleError, resolve
from animeme.phones import PhoneTrack

# Less cannot be seen, and may be rounding (weight units).
NO_EFFECT = 1e-4
# Keys nearer to each other than this are one key; far below any frame.
SAME_TIME_S = 1e-4
# What comes or goes at once takes this long: a curve has one value at a time.
AT_ONCE_S = 1e-3
# Of an ease, so that its S shape shows; linear between them it is off by less than 1 % of the edit.
_EASE_KEYS = 9


@dataclass(frozen=True)
class PlacedEdit:
    """An edit, and where in which file it stands."""

    edit: Edit
    place: str


def read_edits(path: Path) -> EditsDocument:
    """The edits in the file at `path`.

    Raises:
        InputError: it is no sound ``animeme.edits/1`` document.
    """
    return EditsDocument.model_validate(documents.read("edits", path))


def placed(document: EditsDocument, path: Path) -> tuple[PlacedEdit, ...]:
    """The edits of a file, each with its place, in the file's order."""
    return tuple(
        PlacedEdit(edit, f"{path}: edit {number}") for number, edit in enumerate(document.edit, 1)
    )


@dataclass(frozen=True)
class Stage:
    """What edits are applied to: the controls before retargeting, or the shapes after it.

    Attributes:
        kind: "control" or "shape".
        names: name in an edit → name of the curve it means, for all that there could be.
        rest: weight of each curve where nothing drives it; 0 if absent.
    """

    kind: str
    names: Mapping[str, str]
    rest: Mapping[str, float]


def apply_edits(
    curves: CurveSet, edits: Iterable[PlacedEdit], stage: Stage, track: PhoneTrack, lead_s: float
) -> tuple[CurveSet, tuple[Finding, ...]]:
    """Apply those of `edits` that concern a stage, in their order.

    Args:
        curves: of that stage, on the track's time axis.
        edits: of both stages.
        stage: which one this is.
        track: the line, with `lead_s` before its recording.
        lead_s: where the recording starts on the track's time axis.

    Returns:
        The curves, and findings about edits that no longer mean anything.
    """
    findings: list[Finding] = []
    for entry in edits:
        name = getattr(entry.edit, stage.kind)
        if name is None:
            continue
        try:
            known = stage.names.get(name, name if name in curves.names else None)
            if known is None:
                raise StaleError(
                    "edit-curve-unknown",
                    f"there is no {stage.kind} '{name}'",
                    documents.suggestion(name, {*stage.names, *curves.names}),
                )
            span = resolve(entry.edit, track, lead_s)
            edited = _edited(curves, entry.edit, known, stage.rest.get(known, 0.0), span)
            remarks = [
                Finding(
                    Severity.INFO if code == "edit-word-moved" else Severity.WARNING,
                    code,
                    message,
                    place=entry.place,
                    action="Check that it still does what it should.",
                )
                for code, message in span.remarks
            ]
            change = np.abs(_column(edited, known) - _sampled(curves, known, stage, edited.times_s))
            if change.max(initial=0.0) < NO_EFFECT:
                raise StaleError(
                    "edit-no-effect",
                    f"changes nothing: '{name}' is already so",
                    "Delete it, if nothing is amiss.",
                )
        except StaleError as stale:
            findings.append(
                Finding(
                    Severity.WARNING,
                    stale.code,
                    stale.message,
                    place=entry.place,
                    action=stale.action,
                )
            )
            continue
        findings += remarks
        curves = edited
    return curves, tuple(findings)


def text_changed(document: EditsDocument, path: Path, text: str) -> Iterator[Finding]:
    """A warning if the edits were made for another text than `text`."""
    made_for = document.made_for_text
    if made_for is not None and made_for.split() != text.split():
        yield Finding(
            Severity.WARNING,
            "edits-text-changed",
            f"were made for '{_short(made_for)}', the line says '{_short(text)}'",
            place=str(path),
            action="Check each of them, and set made_for_text to the line's text.",
        )


def strangers(edits: Sequence[PlacedEdit], characters: Sequence[str]) -> Iterator[Finding]:
    """A warning for each edit for a character that does not speak the line."""
    for entry in edits:
        name = entry.edit.character
        if name is not None and name not in characters:
            yield Finding(
                Severity.WARNING,
                "edit-character-unknown",
                f"'{name}' does not speak this line",
                place=entry.place,
                action=documents.suggestion(name, characters),
            )


def _short(text: str) -> str:
    text = " ".join(text.split())
    return text if len(text) <= 60 else f"{text[:59]}…"


def _column(curves: CurveSet, name: str) -> Floats:
    return curves.curve(name)


def _sampled(curves: CurveSet, name: str, stage: Stage, times_s: Floats) -> Floats:
    if name not in curves.names:
        return np.full(len(times_s), stage.rest.get(name, 0.0))
    return curves.sample(times_s)[:, curves.names.index(name)]


def _edited(curves: CurveSet, edit: Edit, name: str, rest: float, span: Range) -> CurveSet:
    """`curves` with one of them changed; with a curve more where it had none."""
    come_s, go_s = _eases(edit, span)
    corners = [
        *_ease_keys(span.start_s, come_s, span.open_start),
        *_ease_keys(span.end_s, -go_s, span.open_end),
    ]
    if isinstance(edit, ReplaceEdit):
        corners += [span.start_s + after_s for after_s, _ in edit.keys]
    inside = [t for t in corners if curves.times_s[0] < t < curves.times_s[-1]]
    times_s = _with_keys(curves.times_s, inside)
    weights = curves.sample(times_s)
    names = curves.names
    if name not in names:
        names = (*names, name)
        weights = np.hstack([weights, np.full((len(times_s), 1), rest)])
    column = names.index(name)
    old = weights[:, column]
    share = _share(times_s, span, come_s, go_s)
    match edit:
        case OffsetEdit():
            new = old + share * edit.by
        case MuteEdit():
            new = old + share * (rest - old)
        case ReplaceEdit():
            keys_s, values = np.array(edit.keys).T
            new = old + share * (np.interp(times_s, span.start_s + keys_s, values) - old)
    weights[:, column] = new
    return CurveSet(times_s, names, weights)


def _eases(edit: Edit, span: Range) -> tuple[float, float]:
    """How long an edit takes to come and to go; both shorter where its time is."""
    if isinstance(edit, ReplaceEdit):
        come_s = go_s = edit.blend_s
    else:
        come_s, go_s = max(edit.ease_in_s, AT_ONCE_S), max(edit.ease_out_s, AT_ONCE_S)
    come_s = 0.0 if span.open_start else come_s
    go_s = 0.0 if span.open_end else go_s
    room = (span.end_s - span.start_s) / max(come_s + go_s, 1e-12)
    return come_s * min(1.0, room), go_s * min(1.0, room)


def _ease_keys(from_s: float, length_s: float, is_open: bool) -> Iterator[float]:
    if not is_open:
        yield from (from_s + length_s * i / (_EASE_KEYS - 1) for i in range(_EASE_KEYS))


def _with_keys(times_s: Floats, extra: Sequence[float]) -> Floats:
    """`times_s` and those of `extra` that are not as good as there."""
    wanted = np.unique(np.asarray(extra, dtype=np.float64))
    if not len(wanted):
        return times_s
    wanted = wanted[np.append(True, np.diff(wanted) > SAME_TIME_S)]
    right = np.searchsorted(times_s, wanted).clip(1, len(times_s) - 1)
    gap = np.minimum(np.abs(wanted - times_s[right]), np.abs(wanted - times_s[right - 1]))
    both: Floats = np.union1d(times_s, wanted[gap > SAME_TIME_S])
    return both


def _share(times_s: Floats, span: Range, come_s: float, go_s: float) -> Floats:
    """How much of an edit holds at each time, 0 to 1: an S on its way in and out."""
    share = np.ones(len(times_s))
    if not span.open_start:
        share *= _smooth((times_s - span.start_s) / come_s)
    if not span.open_end:
        share *= _smooth((span.end_s - times_s) / go_s)
    return share


def _smooth(x: Floats) -> Floats:
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)
