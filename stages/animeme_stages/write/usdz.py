"""One file with all of a character's languages: a package of its layers, textures and recordings.

``UsdUtils.CreateNewUsdzPackage`` is not used: it loses a sublayer that has the root layer's name
(usd-core 26.11), gives every file the time of the day, and takes in any kind of file. The source's
own layers go in as they are; only paths in layers of ours are changed.
"""

from __future__ import annotations

import os
import posixpath
import shutil
import tempfile
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from pxr import Ar, Sdf, Usd, UsdUtils

from animeme.errors import InputError
from animeme.files import atomic_path
from animeme.findings import Finding, Severity
from animeme.rig import Character
from animeme_stages.ingest.usd import open_stage, usd_errors

# What the usdz specification allows, https://openusd.org/release/spec_usdz.html
ALLOWED = frozenset(
    {".usda", ".usdc", ".usd", ".usdz"}
    | {".png", ".jpg", ".jpeg", ".exr", ".avif"}
    | {".wav", ".mp3", ".m4a"}
)
MOST_BYTES = 2**31 - 1  # beyond, a file's place in the package cannot be aligned
ALIGNMENT = 64  # bytes; runtimes map the files into memory where they lie
FIRST_DAY = (1980, 1, 1, 0, 0, 0)  # of the zip format: the same input gives the same bytes


@dataclass
class _Contents:
    """What goes into a package.

    Attributes:
        names: file → its path in the package, in order.
        left_out: files that it must not hold, or that are not where the asset says.
    """

    names: dict[Path, str] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)

    def add(self, file: Path, name: str) -> None:
        """Take in a file, unless it is of a kind that no package may hold."""
        if file in self.names:
            return
        if file.suffix.lower() not in ALLOWED:
            self.left_out.append(str(file))
            return
        stem, suffix = posixpath.splitext(name)
        taken, number = set(self.names.values()), 0
        while name in taken:
            number += 1
            name = f"{stem}_{number}{suffix}"
        self.names[file] = name


def package_usdz(
    character: Character, assembly: Path, by_language: Mapping[str, Path], target: Path
) -> tuple[Finding, ...]:
    """Pack an assembly with everything it needs into a new ``.usdz`` at `target`.

    Args:
        character: whose it is.
        assembly: the layer that joins the languages.
        by_language: language tag → that language's layer.
        target: where to write.

    Returns:
        What could not be taken in: kinds of files that the format does not allow, files outside
        the asset's folder, and such as are missing.

    Raises:
        InputError: something cannot be read, or `target` not written; ``usdz-too-large``.
    """
    with usd_errors(assembly):
        contents = _contents(character.source, assembly, by_language)
        with tempfile.TemporaryDirectory() as folder, atomic_path(target) as scratch:
            files = {}
            for file, name in contents.names.items():
                ours = file == assembly or file in by_language.values()
                files[name] = _moved(file, contents, Path(folder)) if ours else file
            _require_room(files, target)
            _write_zip(files, scratch)
            lost = _lost(assembly, scratch)
    remarks = [
        *(
            _remark("usdz-file-left-out", f"{_short(file)} is not in the package", target)
            for file in contents.left_out
        ),
        *(_remark("usdz-incomplete", text, target) for text in lost),
    ]
    return tuple(remarks)


def _remark(code: str, problem: str, target: Path) -> Finding:
    action = "Packages hold USD, PNG, JPEG, EXR, AVIF, WAV, MP3 and M4A of the asset's own folder."
    return Finding(Severity.WARNING, code, problem, place=str(target), action=action)


def _short(file: str) -> str:
    return "/".join(Path(file).parts[-2:])


