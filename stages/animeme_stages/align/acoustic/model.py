"""The en-US acoustic model that PocketSphinx's wheel carries, as arrays.

A phonetically tied model: each base phone has one codebook of Gaussians per feature stream, and
each senone (tied state of context-dependent phones) mixes the Gaussians of its base phone's.
File formats: CMU Sphinx's S3 binary, ``mdef`` and ``sendump``, as their own headers describe them.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pocketsphinx
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Indices = NDArray[np.int64]

STATES = 3
SILENCE_PHONE = "SIL"
_FILES = ("mdef", "means", "variances", "sendump", "transition_matrices")
_BYTE_ORDER = 0x11223344
_VARIANCE_FLOOR = 1e-4
# sendump keeps negative logs to the base 1.0001, shifted right by 10 bits.
_NATS_PER_STEP = 1024 * float(np.log(1.0001))
# Word positions of context-dependent phones, as ``mdef`` numbers them.
INSIDE, FIRST, LAST, ALONE = range(4)


@dataclass(frozen=True, eq=False)
class AcousticModel:
    """Gaussians, mixtures and phones; P phones, C codebooks of D densities, N senones.

    Attributes:
        phones: name of each base phone.
        index: name → base phone.
        projections: per stream (C, D, 2·width): a frame and its square times these, plus…
        constants: … per stream (C, D), is a Gaussian's log density.
        mixtures: per stream (N, D), the weight of each density in a senone.
        codebooks: (N,) base phone whose codebooks a senone mixes.
        sequences: (n, 3) senones of each state sequence.
        plain: (P,) sequence of each base phone without context.
        contexts: (P, P, P, 4) sequence of a phone with its left and right neighbour at each word
            position; -1 where none was trained.
        stay, leave: (P, 3) log probabilities of remaining in a state and of going on.
    """

    phones: tuple[str, ...]
    index: Mapping[str, int]
    projections: tuple[Floats, ...]
    constants: tuple[Floats, ...]
    mixtures: tuple[Floats, ...]
    codebooks: Indices
    sequences: Indices
    plain: Indices
    contexts: NDArray[np.int32]
    stay: Floats
    leave: Floats

    def sequence(self, phone: int, left: int, right: int, position: int) -> int:
        """State sequence of a phone in context; of the nearest word position that was trained."""
        trained = self.contexts[phone, left, right].tolist()
        for near in (position, INSIDE, FIRST, LAST, ALONE):
            if trained[near] >= 0:
                return int(trained[near])
        return int(self.plain[phone])


@cache
def acoustic_model() -> AcousticModel:
    """The model, read once per process (0.1 s, 60 MB)."""
    folder = _folder()
    means = _gaussians(folder / "means")
    variances = [np.maximum(v, _VARIANCE_FLOOR) for v in _gaussians(folder / "variances")]
    phones, entries, sequences = _phones(folder / "mdef")
    base = entries[: len(phones)]
    codebooks = np.zeros(int(sequences.max()) + 1, np.int64)
    codebooks[sequences[entries["sequence"]]] = np.where(
        np.arange(len(entries)) < len(phones), np.arange(len(entries)), entries["context"][:, 0]
    )[:, None]
    stay, leave = _transitions(folder / "transition_matrices", base["transitions"])
    pairs = list(zip(means, variances, strict=True))
    return AcousticModel(
        phones=phones,
        index={name: number for number, name in enumerate(phones)},
        projections=tuple(projection(mean, variance) for mean, variance in pairs),
        constants=tuple(constant(mean, variance) for mean, variance in pairs),
        mixtures=_mixtures(folder / "sendump", len(means), means[0].shape[1], len(codebooks)),
        codebooks=codebooks,
        sequences=sequences,
        plain=base["sequence"].astype(np.int64),
        contexts=_contexts(entries[len(phones) :], len(phones)),
        stay=stay,
        leave=leave,
    )


@cache
def model_digest() -> str:
    """Hexadecimal SHA-256 of the files that the model is read from."""
    whole = hashlib.sha256()
    for name in _FILES:
        with (_folder() / name).open("rb") as stream:
            whole.update(hashlib.file_digest(stream, "sha256").digest())
    return whole.hexdigest()


def _folder() -> Path:
    return Path(pocketsphinx.get_model_path("en-us")) / "en-us"


def projection(mean: Floats, variance: Floats) -> Floats:
    """What a frame and its square are multiplied by for their log densities."""
    return np.concatenate([mean / variance, -0.5 / variance], axis=2)


def constant(mean: Floats, variance: Floats) -> Floats:
    """What is then added."""
    found: Floats = -0.5 * (np.log(2 * np.pi * variance) + mean * mean / variance).sum(axis=2)
    return found


def _s3_body(path: Path) -> tuple[bytes, int]:
    """Content of an S3 file, and where its numbers begin."""
    data = path.read_bytes()
    start = data.index(b"endhdr\n") + len(b"endhdr\n")
    if struct.unpack_from("<I", data, start)[0] != _BYTE_ORDER:
        raise ValueError(f"{path.name} has another byte order")
    return data, start + 4


def _gaussians(path: Path) -> list[Floats]:
    """Per stream (C, D, width)."""
    data, at = _s3_body(path)
    codebooks, streams, densities = struct.unpack_from("<3i", data, at)
    widths = struct.unpack_from(f"<{streams}i", data, at + 12)
    start = at + 12 + 4 * streams + 4
    values = np.frombuffer(data, "<f4", codebooks * densities * sum(widths), start)
    per_codebook = values.reshape(codebooks, -1)
    ends = np.cumsum([densities * width for width in widths])[:-1]
    parts = np.split(per_codebook, ends, axis=1)
    return [
        part.reshape(codebooks, densities, width) for part, width in zip(parts, widths, strict=True)
    ]


def _transitions(path: Path, rows: NDArray[np.int32]) -> tuple[Floats, Floats]:
    data, at = _s3_body(path)
    count, states, targets, total = struct.unpack_from("<4i", data, at)
    counts = np.frombuffer(data, "<f4", total, at + 16).reshape(count, states, targets)
    logs = np.log(np.maximum(counts / counts.sum(axis=2, keepdims=True), 1e-30))[rows]
    order = np.arange(states)
    return logs[:, order, order], logs[:, order, order + 1]


def _mixtures(path: Path, streams: int, densities: int, senones: int) -> tuple[Floats, ...]:
    """Per stream (N, D). The tables are the end of the file, whatever its header says."""
    size = streams * densities * senones
    steps = np.fromfile(path, np.uint8)[-size:].reshape(streams, densities, senones)
    weights = np.exp(-steps.astype(np.float32) * _NATS_PER_STEP)
    return tuple(np.ascontiguousarray(stream.T) for stream in weights)


def _phones(path: Path) -> tuple[tuple[str, ...], NDArray[Any], Indices]:
    """Names of base phones, every phone's entry, and all state sequences."""
    data = path.read_bytes()
    (length,) = struct.unpack_from("<i", data, 8)
    at = 12 + length
    phones, entries, _, _, _, _, sequences, _, nodes, _ = struct.unpack_from("<10i", data, at)
    at += 40
    names = data[at:].split(b"\0", phones)[:phones]
    at += -(-sum(len(name) + 1 for name in names) // 4) * 4 + 8 * nodes
    kind = np.dtype(
        [("sequence", "<i4"), ("transitions", "<i4"), ("position", "u1"), ("context", "u1", 3)]
    )
    table = np.frombuffer(data, kind, entries, at)
    at += kind.itemsize * entries + 4
    states = np.frombuffer(data, "<i2", sequences * STATES, at).reshape(-1, STATES)
    return tuple(name.decode() for name in names), table, states.astype(np.int64)


def _contexts(entries: NDArray[Any], phones: int) -> NDArray[np.int32]:
    """As of `AcousticModel`; a dictionary of as many would take a tenth of a second to make."""
    found = np.full((phones, phones, phones, 4), -1, np.int32)
    phone, left, right = entries["context"].T
    found[phone, left, right, entries["position"]] = entries["sequence"]
    return found
