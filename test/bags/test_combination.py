"""Sums, differences and factors of columns: whatever the names hold, the value is the arithmetic one."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sgms_observer.bags.combination import Combination
from sgms_observer.errors import RecordingError

LOG = Path("log.csv")
NAMES = st.text("ab1.-*/+[ ]°µ(:,)", min_size=1, max_size=6).filter(lambda name: name == name.strip())
NUMBERS = st.floats(-1e6, 1e6).filter(lambda number: abs(number) > 1e-6)


def value(text: str, columns: dict[str, list[float]]) -> list[float]:
    """Return the combination's numbers."""
    combination = Combination(LOG, text, {name: name for name in columns}, tuple(columns))
    return combination.value({name: np.array(numbers) for name, numbers in columns.items()}).tolist()


@given(st.data())
def test_a_quoted_combination_is_the_arithmetic_one(data: st.DataObject) -> None:
    names = data.draw(st.lists(NAMES, min_size=1, max_size=5, unique=True))
    columns = {name: data.draw(st.lists(NUMBERS, min_size=3, max_size=3)) for name in names}
    text, expected = "", np.zeros(3)
    for k in range(data.draw(st.integers(1, 4))):
        name, is_minus = data.draw(st.sampled_from(names)), data.draw(st.booleans())
        space = data.draw(st.sampled_from(["", " "]))
        text += f'{space}{"-" if is_minus else "+" if k else ""}{space}"{name}"'
        term = np.array(columns[name])
        for factor in data.draw(st.lists(NUMBERS, max_size=3)):
            divides = data.draw(st.booleans())
            text += f"{'/' if divides else '*'}{factor!r}"
            term = term / factor if divides else term * factor
        expected = expected - term if is_minus else expected + term
    np.testing.assert_allclose(value(text, columns), expected, rtol=1e-12, atol=1e-12)


@given(st.lists(NAMES, min_size=1, max_size=6, unique=True), st.data())
def test_every_name_stands_for_itself(names: list[str], data: st.DataObject) -> None:
    """A name alone is that column, also where it looks like a combination of the others."""
    name = data.draw(st.sampled_from(names))
    columns = {other: [float(k), 2.0] for k, other in enumerate(names)}
    assert value(name, columns) == columns[name]


@given(st.text('ab1.-*/+[ ]"e°', max_size=12))
def test_any_text_gives_numbers_or_one_sentence(text: str) -> None:
    try:
        assert len(value(text, {"a": [1.0, 2.0], "b": [3.0, 4.0], "a-b": [5.0, 6.0]})) == 2
    except RecordingError as error:
        assert "\n" not in str(error)


def test_precedence_of_names_and_factors() -> None:
    columns = {"a": [1.0, 2.0], "b": [3.0, 4.0], "a-b": [5.0, 6.0], "k": [10.0], "v": [7.0, 8.0, 9.0]}
    assert value("a-b", columns) == [5.0, 6.0]
    assert value('"a"-"b"', columns) == value("a - b", columns) == [-2.0, -2.0]
    assert value("-a*k+b/2", columns) == [-8.5, -18.0]
    assert value("a*-2", columns) == [-2.0, -4.0]
    assert value("a*-k", columns) == [-10.0, -20.0]
    assert value("a*v[3]*1e-3", columns) == pytest.approx([0.009, 0.018])
    assert value("a*pi/180", columns) == pytest.approx([math.pi / 180.0, math.pi / 90.0])


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("a-", "ends where a column must follow"),
        ("a+c", "no column c; it has a, b"),
        ("a+2", "no column 2; it has a, b, v; a number cannot be added"),
        ("a*c", "no factor c"),
        ("a*b", "the factor b has 2 entries; only a single number can be one, such as b"),
        ("a*v[4]", "beyond the 3 entries of v"),
        ("a+v", "v has 3 entries, the columns before it in a[+]v have 2"),
        ("(a)", "no column"),
        ("", "ends where a column must follow"),
    ],
)
def test_one_sentence_for_each_fault(text: str, sentence: str) -> None:
    with pytest.raises(RecordingError, match=sentence):
        value(text, {"a": [1.0, 2.0], "b": [3.0, 4.0], "v": [7.0, 8.0, 9.0]})
