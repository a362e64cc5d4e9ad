"""A character's lips: its shapes as OBJ files, and which vertices are landmarks."""

from __future__ import annotations

import io
import json
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from animeme.curves import Floats
from animeme.errors import InputError
from animeme_stages.crossmap.points import CHIN, EYES, LIPS, STILL

VERTICES = "vertex_indices.json"
_CORNER = re.compile(r"/\S*")
_SIDE = re.compile(r"_([LR])$")


@dataclass(frozen=True, eq=False)
class Head:
    """What a character's controls do to its landmarks, in units of the distance between its eyes.

    Attributes:
        controls: N names, as ARKit spells them.
        numbers: L iBUG numbers of `neutral` and `deltas`.
        neutral: shape (L, 3), x to the character's left, y up, z forward.
        deltas: shape (N, L, 3), displacement at weight 1.
    """

    controls: tuple[str, ...]
    numbers: tuple[int, ...]
    neutral: Floats
    deltas: Floats

    def rows(self, numbers: tuple[int, ...]) -> list[int]:
        """Where the points of these iBUG numbers are."""
        return [self.numbers.index(number) for number in numbers]


def read_head(folder: Path) -> Head:
    """A character from a folder of OBJ files, one per shape at weight 1, and one neutral.

    The neutral face has "neutral" in its name; ``vertex_indices.json`` names the vertices of iBUG's
    68 landmarks under ``idx_to_landmark_verts``, as ICT-FaceKit does.

    Raises:
        InputError: a file is missing, cannot be read, or has other vertices than the neutral face.
    """
    files = sorted(folder.glob("*.obj"))
    neutral = [file for file in files if "neutral" in file.stem.lower()]
    shapes = [file for file in files if file not in neutral]
    if len(neutral) != 1 or not shapes:
        problem = f"has {len(neutral)} neutral faces and {len(shapes)} shapes as OBJ"
        action = "Name a folder with <shape>.obj of each shape and one …neutral….obj."
        raise InputError("head-incomplete", problem, place=str(folder), action=action)
    vertices = _landmarks(folder / VERTICES)
    points = _points(neutral[0])
    if max(vertices) >= len(points):
        problem = f"names vertex {max(vertices)}, the neutral face has {len(points)}"
        action = "Give the landmark vertices of this head."
        raise InputError("head-invalid", problem, place=str(folder / VERTICES), action=action)
    numbers = (*LIPS, *CHIN, *STILL)
    chosen = [vertices[number] for number in numbers]
    corners = points[[vertices[number] for number in EYES]]
    eyes = float(np.linalg.norm(corners[:2].mean(axis=0) - corners[2:].mean(axis=0)))
    deltas = []
    for file in shapes:
        moved = _points(file)
        if moved.shape != points.shape:
            problem = f"has {len(moved)} vertices, the neutral face {len(points)}"
            action = "Export every shape from the same mesh."
            raise InputError("head-invalid", problem, place=str(file), action=action)
        deltas.append(moved[chosen] - points[chosen])
    names = tuple(_SIDE.sub(lambda m: {"L": "Left", "R": "Right"}[m[1]], f.stem) for f in shapes)
    if not eyes > 0 or not np.isfinite(deltas).all():
        problem = "its eyes are in one place, or a vertex is no number"
        raise InputError("head-invalid", problem, place=str(folder), action="Export it again.")
    return Head(names, numbers, points[chosen] / eyes, np.array(deltas) / eyes)


def _landmarks(file: Path) -> list[int]:
    action = f"Put {VERTICES} beside the shapes, with 68 numbers in idx_to_landmark_verts."
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
        found = found["idx_to_landmark_verts"] if isinstance(found, dict) else found
    except FileNotFoundError:
        raise InputError(
            "head-incomplete", "there is no such file", place=str(file), action=action
        ) from None
    except (OSError, ValueError, KeyError) as error:
        raise InputError(
            "head-invalid", f"cannot be used: {error!r}", place=str(file), action=action
        ) from error
    whole = isinstance(found, list) and all(type(n) is int and n >= 0 for n in found)
    if not whole or len(found) != 68:
        raise InputError(
            "head-invalid", "does not list 68 vertices", place=str(file), action=action
        )
    return [int(number) for number in found]


def _points(file: Path) -> Floats:
    """The vertices of an OBJ file in its own order, shape (V, 3)."""
    try:
        lines = file.read_text(encoding="utf-8", errors="replace").splitlines()
        # Only positions and faces: with texture coordinates trimesh splits vertices at seams.
        kept = (_CORNER.sub("", line) for line in lines if line.startswith(("v ", "f ")))
        text = io.StringIO("\n".join(kept) + "\n")
        mesh = trimesh.load_mesh(text, file_type="obj", process=False, maintain_order=True)
        return np.asarray(mesh.vertices, dtype=np.float64)
    except Exception as error:
        # trimesh lets through whatever its parsers meet in a broken file.
        raise InputError(
            "head-invalid", f"cannot be read as OBJ: {error!r}"[:300], place=str(file),
            action="Export it again.",
        ) from error  # fmt: skip
