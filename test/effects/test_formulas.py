"""Every effect: compiled, symbolic and vectorised agree; derivatives; blocks; physics."""

import inspect
from typing import Any

import numpy as np
import pytest
from effects_motion import PERIOD, VALUES, motion

from sgms_observer.effects.catalogue import effect
from sgms_observer.effects.compiled import CompiledEffects
from sgms_observer.effects.effect import INPUTS, Effect, Place
from sgms_observer.formulas import effects as formula
from sgms_observer.formulas import vectorised
from sgms_observer.settings.axis import EffectSettings

NAMES = sorted(VALUES)
STATEFUL = [name for name in NAMES if effect(name).advance is not None]
DISSIPATIVE = [
    "quadratic_drag", "nonlinear_viscous", "eddy_current", "presliding",
]  # fmt: skip


def compiled(name: str, values: tuple[float, ...] | None = None) -> CompiledEffects:
    return CompiledEffects([EffectSettings(name, VALUES[name] if values is None else values)], PERIOD)


def run(effects: CompiledEffects, m: dict[str, np.ndarray], state: np.ndarray | None = None, part: slice = slice(None)):
    state = effects.initial_state() if state is None else state
    chosen = {key: value[part] for key, value in m.items()}
    return effects.evaluate(
        chosen["q"], chosen["v"], chosen["a"], chosen["t"], chosen["u"], chosen["h"], chosen["level"], state,
        chosen["v2"], chosen["a2"],
    )  # fmt: skip


def symbolic_effect(entry: Effect) -> Any:
    """Return an effect's formulas over CasADi symbols."""
    pytest.importorskip("casadi", reason="CasADi is not installed")
    from symbolic_effects import symbolic_effect

    return symbolic_effect(entry)


def by_casadi(name: str, m: dict[str, np.ndarray], p: tuple[float, ...]) -> np.ndarray:
    entry, functions = effect(name), symbolic_effect(effect(name))
    rows = np.column_stack([m[key] for key in INPUTS])
    s = np.array(entry.initial_state)
    out = np.empty(len(rows))
    for k, row in enumerate(rows):
        if functions.advance is not None:
            s = np.array(functions.advance(row, s, p)).ravel()
        out[k] = float(functions.output(row, s, p))
    return out


def through_kernel(name: str, m: dict[str, np.ndarray], p: tuple[float, ...]) -> np.ndarray:
    place, effects = effect(name).place, compiled(name, p)
    if place is Place.EFFORT_PATH:
        return effects.arrived_effort(m["u"], effects.initial_state())
    if place is Place.MEASURED_POSITION:
        return effects.measured_position(m["q"])
    if name == "mass_error":
        return effects.added_mass * m["a"]
    force, factor = run(effects, m)
    return factor if place is Place.LEVEL_FACTOR else force


@pytest.mark.parametrize("name", [name for name in NAMES if name != "actuator_delay"])
def test_compiled_and_symbolic_agree(name: str) -> None:
    m = {key: value[:700] for key, value in motion().items()}
    expected = by_casadi(name, m, VALUES[name])
    assert np.ptp(expected) > 0.0 or name in ("offset",)
    scale = np.abs(expected).max()
    assert through_kernel(name, m, VALUES[name]) == pytest.approx(expected, rel=1e-9, abs=1e-12 * scale)


@pytest.mark.parametrize(
    "name", [n for n in NAMES if effect(n).advance is None and n not in ("actuator_delay", "offset")]
)
def test_vectorised_agrees_with_compiled(name: str) -> None:
    m, entry = motion(), effect(name)
    formula = getattr(vectorised(entry.output.__module__), entry.output.__name__)
    values = {**m, "p": VALUES[name]}
    expected = formula(*(values[key] for key in inspect.signature(formula).parameters))
    assert through_kernel(name, m, VALUES[name]) == pytest.approx(expected, rel=1e-12, abs=1e-15)


