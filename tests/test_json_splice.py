"""Editing JSON text: what was asked for is there, every other byte stays."""

from __future__ import annotations

import json
import random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from animeme_stages.write.json_splice import Splice, dumps

KEYS = ("buffers", "accessors", "a", "", "é\n", '"', "}")
NUMBERS = ("0", "-0", "-0.0", "1.0", "1e-7", "1E+5", "12345678901234567890", "0.10")

# A document is drawn as nested lists of what to render: ("object", pairs), ("array", items), or the
# text of a scalar. So numbers and escapes get forms that json.dumps would never choose.
SCALARS = st.one_of(
    st.sampled_from(("true", "false", "null", *NUMBERS)),
    st.sampled_from((r'"\u00e9"', '"é"', r'"\/"', r'"\ud83d\ude00"', '"]}"', r'"\""', '""')),
)


def arrays(inner: Any) -> Any:
    return st.tuples(st.just("array"), st.lists(inner, max_size=3))


VALUES = st.recursive(
    SCALARS,
    lambda inner: (
        arrays(inner)
        | st.tuples(
            st.just("object"), st.lists(st.tuples(st.sampled_from(KEYS), inner), max_size=3)
        )
    ),
    max_leaves=8,
)
DOCUMENTS = st.lists(st.tuples(st.sampled_from(KEYS), arrays(VALUES)), max_size=4)
NEW_VALUES = st.one_of(
    st.integers(-5, 5),
    st.sampled_from((0.1, 1e-9, "x", 'é"\\', None, True)),
    st.dictionaries(st.sampled_from(KEYS), st.integers(0, 3), max_size=2),
)


def rendered(value: Any, source: random.Random) -> str:
    def space() -> str:
        return source.choice(("", "", " ", "\n", "\t \r\n"))

    if isinstance(value, str):
        return value
    kind, inner = value
    if kind == "array":
        parts = [space() + rendered(item, source) + space() for item in inner]
        return "[" + (",".join(parts) or space()) + "]"
    parts = [
        space() + json.dumps(key) + space() + ":" + space() + rendered(item, source) + space()
        for key, item in inner
    ]
    return "{" + (",".join(parts) or space()) + "}"


def text_of(document: Any, seed: int) -> str:
    return rendered(("object", document), random.Random(seed))


def common(first: str, second: str) -> int:
    """Length of the beginning that two texts share."""
    differing = (i for i, (a, b) in enumerate(zip(first, second, strict=False)) if a != b)
    return next(differing, min(len(first), len(second)))


def require_only_inserted(old: str, new: str) -> None:
    head = common(old, new)
    tail = common(old[::-1], new[::-1])
    assert head + tail >= len(old), f"{old!r} → {new!r}"


APPENDS = st.lists(
    st.tuples(st.sampled_from((*KEYS, "new")), st.lists(NEW_VALUES, max_size=3)),
    unique_by=lambda pair: pair[0],
    max_size=4,
)


@given(DOCUMENTS, st.integers(0, 999), APPENDS)
@settings(deadline=None, derandomize=True, max_examples=150)
def test_appending_adds_elements_and_touches_no_other_byte(
    document: Any, seed: int, appends: list[tuple[str, list[Any]]]
) -> None:
    text = text_of(document, seed)
    expected = json.loads(text)
    together, one_by_one = Splice(text), text
    for key, values in appends:
        together.append(key, values)
        alone = Splice(one_by_one)
        alone.append(key, values)
        require_only_inserted(one_by_one, alone.apply())
        one_by_one = alone.apply()
        if values:
            expected[key] = [*expected.get(key, []), *values]
    assert together.apply() == one_by_one
    assert json.loads(one_by_one) == expected


@given(DOCUMENTS, st.integers(0, 999), st.sampled_from((*KEYS, "new")), NEW_VALUES)
@settings(deadline=None, derandomize=True, max_examples=100)
def test_setting_a_member_replaces_its_value_and_nothing_else(
    document: Any, seed: int, key: str, value: Any
) -> None:
    text = text_of(document, seed)
    splice = Splice(text)
    span = splice.members().get(key)
    splice.set(0, key, value)
    result = splice.apply()
    assert json.loads(result) == json.loads(text) | {key: value}
    if span is None:
        require_only_inserted(text, result)
    else:
        assert result == text[: span[0]] + dumps(value) + text[span[1] :]


@given(DOCUMENTS, st.integers(0, 999))
@settings(deadline=None, derandomize=True, max_examples=100)
def test_spans_are_those_of_the_values(document: Any, seed: int) -> None:
    text = text_of(document, seed)
    splice = Splice(text)
    parsed = json.loads(text)
    members = splice.members()
    assert set(members) == set(parsed)
    for key, (start, end) in members.items():
        assert json.loads(text[start:end]) == parsed[key]
        spans = splice.elements(start)
        assert [json.loads(text[a:b]) for a, b in spans] == parsed[key]


@given(DOCUMENTS, st.integers(0, 999), st.data())
@settings(deadline=None, derandomize=True, max_examples=100)
def test_members_of_an_inner_object_can_be_set_while_arrays_grow(
    document: Any, seed: int, data: st.DataObject
) -> None:
    inner = data.draw(st.lists(st.tuples(st.sampled_from(KEYS), SCALARS), max_size=3))
    text = text_of([("buffers", ("array", [("object", inner), "{}"])), *document], seed)
    parsed = json.loads(text)
    splice = Splice(text)
    start = splice.members()["buffers"][0]
    elements = splice.elements(start)
    if not elements or not isinstance(parsed["buffers"][0], dict):
        return  # a twin of the key came later
    splice.set(elements[0][0], "byteLength", 12)
    splice.append("buffers", [{"byteLength": 3}])
    parsed["buffers"][0]["byteLength"] = 12
    parsed["buffers"].append({"byteLength": 3})
    assert json.loads(splice.apply()) == parsed


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("{}", {"x": [1, 2]}),
        ('{"x":[]}', {"x": [1, 2]}),
        ('{ "x" : [ 0 ] }', {"x": [0, 1, 2]}),
        ('{"y":0}', {"y": 0, "x": [1, 2]}),
    ],
)
def test_appending_twice_to_one_array_gives_both(text: str, expected: Any) -> None:
    splice = Splice(text)
    splice.append("x", [1])
    splice.append("x", [2])
    assert json.loads(splice.apply()) == expected
    assert splice.apply().count('"x"') == 1


def test_of_twin_keys_the_last_counts_as_readers_have_it() -> None:
    splice = Splice('{"a":[1],"a":[2]}')
    splice.append("a", [3])
    assert splice.apply() == '{"a":[1],"a":[2,3]}'


def test_appending_nothing_changes_nothing() -> None:
    splice = Splice("{ }")
    splice.append("a", [])
    assert splice.apply() == "{ }"
