"""Writing line animations into glTF by appending, and taking them out again.

Nothing is serialised anew: the JSON text gets new elements, the binary chunk gets new bytes behind
the old ones, and the rest is copied.
"""

from __future__ import annotations

import base64
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar
from urllib.parse import quote

from animeme.contracts import Format, LineAnimation, Verify, unverified
from animeme.curves import CurveSet
from animeme.delivery import StoredTrack
from animeme.errors import InputError
from animeme.files import atomic_path
from animeme.rig import Character
from animeme_stages.ingest.glb import Container, open_container, unreadable
from animeme_stages.ingest.gltf import character_in, load_gltf
from animeme_stages.ingest.gltf_data import (
    Buffers,
    external_files,
    external_uris,
    local_file,
    weight_animations,
)
from animeme_stages.ingest.gltf_document import line_of, mark_of, marked
from animeme_stages.ingest.gltf_stored import stored
from animeme_stages.write.glb import restore, write_glb
from animeme_stages.write.gltf_clip import GltfClip, all_ours
from animeme_stages.write.gltf_files import companions, owners, placed, side_car_name
from animeme_stages.write.gltf_harm import harm
from animeme_stages.write.gltf_lines import Appended, animated, carried, drives, free_name
from animeme_stages.write.gltf_origin import LISTS, Origin, Past, our_lines, past_of
from animeme_stages.write.gltf_source import source_of
from animeme_stages.write.gltf_vrma import Vrma
from animeme_stages.write.json_splice import Splice


