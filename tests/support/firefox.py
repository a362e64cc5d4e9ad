"""Firefox, as a reviewer's browser: walks over pages from disk, with a display and sound."""

from __future__ import annotations

import base64
import io
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from support.browser import LOCAL, Pixels
from support.judges import node_answer

Step = tuple[str, ...]


@dataclass(frozen=True)
class Seen:
    """What a walk saw: by the names that it gave, and complaints and requests on the way."""

    seen: dict[str, Any]
    complaints: list[str]
    requests: list[str]

    def __getitem__(self, name: str) -> Any:
        return self.seen[name]

    def picture(self, name: str) -> Pixels:
        """A picture, shape (height, width, 3)."""
        with Image.open(io.BytesIO(base64.b64decode(self.seen[name]))) as image:
            return np.asarray(image.convert("RGB"), dtype=np.int16)

    def require_quiet(self) -> None:
        """Nothing was complained of, and nothing asked for that is not on this machine's disk."""
        assert self.complaints == []
        assert [url for url in self.requests if not url.startswith(LOCAL)] == []


@dataclass(frozen=True)
class Firefox:
    """The machine's Firefox, where it has a display and a sound output."""

    program: str

    def walk(self, steps: Sequence[Step], downloads: Path) -> Seen:
        """Take the steps that tests/node/firefox.mjs describes, in a profile of their own."""
        asked = {"firefox": self.program, "downloads": str(downloads), "steps": steps}
        return Seen(**node_answer("puppeteer-core", "firefox.mjs", asked=asked))


@contextmanager
def firefox() -> Iterator[Firefox]:
    """Firefox on a virtual display with a sound output that nobody hears; skips without them.

    Without a display it has no WebGL, and without a sound output it plays no recording.
    """
    program = shutil.which("firefox-esr") or shutil.which("firefox")
    lacking = [] if program else ["firefox-esr"]
    lacking += [name.lower() for name in ("Xvfb", "pulseaudio") if not shutil.which(name)]
    if lacking:
        pytest.skip(f"not installed: apt-get install {' '.join(lacking)}")
    assert program is not None
    # Sockets have short names: not the long ones of pytest's folders.
    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_RUNTIME_DIR", folder)
        read, write = os.pipe()
        socket = f"{folder}/sound"
        commands = (
            ["Xvfb", "-displayfd", str(write), "-screen", "0", "1600x1200x24", "-nolisten", "tcp"],
            ["pulseaudio", "-n", "--daemonize=no", "--exit-idle-time=-1",
             "--load=module-null-sink",
             f"--load=module-native-protocol-unix auth-anonymous=1 socket={socket}"],
        )  # fmt: skip
        own = {**os.environ, "HOME": folder}
        servers = [
            subprocess.Popen(
                command, env=own, pass_fds=(write,), stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
            for command in commands
        ]  # fmt: skip
        os.close(write)
        try:
            with os.fdopen(read) as told:
                number = told.readline().strip()
            assert number, "Xvfb did not start"
            patch.setenv("DISPLAY", f":{number}")
            patch.setenv("PULSE_SERVER", f"unix:{socket}")
            patch.setenv("LIBGL_ALWAYS_SOFTWARE", "1")
            yield Firefox(program)
        finally:
            for server in servers:
                server.terminate()
            for server in servers:
                server.wait(timeout=20)
