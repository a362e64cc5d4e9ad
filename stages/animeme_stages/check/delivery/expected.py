"""How far the mouth should be open, moment by moment, as its recording and its phones tell.

There are three guesses. The first is what lips do: linear in the
recording's mel bands (see `sound`) and, where they are known, in classes of phones over half a
second around each moment. It was fitted to the captured lips of every other line of the GRID
corpus's speaker s1 (Cooke et al. 2006, CC BY 4.0) by ``tests/bench/sync.py``, which prints how good
it is on the others. Classes are of IPA, so it knows no language. The second is what models
of speech do, linear in the same classes and fitted to those that are shipped, and the third what
animators do by rule: an opening for each kind of phone, blurred.
"""

from __future__ import annotations

import json
from functools import cache
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from animeme.contracts import Speech
from animeme.curves import Floats
from animeme.phones import SILENCE, PhoneTrack
from animeme_stages.check.delivery.sound import RATE_HZ, features

WEIGHTS = "expected_opening.json"
# Phones whose lips and jaw look alike, by how their IPA begins, after the classes of Jeffers &
# Barley, Speechreading (1971), and how far an animator opens the mouth for them, any unit. What
# fits none is like an alveolar.
_KINDS: tuple[tuple[str, float], ...] = (
    ("p b m", 0.0),
    ("f v ɱ", 0.15),
    ("θ ð", 0.35),
    ("ʃ ʒ tʃ dʒ ɕ ʑ tɕ dʑ", 0.35),
    ("s z ts dz", 0.35),
    ("k ɡ g ŋ h x ɣ χ ʁ ɦ", 0.35),
    ("w ɥ", 0.35),
    ("ɹ r ɻ", 0.35),
    ("ɝ ɚ", 0.6),
    ("j ʝ ɲ ʎ", 0.35),
    ("i ɪ ɨ", 0.6),
    ("u ʊ y ʏ ɯ", 0.6),
    ("o ø œ ɤ", 0.6),
    ("æ ɑ a ɐ ɔ ɒ ʌ", 1.0),
    ("e ɛ ə ɜ ɘ", 0.6),
    ("t d n l ɾ", 0.35),
)
CLASSES = tuple(tuple(phones.split()) for phones, _ in _KINDS)
_OPENINGS = tuple(opening for _, opening in _KINDS)
# Mouths take about this long from one phone to the next (standard deviation, seconds).
_BLUR_S = 0.03
_SILENT = len(CLASSES)
# Frames that are looked at, relative to the guessed one; each stands for three.
_CONTEXT = tuple(range(-24, 25, 4))


def expected_opening(speech: Speech, track: PhoneTrack | None = None) -> Floats:
    """How far the mouth should be open in each frame, any unit, shape (F,).

    Args:
        speech: the recording.
        track: its phones, if they are known; the guess is better for them.
    """
    heard = features(speech)
    if track is None:
        return np.asarray(heard @ _weights("sound"))
    both = np.hstack([heard, phone_features(track, len(heard))])
    return np.asarray(both @ _weights("sound and phones"))


def opening_of_phones(track: PhoneTrack, count: int) -> Floats:
    """The same in each of `count` frames, as the phones alone tell, shape (count,)."""
    return np.asarray(phone_features(track, count) @ _weights("phones"))


def opening_of_models(track: PhoneTrack, count: int) -> Floats:
    """How far models of speech would open the mouth in each of `count` frames, shape (count,)."""
    return np.asarray(phone_features(track, count) @ _weights("models"))


def opening_by_rule(track: PhoneTrack, count: int) -> Floats:
    """How far an animator would open the mouth in each of `count` frames, shape (count,)."""
    wanted = np.zeros(count)
    for phone, ipa in zip(track.phones, track.ipa(), strict=True):
        first, last = round(phone.start_s * RATE_HZ), round(phone.end_s * RATE_HZ)
        wanted[first:last] = 0.0 if phone.symbol == SILENCE else _OPENINGS[class_of(ipa)]
    reach = int(4 * _BLUR_S * RATE_HZ)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / (_BLUR_S * RATE_HZ)) ** 2)
    return np.convolve(np.pad(wanted, reach, mode="edge"), kernel / kernel.sum(), "valid")


def phone_features(track: PhoneTrack, count: int) -> Floats:
    """Which class of phones is spoken around each of `count` frames.

    Returns:
        Shape (count, classes × frames of context), 0 to 3.
    """
    spoken = np.zeros((count, len(CLASSES) + 1))
    spoken[:, _SILENT] = 1.0
    for phone, ipa in zip(track.phones, track.ipa(), strict=True):
        first, last = round(phone.start_s * RATE_HZ), round(phone.end_s * RATE_HZ)
        spoken[first:last] = 0.0
        spoken[first:last, _SILENT if phone.symbol == SILENCE else class_of(ipa)] = 1.0
    reach = _CONTEXT[-1] + 1
    padded = np.pad(spoken, ((reach, reach), (0, 0)), mode="edge")
    near = padded[:-2] + padded[1:-1] + padded[2:]
    return np.hstack([near[reach - 1 + c : reach - 1 + c + count] for c in _CONTEXT])


def class_of(ipa: str) -> int:
    """Which of `CLASSES` a phone is of: that with the longest beginning of it."""
    length, found = max(
        (len(start), -number)
        for number, starts in enumerate(CLASSES)
        for start in (*starts, "")
        if ipa.startswith(start)
    )
    return -found if length else len(CLASSES) - 1


@cache
def _weights(which: str) -> NDArray[np.float64]:
    text = files(__package__).joinpath(WEIGHTS).read_text(encoding="utf-8")
    return np.array(json.loads(text)[which])
