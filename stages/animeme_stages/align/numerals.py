"""Numbers and what is written with them, in words."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from functools import cache

from num2words import num2words

from animeme_stages.align.language import Language, Numerals

# Longer runs of digits are serial numbers, read one by one; num2words has no names for them.
_LONGEST_NUMBER = 12


def spoken(match: re.Match[str], language: Language) -> Iterator[str]:
    """What one match of the text's pattern is read as.

    Args:
        match: has one of the groups word, sign, abbreviation, year, hour, number.
        language: of the words.
    """
    found = {name: text for name, text in match.groupdict().items() if text is not None}
    if "word" in found:
        yield found["word"]
    elif "sign" in found:
        yield language.signs[found["sign"]]
    elif "abbreviation" in found:
        yield language.abbreviation(found["abbreviation"])
    elif "year" in found:
        yield _date(found, language)
    elif "hour" in found:
        yield _time(int(found["hour"]), int(found["minute"]), language)
    else:
        yield from _quantity(found, language)


def _date(found: dict[str, str], language: Language) -> str:
    """An ISO date."""
    year, day = int(found["year"]), int(found["day"])
    table = language.date
    return str(table["words"]).format(
        year=_named(year, language, str(table.get("year", "cardinal"))),
        month=table["months"][int(found["month"]) - 1],
        day=_named(day, language, str(table.get("day", "cardinal"))),
    )


def _time(hour: int, minute: int, language: Language) -> str:
    """A time of day on the 24-hour clock."""
    table = language.time
    hours = str(table.get("hours", "")).split()
    form = "words" if minute else "full"
    if 0 < minute < 10 and "early" in table:
        form = "early"
    singular = hour == 1 and f"{form}_one" in table
    return str(table[f"{form}_one" if singular else form]).format(
        h=hours[(hour - 1) % 12].replace("_", " ") if hours else _named(hour, language),
        m=_named(minute, language),
    )


def _quantity(found: dict[str, str], language: Language) -> Iterator[str]:
    """A number with its sign, ending, currency or unit."""
    digits = re.sub(r"\s", "", found["number"])
    if "minus" in found:
        yield language.minus
    if "ordinal" in found and is_plain(digits):
        yield _named(int(digits), language, "ordinal") + language.ordinal.get("ending", "")
        return
    currency = found.get("currency") or found.get("currency_after")
    forms = language.currencies[currency] if currency else language.units.get(found.get("unit", ""))
    if forms is None or "magnitude" in found:
        if "percent" in found:
            yield language.percent
        yield from number_words(digits, language)
        yield found.get("magnitude", "")
        yield forms[-1] if forms else ""
        return
    whole, point, cents = digits.rpartition(language.decimal)
    if currency and language.cents and point and len(cents) == 2 and language.decimal not in whole:
        yield from _counted(whole, forms, language)
        if cents != "00":
            yield from number_words(cents.lstrip("0"), language)
    else:
        yield from _counted(digits, forms, language)


def _counted(digits: str, forms: Sequence[str], language: Language) -> Iterator[str]:
    """A number and the noun it counts, in the form that it asks for."""
    if digits == "1" and language.one:
        yield language.one
    else:
        yield from number_words(digits, language)
    plain = digits.replace(language.thousands, "")
    if plain.isdigit() and len(plain) <= _LONGEST_NUMBER:
        index = _PLURALS[language.plural](int(plain))
    else:
        index = 1  # fractions
    yield forms[min(index, len(forms) - 1)]


def _east_slavic(n: int) -> int:
    if n % 10 == 1 and n % 100 != 11:
        return 0
    return 1 if n % 10 in (2, 3, 4) and n % 100 not in (12, 13, 14) else 2


def _polish(n: int) -> int:
    if n == 1:
        return 0
    return 1 if n % 10 in (2, 3, 4) and n % 100 not in (12, 13, 14) else 2


def _czech(n: int) -> int:
    return 0 if n == 1 else 1 if n in (2, 3, 4) else 2


def _arabic(n: int) -> int:
    return 1 if 3 <= n % 100 <= 10 else 0


# Which of a noun's forms goes with a number; after the plural rules of Unicode's CLDR.
_PLURALS: dict[str, Callable[[int], int]] = {
    "one": lambda n: int(n != 1),
    "zero-one": lambda n: int(n > 1),
    "east-slavic": _east_slavic,
    "polish": _polish,
    "czech": _czech,
    "arabic": _arabic,
}


def number_words(digits: str, language: Language) -> Iterator[str]:
    """Words for a number as written, with the language's separators."""
    thousands = language.thousands
    whole, *rest = digits.split(language.decimal)
    if len(rest) > 1:  # no number: a version, a date, an address
        for part in digits.split(language.decimal):
            yield from number_words(part, language)
        return
    if re.fullmatch(language.grouping, whole):
        whole = whole.replace(thousands, "")
    for part in re.split(r"[.,]", whole):
        yield from _whole_words(part, language)
    if rest:
        yield language.decimal_word
        for part in rest[0].split(thousands):
            yield from (_named(int(digit), language) for digit in part)


def _whole_words(digits: str, language: Language) -> Iterator[str]:
    if is_plain(digits):
        yield _named(int(digits), language)
    else:
        yield from (_named(int(digit), language) for digit in digits)


def is_plain(digits: str) -> bool:
    """Whether digits are read as one number; a leading zero is part of what is said."""
    return digits.isdigit() and len(digits) <= _LONGEST_NUMBER and str(int(digits)) == digits


@cache
def _named(number: int, language: Language, form: str = "cardinal") -> str:
    """The name of a number: `form` is cardinal, ordinal, year or digits."""
    if form == "digits":
        return " ".join(_named(int(digit), language) for digit in str(number))
    if form == "ordinal" and str(number) in language.ordinals:
        return language.ordinals[str(number)]
    if language.numerals:
        return compose(number, language.numerals)
    words = str(num2words(number, lang=language.numbers, to=form))
    for wrong, right in language.respell.items():
        words = words.replace(wrong, right)
    return words


def compose(number: int, numerals: Numerals) -> str:
    """The name of a number from a table of names, for languages that num2words lacks.

    Args:
        number: not negative.
        numerals: names of the small numbers and of the powers that count them.
    """
    special = numerals.special.get(str(number))
    if special is not None:
        return special
    if number < len(numerals.small):
        return numerals.small[number]
    scale = next(scale for scale in numerals.scales if scale.value <= number)
    count, rest = divmod(number, scale.value)
    head = numerals.special.get(str(count * scale.value))
    if head is None:
        head = numerals.joint.join((compose(count, numerals), scale.name))
    if not rest:
        return head
    gap = [numerals.gap] if numerals.gap and rest * 10 < scale.value else []
    return numerals.joint.join(
        [numerals.before_rest.get(head, head), *gap, compose(rest, numerals)]
    )
