"""Chromium, as a reviewer's browser: what a page does, shows and complains of."""

from __future__ import annotations

import io
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

# Software rendering; nothing that talks to a network by itself.
ARGUMENTS = (
    "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic",
    "--no-first-run", "--disable-background-networking", "--disable-component-update",
    "--disable-sync", "--autoplay-policy=no-user-gesture-required",
)  # fmt: skip
NO_WEBGL = """const get = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
  return kind.startsWith("webgl") ? null : get.call(this, kind, ...rest); };"""
LOCAL = ("file:", "data:", "blob:")
Pixels = NDArray[np.int16]


@contextmanager
def chromium() -> Iterator[Any]:
    """The machine's Chromium by Playwright; skips the test where either is absent."""
    driver = pytest.importorskip("playwright.sync_api", reason="playwright (extra 'dev') is absent")
    found = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "chrome"))), None)
    if found is None:
        pytest.skip("Chromium is not installed (apt-get install chromium)")
    with driver.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=found, args=list(ARGUMENTS))
        yield browser
        browser.close()


class Watched:
    """A page, with all that it complained of and asked for."""

    def __init__(self, browser: Any, file: Path, *, anchor: str = "", webgl: bool = True) -> None:
        self.page = browser.new_page(viewport={"width": 1440, "height": 1000})
        if not webgl:
            self.page.add_init_script(NO_WEBGL)
        self.complaints: list[str] = []
        self.requests: list[str] = []
        self.page.on("console", self._hear)
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(file.absolute().as_uri() + anchor)

    def __enter__(self) -> Watched:
        return self

    def __exit__(self, *_: object) -> None:
        self.page.close()

    def _hear(self, message: Any) -> None:
        if message.type in ("error", "warning"):
            self.complaints.append(message.text)

    def require_quiet(self) -> None:
        """Nothing was complained of, and nothing asked for that is not on this machine's disk."""
        assert self.complaints == []
        assert [url for url in self.requests if not url.startswith(LOCAL)] == []

    def wait_for_head(self, heads: int = 1) -> None:
        """Wait until the heads are there."""
        self.page.wait_for_selector(f".stage[data-ready='{heads}']", timeout=30_000)
        self.settle()

    def settle(self) -> None:
        """Wait for two pictures."""
        self.page.evaluate(
            "() => new Promise(r => requestAnimationFrame(() => requestAnimationFrame(r)))"
        )

    def wait_until(self, true: Callable[[], bool], *, within_s: float = 20.0) -> None:
        """Wait until something is true; the page's policy lets no test poll inside it."""
        for _ in range(round(within_s / 0.05)):
            if true():
                return
            self.page.wait_for_timeout(50)
        raise AssertionError("it did not happen in time")

    @property
    def time_s(self) -> float:
        """Where playing is."""
        minutes, seconds = self.page.inner_text(".player .time").split()[0].split(":")
        return float(minutes) * 60 + float(seconds)

    def seek(self, at_s: float) -> None:
        """Go to a time by the slider."""
        self.page.evaluate(
            """at => { const slider = document.querySelector('.player input[type=range]');
            slider.value = at; slider.dispatchEvent(new Event('input')); }""",
            at_s,
        )
        self.settle()

    def head(self) -> Pixels:
        """What the canvas of the head shows, shape (height, width, 3)."""
        shot = self.page.locator("canvas.head").screenshot()
        with Image.open(io.BytesIO(shot)) as image:
            return np.asarray(image.convert("RGB"), dtype=np.int16)


def inside_mouth(picture: Pixels) -> int:
    """How many pixels of Ada's picture are the dark red of the cavity behind her lips."""
    red, green, blue = np.moveaxis(picture, -1, 0)
    return int(((red > 45) & (red < 150) & (green < 45) & (blue < 45)).sum())
