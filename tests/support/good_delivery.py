"""A sound delivery, quick to judge: what is broken on purpose elsewhere."""

from __future__ import annotations

import json
import shutil
from dataclasses import dataclass
from pathlib import Path

import soundfile

import animeme
from animeme import registry
from animeme.contracts import LineAnimation
from support.gltf_build import BIN_KIND, TRIANGLE, face, glb
from support.jobs import SmallJob

# The shapes of ARKit that speak and that are broken here, and so many of the rest that the family
# is known; the sample's head has all of them.
NAMES = (
    "jawOpen", "jawForward", "jawLeft", "jawRight", "mouthClose", "mouthFunnel", "mouthPucker",
    "mouthLeft", "mouthRight", "mouthSmileLeft", "mouthSmileRight", "mouthStretchLeft",
    "mouthStretchRight", "mouthRollLower", "mouthRollUpper",
    "mouthShrugLower", "mouthShrugUpper", "mouthPressLeft", "mouthPressRight",
    "mouthLowerDownLeft", "mouthLowerDownRight", "mouthUpperUpLeft", "mouthUpperUpRight",
)  # fmt: skip
LINE, SECOND = "en/boat", "en/five"


@dataclass(frozen=True)
class Good:
    """A sound delivery of two lines in two languages.

    Attributes:
        folder: of the delivery.
        asset: the English file.
        source: what it was made from.
        dialogue: recordings, transcripts and phones.
        one: a dialogue of `LINE` alone.
    """

    folder: Path
    asset: Path
    source: Path
    dialogue: Path
    one: Path


def deliver(folder: Path, source: Path) -> Good:
    """A head speaks; its phones lie beside the recordings, so that nobody aligns again."""
    folder.mkdir(parents=True)
    job = SmallJob(
        folder,
        {
            "job": {"name": "small", "output": "out"},
            "dialogue": {"root": "dialogue"},
            "characters.hero": {"asset": source.name},
        },
    )
    shutil.copy(source, folder / source.name)
    for key in (LINE, SECOND):
        job.line(key, like=key)
    assert animeme.run(job.write(), executor="inline").exit_code == 0
    asset = job.output / "en" / f"hero{source.suffix}"
    for found in (job.output / "alignments" / "en").glob("*.json"):
        shutil.copy(found, job.dialogue / "en")
    _translate(job, source, asset)
    one = folder / "one"
    (one / "en").mkdir(parents=True)
    for file in job.dialogue.glob(f"{LINE}.*"):
        shutil.copy(file, one / "en")
    return Good(job.output, asset, folder / source.name, job.dialogue, one)


def _translate(job: SmallJob, source: Path, asset: Path) -> None:
    """German, as it looks in English: no second aligner is loaded."""
    shutil.copytree(job.dialogue / "en", job.dialogue / "de")
    for file in (job.dialogue / "de").glob("*.json"):
        aligned = json.loads(file.read_text(encoding="utf-8"))
        file.write_text(json.dumps({**aligned, "language": "de"}), encoding="utf-8")
    form = registry.format_of(asset)
    lines = [
        LineAnimation(name, "de", curves, soundfile.info(job.dialogue / f"de/{name}.wav").duration)
        for name, curves in form.read_animations(asset).items()
    ]
    target = job.output / "de" / asset.name
    target.parent.mkdir()
    form.write(form.load(source), lines, target)


def tiny_head(path: Path) -> Path:
    """A triangle with the shapes of ARKit that matter here."""
    path.write_bytes(glb(face(NAMES), (BIN_KIND, TRIANGLE)))
    return path
