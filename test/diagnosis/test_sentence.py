"""The verdict in one sentence, as a machine builder reads it first."""

from types import SimpleNamespace
from typing import Any

from sgms_observer.diagnosis.criteria import Criteria
from sgms_observer.diagnosis.report import sentence
from sgms_observer.settings.axis import EffectSettings
from sgms_observer.settings.units import Units

LINEAR = Units()


def answer(verdict: str, **alternatives: tuple[str, ...]) -> Any:
    """Return what the sentence needs of an answer."""
    gap = SimpleNamespace(held_out="held-out", before=4.0, after=2.0, noise=1.5)
    effects = [
        SimpleNamespace(settings=EffectSettings(name), alternatives=others) for name, others in alternatives.items()
    ]
    of_file = (EffectSettings("offset", (0.1,)), EffectSettings("spring", (1.0, 0.0)))
    diagnosis = SimpleNamespace(file_effects=of_file, evaluation=SimpleNamespace(criteria=Criteria()))
    return SimpleNamespace(
        verdict=verdict, gap=gap, effects=effects, located=(), learnt=(), tests=(), diagnosis=diagnosis
    )


def test_names_are_listed_as_a_person_lists_them() -> None:
    one = sentence(answer("effect_found", cogging=()), LINEAR)
    assert one.startswith("The model misses cogging: with it, the gap on held-out data falls from 4 % to 2 %")
    three = sentence(answer("effect_found", cogging=(), actuator_delay=(), gravity=()), LINEAR)
    assert three.startswith("The model misses cogging, actuator delay and gravity: with them")


def test_an_effect_of_the_file_is_wrong_and_not_missing() -> None:
    one = sentence(answer("effect_found", offset=()), LINEAR)
    assert one.startswith("The offset of the file is wrong: with the new values, the gap on held-out data falls from")
    both = sentence(answer("effect_found", offset=(), cogging=(), spring=()), LINEAR)
    assert both.startswith("The model misses cogging and the offset and spring of the file are wrong: with the new")


def test_a_gap_far_above_the_noise_is_not_called_noise() -> None:
    silent, loud = answer("no_effect"), answer("no_effect")
    for one, noise in ((silent, 1.0), (loud, 0.9)):
        one.changed, one.gap.noise = (), noise
    assert sentence(silent, LINEAR).endswith("the gap is 2 % of the rms effort.")
    assert "The noise alone would leave 0.9 %: the rest is a force that no recorded signal" in sentence(loud, LINEAR)


def test_what_was_learnt_beside_a_name_is_said_with_what_it_leaves() -> None:
    found = answer("effect_found", cogging=())
    place, contact = SimpleNamespace(is_of_contact=False), SimpleNamespace(is_of_contact=True)
    beside = "of the rms effort. Beside that, something without a name is missing"
    for maps, law in (
        ((place, contact), ""),
        ((contact, contact), ", which may be another contact law than that of the file"),
    ):
        found.learnt, found.gap_with_learnt = maps, 1.234
        assert sentence(found, LINEAR) == (
            "The model misses cogging: with it, the gap on held-out data falls from 4 % to 2 %"
            f" {beside}{law}: with learnt maps of it, 1.23 % is left."
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
