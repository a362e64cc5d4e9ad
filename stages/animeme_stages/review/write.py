"""The stage that writes a review: an index, a page per line, and what they share."""

from __future__ import annotations

import base64
import gzip
import hashlib
import json
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

from animeme.errors import InputError
from animeme.files import stamp, unwritable, write_bytes
from animeme.reviewing import (
    Detail,
    Listener,
    Performed,
    Review,
    Reviewable,
    ReviewedLine,
    WrittenReview,
)
from animeme_stages.review import html
from animeme_stages.review.data import index_of, line_of, take_of
from animeme_stages.review.sound import Sound, sound_of
from animeme_stages.review.view import View, view_of

INDEX = "index.html"
# Says which files are ours: a review in the same folder takes away what it does not write anew.
MANIFEST = "review.json"
_SCHEMA = "animeme.review-files/1"
NO_BUNDLE = (
    "The 3D view is not part of this installation. A wheel has it; a checkout gets it with "
    "`pip install --editable .`, which fetches Node and three.js, so it needs the network."
)
_UNSAFE = re.compile(r"[^\w.\- ]+")


def write_review(
    review: Review, output: Path, *, single_file: bool, listener: Listener
) -> WrittenReview:
    """Write `review` to the folder `output`; see `animeme.reviewing.review`.

    Raises:
        InputError: it cannot be written.
    """
    return _Writer(review, output, single_file=single_file).write(listener)


@dataclass(frozen=True)
class _Heard:
    """A recording, and where pages find it; `why` it cannot be heard."""

    sound: Sound | None
    source: str = ""
    why: str = ""


