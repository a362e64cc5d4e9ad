"""Files that a list names, found as people on other systems have spelt them."""

from __future__ import annotations

import os
from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path

from animeme.dialogue import AUDIO_SUFFIXES, FILM_SUFFIXES, composed
from animeme.languages import find_tag, is_common, nearest


@dataclass
class Recordings:
    """Looks files up, each folder once.

    Names may differ in capitals, in Unicode composition, and in a recording's suffix: a list is
    often older than the format that its recordings are delivered in.
    """

    _folders: dict[Path, dict[str, tuple[str, ...]]] = field(default_factory=dict)
    _stems: dict[Path, dict[str, list[str]]] = field(default_factory=dict)
    _tags: dict[Path, dict[str, tuple[str, ...]]] = field(default_factory=dict)

    def find(self, base: Path, parts: tuple[str, ...]) -> Path | None:
        """The recording at a path below `base`, None if there is none, or more than one."""
        folder = base
        for part in parts[:-1]:
            found = self._entry(folder, part)
            if found is None:
                return None
            folder = found
        path = self._entry(folder, parts[-1]) if parts else None
        if path is not None and path.suffix.lower() in AUDIO_SUFFIXES and path.is_file():
            return path
        return self._of_stem(folder, parts[-1]) if parts else None

    def beside(self, recording: Path) -> list[Path]:
        """The files whose names are `recording`'s but for the suffix, itself among them."""
        folder = recording.parent
        if folder not in self._stems:
            stems: dict[str, list[str]] = defaultdict(list)
            for name in sorted(name for names in self._listing(folder).values() for name in names):
                stems[composed(Path(name).stem)].append(name)
            self._stems[folder] = stems
        names = self._stems[folder].get(composed(recording.stem), [])
        return [path for name in names if (path := folder / name).is_file()]

    def language_folders(self, base: Path, tag: str) -> tuple[str, ...]:
        """Names of the folders in `base` that stand for a language."""
        if base not in self._tags:
            tags: dict[str, tuple[str, ...]] = {}
            for name in sorted(n for names in self._listing(base).values() for n in names):
                if is_common(name) and (base / name).is_dir():
                    found = find_tag(name) or ""
                    tags[found] = (*tags.get(found, ()), name)
            self._tags[base] = tags
        return self._tags[base].get(nearest(tag, self._tags[base]) or tag, ())

    def _listing(self, folder: Path) -> dict[str, tuple[str, ...]]:
        """Names in a folder by their folded form."""
        if folder not in self._folders:
            listing: dict[str, tuple[str, ...]] = {}
            try:
                names = sorted(os.listdir(folder))
            except (OSError, ValueError):  # no such folder, or no name that one could have
                names = []
            for name in names:
                listing[_folded(name)] = (*listing.get(_folded(name), ()), name)
            self._folders[folder] = listing
        return self._folders[folder]

    def _entry(self, folder: Path, name: str) -> Path | None:
        if name == "..":
            return folder / name
        names = self._listing(folder).get(_folded(name), ())
        exact = [found for found in names if found == name]
        if exact or len(names) == 1:
            return folder / (exact or names)[0]
        return None

    def _of_stem(self, folder: Path, name: str) -> Path | None:
        stem, dot, suffix = name.rpartition(".")
        stems = [name] + ([stem] if dot and len(suffix) <= 4 else [])
        for candidate in stems:
            found = [
                path
                for suffix in AUDIO_SUFFIXES
                if (path := self._entry(folder, candidate + suffix)) is not None and path.is_file()
            ]
            sounds = [path for path in found if path.suffix.lower() not in FILM_SUFFIXES] or found
            if len(sounds) == 1:
                return sounds[0]
        return None


def _folded(name: str) -> str:
    return composed(name).casefold()
