"""One line of the sample, as each model moves it: docs/models-strip.png.

    python tests/bench/models_picture.py ../shared/data/grid-s1 ../shared/assets/ict \
        docs/models-strip.png

`dam` and `cohen-massaro` are as shipped; the others are fitted to the motion that
`dam` was fitted to (see `shipped_model.py`). Every row is what `animeme run` wrote into the
character.
"""

from __future__ import annotations

import argparse
import json
import shutil
import tempfile
from dataclasses import replace
from pathlib import Path

from PIL import Image, ImageDraw
from shipped_model import mapped

import animeme
from animeme.phones import Phone, PhoneTrack
from animeme_stages.pictures import style
from animeme_stages.pictures.played import read_played
from animeme_stages.pictures.scene import load_scene
from animeme_stages.pictures.strip import sheet
from render import camera_for

SAMPLE = Path(__file__).resolve().parents[2] / "sample_assets"
LINE = "boat"
MODELS = ("dam", "dam-2009", "cohen-massaro", "mmm", "bigram")
SHIPPED = ("dam", "cohen-massaro")
# One line in so many is enough for a picture of what is slow to fit.
EVERY = {"dam-2009": 5}
# Phones of "Mama bought a big blue boat for Bob" that show closures, rounding and contact.
SHOWN = (0, 1, 4, 5, 8, 13, 15, 17, 21)
FRAME_PX = (150, 118)
MARGIN_PX = 110
ZOOM = 1.0


def job(folder: Path, asset: Path, model: str, file: Path | None) -> Path:
    """Write a job of one line and one character; returns its file."""
    spoken = folder / "dialogue" / "en"
    spoken.mkdir(parents=True)
    for path in (SAMPLE / "dialogue" / "en").glob(f"{LINE}.*"):
        shutil.copy(path, spoken)
    chosen = f"file = {json.dumps(str(file))}" if file else f'name = "{model}"'
    path = folder / "job.toml"
    path.write_text(
        f'[job]\nname = "{model}"\n[dialogue]\nroot = "dialogue"\n[model]\n{chosen}\n'
        f"[characters.one]\nasset = {json.dumps(str(asset))}\n",
        encoding="utf-8",
    )
    return path


def row(asset: Path, model: str, file: Path | None, *, labelled: bool) -> Image.Image:
    """Run the line with one model and draw the middle of some phones."""
    with tempfile.TemporaryDirectory() as name:
        folder, output = Path(name), Path(name) / "out"
        animeme.run(job(folder, asset.resolve(), model, file), output=output)
        scene = load_scene(output / "en" / "one.glb")
        played = read_played(scene.character, LINE)
        document = json.loads((output / "alignments" / "en" / f"{LINE}.json").read_text("utf-8"))
    track = PhoneTrack.from_document(document)
    spoken = [phone for phone in track.phones if phone.symbol != "sil"]
    shown = [spoken[index] for index in SHOWN]
    frames = [played.weights((phone.start_s + phone.end_s) / 2) for phone in shown]
    labels = [label(track, phone) for phone in shown] if labelled else []
    camera = camera_for(scene, "mouth", yaw=12.0, aspect=FRAME_PX[0] / FRAME_PX[1])
    camera = replace(camera, height=camera.height / ZOOM)
    frames_image = sheet(scene, frames, camera, labels=labels, frame_px=FRAME_PX)
    image = Image.new("RGB", (MARGIN_PX + frames_image.width, frames_image.height), style.PAPER)
    image.paste(frames_image, (MARGIN_PX, 0))
    middle = (MARGIN_PX / 2, FRAME_PX[1] / 2)
    ImageDraw.Draw(image).text(middle, model, fill=style.INK, font=style.font(14), anchor="mm")
    return image


def label(track: PhoneTrack, phone: Phone) -> str:
    """The word and the phone."""
    middle_s = (phone.start_s + phone.end_s) / 2
    (word,) = [w.text for w in track.words if w.start_s <= middle_s < w.end_s]
    return f"{word}  {phone.symbol}"


def fit(data: Path, head: Path, folder: Path) -> None:
    """Write the models that are not shipped, unless they are there."""
    folder.mkdir(parents=True, exist_ok=True)
    wanted = [m for m in MODELS if m not in SHIPPED and not (folder / f"{m}.json").exists()]
    dataset = mapped(data, head) if wanted else None
    for model in wanted:
        assert dataset is not None
        some = dataset.subset(dataset.lines[:: EVERY.get(model, 1)])
        animeme.save_model(animeme.train(some, model, {}), folder / f"{model}.json")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path)
    parser.add_argument("head", type=Path)
    parser.add_argument("output", type=Path)
    parser.add_argument("--asset", type=Path, default=SAMPLE / "ada.glb", help="who speaks")
    parser.add_argument("--fitted", type=Path, help="folder of the fitted models, made if absent")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = arguments.fitted or Path(name)
        fit(arguments.data, arguments.head, folder)
        rows = [
            row(
                arguments.asset,
                model,
                None if model in SHIPPED else folder / f"{model}.json",
                labelled=model == MODELS[-1],
            )
            for model in MODELS
        ]
    picture = Image.new("RGB", (rows[0].width, sum(image.height for image in rows)))
    top = 0
    for image in rows:
        picture.paste(image, (0, top))
        top += image.height
    picture.quantize(128).save(arguments.output, optimize=True)


if __name__ == "__main__":
    main()
