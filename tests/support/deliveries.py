"""A sound delivery of the sample's head, and ways to damage it."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

import animeme
from animeme import registry
from animeme.contracts import LineAnimation
from animeme.curves import CurveSet
from animeme.validation import ValidationReport, validate
from support.gltf_build import BIN_KIND, bin_of, document_of, glb
from support.jobs import SAMPLE, SmallJob

Json = dict[str, Any]
Curves = Callable[[CurveSet], CurveSet]


def make_delivery(folder: Path) -> Path:
    """The sample's head speaks one line in two languages; gives the folder of what was made."""
    job = SmallJob(
        folder,
        {
            "job": {"name": "small", "output": "out"},
            "dialogue": {"root": "dialogue"},
            "characters.ada": {"asset": ["ada.glb", "ada.usdc"]},
        },
    )
    folder.mkdir(parents=True)
    job.asset("ada.glb")
    job.asset("ada.usdc")
    job.line("en/boat", like="en/boat")
    job.line("de/boat", like="de/five")
    report = animeme.run(job.write(), executor="inline")
    assert report.exit_code == 0
    return job.output


def codes(*paths: Path, **options: Any) -> set[str]:
    """Codes of all that is found."""
    return {finding.code for finding in validate(paths, **options).all_findings}


def skipped(report: ValidationReport) -> set[str]:
    """Checks that could not judge something."""
    return {entry.check for entry in report.skipped}


def edited(source: Path, target: Path, edit: Callable[[Json, bytearray], None]) -> Path:
    """A GLB with its JSON and its binary chunk edited in place."""
    document, binary = document_of(source), bytearray(bin_of(source) or b"")
    edit(document, binary)
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_bytes(glb(json.dumps(document), (BIN_KIND, bytes(binary))))
    return target


def float_of(document: Json, accessor: int, index: int) -> int:
    """Where in the binary chunk a float of an accessor is."""
    entry = document["accessors"][accessor]
    view = document["bufferViews"][entry["bufferView"]]
    return int(view.get("byteOffset", 0)) + int(entry.get("byteOffset", 0)) + 4 * index


def put_float(accessor: str, index: int, value: float) -> Callable[[Json, bytearray], None]:
    """Overwrites one float of the last animation's first sampler ("input" or "output")."""

    def edit(document: Json, binary: bytearray) -> None:
        sampler = document["animations"][-1]["samplers"][0]
        struct.pack_into("<f", binary, float_of(document, sampler[accessor], index), value)

    return edit


def with_curves(
    delivered: Path,
    target: Path,
    change: Curves,
    *,
    name: str = "boat",
    language: str = "en",
    length_s: float = 0.0,
    source: Path | None = None,
) -> Path:
    """A head with one line of `delivered` after `change`; the sample's, if there is no `source`."""
    form = registry.format_of(delivered)
    curves = change(form.read_animations(delivered)[name])
    line = LineAnimation(name, language, curves, length_s or curves.duration_s)
    target.parent.mkdir(parents=True, exist_ok=True)
    form.write(form.load(source or SAMPLE / f"ada{delivered.suffix}"), [line], target)
    return target


def shapes(**added: Mapping[float, float]) -> Curves:
    """Puts keys (time → weight) on shapes, in place of what they did."""

    def change(curves: CurveSet) -> CurveSet:
        times_s = np.union1d(curves.times_s, [t for keys in added.values() for t in keys])
        names = tuple(dict.fromkeys((*curves.names, *added)))
        weights = np.zeros((len(times_s), len(names)))
        weights[:, : len(curves.names)] = curves.sample(times_s)
        for name, keys in added.items():
            weights[:, names.index(name)] = np.interp(times_s, list(keys), list(keys.values()))
        return CurveSet(times_s, names, weights)

    return change


def moved(by_s: float) -> Curves:
    """Shifts all keys, and holds the first from the start."""

    def change(curves: CurveSet) -> CurveSet:
        at_s = np.arange(0.0, curves.duration_s + 1e-6, 1 / 60)
        return CurveSet(at_s, curves.names, curves.sample(at_s - by_s))

    return change


def opening(of: Callable[[Any, Any], Any]) -> Curves:
    """Replaces what the jaw and the lips' seal do by `of(times_s, jawOpen)`."""

    def change(curves: CurveSet) -> CurveSet:
        at_s = np.arange(0.0, curves.duration_s + 1e-6, 1 / 60)
        weights = curves.sample(at_s)
        jaw = curves.names.index("jawOpen")
        weights[:, jaw] = of(at_s, weights[:, jaw])
        if "mouthClose" in curves.names:
            weights[:, curves.names.index("mouthClose")] = 0.0
        return CurveSet(at_s, curves.names, weights)

    return change
