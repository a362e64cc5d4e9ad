"""How well visemes solved from ARKit's controls tell what is said: the tables of docs/rigs.md.

    python -m bench.visemes ALIGNMENTS [--model NAME]

ALIGNMENTS is a folder that `animeme run` or `animeme align` filled. For the middle of each phone
(for p and b: of its closure) it asks whether the strongest viseme is the one that the family's own
table has for that phone, or at least one that looks like it on the lips.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np

import animeme
from animeme.phones import PhoneTrack
from animeme.rig import Character, MeshShapes
from animeme_stages.retarget.profile_files import shipped_profile
from animeme_stages.retarget.profiles import bind
from animeme_stages.retarget.retarget import retarget

# Viseme → phones, as the families' own documentation has them (see the profiles for sources).
TABLES: Mapping[str, Mapping[str, str]] = {
    "oculus": {
        "viseme_PP": "p b m", "viseme_FF": "f v", "viseme_TH": "θ ð", "viseme_DD": "t d ɾ",
        "viseme_kk": "k ɡ", "viseme_CH": "tʃ dʒ ʃ ʒ", "viseme_SS": "s z", "viseme_nn": "n l ŋ",
        "viseme_RR": "ɹ r ɝ ɚ", "viseme_aa": "a ɑ æ aɪ aʊ ʌ", "viseme_E": "ɛ e eɪ ə",
        "viseme_I": "i ɪ j", "viseme_O": "o ɔ oʊ ɔɪ ɒ", "viseme_U": "u ʊ w y",
    },
    "preston-blair": {
        "AI": "a ɑ æ aɪ aʊ ʌ ə", "E": "i ɪ e ɛ eɪ", "O": "o ɔ oʊ ɔɪ ɒ", "U": "u ʊ y",
        "etc": "t d ɾ n k ɡ ŋ s z ɹ r j θ ð tʃ dʒ ʃ ʒ", "L": "l", "WQ": "w", "MBP": "p b m",
        "FV": "f v",
    },
    "vrm1": {
        "aa": "a ɑ æ aɪ aʊ ʌ", "ih": "i ɪ", "ou": "u ʊ y", "ee": "ɛ e eɪ", "oh": "o ɔ oʊ ɔɪ ɒ",
    },
    "smartbody": {
        "open": "a ɑ æ aɪ aʊ ʌ ɛ ə", "W": "u ʊ w o ɔ", "ShCh": "tʃ dʒ ʃ ʒ", "PBM": "p b m",
        "FV": "f v", "wide": "i ɪ e eɪ s z",
    },
}  # fmt: skip
# Visemes that look alike, after the classes of Jeffers & Barley, Speechreading (1971).
ALIKE = (
    {"viseme_CH", "viseme_RR", "viseme_U", "viseme_O"},
    {"viseme_TH", "viseme_DD", "viseme_kk", "viseme_nn", "viseme_SS", "viseme_I", "viseme_E"},
    {"viseme_aa", "viseme_E", "viseme_kk"},
    {"O", "U", "WQ"},
    {"etc", "L", "E"},
    {"AI", "L"},
    {"ou", "oh"},
    {"ih", "ee"},
    {"aa", "ee"},
    {"W", "ShCh"},
)
KINDS: Mapping[str, tuple[str, ...]] = {
    "p b m": ("p", "b", "m"),
    "f v": ("f", "v"),
    "vowels": (
        "a", "ɑ", "æ", "aɪ", "aʊ", "ʌ", "ɛ", "e", "eɪ", "ə", "i", "ɪ", "o", "ɔ", "oʊ", "ɔɪ", "ɒ",
        "u", "ʊ", "y",
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Tally:
    """What a family's visemes did over some lines.

    Attributes:
        right, alike, phones: per kind of phone: counts.
        aperture: of the lips during p, b and m, in units of jawOpen: mean and largest.
        step: 99th percentile of the largest change of any weight from frame to frame at 60 Hz.
    """

    right: Counter[str]
    alike: Counter[str]
    phones: Counter[str]
    aperture: tuple[float, float]
    step: float


def tally(tracks: Sequence[PhoneTrack], model_name: str, family: str) -> Tally:
    """Count over `tracks` as `model_name` speaks them on a rig of `family`."""
    model = animeme.load_model(model_name)
    profile = shipped_profile(family)
    mesh = MeshShapes("/nodes/0", "face", profile.shapes, (0.0,) * len(profile.shapes))
    rig = bind(profile, Character(Path("rig.glb"), "gltf", (mesh,)))
    wanted = {p: v for v, phones in TABLES[family].items() for p in phones.split()}
    right, alike, count = Counter[str](), Counter[str](), Counter[str]()
    apertures, steps = [0.0], []
    for track in tracks:
        curves = retarget(model.synthesize(track, rate_hz=60.0), rig, {})
        names = [name for name in curves.names if name != profile.rest]
        columns = [curves.names.index(name) for name in names]
        steps.append(np.abs(np.diff(curves.weights[:, columns], axis=0)).max(axis=1))
        opens = np.array(
            [
                profile.poses[n].get("jawOpen", 0) - profile.poses[n].get("mouthClose", 0)
                for n in names
            ]
        )
        for symbol, phone in zip(track.ipa(), track.phones, strict=True):
            if symbol not in wanted:
                continue
            share = 0.3 if symbol in ("p", "b") else 0.5
            weights = curves.sample(phone.start_s + share * phone.duration_s)[0, columns]
            found = names[int(weights.argmax())]
            kind = next((kind for kind, symbols in KINDS.items() if symbol in symbols), "others")
            hit = found == wanted[symbol]
            count[kind] += 1
            right[kind] += hit
            alike[kind] += hit or any({found, wanted[symbol]} <= group for group in ALIKE)
            if kind == "p b m":
                apertures.append(float(weights @ opens))
    spread = (float(np.mean(apertures)), max(apertures))
    return Tally(right, alike, count, spread, float(np.percentile(np.concatenate(steps), 99)))


@click.command()
@click.argument("alignments", type=click.Path(path_type=Path, exists=True))
@click.option("--model", "models", multiple=True, default=("dam", "cohen-massaro"))
def main(alignments: Path, models: Sequence[str]) -> None:
    """Print one row per model and family."""
    files = sorted(alignments.rglob("*.json"))
    documents = [json.loads(path.read_text(encoding="utf-8")) for path in files]
    tracks = [PhoneTrack.from_document(d) for d in documents if "phones" in d]
    kinds = [*KINDS, "others"]
    click.echo(" | ".join(["model", "rig", *kinds, "p b m aperture: mean, most", "step"]))
    for model in models:
        for family in TABLES:
            found = tally(tracks, model, family)
            cells = [
                f"{found.right[kind] / n:.0%} ({found.alike[kind] / n:.0%})" if n else "–"
                for kind, n in ((kind, found.phones[kind]) for kind in kinds)
            ]
            mean, most = found.aperture
            row = [model, family, *cells, f"{mean:.2f}, {most:.2f}", f"{found.step:.2f}"]
            click.echo(" | ".join(row))


if __name__ == "__main__":
    main()
