"""Build the model that is shipped as `dam`: GRID's speaker 1 on ARKit controls.

    python tests/bench/shipped_model.py ../shared/data/grid-s1 ../shared/assets/ict dam_grid.json

The landmarks are cross-mapped to the ICT head, both sides of the mouth alike, and `dam` is fitted
to the result. What one camera in front cannot see, the lower lip drawn in under the teeth for /f v/
and pressed for /p b m/, comes from the table of the untrained Cohen–Massaro model, as contacts. The
same input gives the same bytes.
"""

from __future__ import annotations

import argparse
import pickle
import tempfile
from pathlib import Path

import animeme
from animeme.dataset import Dataset
from animeme_stages.synthesize.cohen_massaro import CohenMassaro
from animeme_stages.synthesize.contacts import Bound, Contacts
from animeme_stages.synthesize.dam import Dam

OPTIONS = {"rounds": 200, "depth": 4, "rate": 0.14}
LARGEST_BYTES = 1_000_000
# Class of contact → the phone whose row of the table it takes.
CONTACTS = {"bilabial": "m", "labiodental": "f"}
CREDITS = (
    "Fitted to speaker 1 of the GRID corpus: M. Cooke, J. Barker, S. Cunningham and X. Shao, 'An "
    "audio-visual corpus for speech perception and automatic speech recognition', JASA 120 (2006), "
    "https://doi.org/10.1121/1.2229005; CC BY 4.0, https://creativecommons.org/licenses/by/4.0/. "
    "Changed: lip motion was tracked, and mapped to ARKit controls on ICT-FaceKit's head (MIT)."
)


def mapped(data: Path, head: Path) -> Dataset:
    """The corpus as controls of the head."""
    with tempfile.TemporaryDirectory() as folder:
        found = animeme.crossmap(
            data / "landmarks.npz", head, folder, lines=data / "lines", keys="none", symmetric=True
        )
        print(f"{len(found.files)} takes, residual {found.residual:.4f}")
        return animeme.read_dataset(folder, workers=2)


def contacts(model: Dam) -> Contacts:
    """Exact targets of lips that meet lips or teeth."""
    table = CohenMassaro.default().table
    bounds = []
    for kind, phone in CONTACTS.items():
        row = table.rows[phone]
        for control in model.controls_:
            column = table.controls.index(control)
            if table.contact[row, column]:
                limit = float(table.targets[row, column])
                bounds += [Bound(kind, control, limit, upper) for upper in (True, False)]
    return Contacts(tuple(bounds))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path)
    parser.add_argument("head", type=Path)
    parser.add_argument("output", type=Path)
    parser.add_argument("--tracks", type=Path, help="pickle of the dataset, made if absent")
    arguments = parser.parse_args()
    if arguments.tracks and arguments.tracks.exists():
        dataset = pickle.loads(arguments.tracks.read_bytes())
    else:
        dataset = mapped(arguments.data, arguments.head)
        if arguments.tracks:
            arguments.tracks.write_bytes(pickle.dumps(dataset))
    model = animeme.train(dataset, "dam", OPTIONS)
    assert isinstance(model, Dam)
    model.contacts_ = contacts(model)
    model.credits_ = CREDITS
    animeme.save_model(model, arguments.output)
    size = arguments.output.stat().st_size
    print(f"{len(dataset.lines)} lines, {len(model.controls)} controls, {size / 1000:.0f} kB")
    assert size <= LARGEST_BYTES, "make rounds or depth smaller"


if __name__ == "__main__":
    main()
