"""USD characters: dialogue as an override layer beside the untouched source."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import ClassVar

from pxr import Ar, Sdf, Usd, UsdUtils

from animeme.contracts import LineAnimation, Verify, unverified
from animeme.curves import CurveSet
from animeme.delivery import StoredTrack
from animeme.errors import InputError
from animeme.rig import Character
from animeme_stages.ingest.usd import load_usd, open_stage, usd_errors
from animeme_stages.ingest.usd_stored import stored
from animeme_stages.write import usd_harm, usd_layer, usd_read
from animeme_stages.write.usd_plan import Host, plan


class UsdFormat:
    """USD in all of its suffixes.

    A written layer sublayers the source by relative path. Below the character's prim it defines
    ``Dialogue``, one SkelAnimation per line (and per skeleton, where there are several), built
    upon the animation that the skeleton came with; the variant set ``dialogueLine`` chooses one,
    and with it a SpatialAudio that plays its recording, by relative path.
    """

    name: ClassVar[str] = "usd"
    suffixes: ClassVar[tuple[str, ...]] = (".usda", ".usdc", ".usd", ".usdz")
    assembly_suffix: ClassVar[str] = ".usda"

    def output_suffix(self, source: Path) -> str:
        """Text beside a text source, to read; else binary, for delivery."""
        return ".usda" if source.suffix.lower() == ".usda" else ".usdc"

    def load(self, path: Path, *, within: Path | None = None) -> Character:
        """The character in the file at `path`.

        Args:
            path: the asset.
            within: folder that its layers must be in; its own if None.

        Raises:
            InputError: see `animeme_stages.ingest.usd.load_usd`.
        """
        return load_usd(path, within or path.parent)

    def for_layout(self, layout: str, character: Character) -> UsdFormat:
        """Itself, for the layouts that USD has.

        Raises:
            InputError: ``layout-unsupported``: it is one of glTF's.
        """
        if layout in ("per-character", "per-line"):
            return self
        raise InputError(
            "layout-unsupported",
            f"is USD, which has no layout '{layout}': its layers hold nothing but animation anyway",
            place=str(character.source),
            action='Use layout = "per-line", or make its glTF file a character of its own.',
        )

    def companions(self, character: Character) -> dict[str, Path]:
        """None: a layer refers to its source where it is."""
        return {}

    def inputs(self, character: Character) -> tuple[Path, ...]:
        """Layers and textures that the source brings with it, those that are missing too."""
        source = character.source
        stage = open_stage(source)
        with usd_errors(source):
            layers, *assets = UsdUtils.ComputeAllDependencies(str(source))
        found = {layer.realPath for layer in (*stage.GetUsedLayers(), *layers)}.union(*assets)
        files = {Path(Ar.SplitPackageRelativePathOuter(path)[0]) for path in found}
        # No devices: what a texture is called is not looked at when an asset is loaded.
        kept = (f for f in files if f.is_absolute() and (f.is_file() or not f.exists()))
        return tuple(sorted(f for f in kept if f != source.resolve()))

    def write(
        self,
        character: Character,
        lines: Sequence[LineAnimation],
        target: Path,
        *,
        verify: Verify = unverified,
    ) -> tuple[Path, ...]:
        """Write `lines` to an override layer at `target`: text for ``.usda``, else binary.

        Raises:
            InputError: the source cannot be read, or `target` cannot be written.
            ValueError: no lines, two of one name, or a curve for a shape that `character` lacks.
        """
        _require_distinct(lines)
        for line in lines:
            if strange := set(line.curves.names) - set(character.shapes):
                raise ValueError(f"{line.name}: no such shapes: {', '.join(sorted(strange))}")
        stage, hosts = _planned(character)
        end_s = max(line.end_s for line in lines)
        layer = usd_layer.override_layer(character.source, stage, target, end_s=end_s)
        with Sdf.ChangeBlock():
            for number, host in enumerate(hosts):
                # Once, however many prims the character is made of.
                heard = number == 0
                usd_layer.add_lines(layer, host, character, lines, target, heard=heard)
                usd_layer.bind_pointers(layer, stage, host)
        usd_layer.export(layer, target, verify)
        return (target,)

    def write_assembly(
        self,
        character: Character,
        by_language: Mapping[str, Path],
        target: Path,
        *,
        verify: Verify = unverified,
    ) -> tuple[Path, ...]:
        """Write a small layer at `target` that joins the languages in a variant set.

        Raises:
            InputError: the source or a language's file cannot be read, or `target` not written.
        """
        if not by_language:
            return ()
        stage, hosts = _planned(character)
        ends_s = []
        for path in by_language.values():
            spoken = open_stage(path)
            ends_s.append(spoken.GetEndTimeCode() / spoken.GetTimeCodesPerSecond())
        layer = usd_layer.override_layer(character.source, stage, target, end_s=max(ends_s))
        for host in hosts:
            usd_layer.add_languages(layer, host, by_language, target)
            usd_layer.bind_pointers(layer, stage, host)
        usd_layer.export(layer, target, verify)
        return (target,)

    def read_animations(self, path: Path) -> dict[str, CurveSet]:
        """Weight curves of every animation in the file, by line or prim name.

        Raises:
            InputError: ``asset-unreadable``; ``asset-animation-invalid``: weights do not fit.
        """
        return usd_read.read_animations(path)

    def strip(self, path: Path, target: Path) -> tuple[str, ...]:
        """Refuse: there is nothing to take out of a layer that is nothing but ours.

        Raises:
            InputError: always ``strip-layer``.
        """
        raise InputError(
            "strip-layer",
            "is a USD file: animeme writes layers of their own over a source that it never changes",
            place=str(path),
            action="Delete the layer; the source is as it was.",
        )

    def stored(
        self, character: Character, names: Collection[str] | None = None
    ) -> tuple[StoredTrack, ...]:
        """Weights as they are stored; see `animeme.delivery.StoredReader`."""
        return stored(character, names)

    def harm(self, character: Character, output: Path) -> list[str]:
        """What `output` lost or changed of the character's source: one sentence each.

        Raises:
            InputError: ``asset-unreadable``.
        """
        return usd_harm.harm(character, output)


def _planned(character: Character) -> tuple[Usd.Stage, tuple[Host, ...]]:
    """The source's stage, and where its dialogue goes."""
    stage = open_stage(character.source)
    with usd_errors(character.source):
        return stage, plan(character, stage)


def _require_distinct(lines: Sequence[LineAnimation]) -> None:
    names = [line.name for line in lines]
    if not names:
        raise ValueError("no lines to write")
    if twice := sorted(name for name, count in Counter(names).items() if count > 1):
        raise ValueError(f"line names must be distinct; repeated: {', '.join(twice)}")