@pytest.mark.parametrize("name", [name for name in NAMES if name not in ("actuator_delay", "quantisation")])
def test_derivatives_by_parameters_against_finite_differences(name: str) -> None:
    entry, functions, m = effect(name), symbolic_effect(effect(name)), motion()
    p = np.array(VALUES[name])
    rng = np.random.default_rng(3)
    for k in rng.integers(10, 1500, 12):
        row = np.array([m[key][k] for key in INPUTS])
        s = rng.uniform(0.2, 0.8, len(entry.initial_state))
        for function, jacobian in (
            (functions.output, functions.output_by_parameters),
            (functions.advance, functions.advance_by_parameters),
        ):
            if function is None or jacobian is None:
                continue
            exact = np.array(jacobian(row, s, p))
            for j, value in enumerate(p):
                step = 1e-6 * max(abs(value), 1e-3 if value == 0 else 0)
                up, down = p.copy(), p.copy()
                up[j] += step
                down[j] -= step
                numeric = (np.array(function(row, s, up)) - np.array(function(row, s, down))).ravel() / (2 * step)
                size = np.abs(np.array(function(row, s, p))).max() / abs(value)
                assert exact[:, j] == pytest.approx(numeric, rel=1e-4, abs=1e-6 * size + 1e-300)


@pytest.mark.parametrize("name", STATEFUL)
def test_any_split_into_blocks_gives_the_same_bits(name: str) -> None:
    m, effects = motion(), compiled(name)
    whole = run(effects, m)
    state = effects.initial_state()
    parts = [run(effects, m, state, slice(i, i + 173)) for i in range(0, 4000, 173)]
    for row in (0, 1):
        assert np.array_equal(whole[row], np.concatenate([part[row] for part in parts]))


def test_delay_is_the_same_effort_later() -> None:
    effects, m = compiled("actuator_delay"), motion()
    arrived = effects.arrived_effort(m["u"], effects.initial_state())
    expected = np.interp(m["t"] - 2.6e-3, m["t"], m["u"])
    assert arrived[5:] == pytest.approx(expected[5:], abs=1e-12)
    state = effects.initial_state()
    parts = [effects.arrived_effort(m["u"][i : i + 7], state) for i in range(0, 4000, 7)]
    assert np.array_equal(np.concatenate(parts), arrived)
    assert np.array_equal(
        compiled("actuator_delay", (0.0,)).arrived_effort(m["u"], compiled("actuator_delay", (0.0,)).initial_state()),
        m["u"],
    )


@pytest.mark.parametrize("name", NAMES)
def test_defaults_are_no_effect(name: str) -> None:
    m, effects = motion(), CompiledEffects([EffectSettings(name)], PERIOD)
    force, factor = run(effects, m)
    assert np.abs(force).max() == 0.0
    assert factor == pytest.approx(np.ones(len(factor)), abs=5e-3)  # frictional_lag: a very fast one
    assert effects.added_mass == 0.0
    assert effects.measured_position(m["q"]) == pytest.approx(m["q"], abs=1e-11)
    assert effects.arrived_effort(m["u"], effects.initial_state()) == pytest.approx(m["u"])


@pytest.mark.parametrize("name", DISSIPATIVE)
def test_friction_like_forces_take_energy_out_of_a_closed_cycle(name: str) -> None:
    n = 2000
    t = np.arange(3 * n) * PERIOD
    v = 0.02 * np.cos(2 * np.pi * t / (n * PERIOD))
    m = {key: np.zeros(3 * n) for key in INPUTS} | {
        "v": v,
        "t": t,
        "h": np.full(3 * n, PERIOD),
        "level": np.full(3 * n, 4.0),
    }
    force, _factor = run(compiled(name), m)
    assert np.sum((force * v)[-n:]) * PERIOD > 0.0


def test_position_correction_undoes_the_encoder() -> None:
    effects, q = compiled("encoder_interpolation_error"), np.linspace(0.0, 1e-4, 999)
    error = effects.corrected_position(effects.measured_position(q)) - q
    wrong = effects.measured_position(q) - q
    assert np.abs(error).max() < 0.01 * np.abs(wrong).max()


