"""Which bigram each key of a result comes from, so that an animator finds what to edit."""

from __future__ import annotations

from typing import Any

from animeme.curves import CurveSet, reduce_keys
from animeme.phones import PhoneTrack
from animeme_stages.synthesize.bigram import Bigram, missing_pairs
from animeme_stages.synthesize.bigram_files import find_set
from animeme_stages.synthesize.bigram_set import SAMPLES
from animeme_stages.synthesize.sampling import sample_times

_RATE_HZ = 60.0
_KEY_ERROR = 0.005
# A pose below this at a key and its neighbours is at rest there.
_REST = 0.005


def trace_bigrams(bigrams: str, track: PhoneTrack) -> dict[str, Any]:
    """The keys of every pose in a line, each with the bigram that it comes from.

    Args:
        bigrams: shipped name or file of the set.
        track: the line's phones.

    Returns:
        JSON-safe: ``poses``, pose → keys with ``time_s``, ``weight``, ``pair`` (of the line),
        ``from`` (the entry of the set, another where the set lacks the pair), ``set`` (the
        document that has it), ``at`` (local time in it), ``phones`` with their times, and
        ``changed`` (passes after the stitching that changed the weight); ``missing``, pair → what
        it is made of.
    """
    drawn = find_set(bigrams)
    model = Bigram.from_set(drawn)
    parts = model.segments(track)
    passes = model.passes(track, sample_times(track.duration_s, _RATE_HZ))
    classes = [drawn.set_.class_of(symbol) for symbol in parts.symbols]
    written = ["sil", *(phone.symbol for phone in track.phones), "sil"]
    places = {
        (int(row), int(pair)): float(low + part) / (SAMPLES - 1)
        for rows, pairs, lows, rests in parts.bigrams_at(passes.times_s)
        for row, pair, low, part in zip(rows, pairs, lows, rests, strict=True)
    }
    poses = {}
    for column, pose in enumerate(drawn.set_.poses):
        single = CurveSet(passes.times_s, (pose,), passes.limited[:, [column]])
        kept = reduce_keys(single, _KEY_ERROR)
        keys = []
        for row in passes.times_s.searchsorted(kept.times_s).tolist():
            weight = float(passes.limited[row, column])
            around = passes.limited[max(row - 1, 0) : row + 2, column]
            if abs(around).max() < _REST:
                continue
            pair = int(passes.stitched.pair[row, column])
            first, second = classes[pair], classes[pair + 1]
            source = drawn.set_.source(first, second)
            keys.append(
                {
                    "time_s": round(float(passes.times_s[row]), 4),
                    "weight": round(weight, 4),
                    "pair": f"{first}|{second}",
                    "from": source,
                    "set": (drawn.owners or {}).get(source, ""),
                    "at": round(places[row, pair], 3),
                    "phones": [_spoken(track, written, pair + i) for i in (0, 1)],
                    "changed": passes.at(row, column),
                }
            )
        if keys:
            poses[pose] = keys
    return {"poses": poses, "missing": missing_pairs(drawn.set_, track)}


def _spoken(track: PhoneTrack, written: list[str], segment: int) -> dict[str, Any]:
    """A phone of a pair; the rests before and after a track have no length in it."""
    if 0 < segment <= len(track.phones):
        phone = track.phones[segment - 1]
        return {
            "symbol": phone.symbol,
            "start_s": round(phone.start_s, 4),
            "end_s": round(phone.end_s, 4),
        }
    at_s = 0.0 if segment == 0 else round(track.duration_s, 4)
    return {"symbol": written[segment], "start_s": at_s, "end_s": at_s}
