"""What a review shows of delivered files, ours or anybody's."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path

from animeme.check_profiles import read_profile
from animeme.deliveries import read_deliveries
from animeme.delivery import Performance
from animeme.dialogue import transcript_of
from animeme.errors import InputError
from animeme.findings import Finding, status_of
from animeme.reviewing import (
    DEFAULT_FRAME_HZ,
    Detail,
    Performed,
    ReviewedLine,
    moving,
    scores_of,
)
from animeme.validation import delivery_checks, judge


class DeliveryReview:
    """Delivered files, ours or anybody's.

    Args:
        path: a file, or a folder of them.
        dialogue: folder of the recordings, None if there are none to be heard.
        language, aligner, lexicon, rig, profile: as for `animeme.validation.validate`.
    """

    frame_hz = DEFAULT_FRAME_HZ

    def __init__(
        self,
        path: Path,
        *,
        dialogue: Path | None,
        language: str | None,
        aligner: str,
        lexicon: Path | None,
        rig: str,
        profile: str,
    ) -> None:
        self.title = path.stem if path.is_file() else path.resolve().name
        chosen = read_profile(profile, delivery_checks())
        subjects, unread = read_deliveries(
            [path], against=None, dialogue=dialogue, names=chosen.lines, rig=rig,
            language=language, aligner=aligner, lexicon=lexicon,
        )  # fmt: skip
        judged = judge(subjects, unread, chosen)
        self._root = path if path.is_dir() else path.parent
        self._takes: dict[tuple[str, str], list[Performance]] = {}
        for delivery in subjects.files:
            for performance in delivery.performances:
                name = (performance.line, delivery.path.stem)
                self._takes.setdefault(name, []).append(performance)
        found: dict[tuple[str, str], list[Finding]] = {}
        general: list[Finding] = []
        for finding in judged.all_findings:
            name = (finding.line, Path(finding.file).stem)
            if name in self._takes:
                found.setdefault(name, []).append(finding)
            else:
                general.append(finding)
        self.findings: tuple[Finding, ...] = tuple(general)
        self.lines = tuple(
            self._line(*name, takes, found.get(name, []))
            for name, takes in sorted(self._takes.items(), key=lambda entry: entry[0][::-1])
        )
        if not self.lines:
            broken = next((file.error for file in subjects.files if file.error), None)
            raise broken or InputError(
                "review-empty",
                "holds no animation of a face, so there is nothing to be shown",
                place=str(path),
                action="Name a run's output folder, or a file with animated blendshapes.",
            )

    def _line(
        self, key: str, character: str, takes: Sequence[Performance], findings: Sequence[Finding]
    ) -> ReviewedLine:
        track, length_s, words = None, max(take.shapes.duration_s for take in takes), ""
        if takes[0].take is not None:
            with suppress(InputError):
                length_s = takes[0].take.speech.duration_s
                track = takes[0].take.track
                words = " ".join(word.text for word in track.words)
        scores = [] if track is None else scores_of((p.symbol, p.score) for p in track.phones)
        status = status_of(finding for finding in findings if not finding.ours)
        return ReviewedLine(
            key, character, takes[0].language, status, length_s, tuple(findings),
            min(scores, default=None), words,
        )  # fmt: skip

    def details(self, lines: Sequence[ReviewedLine]) -> Iterator[Detail]:
        """See `animeme.reviewing.Reviewable`."""
        yield from map(self._detail, lines)

    def _detail(self, line: ReviewedLine) -> Detail:
        takes = self._takes[line.key, line.character]
        performed = tuple(
            Performed(
                take.path.relative_to(self._root).as_posix(),
                take.path,
                take.name,
                take.path,
                moving(take.shapes, take.rest),
                take.audio_start_s,
            )
            for take in takes
        )
        take = takes[0].take
        if take is None:
            why = "No recording is known for it: name their folder with --dialogue."
            return Detail("", None, None, performed, (why,))
        remarks, text, track = [], "", None
        with suppress(InputError):
            text = transcript_of(take.line)
        try:
            track = take.track
        except InputError as error:
            remarks.append(f"Its words cannot be shown: {error.problem}.")
        audio = take.line.audio if take.line.audio.is_file() else None
        return Detail(text or line.words, audio, track, performed, tuple(remarks))
