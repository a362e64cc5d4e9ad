"""How far a rig's mouth is open, from the shapes that its profile opens and closes it with."""

from __future__ import annotations

import numpy as np

from animeme.contracts import LineSubject
from animeme.curves import Floats


def opening(subject: LineSubject) -> Floats | None:
    """Opening of the mouth at each key, in units of the control ``jawOpen``, shape (T,).

    What the shapes driven by ``jawOpen`` add to it, less what those driven by ``mouthClose`` take
    away again.

    Returns:
        None where the rig has no shape for ``jawOpen``.
    """
    opened = _driven(subject, "jawOpen")
    if opened is None:
        return None
    closed = _driven(subject, "mouthClose")
    return opened if closed is None else opened - closed


def _driven(subject: LineSubject, control: str) -> Floats | None:
    """The control that the shape it drives most amounts to, shape (T,)."""
    drives = subject.rig.profile.drives.get(control, ())
    if not drives:
        return None
    drive = max(drives, key=lambda entry: abs(entry.gain))
    if drive.shape not in subject.shapes.names or drive.gain == 0:
        return None
    return np.asarray(subject.shapes.curve(drive.shape) / drive.gain)
