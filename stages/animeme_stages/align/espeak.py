"""espeak-ng through ctypes: pronunciations and speech for the languages without a dictionary.

The library is GPL-3.0 and comes with the extra ``espeak``; nothing here is loaded unless it is
asked for. espeak keeps one global state per process, so there is one instance per process.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from animeme.errors import InputError

# From espeak-ng's speak_lib.h.
_OUTPUT_RETRIEVAL = 1
_DONT_EXIT = 0x8000
_CHARS_UTF8 = 1
_PHONEMES_IPA = 0x02
_SEPARATOR = "_"
# Tones, where a word of another script is read in the voice of its own language.
_TONES = str.maketrans("", "", "0123456789^")
_POS_CHARACTER = 1
_PARAM_RATE = 1

_SYNTH_CALLBACK = ctypes.CFUNCTYPE(
    ctypes.c_int, ctypes.POINTER(ctypes.c_short), ctypes.c_int, ctypes.c_void_p
)


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
        phones = (
            phone.translate(_TONES).strip("ˈˌ‍") for phone in spoken if not phone.startswith("(")
        )
        return tuple(phone for phone in phones if phone)

    def speak(self, text: str, voice: str, *, words_per_minute: int = 160) -> NDArray[np.int16]:
        """Speech for `text`, mono int16 at `rate_hz`, shape (S,)."""
        chunks: list[NDArray[np.int16]] = []

        def collect(samples: ctypes._Pointer[ctypes.c_short], count: int, _: object) -> int:
            if samples and count > 0:
                chunks.append(np.ctypeslib.as_array(samples, (count,)).astype(np.int16))
            return 0

        self._set_voice(voice)
        callback = _SYNTH_CALLBACK(collect)
        self.library.espeak_SetSynthCallback(callback)
        self.library.espeak_SetParameter(_PARAM_RATE, words_per_minute, 0)
        data = text.encode()
        self.library.espeak_Synth(
            data, len(data) + 1, 0, _POS_CHARACTER, 0, _CHARS_UTF8, None, None
        )
        self.library.espeak_Synchronize()
        return np.concatenate(chunks) if chunks else np.zeros(0, np.int16)

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


@lru_cache(maxsize=1)
def espeak() -> Espeak:
    """The process's espeak-ng.

    Raises:
        InputError: the extra is not installed; says how to install it.
    """
    try:
        import espeakng_loader
    except ImportError:
        raise InputError(
            "extra-missing",
            "pronunciations for this language come from espeak-ng, which is not installed",
            place="extra 'espeak'",
            action="Run `pip install 'animeme[espeak]'`.",
        ) from None
    library = ctypes.CDLL(str(espeakng_loader.get_library_path()))
    library.espeak_TextToPhonemes.restype = ctypes.c_char_p
    library.espeak_TextToPhonemes.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_int]
    path = str(espeakng_loader.get_data_path()).encode()
    rate_hz = library.espeak_Initialize(_OUTPUT_RETRIEVAL, 0, path, _DONT_EXIT)
    if rate_hz <= 0:
        raise InputError(
            "extra-missing",
            "espeak-ng is installed but did not start",
            place="extra 'espeak'",
            action="Reinstall it: `pip install --force-reinstall espeakng-loader`.",
        )
    return Espeak(library, rate_hz)
