"""Colours and typefaces that all pictures and plots share."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from PIL import ImageFont
from PIL.ImageFont import FreeTypeFont

from animeme_stages.pictures.raster import Singles

Rgb = tuple[int, int, int]
Font = FreeTypeFont

PAPER: Rgb = (250, 250, 250)
INK: Rgb = (44, 46, 52)
FAINT: Rgb = (124, 128, 138)
PALE: Rgb = (176, 180, 188)
RULE: Rgb = (216, 218, 223)
ACCENT: Rgb = (30, 96, 174)
WARNING: Rgb = (190, 110, 0)
ERROR: Rgb = (184, 38, 38)
BACKDROP: tuple[Rgb, Rgb] = ((219, 222, 226), (163, 170, 179))
"""Behind a character, from the middle to the corners."""
# Told apart by the colour-blind too: Okabe and Ito, "Color Universal Design" (2008), less yellow,
# which no curve on paper can have.
SERIES: tuple[Rgb, ...] = (
    (0, 114, 178), (213, 94, 0), (0, 158, 115), (204, 121, 167), (86, 180, 233), (230, 159, 0),
)  # fmt: skip


def hexadecimal(colour: Rgb) -> str:
    """A colour as Matplotlib takes it."""
    return "#{:02x}{:02x}{:02x}".format(*colour)


def displayed(light: Singles) -> Singles:
    """Linear light, 0 to 1, as display values."""
    return np.asarray(np.power(np.clip(light, 0.0, 1.0), np.float32(1 / 2.2)), dtype=np.float32)


@cache
def font(size_px: int, *, bold: bool = False) -> FreeTypeFont:
    """The typeface of all pictures, which has IPA, Greek and Cyrillic; it comes with Matplotlib."""
    import matplotlib

    folder = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    # The plain layout is the same on every machine; Pillow's other one depends on what is there.
    return ImageFont.truetype(folder / name, size_px, layout_engine=ImageFont.Layout.BASIC)


@cache
def _glyphs() -> frozenset[int]:
    """Characters that the typeface has."""
    from matplotlib import ft2font

    return frozenset(ft2font.FT2Font(font(12).path).get_charmap())


def writable(text: str) -> bool:
    """Whether the typeface has every character of a text, and writes it as it is read."""
    return all(ord(c) in _glyphs() and not "\u0590" <= c <= "\u08ff" for c in text)


def plot_settings() -> Any:
    """Matplotlib's rcParams of every plot."""
    from cycler import cycler

    ink, faint, rule = (hexadecimal(colour) for colour in (INK, FAINT, RULE))
    return {
        "axes.edgecolor": rule,
        "axes.facecolor": "white",
        "axes.labelcolor": ink,
        "axes.prop_cycle": cycler(color=[hexadecimal(colour) for colour in SERIES]),
        "axes.spines.right": False,
        "axes.spines.top": False,
        "figure.facecolor": hexadecimal(PAPER),
        "font.family": "DejaVu Sans",
        "font.size": 9,
        "legend.frameon": False,
        "savefig.facecolor": hexadecimal(PAPER),
        # Ids in SVG are random unless salted.
        "svg.fonttype": "none",
        "svg.hashsalt": "animeme",
        "text.color": ink,
        "text.parse_math": False,  # words and symbols are no formulas
        "xtick.color": faint,
        "ytick.color": faint,
    }
