"""Effects of the YAML act in the plant where the catalogue says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from stages import paper_axis, stored_energy, under_open_loop, with_reference, work_of_effort

from sgms_observer.effects.catalogue import effect, names
from sgms_observer.effects.compiled import CompiledEffects
from sgms_observer.effects.effect import flat_values
from sgms_observer.errors import ConfigurationError
from sgms_observer.settings.axis import AxisSettings, EffectSettings
from sim_plant.record import StageRecord
from sim_plant.stage import SimulatedStage


def with_effect(axis: AxisSettings, name: str, **values: float) -> AxisSettings:
    entry = effect(name)
    listed = flat_values(entry, {item.name: values.pop(item.name, item.default) for item in entry.parameters})
    assert not values
    return replace(axis, stage_effects=(EffectSettings(name, listed),))


def run(axis: AxisSettings, samples: int = 4000) -> StageRecord:
    return SimulatedStage(axis, 1e-4).step(samples)


@pytest.mark.parametrize("name", names())
def test_default_strength_changes_nothing_that_shows(name: str) -> None:
    plain, affected = run(paper_axis()), run(with_effect(paper_axis(), name))
    if name == "frictional_lag":  # has no strength: it is there or not
        assert not np.array_equal(plain.position, affected.position)
        return
    np.testing.assert_allclose(affected.position, plain.position, rtol=0.0, atol=2e-11)


def test_cogging_pushes_as_its_formula_says() -> None:
    axis = with_effect(paper_axis(), "cogging", amplitude=1.4, pitch=1e-4, phase=0.3)
    record = run(axis)
    expected = 1.4 * np.sin(2 * np.pi * record.position / 1e-4 + 0.3)
    step = np.abs(record.velocity).max() * 1e-5
    assert np.abs(record.effect_force - expected).max() < 1.4 * 2 * np.pi / 1e-4 * step


def test_effects_of_the_model_hold_for_the_stage_unless_it_has_its_own() -> None:
    offset = (EffectSettings("offset", (0.7,)),)
    both = run(replace(paper_axis(), effects=offset))
    none = run(replace(paper_axis(), effects=offset, stage_effects=()))
    np.testing.assert_allclose(both.effect_force, 0.7)
    assert not none.effect_force.any()


def test_effort_path_lies_between_publication_and_mass() -> None:
    gain = run(with_effect(paper_axis(), "actuator_gain", gain=0.8))
    np.testing.assert_allclose(gain.effort_applied, 0.8 * gain.control_effort)
    delay = run(with_effect(paper_axis(), "actuator_delay", delay=3e-4))
    np.testing.assert_allclose(delay.effort_applied[3:], delay.control_effort[:-3], atol=1e-9)
    limited = run(with_effect(paper_axis(), "actuator_saturation", limit=4.2))
    assert np.abs(limited.control_effort).max() > 4.2
    assert np.abs(limited.effort_applied).max() == pytest.approx(4.2)


def test_encoder_error_moves_the_measurement_not_the_force_balance() -> None:
    record = run(with_effect(paper_axis(), "encoder_interpolation_error", amplitude=1e-7, pitch=2e-5, phase=0.2))
    error = record.measured_position - record.position
    np.testing.assert_allclose(error, 1e-7 * np.sin(2 * np.pi * record.position / 2e-5 + 0.2), atol=1e-15)


def test_level_factor_scales_what_the_elements_carry() -> None:
    plain = run(paper_axis("sgms"))
    warm = run(with_effect(paper_axis("sgms"), "position_dependent_friction", share=0.3, center=0.0, width=1.0))
    assert np.abs(warm.element_force).max() == pytest.approx(1.3 * np.abs(plain.element_force).max(), rel=0.02)


def test_added_mass_is_felt() -> None:
    heavy = run(with_effect(paper_axis(), "mass_error", mass=2.0))
    balance = heavy.effort_applied - 5.0 * heavy.acceleration - heavy.friction
    wrong = heavy.effort_applied - 3.0 * heavy.acceleration - heavy.friction
    assert np.abs(balance[1000:]).max() < 0.1 < np.abs(wrong[1000:]).max()
    with pytest.raises(ConfigurationError, match="have no positive sum"):
        SimulatedStage(with_effect(paper_axis(), "mass_error", mass=-3.0), 1e-4)


def test_flexible_mode_rings_at_the_frequency_of_two_masses() -> None:
    axis = under_open_loop(paper_axis("gms", {"coulomb_force": 1e-6, "static_force": 1e-6, "viscous_coefficient": 0.0}))
    axis = with_effect(axis, "flexible_mode", mass=1.0, frequency=40.0, damping_ratio=0.001)
    record = SimulatedStage(axis, 1e-4).step(10_000, 0.3)
    mean = np.polynomial.Polynomial.fit(record.time, record.velocity, 1)
    assert mean.convert().coef[1] == pytest.approx(0.3 / 3.0, rel=1e-3)
    ringing = np.sign(record.velocity - mean(record.time))
    frequency = np.count_nonzero(np.diff(ringing)) / 2.0 / record.time[-1]
    assert frequency == pytest.approx(40.0 * np.sqrt(3.0 / 2.0), rel=0.02)  # masses of 2 kg and 1 kg


def test_presliding_element_holds_without_drift() -> None:
    axis = under_open_loop(with_effect(paper_axis("sgms"), "presliding", force=2.0, distance=2e-6))
    force = np.concatenate([np.linspace(0.0, 3.0, 5000), np.full(45_000, 3.0)])
    record = SimulatedStage(axis, 1e-4).step(50_000, force)
    assert np.ptp(record.position[-20_000:]) < 1e-12


def test_dissipative_effects_take_energy() -> None:
    for name, values in (
        ("eddy_current", {"peak_force": 1.0, "peak_velocity": 5e-3}),
        ("quadratic_drag", {"coefficient": 5e3}),
        ("asymmetric_coulomb", {"share": 0.3}),
        ("presliding", {"force": 0.5, "distance": 1e-5}),
    ):
        axis = with_effect(paper_axis("sgms"), name, **values)
        record = run(axis, 10_000)
        period = slice(4000, 8001, 2000)
        energy = stored_energy(axis, record)[period]
        plain = run(paper_axis("sgms"), 10_000)

        def lost(one: StageRecord) -> float:
            return float(work_of_effort(one)[4000:8000].sum())

        assert abs(np.diff(energy)).max() < 0.01 * lost(record)
        assert lost(record) > lost(plain) * (1.0 if name != "asymmetric_coulomb" else 0.99), name


def test_plant_and_catalogue_agree_on_recorded_motion() -> None:
    axis = replace(
        with_reference(paper_axis("sgms"), kind="point_to_point", amplitude=5e-3, dwell=0.05),
        stage_effects=(EffectSettings("spring", (50.0, 1e-3)), EffectSettings("asymmetric_viscous", (8.0,))),
    )
    record = run(axis)
    effects = CompiledEffects(axis.stage_effects or (), 1e-4)
    n = len(record)
    force, factor = effects.evaluate(
        record.position, record.velocity, record.acceleration, record.time, record.effort_applied,
        np.full(n, 1e-4), np.full(n, 4.0), effects.initial_state(),
    )  # fmt: skip
    assert not (factor - 1.0).any()
    bound = (50.0 * np.abs(record.velocity).max() + 8.0 * np.abs(record.acceleration).max()) * 1e-5
    assert np.abs(record.effect_force - force).max() < bound
