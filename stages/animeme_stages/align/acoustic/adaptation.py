"""The acoustic model, led towards one speaker and one microphone.

Maximum a posteriori estimation of Gaussian mixtures (Gauvain & Lee 1994, IEEE Trans. Speech and
Audio Processing 2(2)): what was seen of a voice counts beside what the model knew, as if that had
been seen some times before. What was not seen stays as it was.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from animeme_stages.align.acoustic.hear import Frames
from animeme_stages.align.acoustic.model import (
    AcousticModel,
    Floats,
    Indices,
    constant,
    projection,
)

Doubles = NDArray[np.float64]
Halves = NDArray[np.float16]

# What the model knew counts as this many frames: of a mean, of a variance, of a senone's weights.
_MEAN_FRAMES, _VARIANCE_FRAMES, _WEIGHT_FRAMES = 10.0, 50.0, 20.0
# A variance shrinks to this share at most: few frames are more alike than many.
_LEAST_VARIANCE = 0.3


@dataclass(frozen=True, eq=False)
class Observations:
    """What was seen of a voice; C codebooks of D densities, N senones, per stream.

    Attributes:
        counts: (C, D) frames of each density, in parts.
        sums, squares: (C, D, width) of these frames, and of their squares.
        weights: (N, D) frames of each density in each senone, in parts.
    """

    counts: tuple[Doubles, ...]
    sums: tuple[Doubles, ...]
    squares: tuple[Doubles, ...]
    weights: tuple[Doubles, ...]

    @classmethod
    def none(cls, model: AcousticModel) -> Observations:
        """Nothing seen yet."""
        shapes = [(*p.shape[:2], p.shape[2] // 2) for p in model.projections]
        return cls(
            tuple(np.zeros(shape[:2]) for shape in shapes),
            tuple(np.zeros(shape) for shape in shapes),
            tuple(np.zeros(shape) for shape in shapes),
            tuple(np.zeros(mixture.shape) for mixture in model.mixtures),
        )

    def __add__(self, other: Observations) -> Observations:
        """What both have seen."""
        return Observations(
            *(
                tuple(a + b for a, b in zip(own, others, strict=True))
                for own, others in (
                    (self.counts, other.counts),
                    (self.sums, other.sums),
                    (self.squares, other.squares),
                    (self.weights, other.weights),
                )
            )
        )

    def see(self, model: AcousticModel, frames: Frames, senones: Indices) -> None:
        """Add a recording's frames, in place.

        Args:
            model: tells which densities of a senone a frame comes from.
            frames: T frames.
            senones: (T,) the state at each of them.
        """
        codebooks = model.codebooks[senones]
        for at, stream in enumerate(frames.streams):
            both = np.concatenate([stream, stream**2], axis=1)
            for codebook in np.unique(codebooks):
                rows = np.flatnonzero(codebooks == codebook)
                part = self._parts(model, at, int(codebook), both[rows], senones[rows])
                self.counts[at][codebook] += part.sum(axis=0)
                self.sums[at][codebook] += part.T @ stream[rows]
                self.squares[at][codebook] += part.T @ stream[rows] ** 2
                np.add.at(self.weights[at], senones[rows], part)

    @staticmethod
    def _parts(
        model: AcousticModel, stream: int, codebook: int, frames: Floats, senones: Indices
    ) -> Doubles:
        """Posterior probability of each density for each frame, (T, D)."""
        logs = (frames @ model.projections[stream][codebook].T).astype(np.float64)
        logs += model.constants[stream][codebook]
        logs += np.log(model.mixtures[stream][senones])
        logs -= logs.max(axis=1, keepdims=True)
        part = np.exp(logs)
        result: Doubles = part / part.sum(axis=1, keepdims=True)
        return result


@dataclass(frozen=True, eq=False)
class Adaptation:
    """What is different in a voice, per stream.

    Attributes:
        means, variances: (C, D, width).
        senones: (M,) those that were seen; the same for every stream.
        log_weights: (M, D) of their densities.
    """

    means: tuple[Halves, ...]
    variances: tuple[Halves, ...]
    senones: Indices
    log_weights: tuple[Halves, ...]

    def of(self, model: AcousticModel) -> AcousticModel:
        """The model with it."""
        mixtures = []
        for general, own in zip(model.mixtures, self.log_weights, strict=True):
            mixture = general.copy()
            mixture[self.senones] = np.exp(own.astype(np.float32))
            mixtures.append(mixture)
        pairs = [
            (mean.astype(np.float32), variance.astype(np.float32))
            for mean, variance in zip(self.means, self.variances, strict=True)
        ]
        return replace(
            model,
            projections=tuple(projection(mean, variance) for mean, variance in pairs),
            constants=tuple(constant(mean, variance) for mean, variance in pairs),
            mixtures=tuple(mixtures),
        )


def adapted(model: AcousticModel, seen: Observations) -> Adaptation:
    """What a voice makes of the model."""
    senones = np.flatnonzero(seen.weights[0].sum(axis=1) > 0)
    means, variances, weights = [], [], []
    for at, table in enumerate(model.projections):
        mean, variance = _moments(table)
        count = seen.counts[at][:, :, None]
        new = (_MEAN_FRAMES * mean + seen.sums[at]) / (_MEAN_FRAMES + count)
        spread = seen.squares[at] - 2 * new * seen.sums[at] + count * new**2
        wide = (_VARIANCE_FRAMES * variance + spread) / (_VARIANCE_FRAMES + count)
        means.append(new.astype(np.float16))
        variances.append(np.maximum(wide, _LEAST_VARIANCE * variance).astype(np.float16))
        weights.append(_log_weights(model.mixtures[at][senones], seen.weights[at][senones]))
    return Adaptation(tuple(means), tuple(variances), senones, tuple(weights))


def _moments(table: Floats) -> tuple[Doubles, Doubles]:
    """Means and variances that `projection` was made of."""
    width = table.shape[2] // 2
    variance = -0.5 / table[:, :, width:].astype(np.float64)
    return table[:, :, :width] * variance, variance


def _log_weights(known: Floats, seen: Doubles) -> Halves:
    # The model's weights do not sum to one: they were rounded when they were stored.
    total = known.sum(axis=1, keepdims=True, dtype=np.float64)
    share = (_WEIGHT_FRAMES * known / total + seen) / (
        _WEIGHT_FRAMES + seen.sum(axis=1, keepdims=True)
    )
    found: Halves = np.log(share * total).astype(np.float16)
    return found


def check(model: AcousticModel, found: Adaptation) -> None:
    """Make sure that an adaptation fits a model.

    Raises:
        ValueError: it does not.
    """
    for at in range(len(model.projections)):
        shape = (*model.projections[at].shape[:2], model.projections[at].shape[2] // 2)
        rows = (len(found.senones), model.mixtures[at].shape[1])
        arrays: Sequence[tuple[Halves, tuple[int, ...]]] = (
            (found.means[at], shape),
            (found.variances[at], shape),
            (found.log_weights[at], rows),
        )
        if any(array.shape != wanted for array, wanted in arrays):
            raise ValueError("has arrays of another size")
        if not all(np.isfinite(array).all() for array, _ in arrays):
            raise ValueError("has numbers that are not finite")
        if not (found.variances[at] > 0).all():
            raise ValueError("has variances that are not above 0")
    inside = (found.senones >= 0) & (found.senones < len(model.codebooks))
    if not inside.all():
        raise ValueError("names states that the model has not")
