"""The verdict in one sentence, as a machine builder reads it first."""

from types import SimpleNamespace
from typing import Any

from sgms_observer.diagnosis.report import sentence
from sgms_observer.settings.axis import EffectSettings
from sgms_observer.settings.units import Units

LINEAR = Units()


def answer(verdict: str, **alternatives: tuple[str, ...]) -> Any:
    """Return what the sentence needs of an answer."""
    gap = SimpleNamespace(held_out="held-out", before=4.0, after=2.0)
    effects = [
        SimpleNamespace(settings=EffectSettings(name), alternatives=others) for name, others in alternatives.items()
    ]
    return SimpleNamespace(verdict=verdict, gap=gap, effects=effects, located=(), learnt=(), tests=())


def test_names_are_listed_as_a_person_lists_them() -> None:
    one = sentence(answer("effect_found", cogging=()), LINEAR)
    assert one.startswith("The model misses cogging: with it, the gap on held-out data falls from 4 % to 2 %")
    three = sentence(answer("effect_found", cogging=(), actuator_delay=(), spring=()), LINEAR)
    assert three.startswith("The model misses cogging, actuator delay and spring: with them")


def test_what_was_learnt_beside_a_name_is_said_with_what_it_leaves() -> None:
    found = answer("effect_found", cogging=())
    found.learnt, found.gap_with_learnt = (SimpleNamespace(), SimpleNamespace()), 1.234
    assert sentence(found, LINEAR) == (
        "The model misses cogging: with it, the gap on held-out data falls from 4 % to 2 % of the rms effort."
        " Beside that, something without a name is missing: with learnt maps of it, 1.23 % is left."
    )


def test_what_cannot_be_told_is_said_of_the_effect_that_it_is_about() -> None:
    doubtful = sentence(answer("ambiguous", cogging=(), stribeck=("eddy_current", "quadratic_drag")), LINEAR)
    assert "something like cogging and stribeck, but" in doubtful
    assert "cannot tell stribeck from eddy current or quadratic drag; the gap" in doubtful


def test_values_of_the_file_that_moved_are_said_where_no_effect_is_missing() -> None:
    plain = answer("no_effect")
    plain.changed = ()
    assert (
        sentence(plain, LINEAR)
        == "Nothing is missing that these recordings could show; the gap is 2 % of the rms effort."
    )
    moved = answer("no_effect")
    moved.changed = (SimpleNamespace(name="mass"), SimpleNamespace(name="friction.coulomb_force"))
    assert sentence(moved, LINEAR) == (
        "No effect is missing that these recordings could show, but the fit moves mass and friction.coulomb_force"
        " beyond the tolerance of the file: the gap on held-out data falls from 4 % to 2 % of the rms effort."
    )