class _Writer:
    """Writes one review."""

    def __init__(self, review: Review, output: Path, *, single_file: bool) -> None:
        self._review, self._output, self._single = review, output, single_file
        self._written: dict[str, int] = {}
        self._heard: dict[Path, _Heard] = {}
        self._sounds: dict[str, str] = {}  # of a single file: name → data URI
        self._assets: dict[str, str] = {}  # of a single file: digest → script
        self._digests: dict[tuple[Path, str], tuple[str | None, str]] = {}
        self._remarks: dict[str, None] = {}
        self._names = _names_of(review.chosen)

    def write(self, listener: Listener) -> WrittenReview:
        """Everything."""
        review, head = self._review, html.head_script()
        if head is None:
            self._remarks[NO_BUNDLE] = None
        earlier = self._earlier()
        if INDEX not in earlier and (self._output / INDEX).exists():
            raise InputError(
                "output-taken",
                "is there already, and no review's",
                place=str(self._output / INDEX),
                action="Choose another output folder.",
            )
        lines: dict[str, Any] = {}
        for done, (line, data) in enumerate(self._lines(), 1):
            name = self._names[line.key, line.character]
            if self._single:
                lines[name] = data
            else:
                self._page(name, line, data)
            listener(done, len(review.chosen))
        links = {key: f"#{quote(n)}" if self._single else f"lines/{quote(n)}.html"
                 for key, n in self._names.items()}  # fmt: skip
        other = review.other.title if review.other else ""
        index = {"index": index_of(review.shown, links, other)}
        if self._single:
            index |= {"lines": lines, "sounds": self._sounds}
            scripts = [html.script(), *([head] if head else []), *self._assets.values()]
            self._put(INDEX, html.page(self._title(), index, scripts=scripts, style=html.style()))
        else:
            self._put("assets/page.js", html.script())
            self._put("assets/page.css", html.style())
            if head is not None:
                self._put("assets/head.js", head)
            page = html.page(
                self._title(), index,
                scripts=[Path("assets/page.js")], style=Path("assets/page.css"),
            )  # fmt: skip
            self._put(INDEX, page)
        self._tidy(earlier)
        return WrittenReview(
            self._output / INDEX, len(review.shown.lines), len(review.chosen),
            sum(self._written.values()), head is not None, tuple(self._remarks),
        )  # fmt: skip

    def _title(self) -> str:
        return f"{self._review.shown.title} · review"

    def _lines(self) -> Iterator[tuple[ReviewedLine, dict[str, Any]]]:
        review = self._review
        chosen = review.chosen
        details = review.shown.details(chosen)
        others: Iterator[Detail] = iter(())
        if review.other is not None:
            pairs = review.other_lines
            there = [pairs[key] for line in chosen if (key := (line.key, line.character)) in pairs]
            others = review.other.details(there)
        for line, detail in zip(chosen, details, strict=True):
            beside = (line.key, line.character) in review.other_lines
            yield line, self._line(line, detail, next(others) if beside else None)

    def _line(self, line: ReviewedLine, detail: Detail, other: Detail | None) -> dict[str, Any]:
        remarks = list(detail.remarks)
        heard = self._hear(detail.audio) if detail.audio else _Heard(None)
        remarks += [heard.why] if heard.why else []
        takes = list(self._takes("A", self._review.shown, detail, remarks))
        if self._review.other is not None:
            if other is None:
                remarks.append(f"{self._review.other.title} has no such line to compare with.")
            else:
                takes += self._takes("B", self._review.other, other, remarks)
        if html.head_script() is None:
            remarks.append(NO_BUNDLE)
        return line_of(
            line, detail, sound=heard.sound, source=heard.source or None, takes=takes,
            frame_hz=self._review.shown.frame_hz, remarks=list(dict.fromkeys(remarks)),
        )  # fmt: skip

    def _takes(
        self, side: str, shown: Reviewable, detail: Detail, remarks: list[str]
    ) -> Iterator[dict[str, Any]]:
        performed = detail.performed
        if self._single:  # the same motion in another format would double its size
            performed = performed[:1]
        for entry in performed:
            asset = self._asset(entry, remarks)
            yield take_of(entry, side=side, title=shown.title, asset=asset)

    def _asset(self, performed: Performed, remarks: list[str]) -> str | None:
        """Name of the viewing copy of a face; None if there is none."""
        if html.head_script() is None:
            return None
        key = (performed.face, stamp(performed.face))
        if key not in self._digests:
            self._digests[key] = self._made(performed)
        digest, why = self._digests[key]
        if why:
            remarks.append(why)
        return digest

    def _made(self, performed: Performed) -> tuple[str | None, str]:
        try:
            view: View = view_of(performed.face)
        except InputError as error:
            return None, f"The head of {performed.file} cannot be shown: it {error.problem}."
        except Exception as error:  # noqa: BLE001  strange files are shown without their head
            why = f"{type(error).__name__}: {error}"
            return None, f"The head of {performed.file} cannot be shown: reading failed ({why})."
        digest = view.digest
        name = f"assets/{digest}.js"
        if digest not in self._assets and name not in self._written:
            packed = gzip.compress(view.glb, 6, mtime=0)
            text = html.asset_script(digest, view.to_json(), packed)
            if self._single:
                self._assets[digest] = text
            else:
                self._put(name, text)
        return digest, ""

    def _hear(self, path: Path) -> _Heard:
        if path not in self._heard:
            self._heard[path] = self._sound(path)
        return self._heard[path]

    def _sound(self, path: Path) -> _Heard:
        try:
            sound = sound_of(path, small=self._single)
        except InputError as error:
            return _Heard(None, why=f"The recording cannot be heard: it {error.problem}.")
        try:
            data = path.read_bytes() if sound.data is None else sound.data
        except OSError as error:
            return _Heard(None, why=f"The recording cannot be read ({error.strerror}).")
        name = hashlib.sha256(data).hexdigest()[:16]
        if self._single:
            self._sounds[name] = f"data:{sound.mime};base64,{base64.b64encode(data).decode()}"
            return _Heard(sound, f"sound:{name}")
        self._put(f"audio/{name}{sound.suffix}", data)
        return _Heard(sound, f"audio/{name}{sound.suffix}")

    def _page(self, name: str, line: ReviewedLine, data: dict[str, Any]) -> None:
        up = Path(*[".."] * (name.count("/") + 1))
        names = list(self._names.values())
        here = names.index(name) if len(names) < 2 else self._place_of(name)
        around = {
            "up": up.as_posix(),
            "before": f"lines/{quote(names[here - 1])}.html" if here else None,
            "after": f"lines/{quote(names[here + 1])}.html" if here + 1 < len(names) else None,
        }
        assets = dict.fromkeys(take["asset"] for take in data["takes"] if take["asset"])
        scripts = [up / "assets" / "page.js"]
        scripts += [up / "assets" / "head.js"] if assets else []
        scripts += [up / "assets" / f"{digest}.js" for digest in assets]
        title = f"{line.key} · {line.character}"
        text = html.page(
            title, {"line": data, "around": around, "title": self._review.shown.title},
            scripts=scripts, style=up / "assets" / "page.css",
        )  # fmt: skip
        self._put(f"lines/{name}.html", text)

    def _place_of(self, name: str) -> int:
        if not hasattr(self, "_places"):
            self._places = {name: place for place, name in enumerate(self._names.values())}
        return self._places[name]

    def _put(self, name: str, content: str | bytes) -> None:
        data = content if isinstance(content, bytes) else content.encode("utf-8", "replace")
        write_bytes(self._output / name, data, durable=False)
        self._written[name] = len(data)

    def _earlier(self) -> list[str]:
        """Files that an earlier review left here."""
        try:
            known = json.loads((self._output / MANIFEST).read_bytes())
            ours = known["schema"] == _SCHEMA
            return [name for name in known["files"] if isinstance(name, str)] if ours else []
        except FileNotFoundError:
            return []
        except NotADirectoryError as error:
            raise unwritable(self._output, error) from error
        except (OSError, ValueError, KeyError, TypeError):
            return []

    def _tidy(self, earlier: list[str]) -> None:
        root = os.path.abspath(self._output)
        for name in earlier:
            path = os.path.abspath(os.path.join(root, name))
            if name not in self._written and path.startswith(root + os.sep):
                Path(path).unlink(missing_ok=True)
                folder = os.path.dirname(path)
                while folder != root and not os.listdir(folder):
                    os.rmdir(folder)
                    folder = os.path.dirname(folder)
        told = {"schema": _SCHEMA, "files": sorted(self._written)}
        self._put(MANIFEST, json.dumps(told, ensure_ascii=False, indent=1) + "\n")


def _names_of(lines: tuple[ReviewedLine, ...]) -> dict[tuple[str, str], str]:
    """(key, character) → a path for its page, safe on any system; none twice."""
    found: dict[tuple[str, str], str] = {}
    taken: set[str] = set()
    for line in lines:
        whole = f"{line.character}/{line.key}"
        parts = [_UNSAFE.sub("_", part).strip(" .") or "_" for part in whole.split("/")]
        name = "/".join(part[:80] for part in parts)
        if name != whole or name.casefold() in taken:
            mark = hashlib.sha256(whole.encode("utf-8", "surrogatepass")).hexdigest()[:8]
            name = f"{name}-{mark}"
        taken.add(name.casefold())
        found[line.key, line.character] = name
    return found
