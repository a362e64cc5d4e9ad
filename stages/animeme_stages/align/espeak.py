"""espeak-ng through ctypes: pronunciations and speech for the languages without a dictionary.

The library is GPL-3.0 and comes with the extra ``espeak``; nothing here is loaded unless it is
asked for. espeak keeps one global state per process, so there is one instance per process.
"""

from __future__ import annotations

import _ctypes
import ctypes
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from animeme.errors import InputError

# From espeak-ng's speak_lib.h, revision 12.
_OUTPUT_SYNCHRONOUS = 2
_PHONEME_EVENTS = 0x0001
_PHONEME_EVENTS_IPA = 0x0002
_DONT_EXIT = 0x8000
_EVENT_LIST_END = 0
_EVENT_WORD = 1
_EVENT_PHONEME = 7
_CHARS_UTF8 = 1
_END_PAUSE = 0x1000
_PHONEMES_IPA = 0x02
_SEPARATOR = "_"
# Tones, where a word of another script is read in the voice of its own language.
_TONES = str.maketrans("", "", "0123456789^")
_POS_CHARACTER = 1
_PARAM_RATE = 1

# What a pause follows.
_SIGNS = (".", ",", "?", "!")
# Words beyond some 500 to 800 bytes without a sign are lost without a word.
LONGEST_PART_BYTES = 300
# espeak accepts these.
SLOWEST_WPM, FASTEST_WPM = 80, 450


class _EventId(ctypes.Union):
    _fields_: ClassVar = [
        ("number", ctypes.c_int),
        ("name", ctypes.c_char_p),
        # Not c_char: its value would end at a zero, which a name of eight bytes lacks.
        ("string", ctypes.c_ubyte * 8),
    ]


class _Event(ctypes.Structure):
    """espeak_EVENT."""

    _fields_: ClassVar = [
        ("type", ctypes.c_int),
        ("unique_identifier", ctypes.c_uint),
        ("text_position", ctypes.c_int),
        ("length", ctypes.c_int),
        ("audio_position", ctypes.c_int),  # milliseconds, rounded down
        ("sample", ctypes.c_int),
        ("user_data", ctypes.c_void_p),
        ("id", _EventId),
    ]


_SYNTH_CALLBACK = ctypes.CFUNCTYPE(
    ctypes.c_int, ctypes.POINTER(ctypes.c_short), ctypes.c_int, ctypes.POINTER(_Event)
)


@dataclass(frozen=True)
class SpeechEvent:
    """Something that begins while espeak speaks.

    Attributes:
        kind: a word or a phone.
        sample: where it begins in the samples.
        character: of a word, where it stands in the text; of a phone, its word's place.
        symbol: a phone in espeak's IPA, "" for a pause, or the name of a language in brackets
            where the voice changes to that language or back; "" for a word.
    """

    kind: Literal["word", "phone"]
    sample: int
    character: int
    symbol: str = ""


@dataclass(frozen=True, eq=False)
class Rendition:
    """What espeak made of a text: samples, mono int16 of shape (S,), and their events in order."""

    samples: NDArray[np.int16]
    events: tuple[SpeechEvent, ...]


