"""What judges lines and written files."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

if TYPE_CHECKING:
    from animeme.contracts.format import Format, LineAnimation
    from animeme.curves import CurveSet
    from animeme.findings import Finding
    from animeme.phones import PhoneTrack
    from animeme.rig import BoundRig, Character


@dataclass(frozen=True)
class LineSubject:
    """What a check of one line sees.

    Attributes:
        track: the aligned phones.
        controls: the model's curves.
        rig: the bound rig.
        shapes: what will be written, after retargeting and key reduction.
    """

    track: PhoneTrack
    controls: CurveSet
    rig: BoundRig
    shapes: CurveSet


@dataclass(frozen=True)
class AssetSubject:
    """What a check of one written file sees.

    Attributes:
        character: the source.
        format: which wrote it.
        output: the file.
        lines: what should be in it.
    """

    character: Character
    format: Format
    output: Path
    lines: tuple[LineAnimation, ...]


class Check(Protocol):
    """Judges one line's curves or one written asset.

    Those of delivered files are asked more: `animeme.delivery.DeliveryCheck`.

    Attributes:
        id: permanent and unique.
        subject: what `run` is given.
        rationale: why it matters, for the person who reads the finding.
    """

    id: ClassVar[str]
    subject: ClassVar[str]
    rationale: ClassVar[str]

    def run(self, subject: Any) -> Iterable[Finding]:
        """Findings about `subject`; none if all is well."""
        ...
