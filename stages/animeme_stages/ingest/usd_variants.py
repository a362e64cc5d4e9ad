"""Blendshapes that a character has in some of its variants only."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import closing
from dataclasses import replace

from pxr import Sdf, Usd

from animeme_stages.ingest.usd_meshes import SpeakingMesh, speaking_meshes

LINE_SET = "dialogueLine"
LANGUAGE_SET = "dialogueLanguage"
OUR_SETS = frozenset({LINE_SET, LANGUAGE_SET})

# Each variant is composed once, alone. No character has as many that matter; a set of materials
# may, and must not cost minutes.
MOST_VARIANTS = 64


def driven_meshes(stage: Usd.Stage) -> tuple[SpeakingMesh, ...]:
    """`speaking_meshes` as selected, with what each other variant has besides.

    A line moves the shapes of every variant, so that a user may still switch. Variants are tried
    one at a time, the others as selected; meshes whose skeleton only the variant has are left out.
    """
    found = {mesh.path: mesh for mesh in speaking_meshes(stage)}
    for _ in _each_variant(stage):
        for mesh in speaking_meshes(stage):
            known = found.get(mesh.path, replace(mesh, shapes=()))
            shapes = tuple(dict.fromkeys(known.shapes + mesh.shapes))
            found[mesh.path] = replace(known, shapes=shapes)
    return tuple(mesh for mesh in found.values() if stage.GetPrimAtPath(mesh.skeleton))


def speaking_variant(stage: Usd.Stage) -> tuple[Sdf.Path, str, str] | None:
    """Prim, variant set and variant with which some mesh of `stage` would speak, if any."""
    with closing(_each_variant(stage)) as variants:
        return next((variant for variant in variants if speaking_meshes(stage)), None)


def _each_variant(stage: Usd.Stage) -> Generator[tuple[Sdf.Path, str, str]]:
    """Every variant that is not selected, selected while it is given."""
    everywhere = Usd.PrimRange.Stage(stage, Usd.PrimAllPrimsPredicate)
    choices = [
        (prim.GetPath(), name, variant, selected)
        for prim in everywhere
        if prim.HasVariantSets()
        for name in prim.GetVariantSets().GetNames()
        if name not in OUR_SETS
        for selected in [prim.GetVariantSet(name).GetVariantSelection()]
        for variant in prim.GetVariantSet(name).GetVariantNames()
        if variant != selected
    ]
    session = stage.GetSessionLayer()
    for path, name, variant, _ in choices[:MOST_VARIANTS]:
        said = session.ExportToString()
        try:
            with Usd.EditContext(stage, session):
                stage.GetPrimAtPath(path).GetVariantSet(name).SetVariantSelection(variant)
            yield path, name, variant
        finally:
            session.ImportFromString(said)
