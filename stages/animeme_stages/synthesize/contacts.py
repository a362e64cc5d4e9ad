"""Lips that meet: closures of /p b m/ and labiodental contact of /f v/, for any model.

Albrecht, Haber & Seidel 2002, section 3.2, ask for a key at the start and the end of every closure
(of /p b/ only the closure, not the release), with the lips together in between. A statistical model
is too smooth to promise that. This stage bounds each control that parts the lips during a contact,
by a bound learned from the captured contacts, and lets go of it smoothly on either side.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from animeme.curves import Floats
from animeme.dataset import CapturedLine, Dataset
from animeme.phones import PhoneTrack
from animeme_stages.synthesize.articulation import Articulation, pieces

# The part of /p b/ that is closure; the rest is release (as in the shipped Cohen–Massaro table).
CLOSURE_SHARE = 0.6
# The longest and the shortest time to reach or leave a contact; the latter is two frames at 60 Hz.
LONGEST_RAMP_S = 0.05
SHORTEST_RAMP_S = 1 / 30
# The same from a phone with a contact on its other side, too: it still opens in its middle.
SQUEEZED_RAMP_S = 1 / 60
# A contact is looked for this much before and after its phone, as `closure_recall` does.
SLACK_S = 0.04
# What the captured speaker does in this part of his contacts is the bound.
USUAL = 0.9
# Controls whose contacts differ by more than this part of the control's range are not bounded ...
LOOSEST = 0.35
# ... nor those that keep within the bound in more than this part of all other phones.
COMMONEST = 0.4
# Fewer contacts than this say nothing about a control.
FEWEST = 8


@dataclass(frozen=True)
class Bound:
    """What one control does during one kind of contact.

    Attributes:
        kind: "bilabial" or "labiodental".
        control: its name.
        limit: the value that it does not pass.
        upper: it stays at or below `limit`, else at or above.
    """

    kind: str
    control: str
    limit: float
    upper: bool


@dataclass(frozen=True)
class Span:
    """When a contact lasts, and over which times it is reached and left."""

    kind: str
    start_s: float
    end_s: float
    ramp_in_s: float
    ramp_out_s: float


def contact_spans(track: PhoneTrack) -> tuple[Span, ...]:
    """The contacts of a track, in order."""
    return tuple(_spans(track))


def _kind(letter: Articulation) -> str | None:
    """Which contact a letter is."""
    if not letter.vowel and letter.manner in ("plosive", "nasal") and letter.place == 0:
        return "bilabial"
    teeth = letter.manner == "fricative" and 0 < letter.place < 8 and not letter.rounded
    return "labiodental" if teeth else None


def _spans(track: PhoneTrack) -> Iterator[Span]:
    phones, symbols = track.phones, track.ipa()
    touching = {j for j, symbol in enumerate(symbols) if any(map(_kind, pieces(symbol)))}
    for index, (symbol, phone) in enumerate(zip(symbols, phones, strict=True)):
        letters = pieces(symbol)
        for part, letter in enumerate(letters):
            kind = _kind(letter)
            if kind is None:
                continue
            step_s = phone.duration_s / len(letters)
            start_s = phone.start_s + part * step_s
            end_s = phone.end_s if part == len(letters) - 1 else start_s + step_s
            if letter.manner == "plosive":
                end_s = start_s + CLOSURE_SHARE * (end_s - start_s)
            before = phones[index - 1].duration_s if index else LONGEST_RAMP_S
            after = phones[index + 1].duration_s if index + 1 < len(phones) else LONGEST_RAMP_S
            ramp_in_s = _ramp(before, squeezed=index - 2 in touching)
            ramp_out_s = _ramp(after, squeezed=index + 2 in touching)
            yield Span(kind, start_s, end_s, ramp_in_s, ramp_out_s)


def _ramp(neighbour_s: float, *, squeezed: bool) -> float:
    """How long a contact takes from its neighbour; less if there is a contact beyond, too.

    A short vowel between two contacts would never open otherwise.
    """
    share, shortest_s = (0.5, SQUEEZED_RAMP_S) if squeezed else (0.75, SHORTEST_RAMP_S)
    return min(max(share * neighbour_s, shortest_s), LONGEST_RAMP_S)


@dataclass(frozen=True)
class Contacts:
    """The bounds of a set of controls, applied to any curves over them."""

    bounds: tuple[Bound, ...] = ()

    def keys(self, track: PhoneTrack) -> list[float]:
        """Times at which a curve needs keys: both ends of every bounded contact."""
        kinds = {bound.kind for bound in self.bounds}
        spans = [span for span in contact_spans(track) if span.kind in kinds]
        return [time_s for span in spans for time_s in (span.start_s, span.end_s)]

    def hold(
        self, track: PhoneTrack, times_s: Floats, weights: Floats, controls: Sequence[str]
    ) -> Floats:
        """`weights` with every bound kept during its contacts, without a jump.

        Args:
            track: the phones.
            times_s: shape (T,).
            weights: shape (T, N).
            controls: N names.
        """
        held = weights.copy()
        spans = contact_spans(track) if self.bounds else ()
        # Lips that meet come last: next to /f v/, a gap between them is what would be seen.
        for kind in sorted({bound.kind for bound in self.bounds}, reverse=True):
            pull = _pull([span for span in spans if span.kind == kind], times_s)
            for bound in self.bounds:
                if bound.kind == kind:
                    column = held[:, controls.index(bound.control)]
                    over = column - bound.limit
                    column -= pull * (np.maximum(over, 0) if bound.upper else np.minimum(over, 0))
        return held

    def to_json(self) -> list[dict[str, Any]]:
        """As model documents have it."""
        return [asdict(bound) for bound in self.bounds]

    @classmethod
    def from_json(cls, entries: Any, controls: Sequence[str]) -> Contacts:
        """Read what `to_json` wrote.

        Raises:
            ValueError: an entry makes no sense; says which.
        """
        bounds = []
        for entry in entries:
            if not isinstance(entry, Mapping) or set(entry) != {
                "kind", "control", "limit", "upper",
            }:  # fmt: skip
                raise ValueError(f"contacts: {entry!r} is not a contact")
            bound = Bound(
                str(entry["kind"]), str(entry["control"]), float(entry["limit"]), entry["upper"]
            )
            if bound.kind not in ("bilabial", "labiodental") or bound.control not in controls:
                raise ValueError(f"contacts: unknown {bound.kind} or {bound.control}")
            if not np.isfinite(bound.limit) or not isinstance(bound.upper, bool):
                raise ValueError(f"contacts: {entry!r} is not a contact")
            bounds.append(bound)
        return cls(tuple(bounds))


def _pull(spans: Sequence[Span], times_s: Floats) -> Floats:
    """1 during contacts, smoothly to 0 over their ramps, shape (T,)."""
    pull = np.zeros(len(times_s))
    for span in spans:
        first, last = np.searchsorted(
            times_s, [span.start_s - span.ramp_in_s, span.end_s + span.ramp_out_s]
        )
        at_s = times_s[first:last]
        before = (span.start_s - at_s) / span.ramp_in_s
        after = (at_s - span.end_s) / span.ramp_out_s
        u = 1.0 - np.clip(np.maximum(before, after), 0.0, 1.0)
        pull[first:last] = np.maximum(pull[first:last], u * u * (3.0 - 2.0 * u))
    return pull


def learn_contacts(dataset: Dataset) -> Contacts:
    """The bounds that the captured speaker keeps.

    A control is bounded if its most extreme value during a contact hardly varies, and other phones
    seldom reach it.
    """
    extremes: dict[str, list[Floats]] = {"bilabial": [], "labiodental": [], "other": []}
    for line in dataset.lines:
        for kind, low, high in _extremes(line):
            extremes[kind].append(np.stack([low, high]))
    if not extremes["other"]:
        return Contacts()
    other = np.stack(extremes["other"])
    values = np.concatenate([line.values for line in dataset.lines])
    bounds = []
    for kind in ("bilabial", "labiodental"):
        if len(extremes[kind]) < FEWEST:
            continue
        seen = np.stack(extremes[kind])
        for column, control in enumerate(dataset.controls):
            for upper in (True, False):
                side = 0 if upper else 1
                own, rest = seen[:, side, column], other[:, side, column]
                limit = _bound(own, rest, values[:, column], upper=upper)
                if limit is not None:
                    bounds.append(Bound(kind, control, limit, upper))
    return Contacts(tuple(bounds))


def _bound(own: Floats, rest: Floats, values: Floats, *, upper: bool) -> float | None:
    own, rest, values = (a[np.isfinite(a)] for a in (own, rest, values))
    if len(own) < FEWEST or not len(rest):
        return None
    spread = float(np.diff(np.percentile(values, [2, 98]))[0])
    if spread <= 0 or np.diff(np.percentile(own, [5, 95]))[0] > LOOSEST * spread:
        return None
    limit = float(np.quantile(own, USUAL if upper else 1 - USUAL))
    within = rest <= limit if upper else rest >= limit
    return None if within.mean() > COMMONEST else float(f"{limit:.6g}")


def _extremes(line: CapturedLine) -> Iterator[tuple[str, Floats, Floats]]:
    """Kind, smallest and largest captured value of each control, for every phone."""
    contacts = {round(span.start_s, 9): span.kind for span in contact_spans(line.track)}
    for symbol, phone in zip(line.track.ipa(), line.track.phones, strict=True):
        kind = contacts.get(round(phone.start_s, 9))
        if kind is None and not (pieces(symbol) and pieces(symbol)[0].vowel):
            continue
        inside = (line.times_s >= phone.start_s - SLACK_S) & (line.times_s <= phone.end_s + SLACK_S)
        rows = line.values[inside]
        if len(rows):
            gaps = np.isnan(rows)
            low = np.where(gaps, np.inf, rows).min(axis=0)
            high = np.where(gaps, -np.inf, rows).max(axis=0)
            yield kind or "other", low, high