@pytest.mark.parametrize("period", [1.0e-3, 0.01])
def test_break_away_grows_with_the_logarithm_of_the_rest_and_is_forgotten_over_a_distance(period: float) -> None:
    """Dieterich 1972: the same rise for each factor in the time at rest. The step does not matter."""
    values = share, dwell_time, distance, _ = 0.3, 0.05, 2.0e-5, 1.0e-4
    age = (0.0,)
    rises = {}
    for number in range(1, round(10.0 / period) + 1):
        age = formula.dwell_breakaway_next(0.0, period, age, values)
        rises[round(number * period, 3)] = formula.dwell_breakaway(age, values) - 1.0
    assert rises[1.0] == pytest.approx(share)
    assert rises[10.0] == pytest.approx(share * np.log1p(10.0 / dwell_time) / np.log1p(1.0 / dwell_time))
    (moved,) = formula.dwell_breakaway_next(distance / 1.0e-3, 1.0e-3, age, values)  # far faster than a contact at rest
    assert moved == pytest.approx(age[0] * np.exp(-1.0))


def test_frictional_lag_is_the_gms_relaxation_while_sliding() -> None:
    n, rate = 3000, 50.0
    speed = np.where(np.arange(n) < 1500, 5e-3, 5e-4)
    level = 4.0 + 0.5 * np.exp(-((speed / 1e-3) ** 2))
    m = {key: np.zeros(n) for key in INPUTS} | {"v": speed, "h": np.full(n, PERIOD), "level": level}
    _force, factor = run(compiled("frictional_lag", (rate, 1e-5)), m)
    after = np.arange(1, 1501) * PERIOD
    expected = level[-1] + (level[0] - level[-1]) * np.exp(-rate * after / level[-1])
    assert (factor * level)[1500:] == pytest.approx(expected, abs=1e-3)


def test_flexible_mode_carries_the_mass_at_low_frequency_and_leaves_it_at_high() -> None:
    effects = compiled("flexible_mode", (2.0, 30.0, 0.1))
    assert effects.added_mass == -2.0
    t = np.arange(20000) * 1e-4
    for frequency, carried in ((0.5, 2.0), (600.0, 0.0)):
        a = np.sin(2 * np.pi * frequency * t)
        m = {key: np.zeros(len(t)) for key in INPUTS} | {"a": a, "h": np.full(len(t), 1e-4), "level": np.ones(len(t))}
        force, _factor = run(effects, m)
        mass = -np.dot(force[10000:], a[10000:]) / np.dot(a[10000:], a[10000:])
        # the reaction without -m a is -(omega^2 x + ...) m, which is +m a when the mass follows
        assert -mass == pytest.approx(carried, abs=0.03)


def test_the_friction_of_a_load_behind_play_goes_with_a_reversal_and_is_back_at_the_other_wall() -> None:
    gap, share, stop, step = 4e-5, 0.2, 2e-6, 1e-7
    v = np.concatenate([np.full(1000, step), np.full(1000, -step)]) / PERIOD
    m = {key: np.zeros(2000) for key in INPUTS} | {"v": v, "h": np.full(2000, PERIOD), "level": np.full(2000, 4.0)}
    force, factor = run(compiled("backlash", (gap, share, stop)), m)
    assert np.all(factor == 1.0)
    assert force[999] / (4.0 + force[999]) == pytest.approx(share)
    back = np.arange(1, 1001) * step
    free = force[1000:][(back > stop + step) & (back < stop + gap - step)]
    assert np.abs(free).max() < 1e-9
    assert force[1000:][back > gap + 2.0 * stop + step] == pytest.approx(-force[999])


def test_gravity_turns_with_a_revolute_joint_and_is_constant_on_a_slope() -> None:
    q = np.linspace(-3.0, 3.0, 50)
    m = {key: np.zeros(50) for key in INPUTS} | {"q": q, "h": np.full(50, PERIOD), "level": np.ones(50)}
    turning, _factor = run(compiled("gravity", (56.0, 0.4, 1.0)), m)
    assert turning == pytest.approx(56.0 * np.sin(q + 0.4))
    standing, _factor = run(compiled("gravity", (98.1, 0.5 * np.pi, 0.0)), m)
    assert standing == pytest.approx(np.full(50, 98.1))
