"""The translator refuses what it does not know with one sentence, and takes effects of the user's own."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from c_build import assert_equal, exported, needs

from sgms_observer.effects import catalogue
from sgms_observer.effects.effect import Effect, EffectParameter, Place
from sgms_observer.errors import ConfigurationError
from sgms_observer.export.program import source_of
from sgms_observer.export.translator import Translator
from sgms_observer.export.values import REAL, Array, Value
from sgms_observer.settings.axis import AxisSettings, CompensationSettings, EffectSettings, EstimatorSettings

AXIS = AxisSettings(estimator=EstimatorSettings(kind="ekf"), compensation=CompensationSettings(enabled=True))
SOFT = 1.0e-3
STRENGTH = (EffectParameter("force", "N", 0.0, -10.0, 10.0, "its size", is_strength=True),)


def one_sided(q: float, v: float, p: Any) -> float:
    """Return a force that acts on one half of the stroke only."""
    total = 0.0
    for k in range(3):
        total += v / math.sqrt(v * v + SOFT * SOFT) / (k + 1)
    return p[0] * total if q > 0.0 else 0.5 * p[0]


def worn(s: Any, p: Any) -> float:
    """Return a factor that grows with the state."""
    return 1.0 + p[0] * s[0]


def worn_next(v: float, h: float, s: Any, p: Any) -> tuple[float]:
    """Advance the state toward 1."""
    return (min(s[0] + abs(v) * h, 1.0),)


def user_effect(name: str, place: Place, output: Any, advance: Any = None, state: tuple[float, ...] = ()) -> Effect:
    """Return an effect of the user's own."""
    return Effect(name, place, STRENGTH, "", "", "", (), "", output, advance, state)


@needs("gcc")
def test_effects_of_the_users_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Constants, loops, choices and states of a user's formulas arrive in C."""
    entries = (
        user_effect("one_sided", Place.ADDED_FORCE, one_sided),
        user_effect("worn", Place.LEVEL_FACTOR, worn, worn_next, (0.0,)),
    )
    for entry in entries:
        monkeypatch.setitem(catalogue._effects, entry.name, entry)
    axis = replace(AXIS, effects=tuple(EffectSettings(entry.name, (0.3,)) for entry in entries))
    folder = exported(tmp_path, (axis,))
    assert_equal(folder)
    assert "one_sided" in (folder / "sgms.c").read_text(encoding="utf-8")


def makes_a_list(p: Any) -> float:
    return sum([p[0], p[1]])


def waits(p: Any) -> float:
    x = p[0]
    while x > 1.0:
        x = 0.5 * x
    return x


def opens(p: Any) -> float:
    return float(len(str(p[0])))


def unknown_length(p: Any, n: int) -> float:
    return p[:n].shape[0] * 1.0


def changes_type(p: Any) -> float:
    x = p[0]
    x = p
    return x[0]


@pytest.mark.parametrize("function", [makes_a_list, waits, opens, changes_type])
def test_refusals_are_one_sentence_with_place_and_remedy(function: Callable[..., float]) -> None:
    source = source_of(function)
    assert source is not None
    with pytest.raises(ConfigurationError) as caught:
        Translator().function(source, [Value("p", Array(REAL, (2,)))])
    (sentence,) = caught.value.sentences
    assert sentence.startswith("sgms export cannot write")
    assert function.__name__ in sentence and "line" in sentence and "; write it with" in sentence


def test_an_array_of_unknown_length_is_refused() -> None:
    source = source_of(unknown_length)
    assert source is not None
    with pytest.raises(ConfigurationError, match="length is not known"):
        Translator().function(source, [Value("p", Array(REAL, (2,))), Value("n", REAL)])


def meaning(a: float, b: float, p: Any) -> tuple[float, float]:
    """Python's rounding of a remainder, its min and max, and a swap."""
    a, b = b, a
    whole = int(p[0])
    return max(min(a, b), p[1]) - (-whole % 3) + (-whole // 2), a


def test_python_semantics_are_kept() -> None:
    source = source_of(meaning)
    assert source is not None
    program = Translator()
    text = program.function(source, [Value("a", REAL), Value("b", REAL), Value("p", Array(REAL, (2,)))]).text
    text = " ".join(text.split())
    assert "floor_remainder(-whole, 3)" in text
    assert "floor_divide(-whole, 2)" in text
    assert "real_max(real_min(" in text
