"""The command that a needed force asks for: the reverse of the effort's path, along whole arrays."""

import numpy as np
import pytest

from sgms_observer.effects import kernels
from sgms_observer.effects.compiled import CompiledEffects
from sgms_observer.formulas import vectorised
from sgms_observer.formulas.effects import SOFT_SHARE
from sgms_observer.settings.axis import EffectSettings

PERIOD = 1e-3
PATH = {
    "actuator_gain": (0.8,),
    "actuator_saturation": (6.0,),
    "actuator_dead_zone": (0.4,),
    "actuator_delay": (2.6e-3,),
}
POSITION = {"encoder_interpolation_error": (4.0e-8, 2.0e-5, 0.3), "quantisation": (1.0e-7,)}


def path_of(*names: str) -> CompiledEffects:
    return CompiledEffects([EffectSettings(name, PATH[name]) for name in names], PERIOD)


@pytest.mark.parametrize("names", [(name,) for name in PATH] + [tuple(PATH), tuple(reversed(PATH))])
def test_the_needed_command_lets_the_needed_force_arrive(names: tuple[str, ...]) -> None:
    t = np.arange(4000) * PERIOD
    force = 3.0 * np.sin(5.0 * t)
    effects = path_of(*names)
    arrived = effects.arrived_effort(effects.needed_command(force), effects.initial_state())
    inner = np.abs(force) > 10.0 * SOFT_SHARE * 0.4  # outside the rounded corner of the dead zone
    inner[:10] = inner[-10:] = False  # no command brings the force before the first sample
    assert arrived[inner] == pytest.approx(force[inner], abs=0.01)
    wrong = effects.arrived_effort(force, effects.initial_state())
    if names != ("actuator_saturation",):
        assert np.std((arrived - force)[inner]) < 0.1 * np.std((wrong - force)[inner])


def test_a_saturated_force_asks_for_the_limit_and_a_lost_one_for_nothing() -> None:
    force = np.array([-20.0, -5.0, 0.0, 5.0, 20.0])
    assert path_of("actuator_saturation").needed_command(force).tolist() == [-6.0, -5.0, 0.0, 5.0, 6.0]
    command = path_of("actuator_dead_zone").needed_command(np.linspace(-1.0, 1.0, 2001))
    assert command[1000] == 0.0 and np.all(np.diff(command) > 0.0)
    assert command[[0, -1]] == pytest.approx([-1.4, 1.4], abs=1e-3)


def test_an_axis_without_such_effects_commands_the_force_itself() -> None:
    force = np.array([1.0, -2.0])
    assert CompiledEffects([EffectSettings("offset", (1.0,))], PERIOD).needed_command(force) is force


@pytest.mark.parametrize("names", [tuple(PATH), tuple(reversed(PATH))])
def test_a_block_is_its_samples_to_the_last_bit(names: tuple[str, ...]) -> None:
    """A block goes through one effect after the other, a single sample through all of them."""
    values = np.linspace(-8.0, 8.0, 501)
    path = path_of(*names)
    command = np.empty_like(values)
    kernels.command_block(path.kinds, path.p_at, path.parameters, values, command)
    one_by_one = [kernels.needed_command(path.kinds, path.p_at, path.parameters, value) for value in values]
    assert np.array_equal(command, one_by_one)
    encoder = CompiledEffects([EffectSettings(name, POSITION[name]) for name in POSITION], PERIOD)
    arguments = encoder.kinds, encoder.p_at, encoder.parameters
    for whole, sample in (
        (encoder.measured_position, kernels.measured_position),
        (encoder.corrected_position, kernels.corrected_position),
    ):
        position = 1.0e-5 * values
        assert np.array_equal(whole(position), [sample(*arguments, value) for value in position])
        assert not np.array_equal(whole(position), position)


def test_the_inverse_formulas_are_written_once() -> None:
    formulas = vectorised("effects")
    force = np.linspace(-5.0, 5.0, 77)
    for name in ("actuator_gain", "actuator_saturation", "actuator_dead_zone"):
        expected = getattr(formulas, f"{name}_command")(force, PATH[name])
        assert path_of(name).needed_command(force) == pytest.approx(expected, abs=1e-14)
