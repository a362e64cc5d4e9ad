"""What a browser shows of a character: its meshes and targets in one GLB, without animations."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from animeme import registry
from animeme.errors import InputError

# Parts of the names of materials that lie over the eyes, and that most exports have opaque.
_COVERS = ("eyeblend", "eyeocclusion", "lacrimalfluid", "cornea", "tearline")


@dataclass(frozen=True)
class MeshView:
    """One mesh of a viewing copy.

    Attributes:
        node: index of its node in the GLB.
        shapes: canonical name of each of its targets.
        rest: weight of each when nothing drives it.
    """

    node: int
    shapes: tuple[str, ...]
    rest: tuple[float, ...]


@dataclass(frozen=True)
class View:
    """A character for a browser.

    Attributes:
        glb: a GLB file.
        meshes: those that have targets.
        faces: which way along z it looks, 1 or -1.
        notes: what is not shown as it is.
    """

    glb: bytes
    meshes: tuple[MeshView, ...]
    faces: int = 1
    notes: tuple[str, ...] = ()

    @property
    def digest(self) -> str:
        """A name for it that another view does not have."""
        about = json.dumps([self.to_json(), self.notes], sort_keys=True).encode()
        return hashlib.sha256(self.glb + about).hexdigest()[:16]

    def to_json(self) -> dict[str, Any]:
        """All but the GLB."""
        return {
            "faces": self.faces,
            "notes": list(self.notes),
            "meshes": [
                {"node": mesh.node, "shapes": list(mesh.shapes), "rest": list(mesh.rest)}
                for mesh in self.meshes
            ],
        }


def is_cover(material: str) -> bool:
    """Whether a material, by its name, is a film over the eyes that hides them."""
    plain = material.replace("_", "").lower()
    return any(part in plain for part in _COVERS)


def view_of(path: Path) -> View:
    """The viewing copy of the character in the file at `path`.

    Raises:
        InputError: it cannot be read, or is of a format that nothing converts.
    """
    name = registry.format_of(path).name
    if name not in _VIEWS:
        raise InputError(
            "view-unsupported",
            f"is of the format '{name}', which cannot be shown in 3D",
            place=str(path),
            action="All but the head is shown.",
        )
    return _VIEWS[name](path)


def _view_gltf(path: Path) -> View:
    from animeme_stages.review.view_gltf import view_gltf

    return view_gltf(path)


def _view_usd(path: Path) -> View:
    from animeme_stages.review.view_usd import view_usd  # pxr takes its time

    return view_usd(path)


_VIEWS: Mapping[str, Callable[[Path], View]] = {"gltf": _view_gltf, "usd": _view_usd}
