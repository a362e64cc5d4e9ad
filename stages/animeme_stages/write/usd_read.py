"""Weight curves read back from USD, as a playing application would see them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import reduce
from itertools import compress
from pathlib import Path

import numpy as np
from pxr import Usd, UsdSkel

from animeme.curves import CurveSet
from animeme.errors import InputError
from animeme.rig import canonical_names
from animeme_stages.ingest.usd import (
    CUSTOM_DATA,
    animations,
    is_ours,
    open_stage,
    shape_names,
    usd_errors,
    weight_samples,
)
from animeme_stages.ingest.usd_variants import driven_meshes

# Copies of one shape are one curve if their weights agree this closely (weight units): far below
# what is visible, far above float32's rounding of an interpolated weight.
SAME_WEIGHT = 1e-5


def read_animations(path: Path) -> dict[str, CurveSet]:
    """Weight curves of every SkelAnimation in the file at `path` that has any.

    Lines of ours go by their line's name, joined over all skeletons; others by their prim's name,
    or by its path where several share the name. The shapes go by their canonical names, and by
    the stored ones where numbered copies differ.

    Raises:
        InputError: ``asset-unreadable``; ``asset-animation-invalid``: in a line of ours the number
            of weights is not that of the shapes or a weight is not finite; in any animation a
            shape is named twice.
    """
    stage = open_stage(path)
    with usd_errors(path):
        canonical = canonical_names([mesh.shapes for mesh in driven_meshes(stage)])
        lines: dict[str, list[CurveSet]] = {}
        others: dict[str, dict[str, CurveSet]] = {}
        for animation in animations(stage):
            curves = _stored_curves(stage, animation, path)
            if curves is None:
                continue
            prim = animation.GetPrim()
            line = (prim.GetCustomData().get(CUSTOM_DATA) or {}).get("line")
            if line is not None:
                lines.setdefault(str(line), []).append(curves)
            else:
                others.setdefault(prim.GetName(), {})[str(prim.GetPath())] = curves
    found = {name: reduce(_join, parts) for name, parts in lines.items()}
    for name, by_path in others.items():
        alone = len(by_path) == 1 and name not in found
        found |= {name if alone else at: curves for at, curves in by_path.items()}
    return {name: _fold(curves, canonical) for name, curves in found.items()}


def _stored_curves(stage: Usd.Stage, animation: UsdSkel.Animation, path: Path) -> CurveSet | None:
    """The animation's weights over its stored names; None if it has none."""
    names = shape_names(animation)
    codes, rows = weight_samples(animation)
    prim = animation.GetPrim()
    fits = [len(row) == len(names) and bool(np.isfinite(row).all()) for row in rows]
    if not is_ours(prim):
        # Exporters do write such rows (3ds Max: two weights for one shape); UsdSkel ignores them.
        codes, rows = codes[fits], list(compress(rows, fits))
    elif not all(fits):
        at = fits.index(False)
        raise _invalid(
            path,
            f"{prim.GetPath()} has {len(rows[at])} weights for {len(names)} shapes, or one that "
            f"is not finite, at frame {codes[at]:g}",
        )
    if not names or not rows:
        return None
    try:
        return CurveSet(codes / stage.GetTimeCodesPerSecond(), names, np.array(rows))
    except ValueError as error:
        raise _invalid(path, f"{prim.GetPath()}: {error}") from error


def _invalid(path: Path, problem: str) -> InputError:
    return InputError(
        "asset-animation-invalid",
        problem,
        place=str(path),
        action="Run the job again, or export the animation anew.",
    )


def _join(first: CurveSet, second: CurveSet) -> CurveSet:
    """Curves of two skeletons as one set; where both have a shape, the first one's."""
    more = [i for i, name in enumerate(second.names) if name not in set(first.names)]
    times_s = np.union1d(first.times_s, second.times_s)
    weights = np.hstack([first.sample(times_s), second.sample(times_s)[:, more]])
    return CurveSet(times_s, first.names + tuple(second.names[i] for i in more), weights)


def _fold(curves: CurveSet, canonical: Mapping[str, str]) -> CurveSet:
    """Numbered copies as one curve of their canonical name, where they agree."""
    columns: dict[str, list[int]] = {}
    for i, name in enumerate(curves.names):
        columns.setdefault(canonical.get(name, name), []).append(i)
    kept: dict[str, int] = {}
    for shape, copies in columns.items():
        weights = curves.weights[:, copies]
        if np.allclose(weights, weights[:, :1], rtol=0.0, atol=SAME_WEIGHT):
            kept[shape] = copies[0]
        else:
            kept |= {curves.names[i]: i for i in copies}
    return CurveSet(curves.times_s, tuple(kept), curves.weights[:, list(kept.values())])
