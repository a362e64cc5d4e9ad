"""When an edit by hand happens: seconds, or a word or phone of the line as it is timed now."""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass

from animeme.documents.edits import AnyEdit, Moment, ReplaceEdit, WordMoment
from animeme.phones import SILENCE, Phone, PhoneTrack, Word

# Words and phones come from one alignment; rounding may part their ends by less than this.
_SAME_TIME_S = 1e-3


class StaleError(Exception):
    """An edit no longer means anything; code, message and action of the finding that says so."""

    def __init__(self, code: str, message: str, action: str) -> None:
        super().__init__(code, message, action)
        self.code, self.message, self.action = code, message, action


@dataclass(frozen=True)
class Range:
    """From when to when, on the track's time axis.

    Attributes:
        start_s, end_s: seconds; end after start.
        open_start, open_end: there is nothing before, or behind: the edit does not come or go.
        remarks: code and message of what a person should know.
    """

    start_s: float
    end_s: float
    open_start: bool
    open_end: bool
    remarks: tuple[tuple[str, str], ...] = ()


def resolve(edit: AnyEdit, track: PhoneTrack, lead_s: float) -> Range:
    """When `edit` happens.

    Args:
        edit: what the document says.
        track: the line, with `lead_s` before its recording.
        lead_s: where the recording starts on the track's time axis.

    Raises:
        StaleError: its word or phone is gone, or it lies outside the line.
    """
    remarks: list[tuple[str, str]] = []
    end_of_line_s = track.duration_s
    start_s = 0.0 if edit.from_ is None else _time(edit.from_, track, lead_s, remarks)
    if edit.to is not None:
        end_s = _time(edit.to, track, lead_s, remarks)
    else:
        end_s = end_of_line_s
        if isinstance(edit, ReplaceEdit):
            end_s = start_s + edit.keys[-1][0]
    if start_s >= end_of_line_s or end_s <= 0:
        when_s = start_s if end_s > 0 else end_s
        raise StaleError(
            "edit-outside-line",
            f"happens at {when_s - lead_s:.2f} s, the line lasts from 0 to "
            f"{end_of_line_s - lead_s:.2f} s",
            "Move it, or delete it.",
        )
    if end_s <= start_s:
        raise StaleError(
            "edit-range-empty",
            f"ends at {end_s - lead_s:.2f} s, before it starts at {start_s - lead_s:.2f} s",
            "Its words have changed places, or come too close; set its ends anew.",
        )
    if end_s > end_of_line_s + _SAME_TIME_S:
        message = (
            f"goes on to {end_s - lead_s:.2f} s, the line ends at {end_of_line_s - lead_s:.2f} s"
        )
        remarks.append(("edit-outside-line", message))
    if isinstance(edit, ReplaceEdit) and start_s + edit.keys[-1][0] > end_s + _SAME_TIME_S:
        message = (
            f"its keys go on for {edit.keys[-1][0]:.2f} s, its time for {end_s - start_s:.2f} s"
        )
        remarks.append(("edit-keys-cut", message))
    return Range(
        max(start_s, 0.0),
        min(end_s, end_of_line_s),
        edit.from_ is None,
        end_s > end_of_line_s or (edit.to is None and not isinstance(edit, ReplaceEdit)),
        tuple(remarks),
    )


def _time(
    moment: Moment, track: PhoneTrack, lead_s: float, remarks: list[tuple[str, str]]
) -> float:
    if not isinstance(moment, WordMoment):
        return moment + lead_s
    word = None
    if moment.word is not None or moment.text is not None:
        word = _word(moment, track.words, remarks)
    found: Word | Phone | None = word
    if moment.phone is not None or moment.symbol is not None:
        found = _phone(moment, track, word)
    assert found is not None
    return (found.start_s if moment.edge == "start" else found.end_s) + moment.plus_s


def _word(moment: WordMoment, words: Sequence[Word], remarks: list[tuple[str, str]]) -> Word:
    if moment.text is None:
        assert moment.word is not None
        if moment.word > len(words):
            raise _gone(f"there is no word {moment.word}; the line has {len(words)}")
        return words[moment.word - 1]
    same = [i for i, word in enumerate(words) if _plain(word.text) == _plain(moment.text)]
    if not same:
        raise _gone(f"the word '{moment.text}' is gone")
    if moment.word is None:
        if len(same) > 1:
            raise StaleError(
                "edit-word-unclear",
                f"'{moment.text}' is said {len(same)} times",
                f"Say which: word = {', or word = '.join(str(i + 1) for i in same)}.",
            )
        return words[same[0]]
    at = min(same, key=lambda i: abs(i - (moment.word or 0) + 1))
    if at != moment.word - 1:
        message = f"word {moment.word}, '{moment.text}', is now word {at + 1}"
        remarks.append(("edit-word-moved", message))
    return words[at]


def _phone(moment: WordMoment, track: PhoneTrack, word: Word | None) -> Phone:
    where = f"the word '{word.text}'" if word else "the line"
    phones = [
        (phone, ipa)
        for phone, ipa in zip(track.phones, track.ipa(), strict=True)
        if phone.symbol != SILENCE
        and (
            word is None
            or (
                word.start_s - _SAME_TIME_S <= phone.start_s
                and phone.end_s <= word.end_s + _SAME_TIME_S
            )
        )
    ]
    if moment.phone is not None:
        if moment.phone > len(phones):
            raise _gone(f"there is no phone {moment.phone} in {where}; it has {len(phones)}")
        phone, ipa = phones[moment.phone - 1]
        if moment.symbol is not None and moment.symbol not in (phone.symbol, ipa):
            raise _gone(f"phone {moment.phone} of {where} is {phone.symbol}, not {moment.symbol}")
        return phone
    same = [phone for phone, ipa in phones if moment.symbol in (phone.symbol, ipa)]
    if not same:
        raise _gone(f"the phone {moment.symbol} is not in {where}")
    if len(same) > 1:
        raise StaleError(
            "edit-word-unclear",
            f"the phone {moment.symbol} is {len(same)} times in {where}",
            "Say which: phone = 1 is the first phone, whatever it is.",
        )
    return same[0]


def _gone(message: str) -> StaleError:
    return StaleError("edit-word-gone", message, "Move it to another word, or delete it.")


def _plain(text: str) -> str:
    return unicodedata.normalize("NFC", text).casefold()
