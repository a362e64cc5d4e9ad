"""Tracked lips mapped to a character's controls; import `crossmap` from `animeme`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from animeme import registry
from animeme.findings import Finding


@dataclass(frozen=True)
class CrossMapping:
    """What became of the takes.

    Attributes:
        controls: columns of the files written.
        files: take → its file.
        frames: of all takes.
        gaps: frames in which points were lost; their cells are empty.
        keys: key shapes that were used, 0 for none.
        key_residual, residual: how far key shapes, and the character, stay from the tracked lips:
            root of the mean squared distance across the line of sight, mean over frames, in units
            of the distance between the eyes.
        worst: take → its residual, the largest ten.
        findings: what could not be used, or linked.
    """

    controls: tuple[str, ...]
    files: dict[str, Path]
    frames: int
    gaps: int
    keys: int
    key_residual: float
    residual: float
    worst: dict[str, float]
    findings: tuple[Finding, ...] = field(default=())

    def to_json(self) -> dict[str, Any]:
        """As `animeme crossmap --json` prints it."""
        return {
            "takes": len(self.files),
            "frames": self.frames,
            "gaps": self.gaps,
            "controls": list(self.controls),
            "keys": self.keys,
            "key_residual": self.key_residual,
            "residual": self.residual,
            "worst": self.worst,
            "findings": [finding.to_json() for finding in self.findings],
        }


def crossmap(
    landmarks: str | Path,
    character: str | Path,
    output: str | Path,
    *,
    lines: str | Path | None = None,
    rate_hz: float | None = None,
    keys: str | Path = "auto",
    symmetric: bool = False,
    depth: float = 0.25,
    ridge: float = 0.01,
) -> CrossMapping:
    """Map tracked lips to a character's controls, as a dataset that `read_dataset` takes.

    Args:
        landmarks: an ``.npz`` of many takes, a ``.csv`` of one, or a folder of these.
        character: folder of its shapes as OBJ files, with ``vertex_indices.json``.
        output: folder to write ``<id>.csv`` to.
        lines: folder of ``<id>.<audio>``, ``<id>.txt`` and perhaps ``<id>.TextGrid`` to link there.
        rate_hz: frames per second, where the landmarks do not say.
        keys: "auto" finds key lip shapes, "none" solves without, a CSV file names them.
        symmetric: both sides of the mouth move alike.
        depth: weight of motion to and from the camera, from 0 to 1.
        ridge: how strongly weights are kept small; 0 follows the points as they are.

    Raises:
        InputError: landmarks or character cannot be used; nothing was written.
    """
    if not 0 <= depth <= 1 or not 0 <= ridge < float("inf"):
        raise ValueError("depth must lie between 0 and 1, ridge must not be negative")
    mapped: CrossMapping = registry.stage("crossmap")(
        Path(landmarks), Path(character), Path(output),
        lines=Path(lines) if lines is not None else None, rate_hz=rate_hz, keys=str(keys),
        symmetric=symmetric, depth=depth, ridge=ridge,
    )  # fmt: skip
    return mapped
