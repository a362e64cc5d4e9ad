"""A line as a film: the face, its sound, and what is being said below it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from animeme.errors import InputError
from animeme.files import atomic_path
from animeme.phones import SILENCE, PhoneTrack, Word
from animeme_stages.ingest.audio import decode
from animeme_stages.pictures import encode, style
from animeme_stages.pictures.framing import face_camera, limits_of, ranges_of
from animeme_stages.pictures.played import Played, read_played
from animeme_stages.pictures.scene import Scene, scene_of
from animeme_stages.pictures.shade import Pixels, Renderer
from animeme_stages.pictures.strip import fitted, require_suffix

SMALLEST_PX, LARGEST_PX = 120, 2160
# Of the film's height, what the caption takes.
_CAPTION = 0.17
_SUPERSAMPLE = 2
_MOST_FRAMES = 200_000
# Poses of the line that the main light is worked out for.
_LIT = 3


def film(
    asset: Path,
    animation: str,
    audio: Path | None,
    track: PhoneTrack | None,
    output: Path,
    *,
    rate_hz: float = 30.0,
    height_px: int = 480,
) -> None:
    """Write a line as an MP4 (H.264, AAC) as long as its recording, with captions.

    Args:
        asset: a character's file with the line's animation in it, written by animeme or not.
        animation: its name.
        audio: the recording; a silent film, as long as the animation, if None.
        track: the line's phones, for the captions; without any there are none.
        output: the MP4 to write.
        rate_hz: frames per second, 1 to 120.
        height_px: of the film; it is as wide as it is high.

    Raises:
        InputError: the asset or the recording cannot be read, there is no such animation, nothing
            can write films here, or the output cannot be written.
        ValueError: a rate or a height that no film has.
    """
    if not 1.0 <= rate_hz <= 120.0:
        raise ValueError(f"rate_hz must be from 1 to 120, not {rate_hz}")
    if not SMALLEST_PX <= height_px <= LARGEST_PX:
        raise ValueError(f"height_px must be from {SMALLEST_PX} to {LARGEST_PX}, not {height_px}")
    require_suffix(output, ".mp4")
    write = encode.writer()
    sound = None if audio is None else _sound(audio)
    scene = scene_of(asset)
    played = read_played(scene.character, animation)
    duration_s = played.duration_s if sound is None else sound.duration_s
    count = max(1, round(duration_s * rate_hz))
    if count > _MOST_FRAMES:
        raise InputError(
            "film-too-long",
            f"would be a film of {count} frames",
            place=str(audio or asset),
            action="Give it a lower rate, or cut the line.",
        )
    size_px = height_px // 2 * 2  # the colours of H.264 are halved both ways
    frames = _frames(scene, played, track, np.arange(count) / rate_hz, size_px)
    with atomic_path(output) as scratch:
        write(scratch, frames, (size_px, size_px), rate_hz, sound)


def _sound(audio: Path) -> encode.Sound:
    """A recording as it was made, at most two channels."""
    decoded = decode(audio)
    return encode.Sound(decoded.samples[:, :2], decoded.rate_hz)


def _frames(
    scene: Scene, played: Played, track: PhoneTrack | None, times_s: np.ndarray, size_px: int
) -> Iterator[Pixels]:
    """Each frame of the film, RGB (size_px, size_px, 3)."""
    caption_px = 0 if track is None else round(size_px * _CAPTION)
    picture_px = (size_px, size_px - caption_px)
    curves = played.curves
    camera = face_camera(
        scene, ranges_of(curves.names, curves.weights), aspect=picture_px[0] / picture_px[1]
    )
    lit = np.linspace(0, len(times_s) - 1, _LIT).round().astype(int)
    renderer = Renderer(
        scene,
        camera,
        picture_px,
        supersample=_SUPERSAMPLE,
        ranges=limits_of(curves.names, curves.weights),
        lit=[played.weights(float(times_s[k])) for k in lit],
    )
    for time_s in times_s.tolist():
        picture = renderer.picture(played.weights(time_s))
        if track is None:
            yield picture
        else:
            below = caption(track, time_s, (size_px, caption_px))
            yield np.concatenate([picture, np.asarray(below)])


def caption(track: PhoneTrack, time_s: float, size_px: tuple[int, int]) -> Image.Image:
    """The words around a time, the one that is spoken dark; below it its phones, and the time."""
    width, height = size_px
    image = Image.new("RGB", size_px, style.PAPER)
    draw = ImageDraw.Draw(image)
    large, small = (
        style.font(max(8, round(height * 0.33))),
        style.font(max(7, round(height * 0.24))),
    )
    word = _current(track.words, time_s)
    if word is not None:
        text = fitted(word.text, large, width * 0.5)
        draw.text((width / 2, height * 0.33), text, style.INK, large, anchor="mm")
        half = large.getlength(text) / 2 + large.size * 0.6
        index = track.words.index(word)
        before = " ".join(w.text for w in track.words[max(0, index - 6) : index])
        after = " ".join(w.text for w in track.words[index + 1 : index + 7])
        room = width / 2 - half - 8
        while before and large.getlength(before) > room:
            before = before.partition(" ")[2]
        while after and large.getlength(after) > room:
            after = after.rpartition(" ")[0]
        for said, x, anchor in ((before, width / 2 - half, "rm"), (after, width / 2 + half, "lm")):
            if said and style.writable(said):
                draw.text((x, height * 0.33), said, style.PALE, large, anchor=anchor)
    _phones(draw, track, time_s, size_px, small)
    draw.text((width - 8, height * 0.76), f"{time_s:.2f} s", style.FAINT, small, anchor="rm")
    return image


def _phones(
    draw: ImageDraw.ImageDraw,
    track: PhoneTrack,
    time_s: float,
    size_px: tuple[int, int],
    font: style.Font,
) -> None:
    """The phone at a time, and those beside it."""
    width, height = size_px
    now = next((i for i, p in enumerate(track.phones) if p.start_s <= time_s < p.end_s), None)
    if now is None:
        return
    for k in range(max(0, now - 2), min(len(track.phones), now + 3)):
        symbol = track.phones[k].symbol
        text = "·" if symbol == SILENCE else symbol
        if style.writable(text):
            x = width / 2 + (k - now) * font.size * 2.6
            colour = style.ACCENT if k == now else style.PALE
            draw.text((x, height * 0.76), text, colour, font, anchor="mm")


def _current(words: tuple[Word, ...], time_s: float) -> Word | None:
    """The word that is spoken, or was last."""
    begun = [word for word in words if word.start_s <= time_s]
    return begun[-1] if begun else None
