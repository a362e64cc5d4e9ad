"""How one speaker sounds: learned from lines of theirs, kept in a file, used to align others.

The acoustic model is led towards the voice, and what is usual for its phones is measured on lines
that were left out when it was learned, so that the confidence of a line means the same as ever.
"""

from __future__ import annotations

import hashlib
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from animeme.errors import InputError
from animeme.files import atomic_path
from animeme_stages.align.acoustic.adaptation import Adaptation, Observations, adapted, check
from animeme_stages.align.acoustic.hear import Heard, frames_of, hear
from animeme_stages.align.acoustic.model import AcousticModel, acoustic_model, model_digest
from animeme_stages.align.acoustic.network import Sounds
from animeme_stages.align.confidence import Calibration, Usual, calibration, calibration_text

FORMAT = "animeme.voice/1"
# Lines of two parts: each is judged by what the other teaches.
_PARTS = 2


@dataclass(frozen=True, eq=False)
class Example:
    """A line of a voice that says its transcript.

    Attributes:
        samples: mono, int16, at the model's rate.
        words: per word, its pronunciations.
        senones: state of the acoustic model at each frame, as it was heard.
    """

    samples: NDArray[np.int16]
    words: Sequence[Sequence[Sounds]]
    senones: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Voice:
    """How one speaker sounds.

    Attributes:
        family: of the language's calibration.
        adaptation: of the acoustic model.
        calibration: of the confidence of lines that are heard with it.
    """

    family: str
    adaptation: Adaptation
    calibration: Calibration

    @cached_property
    def model(self) -> AcousticModel:
        """The acoustic model of this voice (60 MB)."""
        return self.adaptation.of(acoustic_model())


def learn(examples: Sequence[Example], family: str) -> Voice:
    """Learn a voice.

    Args:
        examples: at least two, in an order that is always the same.
        family: of the language's calibration.
    """
    parts = [examples[at::_PARTS] for at in range(_PARTS)]
    seen = [observed(part) for part in parts]
    right: list[Heard] = []
    for at, part in enumerate(parts):
        others = [each for other, each in enumerate(seen) if other != at]
        right += heard_with(adapted(acoustic_model(), sum_of(others)), part)
    general = calibration(voice_family(family))
    return Voice(family, adapted(acoustic_model(), sum_of(seen)), general.of_voice(right))


def voice_family(family: str) -> str:
    """Name of the calibration of learned voices in a family of languages."""
    return f"{family}-voice"


def observed(examples: Sequence[Example]) -> Observations:
    """What the lines tell of their voice."""
    model = acoustic_model()
    seen = Observations.none(model)
    for example in examples:
        seen.see(model, frames_of(example.samples), example.senones)
    return seen


def sum_of(seen: Sequence[Observations]) -> Observations:
    """All observations as one."""
    total = seen[0]
    for each in seen[1:]:
        total = total + each
    return total


def heard_with(adaptation: Adaptation, examples: Sequence[Example]) -> list[Heard]:
    """The lines as an adapted model hears them."""
    model = adaptation.of(acoustic_model())
    return [hear(model, example.samples, example.words) for example in examples]


def write_voice(voice: Voice, target: Path) -> None:
    """Write a voice's file: a NumPy archive without objects; the same voice gives the same bytes.

    Raises:
        InputError: it cannot be written.
    """
    usual = [[phone, *v.log_length, *v.loss] for phone, v in voice.calibration.usual.items()]
    adaptation = voice.adaptation
    arrays: dict[str, Any] = {
        "format": np.array(FORMAT),
        "base": np.array(_base(voice.family)),
        "family": np.array(voice.family),
        "usual": np.array(usual, np.float64),
        "threshold": np.array(voice.calibration.threshold("")),
        "senones": adaptation.senones,
    }
    for at in range(len(adaptation.means)):
        arrays[f"means_{at}"] = adaptation.means[at]
        arrays[f"variances_{at}"] = adaptation.variances[at]
        arrays[f"log_weights_{at}"] = adaptation.log_weights[at]
    with atomic_path(target) as scratch, scratch.open("wb") as stream:
        np.savez_compressed(stream, **arrays)


def read_voice(path: Path, family: str) -> Voice:
    """A voice from its file.

    Args:
        path: as `write_voice` wrote it.
        family: of the language that is to be aligned.

    Raises:
        InputError: it cannot be read, is no voice, or does not fit what is installed.
    """
    try:
        state = path.stat()
        voice = _read(path, (state.st_mtime_ns, state.st_size))
    except OSError as error:
        raise _unusable(path, f"cannot be read: {error.strerror}", "Check its name.") from error
    except (ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise _unusable(path, f"is no voice ({error})") from error
    if voice.family != family:
        raise _unusable(path, "was learned from a language with other sounds")
    return voice


def _base(family: str) -> str:
    """Digest of what a voice was learned with: it means nothing with anything else."""
    known = calibration_text(voice_family(family))
    return hashlib.sha256(f"{model_digest()} {known}".encode()).hexdigest()


def _unusable(
    path: Path, problem: str, action: str = "Learn it again: animeme voice."
) -> InputError:
    return InputError("voice-unusable", problem, place=str(path), action=action)


# A batch goes through one voice after the other.
@lru_cache(maxsize=2)
def _read(path: Path, _: tuple[int, int]) -> Voice:
    with path.open("rb") as stream:
        data = np.load(stream, allow_pickle=False)
        if not isinstance(data, np.lib.npyio.NpzFile):
            raise ValueError("it holds one array")
        if str(data["format"]) != FORMAT:
            raise ValueError(f"its format is {str(data['format'])[:40]!r}, not {FORMAT!r}")
        family = str(data["family"])
        if family not in ("en", "mapped"):
            raise ValueError(f"its family is {family[:40]!r}")
        if str(data["base"]) != _base(family):
            raise _unusable(path, "was learned with another version of the acoustic model")
        streams = range(len(acoustic_model().projections))
        adaptation = Adaptation(
            tuple(data[f"means_{at}"] for at in streams),
            tuple(data[f"variances_{at}"] for at in streams),
            data["senones"],
            tuple(data[f"log_weights_{at}"] for at in streams),
        )
        check(acoustic_model(), adaptation)
        known = calibration(voice_family(family))
        usual = {int(row[0]): Usual((row[1], row[2]), (row[3], row[4])) for row in data["usual"]}
        return Voice(family, adaptation, known.fitted(usual, float(data["threshold"])))
