"""The other files of a glTF asset: buffers and images that come along with an output."""

from __future__ import annotations

import filecmp
import json
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

from animeme.errors import InputError
from animeme.files import atomic_path
from animeme_stages.ingest.gltf_data import external_uris, local_file


@dataclass(frozen=True)
class Companions:
    """Files to copy beside an output, checked before anything is written.

    Attributes:
        copies: (from, to) of each file that is not there yet as it should be.
        uris: all external URIs of the source.
    """

    copies: tuple[tuple[Path, Path], ...]
    uris: tuple[str, ...]

    def copy(self) -> list[Path]:
        """Copy them and return the new files."""
        for file, target in self.copies:
            with atomic_path(target) as scratch:
                shutil.copyfile(file, scratch)
        return [target for _, target in self.copies]


def companions(source: Path, uris: Sequence[str], target: Path) -> Companions:
    """What has to come along from `source` to `target`.

    A file that is there with other content is replaced if `target` is the only asset that refers
    to it: then it is what an earlier run copied.

    Raises:
        InputError: a URI leaves the asset's folder, or another asset's file is in the way.
    """
    copies = []
    for uri in uris:
        file = local_file(source, uri)
        copy = target.parent / file.relative_to(source.parent)
        if not file.is_file() or copy.resolve() == file.resolve():
            continue
        if copy.is_file():
            if filecmp.cmp(file, copy, shallow=False):
                continue
            if _referrers(copy, target.parent) != {target.name}:
                raise InputError(
                    "asset-file-clash",
                    f"needs '{uri}', but another asset's file of that name is there",
                    place=str(copy),
                    action="Deliver one of the two as .glb, or rename its file.",
                )
        copies.append((file, copy))
    return Companions(tuple(copies), tuple(uris))


def _referrers(file: Path, folder: Path) -> set[str]:
    """Names of the ``.gltf`` files in `folder` that refer to `file`."""
    found = set()
    for asset in folder.glob("*.gltf"):
        try:
            root = json.loads(asset.read_text(encoding="utf-8"))
            if file in {local_file(asset, uri) for uri in external_uris(root)}:
                found.add(asset.name)
        except (InputError, OSError, ValueError, AttributeError, TypeError):
            found.add(asset.name)  # unreadable: it may be anybody's
    return found


def side_car_name(target: Path, taken: Sequence[str]) -> str:
    """A name for the file of the new buffer that no URI of the source has."""
    names = {unquote(uri) for uri in taken}
    number, name = 1, f"{target.stem}.animeme.bin"
    while name in names:
        number += 1
        name = f"{target.stem}.animeme-{number}.bin"
    return name