@dataclass
class Espeak:
    """A loaded espeak-ng. Get it from `espeak`."""

    library: ctypes.CDLL
    rate_hz: int
    _voice: str = field(default="", init=False)

    def pronounce(self, word: str, voice: str) -> tuple[str, ...]:
        """IPA phones of one word, stress and length marks kept.

        Args:
            word: one orthographic word.
            voice: espeak voice, usually the language tag in lower case.

        Returns:
            One symbol per phone; empty if the word has no sound in that voice.
        """
        self._set_voice(voice)
        pointer = ctypes.c_char_p(word.encode())
        mode = _PHONEMES_IPA | ord(_SEPARATOR) << 8
        spoken: list[str] = []
        while pointer.value:  # one clause at a time
            clause = self.library.espeak_TextToPhonemes(ctypes.byref(pointer), _CHARS_UTF8, mode)
            spoken += clause.decode().replace(" ", _SEPARATOR).split(_SEPARATOR)
        phones = (plain_symbol(phone) for phone in spoken if not phone.startswith("("))
        return tuple(phone for phone in phones if phone)

    def speak(
        self,
        parts: Sequence[str],
        voice: str,
        *,
        words_per_minute: int = 160,
        afresh: bool = True,
    ) -> list[Rendition]:
        """Speech for each of `parts` of a text, with the pauses of their last signs between them.

        Sound and events come from one call, so the times are exact. The same arguments give the
        same samples, whatever was spoken before, if `afresh`.

        Args:
            parts: plain text without markup, each of at most `LONGEST_PART_BYTES`.
            voice: espeak voice.
            words_per_minute: 80 to 450.
            afresh: forget what was spoken before; else the voice's waves go on from there.
        """
        if afresh:
            self._forget()
        self._set_voice(voice)
        self.library.espeak_SetParameter(_PARAM_RATE, words_per_minute, 0)
        last = len(parts) - 1
        return [self._say(part, pause=index < last) for index, part in enumerate(parts)]

    def _say(self, text: str, *, pause: bool) -> Rendition:
        chunks: list[NDArray[np.int16]] = []
        events: list[SpeechEvent] = []

        def collect(
            samples: ctypes._Pointer[ctypes.c_short], count: int, news: ctypes._Pointer[_Event]
        ) -> int:
            if samples and count > 0:
                chunks.append(np.ctypeslib.as_array(samples, (count,)).astype(np.int16))
            index = 0
            while news[index].type != _EVENT_LIST_END:
                events.extend(_event(news[index]))
                index += 1
            return 0

        callback = _SYNTH_CALLBACK(collect)
        self.library.espeak_SetSynthCallback(callback)
        flags = _CHARS_UTF8 | (_END_PAUSE if pause and text.rstrip().endswith(_SIGNS) else 0)
        data = text.replace("\0", " ").encode()
        self.library.espeak_Synth(data, len(data) + 1, 0, _POS_CHARACTER, 0, flags, None, None)
        self.library.espeak_Synchronize()
        samples = np.concatenate(chunks) if chunks else np.zeros(0, np.int16)
        return Rendition(samples, tuple(events))

    def _forget(self) -> None:
        """Start anew.

        The flutter of the voice and the phase of its waves go on from one text to the next, through
        a new voice and through espeak_Terminate: only a library that is loaded again has lost them.
        """
        self.library.espeak_Terminate()
        _ctypes.dlclose(self.library._handle)
        self.library, self.rate_hz = _load()
        self._voice = ""

    def _set_voice(self, voice: str) -> None:
        if voice == self._voice:  # loading one takes milliseconds
            return
        if self.library.espeak_SetVoiceByName(voice.encode()) != 0:
            raise InputError(
                "language-unknown",
                f"espeak-ng has no voice '{voice}'",
                place=voice,
                action="Use a language that `animeme doctor` lists.",
            )
        self._voice = voice


def plain_symbol(symbol: str) -> str:
    """A phone's name without stress, tone and joiner."""
    return symbol.translate(_TONES).strip("ˈˌ\u200d")


def _event(event: _Event) -> Iterator[SpeechEvent]:
    character = max(event.text_position - 1, 0)
    if event.type == _EVENT_WORD:
        yield SpeechEvent("word", event.sample, character)
    elif event.type == _EVENT_PHONEME:
        # Cut off in the middle of a character where a name is too long.
        name = bytes(event.id.string).split(b"\0")[0].decode("utf-8", "ignore")
        yield SpeechEvent("phone", event.sample, character, name)


@lru_cache(maxsize=1)
def espeak() -> Espeak:
    """The process's espeak-ng.

    Raises:
        InputError: the extra is not installed; says how to install it.
    """
    return Espeak(*_load())


def _load() -> tuple[ctypes.CDLL, int]:
    """The library, started, and the sampling rate in Hz of what it speaks."""
    try:
        import espeakng_loader
    except ImportError:
        raise InputError(
            "extra-missing",
            "speech and pronunciations come from espeak-ng, which is not installed",
            place="extra 'espeak'",
            action="Run `pip install 'animeme[espeak]'`.",
        ) from None
    library = _opened(Path(espeakng_loader.get_library_path()))
    library.espeak_TextToPhonemes.restype = ctypes.c_char_p
    library.espeak_TextToPhonemes.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_int]
    path = str(espeakng_loader.get_data_path()).encode()
    options = _DONT_EXIT | _PHONEME_EVENTS | _PHONEME_EVENTS_IPA
    rate_hz = library.espeak_Initialize(_OUTPUT_SYNCHRONOUS, 0, path, options)
    if rate_hz <= 0:
        raise InputError(
            "extra-missing",
            "espeak-ng is installed but did not start",
            place="extra 'espeak'",
            action="Reinstall it: `pip install --force-reinstall espeakng-loader`.",
        )
    return library, rate_hz


def _opened(path: Path) -> ctypes.CDLL:
    """A copy of the library of our own: one that others have loaded too would not be unloaded."""
    try:
        with tempfile.TemporaryDirectory(prefix="animeme-") as folder:
            return ctypes.CDLL(shutil.copy(path, folder))
    except OSError:  # full, or nothing may be run from there
        return ctypes.CDLL(str(path))
