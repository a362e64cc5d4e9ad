"""Key frames of a line side by side: a PNG to look at without a player."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from PIL import Image, ImageDraw

from animeme.errors import InputError
from animeme.files import atomic_path
from animeme.phones import SILENCE, PhoneTrack
from animeme_stages.pictures import style
from animeme_stages.pictures.framing import face_camera, limits_of, ranges_of
from animeme_stages.pictures.moments import Moment, moments_of
from animeme_stages.pictures.played import read_played
from animeme_stages.pictures.scene import Scene, scene_of
from animeme_stages.pictures.shade import Camera, Renderer

FRAME_PX = (230, 280)
SUPERSAMPLE = 3
MOST_MOMENTS = 48
# More frames than this in a row are too wide to look at.
_ROW = 12
_LABEL_PX, _TITLE_PX, _GAP_PX = 44, 34, 2


def draw_strip(
    asset: Path,
    animation: str,
    track: PhoneTrack | None,
    output: Path,
    *,
    title: str = "",
    moments: int = 9,
) -> None:
    """Draw a line's key frames, labelled with word, phone and time, as one PNG.

    Args:
        asset: a character's file with the line's animation in it, written by animeme or not.
        animation: its name.
        track: the line's phones, which choose the frames; without any they are evenly spaced.
        output: the PNG to write.
        title: written above.
        moments: how many frames, 1 to 48; a line of fewer phones has fewer.

    Raises:
        InputError: the asset cannot be read or drawn, has no such animation, or the output cannot
            be written.
        ValueError: no such number of moments.
    """
    if not 1 <= moments <= MOST_MOMENTS:
        raise ValueError(f"moments must be from 1 to {MOST_MOMENTS}, not {moments}")
    require_suffix(output, ".png")
    scene = scene_of(asset)
    played = read_played(scene.character, animation)
    duration_s = played.duration_s if track is None else track.duration_s
    chosen = moments_of(track, duration_s, moments)
    ranges = ranges_of(played.curves.names, played.curves.weights)
    camera = face_camera(scene, ranges, aspect=FRAME_PX[0] / FRAME_PX[1])
    frames = [played.weights(moment.time_s) for moment in chosen]
    limits = limits_of(played.curves.names, played.curves.weights)
    image = sheet(scene, frames, camera, labels=chosen, title=title, ranges=limits)
    with atomic_path(output) as scratch:
        image.save(scratch, format="PNG", optimize=True)


def require_suffix(output: Path, suffix: str) -> None:
    """Refuse a file whose name does not say what it will be.

    Args:
        output: the file.
        suffix: of its name, with the dot, in lower case.

    Raises:
        InputError: it ends in another.
    """
    if output.suffix.lower() != suffix:
        raise InputError(
            "output-suffix",
            f"is no {suffix[1:].upper()} by its name",
            place=str(output),
            action=f"Call it {suffix}.",
        )


def sheet(
    scene: Scene,
    frames: Sequence[Mapping[str, float]],
    camera: Camera,
    *,
    labels: Sequence[Moment | str] = (),
    title: str = "",
    frame_px: tuple[int, int] = FRAME_PX,
    supersample: int = SUPERSAMPLE,
    ranges: Mapping[str, tuple[float, float]] | None = None,
) -> Image.Image:
    """Frames side by side, in rows where they are many, with a label below each.

    Args:
        scene: what to draw.
        frames: canonical shape weights of each.
        camera: point of view.
        labels: one per frame, or none.
        title: written above, if there is one.
        frame_px: width and height of a frame.
        supersample: samples per pixel along each side.
        ranges: canonical shape → its least and greatest weight in the frames, if known: saves time.
    """
    # Light and shade of the ends and the middle, so that all frames agree.
    lit = [] if ranges is None else [frames[0], frames[len(frames) // 2], frames[-1]]
    renderer = Renderer(scene, camera, frame_px, supersample=supersample, ranges=ranges, lit=lit)
    rows = -(-len(frames) // _ROW)
    across = -(-len(frames) // rows)
    label, head = (_LABEL_PX if labels else 0), (_TITLE_PX if title else 0)
    width = across * frame_px[0] + (across - 1) * _GAP_PX
    image = Image.new("RGB", (width, head + rows * (frame_px[1] + label)), style.PAPER)
    draw = ImageDraw.Draw(image)
    if title:
        fitting = fitted(title, style.font(17, bold=True), width - 24)
        draw.text((12, head / 2), fitting, style.INK, style.font(17, bold=True), anchor="lm")
    for k, weights in enumerate(frames):
        left = (k % across) * (frame_px[0] + _GAP_PX)
        top = head + (k // across) * (frame_px[1] + label)
        image.paste(Image.fromarray(renderer.picture(weights)), (left, top))
        if k < len(labels):
            _label(draw, labels[k], left, top + frame_px[1], frame_px[0])
    return image


def _label(draw: ImageDraw.ImageDraw, said: Moment | str, left: int, top: int, width: int) -> None:
    """The word and its phone, and below them the time."""
    middle = left + width / 2
    if isinstance(said, str):
        text = fitted(said, style.font(15), width - 8)
        draw.text((middle, top + _LABEL_PX / 2), text, style.INK, style.font(15), anchor="mm")
        return
    phone = "pause" if said.symbol == SILENCE else said.symbol
    parts = [
        (said.word, style.INK, style.font(15)),
        (phone, style.ACCENT, style.font(15, bold=True)),
    ]
    parts = [part for part in parts if part[0]]
    words = [(fitted(text, font, width * 0.62), colour, font) for text, colour, font in parts]
    total = sum(font.getlength(text) for text, _, font in words) + 9 * (len(words) - 1)
    x = middle - total / 2
    for text, colour, font in words:
        draw.text((x, top + 15), text, colour, font, anchor="lm")
        x += font.getlength(text) + 9
    time = f"{said.time_s:.2f} s"
    draw.text((middle, top + (33 if words else 22)), time, style.FAINT, style.font(12), anchor="mm")


def fitted(text: str, font: style.Font, width_px: float) -> str:
    """`text`, cut to fit; nothing where the typeface lacks its script."""
    text = " ".join(text.split())
    if not style.writable(text):
        return ""
    if font.getlength(text) <= width_px:
        return text
    while text and font.getlength(text + "…") > width_px:
        text = text[:-1]
    return text.rstrip() + "…"
