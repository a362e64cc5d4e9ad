"""The README's picture: ada saying one line, as `animeme run` animated her.

Run ``python sample_assets/picture.py OUTPUT.png``, or ``make picture``.
"""

from __future__ import annotations

import json
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import animeme
from animeme.phones import PhoneTrack
from animeme_stages.pictures.played import read_played
from animeme_stages.pictures.scene import load_scene
from animeme_stages.pictures.strip import sheet
from render import camera_for

SAMPLE = Path(__file__).resolve().parent
LINE = "boat"
# Phones of "Mama bought a big blue boat for Bob" that show closures, rounding and contact.
SHOWN = (0, 1, 4, 5, 8, 13, 15, 17, 21)
FRAME_PX = (230, 300)
ZOOM = 1.25


def main() -> None:
    """Run the sample job and draw the middle of some phones."""
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder)
        animeme.run(SAMPLE / "job.toml", output=output)
        scene = load_scene(output / "en" / "ada.glb")
        played = read_played(scene.character, LINE)
        document = json.loads((output / "alignments" / "en" / f"{LINE}.json").read_text("utf-8"))
    track = PhoneTrack.from_document(document)
    spoken = [phone for phone in track.phones if phone.symbol != "sil"]
    frames, labels = [], []
    for index in SHOWN:
        phone = spoken[index]
        middle_s = (phone.start_s + phone.end_s) / 2
        frames.append(played.weights(middle_s))
        (word,) = [w.text for w in track.words if w.start_s <= middle_s < w.end_s]
        labels.append(f"{word}  {phone.symbol}")
    camera = camera_for(scene, "face", yaw=12.0, aspect=FRAME_PX[0] / FRAME_PX[1])
    camera = replace(camera, height=camera.height / ZOOM)
    picture = sheet(scene, frames, camera, labels=labels, frame_px=FRAME_PX)
    Path(sys.argv[1]).parent.mkdir(parents=True, exist_ok=True)
    picture.save(sys.argv[1], optimize=True)


if __name__ == "__main__":
    main()