class GltfFormat:
    """glTF 2.0: ``.glb``, ``.gltf`` and ``.vrm``."""

    name: ClassVar[str] = "gltf"
    suffixes: ClassVar[tuple[str, ...]] = (".glb", ".gltf", ".vrm")
    assembly_suffix: ClassVar[str] = ""  # glTF has no variants of animations

    def output_suffix(self, source: Path) -> str:
        """As the source's: a GLB stays one."""
        return source.suffix.lower()

    def load(self, path: Path, *, within: Path | None = None) -> Character:
        """The character in the file; see `animeme.contracts.Format`.

        Its buffers and images are delivered beside it, so they must be in its own folder.
        """
        return load_gltf(path)

    def for_layout(self, layout: str, character: Character) -> Format:
        """Itself, or the format of files of animation alone.

        Raises:
            InputError: ``layout-unsupported``: a .vrma of what is no VRM avatar.
        """
        if layout in ("per-character", "per-line"):
            return self
        form = GltfClip() if layout == GltfClip.layout else Vrma()
        return form.for_layout(layout, character)

    def companions(self, character: Character) -> dict[str, Path]:
        """Buffers and images in files of their own; see `animeme.contracts.Format`."""
        source = character.source
        container = source_of(source).container
        files = (local_file(source, uri) for uri in external_uris(container.json))
        return {file.relative_to(source.parent).as_posix(): file for file in files}

    def inputs(self, character: Character) -> tuple[Path, ...]:
        """Buffers and images in files of their own; see `animeme.contracts.Format`."""
        return external_files(character.source)

    def write(
        self,
        character: Character,
        lines: Sequence[LineAnimation],
        target: Path,
        *,
        verify: Verify = unverified,
    ) -> tuple[Path, ...]:
        """Write the source with one animation per line appended.

        One channel per node whose mesh owns a driven shape; nodes with the same targets share a
        sampler, all channels of a line share its times. Where the source is an earlier output of
        ours, its own source gets the lines of both.
        """
        try:
            return self._write(character, lines, target, verify)
        except RecursionError as error:
            raise unreadable(character.source, "holds JSON nested too deeply") from error

    def _write(
        self, character: Character, lines: Sequence[LineAnimation], target: Path, verify: Verify
    ) -> tuple[Path, ...]:
        source = source_of(character.source)
        given, container, past = source.given, source.container, source.past
        beside = companions(given.path, external_uris(container.json), target)
        appended = Appended(
            len(container.json.get("accessors", [])), len(container.json.get("bufferViews", []))
        )
        animations = _animations(lines, character, given, container, past, appended)
        for animation in animations if beside.uris else ():
            animation["extras"] = marked({**animation["extras"]["animeme"], "asset": beside.asset})
        name = None if container.binary else side_car_name(target, beside.uris)
        uri = quote(name) if name else None
        text = _edited(container, appended, animations, source.crc32, uri=uri)
        files: list[tuple[Path | bytes, Path]] = [*beside.copies]
        if name and appended.data:
            files.append((bytes(appended.data), target.with_name(name)))
        with placed(files), atomic_path(target) as scratch:
            if container.binary:
                with scratch.open("wb") as stream:
                    data = bytes(appended.data)
                    write_glb(stream, container, text, data, old=source.kept or None)
            else:
                scratch.write_text(text, encoding="utf-8", newline="")
            verify(scratch)
        return (target, *(path for _, path in files))

    def write_assembly(
        self,
        character: Character,
        by_language: Mapping[str, Path],
        target: Path,
        *,
        verify: Verify = unverified,
    ) -> tuple[Path, ...]:
        """Write nothing: each language stays a file of its own."""
        return ()

    def read_animations(self, path: Path) -> dict[str, CurveSet]:
        """Weight curves of every linear animation in the file."""
        container = open_container(path)
        return weight_animations(container, character_in(container))

    def stored(
        self, character: Character, names: Collection[str] | None = None
    ) -> tuple[StoredTrack, ...]:
        """Weights as they are stored; see `animeme.delivery.StoredReader`."""
        return stored(character, names)

    def harm(self, character: Character, output: Path) -> list[str]:
        """What `output` lost or changed of the source; see `animeme.contracts.Format`."""
        written = open_container(output)
        if mark_of(written.json["asset"]):
            return GltfClip().harm(character, output)
        return harm(source_of(character.source), written)

    def strip(self, path: Path, target: Path) -> tuple[str, ...]:
        """Write the source of an output of ours to `target`, byte for byte.

        Raises:
            InputError: ``strip-nothing``: nothing in it is ours; ``strip-edited``: it was changed
                after us.
        """
        container = open_container(path)
        if mark_of(container.json["asset"]):
            raise all_ours(path)
        past = past_of(container)
        if past is None:
            raise _unstrippable(container)
        beside = companions(path, external_uris(past.source.json), target)
        uris = external_uris(container.json)
        own = [local_file(path, uri) for uri in uris if uri not in external_uris(past.source.json)]
        with (
            placed(beside.copies),
            atomic_path(target) as scratch,
            scratch.open("wb") as stream,
        ):
            restore(stream, past.source)
        if target.resolve() == path.resolve():
            for side_car in own:
                if not any(owners(side_car, side_car.parent)):
                    side_car.unlink(missing_ok=True)
        return tuple(str(animation.get("name")) for animation in past.animations)


def _unstrippable(container: Container) -> InputError:
    lines = our_lines(container)
    if not lines:
        return InputError(
            "strip-nothing",
            "holds no animation of animeme's, so there is nothing to take out",
            place=str(container.path),
            action="Name a file that `animeme run` wrote.",
        )
    views = container.json.get("bufferViews", [])
    noted = isinstance(views, list) and any(isinstance(v, dict) and mark_of(v) for v in views)
    why = (
        "what is left without them is not the source that it was made from: it was edited since"
        if noted
        else "the note of its source is gone: another program saved it, or an older animeme"
    )
    shown = ", ".join(lines[:3]) + (", …" if len(lines) > 3 else "")
    return InputError(
        "strip-edited",
        f"holds {len(lines)} animations of animeme's ({shown}), but {why}",
        place=str(container.path),
        action="Take them out in the program that edited it; their extras hold 'animeme'.",
    )


