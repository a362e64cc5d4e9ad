"""Coarticulation by dominance functions.

Cohen & Massaro 1993, with the extensions of Albrecht, Haber & Seidel 2002 ("the 2002 paper"):
dominance limited to seven segments on either side (eq. 4–5), closure and release, contacts that are
reached exactly, and keys that the sampling would miss (sections 3.2 and 3.3).
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.resources import files
from typing import Any, ClassVar

import numpy as np

from animeme.curves import CurveSet, Floats
from animeme.dataset import Dataset, Listener, no_listener
from animeme.errors import InputError
from animeme.findings import Finding, Severity
from animeme.phones import PhoneTrack
from animeme_stages.synthesize.cohen_massaro_fit import contacts_of, fit_document
from animeme_stages.synthesize.contacts import Contacts
from animeme_stages.synthesize.fitted import require_motion
from animeme_stages.synthesize.options import read_options
from animeme_stages.synthesize.sampling import SAME_TIME_S, sample_times
from animeme_stages.synthesize.segments import Segment, segments, split_symbol
from animeme_stages.synthesize.table import TargetTable

# Coarticulation reaches at most seven segments, fading over the seventh (2002 paper, section 3.1).
REACH = 7
# e^-600 is still a number; beyond, dominances are equal, and equally negligible.
_LARGEST_EXPONENT = 600.0
# The shortest ramp into a contact: two frames at 60 Hz, so that no sample can jump over it.
SHORTEST_RAMP_S = 1 / 30


@dataclass(frozen=True)
class _Arrays:
    """The segments of one track as arrays; S segments, G groups, N controls."""

    start_s: Floats  # (S,)
    end_s: Floats  # (S,)
    peak_start_s: Floats  # (S,)
    peak_end_s: Floats  # (S,)
    alpha: Floats  # (S, G)
    targets: Floats  # (S, N)


@dataclass(frozen=True)
class CohenMassaroOptions:
    """Options of fitting `CohenMassaro`."""

    c: float = field(default=1.1, metadata={"low": 1, "high": 4})
    plateau_s: float = field(default=0.12, metadata={"low": 0, "high": 10})
    contacts: bool = False


class CohenMassaro:
    """Control curves as dominance-weighted averages of phone targets (2002 paper, eq. 5).

    Works untrained, from a shipped table of targets for ARKit controls; `fit` learns a table for
    the controls of a dataset.
    """

    name: ClassVar[str] = "cohen-massaro"

    def __init__(self, table: TargetTable, options: CohenMassaroOptions | None = None) -> None:
        self.table = table
        self.options = options or CohenMassaroOptions()
        self.contacts = (
            contacts_of(table.document, table.controls)
            if table.fitted and self.options.contacts
            else Contacts()
        )

    @property
    def controls(self) -> tuple[str, ...]:
        """Names of the curves that `synthesize` returns."""
        return self.table.controls

    @classmethod
    def default(cls) -> CohenMassaro:
        """The model with the shipped ARKit targets."""
        return _shipped()

    @classmethod
    def configured(cls, options: Mapping[str, Any]) -> CohenMassaro:
        """The shipped model, to be fitted with these options.

        Raises:
            InputError: an option is unknown, or a value makes no sense.
        """
        try:
            read = read_options(CohenMassaroOptions, options)
        except ValueError as error:
            raise InputError(
                "model-option", str(error), place=cls.name, action="docs/models.md lists them."
            ) from error
        return cls(_shipped().table, read)

    def fit(self, dataset: Dataset, *, listener: Listener = no_listener) -> CohenMassaro:
        """A model with the dataset's controls, and targets and dominances learned from it.

        Raises:
            InputError: there is nothing to learn from.
        """
        require_motion(dataset)
        options = self.options
        document = fit_document(dataset, options.c, options.plateau_s, listener)
        if not options.contacts:
            document["contacts"] = []
        return CohenMassaro(TargetTable.from_document(document), options)

    def remarks(self, track: PhoneTrack) -> Iterator[Finding]:
        """Phones that no class has, or that the training data lacked."""
        seen = self.table.document.get("seen")
        if seen is not None:
            strangers = sorted(set(track.ipa()) - set(seen))
            if strangers:
                yield Finding(
                    Severity.INFO,
                    "model-phone-unseen",
                    f"the model never saw /{'/, /'.join(strangers)}/ and moves them like the "
                    "nearest phones",
                    action="Add lines that have them to its training data.",
                )
            return
        unknown = sorted({s for s in track.ipa() if not split_symbol(s, self.table.rows)})
        if unknown:
            yield Finding(
                Severity.INFO,
                "model-phone-unseen",
                f"the model knows nothing of /{'/, /'.join(unknown)}/ and moves them like schwa",
                action="Add them to a class of its table.",
            )

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> CohenMassaro:
        """Rebuild a model from an ``animeme.model`` document.

        Raises:
            ValueError: the document does not fit this model.
        """
        # What a fitted document holds was decided when it was fitted.
        return cls(TargetTable.from_document(document), CohenMassaroOptions(contacts=True))

    def to_document(self) -> dict[str, Any]:
        """The ``animeme.model/1`` document that rebuilds this model."""
        return self.table.to_document()

    def synthesize(self, track: PhoneTrack, *, rate_hz: float) -> CurveSet:
        """Control curves over the whole of `track`.

        Args:
            track: aligned phones; symbols that the table lacks move like schwa.
            rate_hz: sampling rate; keys for contacts and short phones come on top.

        Returns:
            One curve per control, from 0 to the end of the track.
        """
        parts = segments(
            track,
            self.table.rows,
            self.table.releases,
            self.table.contact_rows,
            self.table.start_peak_rows,
            plateau_s=self.table.plateau_s,
            closure_share=self.table.closure_share,
        )
        times_s = key_times(parts, rate_hz, self.contacts.keys(track))
        weights = self._average(self._arrays(parts), times_s)
        self._reach_contacts(parts, times_s, weights)
        if self.table.fitted:
            held = self.contacts.hold(track, times_s, weights, self.controls)
            return CurveSet(times_s, self.controls, held)
        return CurveSet(times_s, self.controls, np.clip(weights, 0.0, 1.0))

    def _arrays(self, parts: Sequence[Segment]) -> _Arrays:
        rows = np.array([part.row for part in parts])
        times = np.array([(p.start_s, p.end_s, p.peak_start_s, p.peak_end_s) for p in parts])
        start_s, end_s, peak_start_s, peak_end_s = times.T
        alpha, targets = self.table.alpha[rows], self.table.targets[rows]
        return _Arrays(start_s, end_s, peak_start_s, peak_end_s, alpha, targets)

    def _average(self, arrays: _Arrays, times_s: Floats) -> Floats:
        """Eq. 5: F(t) = Σ D T / Σ D over the window, shape (T, N)."""
        count = len(arrays.start_s)
        current = np.clip(np.searchsorted(arrays.start_s, times_s, side="right") - 1, 0, count - 1)
        top = np.zeros((len(times_s), len(self.controls)))
        bottom = np.zeros((len(times_s), len(self.table.groups)))
        for offset in range(-REACH, REACH + 1):
            segment = current + offset
            inside = np.flatnonzero((segment >= 0) & (segment < count))
            who = segment[inside]
            if abs(offset) < REACH:
                weight = self._dominance(arrays, who, times_s[inside])
            else:
                weight = self._faded(arrays, who, current[inside], times_s[inside])
            bottom[inside] += weight
            top[inside] += weight[:, self.table.group_of] * arrays.targets[who]
        return top / bottom[:, self.table.group_of]

    def _dominance(self, arrays: _Arrays, who: Any, at_s: Floats) -> Floats:
        """Eq. 2 with separate θ before and after the peak, shape (K, G)."""
        before = np.maximum(arrays.peak_start_s[who] - at_s, 0.0)[:, None]
        after = np.maximum(at_s - arrays.peak_end_s[who], 0.0)[:, None]
        table = self.table
        exponent = table.theta_before * before**table.c + table.theta_after * after**table.c
        # Far from every peak of a very long phone all dominances would underflow together.
        result: Floats = arrays.alpha[who] * np.exp(-np.minimum(exponent, _LARGEST_EXPONENT))
        return result

    def _faded(self, arrays: _Arrays, who: Any, current: Any, at_s: Floats) -> Floats:
        """Eq. 4's outer branches: cubic Hermite from the seventh segment's near border to 0."""
        later = current > who
        border_s = np.where(later, arrays.start_s[current], arrays.end_s[current])
        length_s = arrays.end_s[current] - arrays.start_s[current]
        value = self._dominance(arrays, who, border_s)
        reach_s = np.where(
            later, border_s - arrays.peak_end_s[who], arrays.peak_start_s[who] - border_s
        )[:, None]
        theta = np.where(later[:, None], self.table.theta_after, self.table.theta_before)
        # dD/dt away from the segment; both branches fall, so the same sign serves both sides.
        slope = -value * theta * self.table.c * np.maximum(reach_s, 0.0) ** (self.table.c - 1.0)
        u = (np.abs(at_s - border_s) / length_s)[:, None]
        rest = 1.0 - u
        # Hermite basis with zero value and slope at the far end. It may dip below 0 where the
        # slope is steep; a dominance may not.
        faded = value * (1.0 + 2.0 * u) * rest**2 + slope * length_s[:, None] * u * rest**2
        result: Floats = np.maximum(faded, 0.0)
        return result

    def _reach_contacts(self, parts: Sequence[Segment], times_s: Floats, weights: Floats) -> None:
        """Blend contact controls to their targets, exactly over each contact (section 3.2).

        The paper gives closures a high magnitude, so that they come close. This is the limit of an
        unbounded magnitude whose support ends with the ramps: w/(1 − w) in place of α exp(…).
        """
        table = self.table
        free = np.ones(weights.shape)
        pull = np.zeros(weights.shape)
        total = np.zeros(weights.shape)
        for index, start_s, end_s in _contacts(parts):
            mask = table.contact[parts[index].row]
            ramp_in_s = self._ramp_s(parts, index - 1)
            ramp_out_s = self._ramp_s(parts, index + 1)
            window = slice(
                *np.searchsorted(times_s, [start_s - ramp_in_s, end_s + ramp_out_s + SAME_TIME_S])
            )
            at_s = times_s[window]
            outside = np.where(
                at_s < start_s, (start_s - at_s) / ramp_in_s, (at_s - end_s) / ramp_out_s
            )
            u = np.clip(1.0 - outside, 0.0, 1.0)[:, None]
            # Short of 1, so that where two contacts meet the instant belongs to both.
            w = u * u * (3.0 - 2.0 * u) * mask * (1.0 - 1e-9)
            # Two contacts that overlap share the pull in proportion, and the first is not undone.
            pull[window] = (
                pull[window] * (1.0 - w) + w * free[window] * table.targets[parts[index].row]
            )
            total[window] = total[window] * (1.0 - w) + w * free[window]
            free[window] *= 1.0 - w
        norm = free + total
        weights *= free / norm
        weights += pull / norm

    def _ramp_s(self, parts: Sequence[Segment], neighbour: int) -> float:
        """Time to reach or leave a contact: at most the table's, half of a short neighbour."""
        longest = self.table.contact_ramp_s
        if not 0 <= neighbour < len(parts):
            return longest
        length_s = parts[neighbour].end_s - parts[neighbour].start_s
        return float(np.clip(0.75 * length_s, SHORTEST_RAMP_S, longest))


def _contacts(parts: Sequence[Segment]) -> Iterator[tuple[int, float, float]]:
    """Index and borders of each contact."""
    for index, part in enumerate(parts):
        if part.contact:
            yield index, part.start_s, part.end_s


def key_times(parts: Sequence[Segment], rate_hz: float, more: Sequence[float] = ()) -> Floats:
    """Sampling times: uniform, both ends, contacts' borders, and peaks between two samples.

    Sections 3.2 and 3.3 of the 2002 paper. Shape (T,), strictly increasing, seconds.
    """
    extra = list(more)
    for part in parts:
        if part.contact:
            extra += [part.start_s, part.end_s]
        elif np.floor(part.start_s * rate_hz) == np.floor(part.end_s * rate_hz):
            extra.append((part.peak_start_s + part.peak_end_s) / 2)
    return sample_times(parts[-1].end_s, rate_hz, extra)


@lru_cache(maxsize=1)
def _shipped() -> CohenMassaro:
    text = files("animeme_stages.synthesize").joinpath("arkit_targets.toml").read_text("utf-8")
    return CohenMassaro.from_document(tomllib.loads(text))
