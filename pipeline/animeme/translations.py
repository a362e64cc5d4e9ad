"""Texts that translators keep apart from the lines, joined by id."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from animeme import registry
from animeme.dialogue import Line, composed
from animeme.errors import InputError
from animeme.files import unreadable
from animeme.findings import Finding, Severity
from animeme.languages import language_of_file, language_tag, nearest


@dataclass(frozen=True)
class Text:
    """A text in one language.

    Attributes:
        place: where it is written.
        language: as the file has it, "" if it says nothing.
        ids: what it is called, the surest first.
        text: what is said.
        unfinished: somebody marked it as not yet right.
    """

    place: str
    language: str
    ids: tuple[str, ...]
    text: str
    unfinished: bool = False


@dataclass(frozen=True)
class Translations:
    """Texts by language and id.

    Attributes:
        texts: of all files, in their order.
    """

    texts: tuple[Text, ...] = ()

    @cached_property
    def languages(self) -> tuple[str, ...]:
        """Tags, sorted."""
        return tuple(sorted({text.language for text in self.texts}))

    def has(self, language: str, id: str) -> bool:
        """Whether there is a text for a line."""
        return self._find(language, id) is not None

    def joined(self, lines: Sequence[Line]) -> tuple[tuple[Line, ...], tuple[Finding, ...]]:
        """Give lines without text theirs.

        Returns:
            The lines, and a remark for each language whose texts belong to none of them.
        """
        if not self.texts:
            return tuple(lines), ()
        used: set[Text] = set()
        made = []
        for line in lines:
            text = self._find(line.language, line.id)
            if text is not None:
                used.add(text)
                if not line.text:
                    line = _with_text(line, text)
            made.append(line)
        idle: dict[str, list[Text]] = defaultdict(list)
        for text in self.texts:
            if text not in used:
                idle[text.language].append(text)
        return tuple(made), tuple(_idle(tag, texts) for tag, texts in sorted(idle.items()))

    def tag_for(self, language: str) -> str | None:
        """The language whose texts are those of `language`, None if there is none."""
        return nearest(language, self.languages)

    def _find(self, language: str, id: str) -> Text | None:
        tag = self.tag_for(language)
        name = composed(id).casefold()
        for key in (name, name.rpartition("/")[2]):
            found = self._by_id.get((tag or language, key))
            if found:
                return found
        return None

    @cached_property
    def _by_id(self) -> Mapping[tuple[str, str], Text]:
        found: dict[tuple[str, str], Text] = {}
        for rank in range(max((len(text.ids) for text in self.texts), default=0)):
            for text in self.texts:
                if rank < len(text.ids):
                    found.setdefault((text.language, text.ids[rank].casefold()), text)
        return found


def read_translations(paths: Iterable[Path], language: str = "") -> Translations:
    """The texts in files of translators.

    Args:
        paths: ``.po`` and XLIFF files.
        language: of files that neither say theirs nor have it in their names.

    Raises:
        InputError: a file cannot be read, or nobody knows its language.
    """
    texts: list[Text] = []
    for path in paths:
        if not path.is_file():
            raise InputError(
                "manifest-missing",
                "there is no such file of texts",
                place=str(path),
                action="Check the name; paths in a job start at the job file.",
            )
        try:
            found: Sequence[Text] = registry.stage("read-texts")(path)
        except OSError as error:
            raise unreadable(path, "manifest-unreadable", error) from error
        fallback = language_of_file(path) or language
        for text in found:
            if not text.language and not fallback:
                raise InputError(
                    "language-missing",
                    "does not say its language",
                    place=str(path),
                    action="Name it <language>.po, or add `language` to the job's [dialogue].",
                )
            tag = language_tag(text.language or fallback, place=text.place)
            texts.append(replace(text, language=tag))
    return Translations(tuple(texts))


def _with_text(line: Line, text: Text) -> Line:
    findings = line.findings
    if text.unfinished:
        found = Finding(
            Severity.WARNING,
            "text-unfinished",
            "its text is marked as unfinished",
            place=text.place,
            action="Have it reviewed, or take the mark off.",
        )
        findings = (*findings, found)
    return replace(line, text=text.text, origin=text.place, findings=findings)


def _idle(tag: str, texts: Sequence[Text]) -> Finding:
    names = ", ".join(text.ids[0] for text in texts[:3]) + (" …" if len(texts) > 3 else "")
    return Finding(
        Severity.INFO,
        "text-without-line",
        f"{len(texts)} texts in {tag} belong to no line: {names}",
        place=texts[0].place,
        action="Their ids are those of the lines, or end in them.",
    )
