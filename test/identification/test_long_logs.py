"""Identification of a log that is longer than what is filtered and searched at once."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from sgms_observer.arrays import Floats
from sgms_observer.identification import identify as identify_module
from sgms_observer.identification import prepared, selection
from sgms_observer.identification.effect_terms import EffectTerms, effect_terms
from sgms_observer.identification.identify import Identification, IdentifyOptions, identify, long_enough
from sgms_observer.identification.prepared import parts_of_long
from sgms_observer.identification.problem import RHO, V_S, ElementShape
from sgms_observer.identification.selection import most_informative, rows_to_use
from sgms_observer.identification.start_values import linear_start
from sgms_observer.identification.trace import traces_of
from sgms_observer.offline.recording import Recording, recordings_from_samples
from sgms_observer.settings.axis import (
    AxisSettings,
    EffectSettings,
    EncoderSettings,
    FrictionSettings,
    ReferenceSettings,
    Settings,
    StageSettings,
)
from sim_plant.table import SimulatedTable

PERIOD = 1.0e-3
CORNER = 40.0  # Hz
FRICTION = FrictionSettings(
    element_stiffness=(2.0e5, 0.8e5),
    element_fraction=(0.2, 0.8),
    element_damping=(0.0, 0.0),
    viscous_coefficient=30.0,
    static_force=5.2,
    coulomb_force=4.0,
    stribeck_velocity=5.0e-3,
)
TRUE = AxisSettings(
    mass=10.0,
    friction=FRICTION,
    stage=StageSettings(
        encoder=EncoderSettings(resolution=1.0e-7, noise=5.0e-8),
        force_noise=0.05,
        reference=ReferenceSettings(
            kind="multi_sine", amplitudes=(3.0e-3, 5.0e-4, 1.0e-4), frequencies=(0.47, 1.93, 5.3)
        ),
    ),
)
START = replace(TRUE, mass=6.0, friction=replace(FRICTION, static_force=3.5, coulomb_force=3.0), stage=StageSettings())
SHAPE = ElementShape.of(FRICTION, "sgms")


@pytest.fixture(scope="module")
def log() -> Recording:
    """Return 20 s of rest, then 40 s of motion."""
    table = SimulatedTable(Settings(axes=(TRUE,), sample_period=PERIOD), 1_000_000_000)
    moving = recordings_from_samples(table.step(40_000)[0].samples, "log")[0]
    rng = np.random.default_rng(1)
    rest = np.round(rng.normal(0.0, 5.0e-8, 20_000) / 1.0e-7) * 1.0e-7
    effort = rng.normal(0.0, 0.05, 20_000)
    return Recording("log", PERIOD, np.append(rest, moving.position), np.append(effort, moving.effort))


def _cut(monkeypatch: pytest.MonkeyPatch) -> int:
    """Let a log of more than 15 s be long."""
    most = 15_000
    monkeypatch.setattr(prepared, "MAX_SAMPLES_AT_ONCE", most)
    monkeypatch.setattr(prepared, "_MAX_SAMPLES_OF_PART", 3_000)
    monkeypatch.setattr(identify_module, "MAX_SAMPLES_AT_ONCE", most)
    return most


def test_a_long_log_gives_the_same_values_from_a_search_on_some_parts(
    log: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    options = IdentifyOptions(count=2, cutoff=CORNER)
    whole = identify([log], START, options)
    most = _cut(monkeypatch)
    searched: list[int] = []
    search = selection.search

    def counting(data, *arguments, **options):  # type: ignore[no-untyped-def]
        searched.append(sum(len(piece.position) for piece in data))
        return search(data, *arguments, **options)

    monkeypatch.setattr(selection, "search", counting)
    shown: list[float] = []
    found = identify([log], START, options, shown.append)
    assert max(searched[:4]) < most + 4_000 < max(searched)  # the number of elements; then the last fit of all rows
    assert shown == sorted(shown) and shown[0] == 0.0 and shown[-1] < 1.0
    for j in range(len(whole.confidence.half_width)):
        if whole.confidence.is_identifiable[j]:
            difference = abs(found.parameters.vector()[j] - whole.parameters.vector()[j])
            assert difference < whole.confidence.half_width[j], whole.parameters.names()[j]
    assert found.rms_error == pytest.approx(whole.rms_error, rel=0.02)
    _check_traces(whole, found, log)


def _check_traces(whole: Identification, found: Identification, log: Recording) -> None:
    """The report shows a long log as one recording, at its own times."""
    trace = traces_of(found, START, [log], []).learnt
    assert len(trace) == 1
    assert np.all(np.diff(trace[0].time) > 0.0)
    assert trace[0].time[-1] < log.duration
    at: Floats = np.interp(trace[0].time, log.time, log.position)
    assert np.max(np.abs(trace[0].position - at)) < 1.0e-5
    assert len(trace[0].time) > 1000


def test_a_part_at_rest_is_searched_last(log: Recording, monkeypatch: pytest.MonkeyPatch) -> None:
    most = _cut(monkeypatch)
    parts = [part for group in parts_of_long([log], CORNER, effect_terms(START)) for part in group]
    start = linear_start(parts, START, SHAPE, CORNER)
    data = rows_to_use(start.data, (), start.atoms.slip_deflection)
    few = most_informative(data, start.parameters(2, start.velocity), SHAPE, most)
    assert 0 < len(few.main) < len(data.main)
    assert min(float(np.ptp(piece.position)) for piece in few.main) > 1.0e-4
    assert most_informative(data, start.parameters(2, start.velocity), SHAPE, 10**9) is data


def test_parts_keep_what_is_known_of_the_whole(log: Recording, monkeypatch: pytest.MonkeyPatch) -> None:
    _cut(monkeypatch)
    (parts,) = parts_of_long([log], CORNER, EffectTerms())
    assert np.array_equal(np.concatenate([part.position for part in parts]), log.position)
    assert {part.position_noise for part in parts} == {log.position_noise}
    assert {part.encoder_step for part in parts} == {log.encoder_step}
    assert all(after.continues(before) for before, after in pairwise(parts))
    assert not parts[2].continues(parts[0])


def test_effects_with_a_memory_keep_their_pieces_whole(log: Recording, monkeypatch: pytest.MonkeyPatch) -> None:
    _cut(monkeypatch)
    assert parts_of_long([log], CORNER, EffectTerms((EffectSettings("thermal_drift"),))) == [[log]]
    assert len(parts_of_long([log], CORNER, EffectTerms((EffectSettings("cogging"),)))[0]) > 1


def test_reversals_count_across_the_cuts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three strokes of 20 s, cut into parts of 3 s: no part has a reversal that is not at its border."""
    time = PERIOD * np.arange(60_000)
    turn = 20.0
    position = 0.05 * np.abs((time / turn + 1.0) % 2.0 - 1.0)
    velocity = np.gradient(position, PERIOD)
    effort = 4.0 * np.sign(velocity) + 30.0 * velocity + np.random.default_rng(2).normal(0.0, 0.05, len(time))
    slow = Recording("slow", PERIOD, position, effort)
    _cut(monkeypatch)
    pieces, _notes = long_enough([slow], CORNER)
    parts = [part for group in parts_of_long(pieces, CORNER, EffectTerms()) for part in group]
    start = linear_start(parts, START, SHAPE, CORNER)
    assert start.parameters(1, start.velocity).scalars[[RHO, V_S]].min() > 0.0
