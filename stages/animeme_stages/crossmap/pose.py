"""The head's own motion taken out of tracked points."""

from __future__ import annotations

import numpy as np

from animeme.curves import Floats

# Rounds of aligning all frames with their mean; after the first it hardly moves.
_ROUNDS = 3
# Of the frames, the part that counts as still, and of these the part whose lips are most closed.
STILL_SHARE = 0.3
CLOSED_SHARE = 0.25


def fit_similarity(points: Floats, target: Floats) -> tuple[Floats, Floats, Floats]:
    """Scale, rotation and shift that bring each frame's points nearest to `target`.

    Umeyama, "Least-squares estimation of transformation parameters between two point patterns"
    (1991), eq. 40–42. Points that are NaN do not count.

    Args:
        points: shape (F, P, 3).
        target: shape (P, 3), finite.

    Returns:
        Scales (F,), rotations (F, 3, 3) and shifts (F, 3) of p → s R p + t; NaN where less than
        three points are known.
    """
    known = np.asarray(np.isfinite(points).all(axis=2))
    weight = known / np.maximum(known.sum(axis=1), 1)[:, None]
    source = np.where(known[..., None], points, 0.0)
    middle = np.einsum("fp,fpk->fk", weight, source)
    goal = weight @ target
    a = (source - middle[:, None]) * known[..., None]
    b = (target[None] - goal[:, None]) * known[..., None]
    u, sizes, vt = np.linalg.svd(np.einsum("fp,fpi,fpj->fij", weight, b, a))
    sign = np.ones(sizes.shape)
    sign[:, 2] = np.where(np.linalg.det(u) * np.linalg.det(vt) < 0, -1.0, 1.0)
    rotation = np.einsum("fik,fk,fkj->fij", u, sign, vt)
    spread = np.einsum("fp,fpk->f", weight, a**2)
    usable = (known.sum(axis=1) >= 3) & (spread > 0)
    scale = np.where(usable, (sizes * sign).sum(axis=1) / np.where(usable, spread, 1.0), np.nan)
    shift = goal - scale[:, None] * np.einsum("fij,fj->fi", rotation, middle)
    return scale, rotation, shift


def remove_motion(points: Floats, still: Floats) -> Floats:
    """`points` as if the head, and the camera, had not moved.

    Args:
        points: shape (F, P, 3).
        still: shape (F, S, 3), points that move with the head only.

    Returns:
        Shape (F, P, 3), NaN where a point or the head's position is unknown; scale and place are
        those of the first frame whose `still` points are all known.

    Raises:
        ValueError: in no frame are all `still` points known.
    """
    whole = np.isfinite(still).all(axis=(1, 2))
    if not whole.any():
        raise ValueError("in no frame are all points known that move with the head only")
    reference: Floats = still[np.flatnonzero(whole)[0]]
    for _ in range(_ROUNDS):
        mean: Floats = _moved(still[whole], still[whole], reference).mean(axis=0)
        # The mean shrinks a little towards its middle; its size is kept.
        mean = mean - mean.mean(axis=0)
        size = np.linalg.norm(reference - reference.mean(axis=0))
        reference = mean * (size / np.linalg.norm(mean)) + reference.mean(axis=0)
    return _moved(points, still, reference)


def _moved(points: Floats, still: Floats, reference: Floats) -> Floats:
    scale, rotation, shift = fit_similarity(still, reference)
    turned: Floats = np.einsum("f,fij,fpj->fpi", scale, rotation, points) + shift[:, None]
    return turned


def rest_shape(points: Floats, opening: Floats, first: Floats) -> Floats:
    """The face at rest: the median of frames in which it is still and the lips are closed.

    Args:
        points: shape (F, P, 3) without head motion, no NaN.
        opening: shape (F,), distance of the inner lips.
        first: shape (F,), True where a take begins.

    Returns:
        Shape (P, 3).
    """
    step = np.linalg.norm(np.diff(points, axis=0, prepend=points[:1]), axis=2).mean(axis=1)
    speed = np.where(first.astype(bool), np.inf, step)
    slow = speed <= np.quantile(speed[np.isfinite(speed)], STILL_SHARE) if len(speed) > 1 else True
    slow = np.asarray(slow) & np.isfinite(speed)
    slow = slow if slow.any() else np.ones(len(points), dtype=bool)
    limit = np.quantile(opening[slow], CLOSED_SHARE)
    return np.asarray(np.median(points[slow & (opening <= limit)], axis=0))
