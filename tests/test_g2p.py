"""English words that no dictionary has: how often they are right, and which are spelt out."""

from __future__ import annotations

import re
import subprocess
import sys
import zlib
from collections.abc import Callable, Sequence

import pytest

from animeme_stages.align.g2p import Guesser
from animeme_stages.align.g2p_words import EnglishWords, english_words, is_initialism
from animeme_stages.align.language import language
from animeme_stages.align.pronounce import guess
from animeme_stages.align.text import tokens

Phones = tuple[str, ...]
# Every 20th family of words is kept from training: no form of a word that is tested is learned.
SHARE = 20
TESTED = 800


def family(word: str) -> str:
    stem = word.replace("'s", "").rstrip("'")
    return stem.removesuffix("s")


def is_held_out(word: str) -> bool:
    return zlib.crc32(family(word).encode()) % SHARE == 0


def errors(reference: Phones, guessed: Phones) -> int:
    row = list(range(len(guessed) + 1))
    for index, phone in enumerate(reference, 1):
        previous, row[0] = row[0], index
        for place, other in enumerate(guessed, 1):
            change = previous + (phone != other)
            previous, row[place] = row[place], min(change, row[place] + 1, row[place - 1] + 1)
    return row[-1]


def rates(
    words: Sequence[str], pronounce: Callable[[str], Sequence[Phones]]
) -> tuple[float, float]:
    """Share of words with an error, and errors per phone, against the dictionary's first entry."""
    known = english_words().known
    wrong = [errors(known[word], (*pronounce(word), ())[0]) for word in words]
    return (
        sum(count > 0 for count in wrong) / len(words),
        sum(wrong) / sum(len(known[word]) for word in words),
    )


@pytest.mark.slow
def test_words_that_were_never_seen_are_mostly_right() -> None:
    known = english_words().known
    learned = {word: phones for word, phones in known.items() if not is_held_out(word)}
    tested = [w for w in known if is_held_out(w) and re.fullmatch(r"[a-z']{2,16}", w)]
    tested = sorted(tested, key=lambda word: zlib.crc32(word.encode() + b"!"))[:TESTED]
    words = EnglishWords(learned)
    word_errors, phone_errors = rates(tested, words.pronounce)
    assert word_errors < 0.36  # 0.31 with the dictionary of PocketSphinx 5.1
    assert phone_errors < 0.09
    pytest.importorskip("espeakng_loader")
    from animeme_stages.align.espeak import espeak
    from animeme_stages.align.language import acoustic_phones

    def by_espeak(word: str) -> list[Phones]:
        said = espeak().pronounce(word, "en-us")
        return [tuple(phone for ipa in said for phone in acoustic_phones(ipa))]

    assert rates(tested, by_espeak)[0] > word_errors + 0.1  # which is why it comes second


def test_training_twice_gives_the_same() -> None:
    known = list(english_words().known.items())[::10]
    first, second = Guesser.train(known), Guesser.train(known)
    for word in ("zorblax", "glimmerfen", "kubernetes", "o'malleyson"):
        assert first.guess(word) == second.guess(word)
        assert first.guess(word)


@pytest.mark.slow
def test_another_process_says_the_same() -> None:
    words = ["zorblax", "glimmerfen", "xenomorphs", "kubernetes"]
    code = (
        "from animeme_stages.align.g2p_words import english_words\n"
        f"print([english_words().pronounce(word) for word in {words!r}])"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == str([english_words().pronounce(word) for word in words])


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("voicemail", "V OY S M EY L"),
        ("zorblax", "Z AO R B L AE K S"),
        ("zorblax's", "Z AO R B L AE K S IH Z"),
        ("playlists", "P L EY L IH S T S"),
        ("dragon's", "D R AE G AH N Z"),
        ("wizards'", "W IH Z ER D Z"),
        ("chloë's", "K L OW IY Z"),
        ("vw", "V IY D AH B AH L Y UW"),
        ("npc", "EH N P IY S IY"),
        ("npcs", "EH N P IY S IY Z"),
        ("npc's", "EH N P IY S IY Z"),
        ("https", "EY CH T IY T IY P IY Z"),
    ],
)
def test_words_and_what_they_are_made_of(word: str, said: str) -> None:
    assert " ".join(english_words().pronounce(word)[0]) == said


def test_noises_are_not_spelt_out() -> None:
    for noise in ("hmm", "grrr", "brr", "psst", "shh", "tsk", "pfft", "zzz", "mmm"):
        assert not is_initialism(noise), noise
        assert english_words().pronounce(noise), noise
    for name in ("vw", "npc", "html", "gps", "xml"):
        assert is_initialism(name), name


@pytest.mark.parametrize("word", ["привет", "'", "日本", "a" * 100_000, "1"])
def test_what_english_letters_cannot_spell_is_not_guessed(word: str) -> None:
    assert english_words().pronounce(word) == ()


def test_a_hyphen_parts_words_and_every_guess_is_in_the_inventory() -> None:
    english = language("en")
    found = tokens("The glimmerfen-dweller's NPCs", english)
    assert [token.text for token in found] == ["the", "glimmerfen", "dweller's", "npcs"]
    for token in found[1:]:
        for phones in guess(token, english):
            assert all(symbol == acoustic for symbol, (acoustic,) in phones)