def _contents(source: Path, assembly: Path, by_language: Mapping[str, Path]) -> _Contents:
    contents = _Contents()
    contents.add(assembly, assembly.name)  # the first file is what opens
    for language, file in sorted(by_language.items()):
        contents.add(file, f"{language}/{file.name}")
    layers, assets, missing = UsdUtils.ComputeAllDependencies(str(source))
    files = [*(layer.identifier for layer in layers), *assets]
    # Loading made sure that all layers are where they may be.
    folders = [os.path.dirname(os.path.abspath(_outer(layer.identifier))) for layer in layers]
    inside = Path(os.path.commonpath([os.path.abspath(source.parent), *folders]))
    for found in dict.fromkeys(_outer(str(file)) for file in files):
        file = source if os.path.samefile(found, source) else Path(os.path.abspath(found))
        if file is source or file.is_relative_to(inside):
            name = Path(os.path.abspath(file)).relative_to(inside).as_posix()
            contents.add(file, f"source/{name}")
        else:
            contents.left_out.append(str(file))
    contents.left_out += [str(path) for path in missing]
    for language, file in sorted(by_language.items()):
        for sound in _sounds(file):
            contents.add(sound, f"sound/{language}/{sound.name}")
    return contents


def _outer(path: str) -> str:
    """The file of a path that may lead into a package."""
    file: str = Ar.SplitPackageRelativePathOuter(path)[0]
    return file


def _sounds(file: Path) -> list[Path]:
    """The recordings that a language's layer refers to, in order."""
    layer = Sdf.Layer.FindOrOpen(str(file))
    found: dict[Path, None] = {}
    paths: list[Sdf.Path] = []
    layer.Traverse(Sdf.Path.absoluteRootPath, paths.append)
    for path in sorted(paths):
        if path.IsPropertyPath() and path.name == "filePath":
            asset = layer.GetAttributeAtPath(path).default.path
            found[Path(layer.ComputeAbsolutePath(asset))] = None
    return list(found)


def _moved(file: Path, contents: _Contents, folder: Path) -> Path:
    """A copy of a layer of ours whose paths are those of the package."""
    layer = Sdf.Layer.FindOrOpen(str(file))
    copy = Sdf.Layer.CreateAnonymous(file.suffix)
    copy.TransferContent(layer)
    start = posixpath.dirname(contents.names[file])
    names = {os.path.realpath(known): name for known, name in contents.names.items()}

    def moved(asset: str) -> str:
        name = names.get(os.path.realpath(layer.ComputeAbsolutePath(asset)))
        if name is None:
            return ""  # it is left out
        path = posixpath.relpath(name, start)
        return path if path.startswith("../") else f"./{path}"

    UsdUtils.ModifyAssetPaths(copy, moved)
    target = folder / f"{len(list(folder.iterdir()))}{file.suffix}"
    copy.Export(str(target))
    return target


def _require_room(files: Mapping[str, Path], target: Path) -> None:
    size = sum(file.stat().st_size for file in files.values())
    if size > MOST_BYTES:
        raise InputError(
            "usdz-too-large",
            f"would hold {size / 2**30:.1f} GiB, more than a package may",
            place=str(target),
            action="Deliver the layers as they are, or make smaller textures.",
        )


def _write_zip(files: Mapping[str, Path], target: Path) -> None:
    """Store `files` uncompressed, each starting at a multiple of `ALIGNMENT` bytes."""
    with zipfile.ZipFile(target, "w", zipfile.ZIP_STORED) as package:
        for name, file in files.items():
            info = zipfile.ZipInfo(name, FIRST_DAY)
            assert package.fp is not None
            header = package.fp.tell() + 30 + len(name.encode("utf-8")) + 4
            padding = -header % ALIGNMENT
            # An extra field of an unused kind: its number, its length, and nothing in it.
            info.extra = b"\x86\x19" + padding.to_bytes(2, "little") + bytes(padding)
            with package.open(info, "w") as into, file.open("rb") as stream:
                shutil.copyfileobj(stream, into, 1 << 20)


def _lost(assembly: Path, package: Path) -> list[str]:
    """What goes wrong in the package and not in the assembly that it was made of."""
    before, after = (open_stage(path) for path in (assembly, package))
    lost = len(after.GetCompositionErrors()) - len(before.GetCompositionErrors())
    texts = [f"{lost} of its parts cannot be found again"] if lost > 0 else []
    prims = [{str(p.GetPath()) for p in Usd.PrimRange.Stage(stage)} for stage in (before, after)]
    texts += [f"{path} is missing from it" for path in sorted(prims[0] - prims[1])[:1]]
    return texts
