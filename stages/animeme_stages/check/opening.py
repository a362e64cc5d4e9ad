"""How far a rig's mouth is open, from the shapes that its profile opens and closes it with."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from animeme.curves import CurveSet, Floats
from animeme.rig import BoundRig, Drive


class Moving(Protocol):
    """A rig, and what its shapes do."""

    @property
    def rig(self) -> BoundRig:
        """The bound rig."""
        ...

    @property
    def shapes(self) -> CurveSet:
        """Weights of its shapes."""
        ...


def opening(subject: Moving) -> Floats | None:
    """Opening of the mouth at each key, in units of the control ``jawOpen``, shape (T,).

    What the shapes driven by ``jawOpen`` add to it, less what those driven by ``mouthClose`` take
    away again; on a rig of poses, what each shows of either.

    Returns:
        None where the rig has no shape for ``jawOpen``.
    """
    drive = _main_drive(subject, "jawOpen")
    if drive is None:
        return _of_poses(subject)
    opened = np.asarray(subject.shapes.curve(drive.shape) / drive.gain)
    closing = _main_drive(subject, "mouthClose")
    # Where no shape seals the lips, closing opens the jaw less: it is in the opening already.
    if closing is None or closing.shape == drive.shape:
        return opened
    return opened - np.asarray(subject.shapes.curve(closing.shape) / closing.gain)


def _main_drive(subject: Moving, control: str) -> Drive | None:
    """The shape that a control drives most."""
    drives = subject.rig.profile.drives.get(control, ())
    drive = max(drives, key=lambda entry: abs(entry.gain), default=None)
    if drive is None or drive.shape not in subject.shapes.names or drive.gain == 0:
        return None
    return drive


def _of_poses(subject: Moving) -> Floats | None:
    """The opening that the weights of poses come to."""
    poses = [shape for shape, pose in subject.rig.profile.poses.items() if pose]
    parts = [subject.rig.binds.get(shape, (Drive(shape),)) for shape in poses]
    shapes = tuple(dict.fromkeys(drive.shape for drives in parts for drive in drives))
    if not shapes or not set(shapes) <= set(subject.shapes.names):
        return None
    mix = np.zeros((len(shapes), len(poses)))
    for column, drives in enumerate(parts):
        for drive in drives:
            mix[shapes.index(drive.shape), column] += drive.gain
    written = np.stack([subject.shapes.curve(shape) for shape in shapes])
    weights = np.linalg.lstsq(mix, written, rcond=None)[0]
    opens = np.array(
        [
            pose.get("jawOpen", 0.0) - pose.get("mouthClose", 0.0)
            for pose in (subject.rig.profile.poses[shape] for shape in poses)
        ]
    )
    return np.asarray(opens @ weights)