def _animations(
    lines: Sequence[LineAnimation],
    character: Character,
    given: Container,
    container: Container,
    past: Past | None,
    appended: Appended,
) -> list[dict[str, Any]]:
    """All animations of ours that the output has; their data goes to `appended`.

    A line that was there keeps its place, others come after.
    """
    new = {(line.name, line.language): line for line in lines if drives(line, character)}
    earlier = {line_of(animation): animation for animation in (past.animations if past else ())}
    # Names of all that stays: animations of others, and ours of lines that are not written now.
    staying = [*container.json.get("animations", []), *earlier.values()]
    taken = {str(animation.get("name")) for animation in staying if line_of(animation) not in new}
    buffers, copies = Buffers(given), dict[int, int]()
    made = []
    for key in dict.fromkeys([*earlier, *new]):
        if key in new:
            name = free_name(new[key], taken)
            taken.add(name)
            made.append(animated(new[key], name, character, appended))
        else:
            made.append(carried(earlier[key], buffers, appended, copies))
    return made


def _edited(
    container: Container,
    appended: Appended,
    animations: Sequence[Mapping[str, Any]],
    crc32: int,
    *,
    uri: str | None,
) -> str:
    """The source's JSON text with everything new in it.

    Args:
        container: the source.
        appended: new accessors and bytes.
        animations: new animations.
        crc32: of the source.
        uri: side-car that holds the bytes; None to put them behind the GLB's own.
    """
    splice = Splice(container.text)
    size = len(appended.data)
    if not size:
        return container.text
    replaced: dict[tuple[str, int, str], str] = {}
    buffer, start = _put_buffer(splice, container, appended, uri, replaced)
    _put_animations(splice, container, animations, replaced)
    lists = {
        name: (len(container.json[name]), splice.length(name)) if name in container.json else None
        for name in LISTS
    }
    bin_bytes = container.bin.length if container.bin else None
    nul_bytes = container.json_bytes - len(container.text.encode("utf-8"))
    origin = Origin(container.json_bytes, nul_bytes, bin_bytes, lists, replaced, crc32)
    view = {"buffer": buffer, "byteOffset": start, "byteLength": size}
    splice.append("bufferViews", [{**view, "extras": marked(origin.to_json())}])
    splice.append("accessors", appended.accessors)
    return splice.apply()


def _put_buffer(
    splice: Splice,
    container: Container,
    appended: Appended,
    uri: str | None,
    replaced: dict[tuple[str, int, str], str],
) -> tuple[int, int]:
    """Make room for the new bytes; returns the buffer's index and where in it they begin."""
    buffers = container.json.get("buffers", [])
    size = len(appended.data)
    first_is_chunk = not buffers or "uri" not in buffers[0]
    if uri is None and first_is_chunk and (container.bin or not buffers):
        start = container.bin.length if container.bin else 0
        if not buffers:
            splice.append("buffers", [{"byteLength": start + size}])
            return 0, start
        first = splice.elements(splice.members()["buffers"][0])[0]
        span = splice.members(first[0]).get("byteLength")
        if span is None:
            raise unreadable(container.path, "is broken at /buffers/0/byteLength: missing")
        replaced["buffers", 0, "byteLength"] = splice.text[slice(*span)]
        splice.replace(span, start + size)
        return 0, start
    if uri is None:
        # A GLB that keeps its buffers elsewhere has no chunk to append to.
        encoded = base64.b64encode(appended.data).decode()
        uri = f"data:application/octet-stream;base64,{encoded}"
        appended.data.clear()
    splice.append("buffers", [{"uri": uri, "byteLength": size}])
    return len(buffers), 0


def _put_animations(
    splice: Splice,
    container: Container,
    animations: Sequence[Mapping[str, Any]],
    replaced: dict[tuple[str, int, str], str],
) -> None:
    """Append animations; one of ours of the same line, in a file edited since, is replaced."""
    old = {
        line: index
        for index, animation in enumerate(container.json.get("animations", []))
        if (line := line_of(animation)) is not None
    }
    spans = splice.elements(splice.members()["animations"][0]) if old else []
    new = []
    for animation in animations:
        index = old.get(line_of(animation) or ("", ""))
        if index is None:
            new.append(animation)
        else:
            replaced["animations", index, ""] = splice.text[slice(*spans[index])]
            splice.replace(spans[index], animation)
    splice.append("animations", new)
