"""The catalogue is complete, its entries are checked, and its page is current."""

from pathlib import Path

import pytest

from sgms_observer.effects import catalogue
from sgms_observer.effects.compiled import CompiledEffects
from sgms_observer.effects.effect import Effect, EffectParameter, Place
from sgms_observer.effects.page import catalogue_page
from sgms_observer.effects.switch_source import PAGE as SWITCH
from sgms_observer.effects.switch_source import switch_source
from sgms_observer.errors import ConfigurationError
from sgms_observer.settings.axis import EffectSettings

FIELD_NAMES = [
    "cogging",
    "position_periodic_friction",
    "position_dependent_friction",
    "spring",
    "offset",
    "gravity",
    "asymmetric_coulomb",
    "asymmetric_viscous",
    "stribeck",
    "nonlinear_viscous",
    "quadratic_drag",
    "eddy_current",
    "presliding",
    "backlash",
    "dwell_breakaway",
    "frictional_lag",
    "thermal_drift",
    "wear_step",
    "load_dependent_friction",
    "mass_error",
    "actuator_delay",
    "actuator_gain",
    "actuator_saturation",
    "actuator_dead_zone",
    "flexible_mode",
    "encoder_interpolation_error",
    "quantisation",
    "periodic_disturbance",
    "cross_axis_coupling",
    "learnt_map",
    "learnt_map_2",
    "learnt_map_3",
]


def test_every_effect_of_the_field_is_there() -> None:
    built_in = [entry.name for entry in catalogue.BUILT_IN]
    assert sorted(built_in) == sorted(FIELD_NAMES)


@pytest.mark.parametrize("name", FIELD_NAMES)
def test_entry_is_documented(name: str) -> None:
    entry = catalogue.effect(name)
    assert entry.equation and entry.signature and entry.excitation and entry.reference
    assert any(parameter.is_strength for parameter in entry.parameters)
    for other in entry.confusable_with:
        catalogue.effect(other)


def test_page_is_current() -> None:
    page = Path(__file__).parents[2] / "docs" / "catalogue.md"
    assert page.read_text(encoding="utf-8") == catalogue_page()


def test_unknown_name_and_bad_value_say_what_to_do() -> None:
    with pytest.raises(ConfigurationError, match="coging is not in the catalogue"):
        CompiledEffects([EffectSettings("coging")], 1e-3)
    with pytest.raises(ConfigurationError, match=r"effects.actuator_delay.delay = 1 s must be between 0 and 0.02 s"):
        CompiledEffects([EffectSettings("actuator_delay", (1.0,))], 1e-3)
    with pytest.raises(ConfigurationError, match="has 1 values"):
        CompiledEffects([EffectSettings("cogging", (1.0,))], 1e-3)


def test_a_users_effect_needs_no_change_of_the_package(tmp_path: Path) -> None:
    file = tmp_path / "mine.py"
    file.write_text(
        "import math\n"
        "from sgms_observer.effects.effect import Effect, EffectParameter, Place\n"
        "def force(q, s, p):\n    return p[0] * math.sin(q) + s[0]\n"
        "def advance(h, s, p):\n    return (s[0] + h,)\n"
        "EFFECTS = [Effect('wobble', Place.ADDED_FORCE,\n"
        "    (EffectParameter('size', 'N', 2.0, 0.0, 9.0, 'size', is_strength=True),),\n"
        "    'F', 'x', 'y', (), 'me', force, advance, (0.5,))]\n"
    )
    assert catalogue.load_user_effects([file]) == ("wobble",)
    assert catalogue.load_user_effects([file]) == ()
    effects = CompiledEffects([EffectSettings("offset", (1.0,)), EffectSettings("wobble")], 1e-3)
    import numpy as np

    x = np.array([0.3, 0.4])
    one = np.ones(2)
    force, factor = effects.evaluate(x, x, x, x, x, 0.1 * one, 4.0 * one, effects.initial_state())
    assert force == pytest.approx(1.0 + 2.0 * np.sin(x) + 0.5 + np.array([0.1, 0.2]))
    assert factor == pytest.approx(one)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("x = 1", "it has no EFFECTS"),
        ("1/0", "ZeroDivisionError"),
        (
            "from sgms_observer.effects.catalogue import effect\nEFFECTS = [effect('offset')]",
            "already in the catalogue",
        ),
    ],
)
def test_a_bad_file_is_one_sentence(tmp_path: Path, text: str, sentence: str) -> None:
    file = tmp_path / "bad.py"
    file.write_text(text)
    with pytest.raises(ConfigurationError, match=sentence) as caught:
        catalogue.load_user_effects([file])
    assert len(caught.value.sentences) == 1
    with pytest.raises(ConfigurationError, match="no such file"):
        catalogue.load_user_effects([tmp_path / "absent.py"])


def test_a_record_says_over_what_it_lies_and_what_bounds_its_shape() -> None:
    for entry in catalogue.BUILT_IN:
        if entry.name in FIELD_NAMES and not entry.coordinates:
            assert entry.place in (Place.EFFORT_PATH, Place.MEASURED_POSITION) or entry.name in (
                "offset",  # a constant
                "periodic_disturbance",  # of the frequency
                "cross_axis_coupling",  # of the other axis
                "flexible_mode",
                "learnt_map",
                "learnt_map_2",
                "learnt_map_3",  # what its table says
            )
        for parameter in entry.parameters:
            if parameter.unit in ("m", "m/s", "s", "Hz") and not parameter.is_strength and not entry.lists:
                assert parameter.acts_on, f"{entry.name}.{parameter.name}"
    with pytest.raises(ConfigurationError, match="acts_on = 'place' must be one of"):
        EffectParameter("a", "m", 0.0, 0.0, 1.0, "x", acts_on="place")
    with pytest.raises(ConfigurationError, match="coordinate 'place' is unknown"):
        Effect("odd", Place.ADDED_FORCE, (), "F", "x", "y", (), "me", lambda q: q, coordinates=("place",))


def test_a_formula_with_a_strange_argument_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="argument 'w' is unknown"):
        Effect("odd", Place.ADDED_FORCE, (), "F", "x", "y", (), "me", lambda w: w)
    with pytest.raises(ConfigurationError, match="outside"):
        EffectParameter("a", "-", 2.0, 0.0, 1.0, "too large")


def test_the_compiled_switch_is_written_from_the_records() -> None:
    assert SWITCH.read_text(encoding="utf-8") == switch_source(), "run python -m sgms_observer.effects.switch_source"


@pytest.mark.parametrize("entry", [item for item in catalogue.BUILT_IN if not item.lists], ids=lambda item: item.name)
def test_a_report_asks_about_every_effect_in_its_own_words(entry) -> None:
    values = {parameter.name: f"1 {parameter.unit}" for parameter in entry.parameters}
    asked = entry.asked(values)
    assert entry.question and asked.endswith("?") and "{" not in asked
    others = [other.question for other in catalogue.BUILT_IN if other.name != entry.name]
    assert entry.question not in others
