"""The other files of a glTF asset: buffers and images that come along with an output."""

from __future__ import annotations

import filecmp
import os
import secrets
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePath
from urllib.parse import unquote

from animeme.errors import InputError
from animeme.files import atomic_path
from animeme_stages.ingest.glb import open_container
from animeme_stages.ingest.gltf_data import external_uris, local_file
from animeme_stages.ingest.gltf_document import mark_of

_SUFFIXES = (".gltf", ".glb", ".vrm")


@dataclass(frozen=True)
class Companions:
    """Files to copy beside an output, checked before anything is written.

    Attributes:
        copies: (from, to) of each file that is not there yet as it should be.
        uris: all external URIs of the source.
        asset: what tells outputs of this source from others': its place seen from the output.
    """

    copies: tuple[tuple[Path, Path], ...]
    uris: tuple[str, ...]
    asset: str


def companions(source: Path, uris: Sequence[str], target: Path) -> Companions:
    """What has to come along from `source` to `target`.

    A file that is there with other content is replaced if every asset that refers to it is an
    output of the same source: then it is what an earlier run copied.

    Raises:
        InputError: a URI leaves the asset's folder, or another asset's file is in the way.
    """
    asset = PurePath(os.path.relpath(source, target.parent)).as_posix()
    copies = []
    for uri in uris:
        file = local_file(source, uri)
        copy = target.parent / file.relative_to(source.parent)
        if not file.is_file() or copy.resolve() == file.resolve():
            continue
        if copy.is_file():
            if filecmp.cmp(file, copy, shallow=False):
                continue
            if set(owners(copy, target.parent)) != {asset}:
                raise InputError(
                    "asset-file-clash",
                    f"needs '{uri}', but another asset's file of that name is there",
                    place=str(copy),
                    action="Deliver one of the two as .glb, or rename its file.",
                )
        copies.append((file, copy))
    return Companions(tuple(copies), tuple(uris), asset)


def owners(file: Path, folder: Path) -> Iterator[str]:
    """For each asset in `folder` that refers to `file`: the source it was made from, "" if none."""
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() not in _SUFFIXES:
            continue
        try:
            root = open_container(path).json
            if file in {local_file(path, uri) for uri in external_uris(root)}:
                notes = [mark_of(animation) for animation in root.get("animations", [])]
                yield next((str(note.get("asset", "")) for note in notes if note), "")
        except (InputError, AttributeError, TypeError):
            yield ""  # unreadable: it may be anybody's


def side_car_name(target: Path, taken: Sequence[str]) -> str:
    """A name for the file of the new buffer that no URI of the source has."""
    names = {unquote(uri) for uri in taken}
    number, name = 1, f"{target.stem}.animeme.bin"
    while name in names:
        number += 1
        name = f"{target.stem}.animeme-{number}.bin"
    return name


@contextmanager
def placed(files: Sequence[tuple[Path | bytes, Path]]) -> Iterator[None]:
    """Put files in their places; if anything is raised, all is as it was before.

    Args:
        files: (what to copy, or the content; where to) of each.
    """
    kept: list[tuple[Path, Path]] = []  # what was there → where it waits
    new: list[Path] = []
    try:
        for content, path in files:
            if path.is_file():
                aside = path.with_name(f".{secrets.token_hex(4)}{path.suffix}")
                path.replace(aside)
                kept.append((path, aside))
            with atomic_path(path) as scratch:
                if isinstance(content, Path):
                    shutil.copyfile(content, scratch)
                else:
                    scratch.write_bytes(content)
            new.append(path)
        yield
    except BaseException:
        for path in new:
            path.unlink(missing_ok=True)
        for path, aside in kept:
            aside.replace(path)
        raise
    for _, aside in kept:
        aside.unlink(missing_ok=True)
