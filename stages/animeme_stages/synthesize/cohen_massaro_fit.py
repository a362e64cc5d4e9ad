"""Fitting the Cohen–Massaro model to captured motion.

Every phone gets a class of its own, every control a group of its own. Targets T, magnitudes α and
rates θ before and after (2002 paper, eq. 2 and 5) are found together by Levenberg–Marquardt steps
(Marquardt 1963) on the logarithms of α and θ and on T.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy  # its parts load when they are first used

from animeme.curves import Floats
from animeme.dataset import Dataset, Listener
from animeme.phones import SILENCE
from animeme_stages.synthesize.articulation import letters, nearest
from animeme_stages.synthesize.contacts import Contacts, learn_contacts
from animeme_stages.synthesize.fitted import frames_of
from animeme_stages.synthesize.numbers import rounded
from animeme_stages.synthesize.spoken import Ints, spoken

# Neighbours on either side that are felt while fitting; at the rates that are found, the last of
# the paper's seven add nothing that could be measured.
_REACH = 5
_START_THETA = 18.0
_THETA_LIMITS = (1.0, 200.0)
_ALPHA_LIMITS = (0.02, 50.0)
_STEPS = 20
_CONVERGED = 1e-4
# Added to the normal equations: a phone seen once keeps a magnitude near 1.
_RIDGE = 0.1


@dataclass(frozen=True, eq=False)
class _Pairs:
    """Frames and the phones around them; P pairs."""

    frame: Ints
    row: Ints
    before: Floats  # (P,), (time until the peak)^c, 0 after it
    after: Floats
    frames: int
    rows: int


def fit_document(
    dataset: Dataset, c: float, plateau_s: float, listener: Listener
) -> dict[str, Any]:
    """An ``animeme.model/1`` document of a Cohen–Massaro model fitted to `dataset`.

    Args:
        dataset: lines with captured motion.
        c: exponent of eq. 2, at least 1.
        plateau_s: see the shipped table.
        listener: told of progress.
    """
    symbols = sorted({s for line in dataset.lines for s in line.track.ipa()})
    pairs, values = _pairs(dataset, symbols, c, plateau_s)
    groups: dict[str, Any] = {}
    alpha: dict[str, dict[str, float]] = {symbol: {} for symbol in symbols}
    targets: dict[str, dict[str, float]] = {symbol: {} for symbol in symbols}
    for column, control in enumerate(dataset.controls):
        known = np.isfinite(values[:, column])
        solved = _fit(pairs, values[:, column], known)
        t, a, theta = (rounded(part) for part in solved)
        groups[control] = {
            "controls": [control], "theta_before": float(theta[0]),
            "theta_after": float(theta[1]), "c": c,
        }  # fmt: skip
        for row, symbol in enumerate(symbols):
            alpha[symbol][control], targets[symbol][control] = float(a[row]), float(t[row])
        listener("targets", (column + 1) / len(dataset.controls))
    counts = Counter(s for line in dataset.lines for s in line.track.ipa())
    return {
        "schema": "animeme.model/1",
        "model": "cohen-massaro",
        "config": {
            "fitted": True, "plateau_s": plateau_s, "contact_ramp_s": 0.08, "closure_share": 0.6,
        },
        "groups": groups,
        "classes": {
            symbol: {
                "phones": phones, "alpha": alpha[symbol], "targets": targets[symbol],
            }
            for symbol, phones in _members(symbols).items()
        },
        "seen": {symbol: counts[symbol] for symbol in symbols},
        "contacts": learn_contacts(dataset).to_json(),
    }  # fmt: skip


def _members(symbols: list[str]) -> dict[str, list[str]]:
    """Each phone, and the letters of the IPA that were not seen and look most like it."""
    members = {symbol: [symbol] for symbol in symbols}
    for letter in letters():
        if letter not in members:
            members[nearest(letter, symbols)].append(letter)
    if SILENCE not in members:  # a pause then looks like the closest thing that was captured
        members[nearest("m", symbols)].append(SILENCE)
    return members


def contacts_of(document: Any, controls: tuple[str, ...]) -> Contacts:
    """The learned contacts of a fitted document.

    Raises:
        ValueError: they make no sense.
    """
    return Contacts.from_json(document.get("contacts", []), controls)


def _pairs(
    dataset: Dataset, symbols: list[str], c: float, plateau_s: float
) -> tuple[_Pairs, Floats]:
    phones = spoken([line.track for line in dataset.lines])
    times_s, values = frames_of(dataset, phones.offset_s)
    number = {symbol: i for i, symbol in enumerate(symbols)}
    row = np.array([number[symbol] for symbol in phones.symbols])
    hold_s = np.maximum(phones.length_s - plateau_s, 0.0) / 2
    middle_s = phones.start_s + phones.length_s / 2
    current = np.maximum(np.searchsorted(phones.start_s, times_s, side="right") - 1, 0)
    parts = []
    for offset in range(-_REACH, _REACH + 1):
        who = phones.neighbour(offset)[current]
        frame = np.flatnonzero(who >= 0)
        who = who[frame]
        tau_s = times_s[frame] - middle_s[who]
        before = np.maximum(-tau_s - hold_s[who], 0.0) ** c
        after = np.maximum(tau_s - hold_s[who], 0.0) ** c
        parts.append((frame, row[who], before, after))
    frame, rows, before, after = (np.concatenate(part) for part in zip(*parts, strict=True))
    return _Pairs(frame, rows, before, after, len(times_s), len(symbols)), values


def _fit(pairs: _Pairs, values: Floats, known: Any) -> tuple[Floats, Floats, Floats]:
    """T and α, shape (R,), and (θ before, θ after) of one control."""
    count = pairs.rows
    kept = known[pairs.frame]
    number = np.cumsum(known) - 1
    own = _Pairs(
        number[pairs.frame[kept]], pairs.row[kept], pairs.before[kept], pairs.after[kept],
        int(known.sum()), count,
    )  # fmt: skip
    captured = values[known]
    x = np.concatenate(
        [np.full(count, captured.mean()), np.zeros(count), np.log([_START_THETA] * 2)]
    )
    damping, state = 1e-3, _evaluate(own, x, captured)
    for _ in range(_STEPS):
        error, slopes, residual = state
        normal = (slopes.T @ slopes).toarray()
        normal[np.diag_indices_from(normal)] += _RIDGE * np.concatenate(
            [np.full(count, 1e-3), np.full(count, float(captured.var())), [0.0, 0.0]]
        )
        downhill = slopes.T @ residual
        scale = np.maximum(np.diag(normal), 1e-12)
        for _ in range(6):
            step = np.linalg.solve(normal + np.diag(damping * scale), downhill)
            step[count:] = np.clip(step[count:], -1.0, 1.0)
            moved = x + step
            moved[count : 2 * count] = np.clip(moved[count : 2 * count], *np.log(_ALPHA_LIMITS))
            moved[2 * count :] = np.clip(moved[2 * count :], *np.log(_THETA_LIMITS))
            following = _evaluate(own, moved, captured)
            if following[0] < error:
                x, state, damping = moved, following, max(damping / 5, 1e-7)
                break
            damping *= 8
        if state[0] > error * (1 - _CONVERGED):
            break
    return x[:count], np.exp(x[count : 2 * count]), np.exp(x[2 * count :])


def _evaluate(pairs: _Pairs, x: Floats, captured: Floats) -> tuple[float, Any, Floats]:
    """Squared error, derivatives of the prediction by `x` (sparse), and the residual."""
    count = pairs.rows
    targets, alpha, theta = x[:count], np.exp(x[count : 2 * count]), np.exp(x[2 * count :])
    fall = theta[0] * pairs.before + theta[1] * pairs.after
    d = alpha[pairs.row] * np.exp(-np.minimum(fall, 600.0))
    weight = d / np.maximum(np.bincount(pairs.frame, d, pairs.frames), 1e-300)[pairs.frame]
    predicted = np.bincount(pairs.frame, weight * targets[pairs.row], pairs.frames)
    above = weight * (targets[pairs.row] - predicted[pairs.frame])
    entries = [weight, above, -above * theta[0] * pairs.before, -above * theta[1] * pairs.after]
    full = np.full(len(pairs.row), 2 * count)
    columns = [pairs.row, count + pairs.row, full, full + 1]
    slopes = scipy.sparse.csr_matrix(
        (np.concatenate(entries), (np.tile(pairs.frame, 4), np.concatenate(columns))),
        shape=(pairs.frames, 2 * count + 2),
    )
    residual = captured - predicted
    return float(residual @ residual), slopes, residual
