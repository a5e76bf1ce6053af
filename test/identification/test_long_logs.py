"""Identification of a log that is longer than what is filtered and searched at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from table_case import FRICTION as TABLE

from sgms_observer.arrays import Floats
from sgms_observer.errors import DataError
from sgms_observer.identification import confidence, prepared, selection
from sgms_observer.identification import identify as identify_module
from sgms_observer.identification.effect_terms import EffectTerms, effect_terms
from sgms_observer.identification.identify import Identification, IdentifyOptions, identify, long_enough
from sgms_observer.identification.prepared import parts_of_long, prepare_all
from sgms_observer.identification.problem import MASS, RHO, V_S, ElementShape, chunk_numbers
from sgms_observer.identification.search import scales_of
from sgms_observer.identification.selection import most_informative, rows_to_use
from sgms_observer.identification.start_values import linear_start
from sgms_observer.identification.trace import traces_of
from sgms_observer.offline.recording import Recording, recordings_from_samples
from sgms_observer.settings.axis import (
    AxisSettings,
    EffectSettings,
    EncoderSettings,
    ReferenceSettings,
    Settings,
    StageSettings,
)
from sim_plant.table import SimulatedTable

PERIOD = 1.0e-3
CORNER = 40.0  # Hz
FRICTION = replace(TABLE, element_stiffness=(2.0e5, 0.8e5), stribeck_velocity=5.0e-3)
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
    monkeypatch.setattr(prepared, "_SAMPLES_OF_PART", 3_000)
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
    """Three strokes of 20 s: the cuts lie at the reversals, and no part has a reversal within it."""
    time = PERIOD * np.arange(60_000)
    turn = 20.0
    position = 0.05 * np.abs((time / turn + 1.0) % 2.0 - 1.0)
    velocity = np.gradient(position, PERIOD)
    effort = 4.0 * np.sign(velocity) + 30.0 * velocity + np.random.default_rng(2).normal(0.0, 0.05, len(time))
    slow = Recording("slow", PERIOD, position, effort)
    _cut(monkeypatch)
    pieces, _notes = long_enough([slow], CORNER)
    parts = [part for group in parts_of_long(pieces, CORNER, EffectTerms()) for part in group]
    assert [part.start for part in parts] == pytest.approx([0.0, 20.0, 40.0], abs=0.05)
    start = linear_start(parts, START, SHAPE, CORNER)
    assert start.parameters(1, start.velocity).scalars[[RHO, V_S]].min() > 0.0
    apart = [replace(part, start=part.start + number) for number, part in enumerate(parts)]
    with pytest.raises(DataError, match="the axis reverses never"):
        linear_start(apart, START, SHAPE, CORNER)


def _rest(seconds: float, seed: int, position: float = 0.0, effort: float = 0.0) -> tuple[Floats, Floats]:
    """Return position and effort of an axis at rest."""
    rng = np.random.default_rng(seed)
    count = round(seconds / PERIOD)
    noise = np.round(rng.normal(0.0, 5.0e-8, count) / 1.0e-7) * 1.0e-7
    return position + noise, effort + rng.normal(0.0, 0.05, count)


def _motion(seconds: float) -> tuple[Floats, Floats]:
    """Return position and effort of the first seconds of a table's motion."""
    table = SimulatedTable(Settings(axes=(TRUE,), sample_period=PERIOD), 1_000_000_000)
    piece = recordings_from_samples(table.step(round(seconds / PERIOD))[0].samples, "log")[0]
    return piece.position, piece.effort


def _joined(*spans: tuple[Floats, Floats]) -> Recording:
    positions, efforts = zip(*spans, strict=True)
    return Recording("log", PERIOD, np.concatenate(positions), np.concatenate(efforts))


def test_presliding_after_a_few_strokes_is_used(monkeypatch: pytest.MonkeyPatch) -> None:
    """6 s of strokes, then 54 s of 5 um: the state of the elements is known from the strokes on, cut or not."""
    position, effort = _motion(6.0)
    time = PERIOD * np.arange(54_000)
    small = position[-1] + 5.0e-6 * (1.0 - np.cos(6.0 * time)), 1.0 - np.cos(6.0 * time)
    log = _joined((position, effort), small)
    deflection = 5.0e-5

    def settled(parts: Sequence[Recording]) -> int:
        return sum(int(piece.settled(deflection).sum()) for piece in prepare_all(parts, CORNER, EffectTerms()))

    whole = settled([log])
    _cut(monkeypatch)
    (parts,) = parts_of_long([log], CORNER, EffectTerms())
    assert len(parts) == 2 and parts[1].start < 6.0
    assert settled(parts) > 0.97 * whole


@pytest.mark.parametrize(("before", "motion", "after"), [(6.3, 2.5, 90.0), (0.0, 6.0, 93.0)])
def test_a_little_motion_in_much_rest(
    before: float, motion: float, after: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The rows after the first stroke are shared between the fit and the validation, in whatever parts they lie."""
    position, effort = _motion(motion)
    half = len(position) // 2
    last = half + int(np.argmax(np.abs(position[half:-100])))  # a reversal: the effort of the elements remains
    near = slice(last - 20, last + 20)
    acceleration = 2.0 * np.polyfit(PERIOD * np.arange(40), position[near], 2)[0]
    of_elements = float(np.mean(effort[near])) - TRUE.mass * acceleration
    stopped = _rest(after, 4, float(position[last]), of_elements)
    log = _joined(_rest(before, 3), (position[:last], effort[:last]), stopped)
    _cut(monkeypatch)
    found = identify([log], START, IdentifyOptions(count=2, cutoff=CORNER))
    assert 0.0 < found.held_out_error < 0.3
    assert found.parameters.scalars[MASS] == pytest.approx(10.0, rel=0.2)  # the filters ring at the sudden stop


def test_a_log_without_long_strokes_stays_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """After a motion one way, once, no stroke is long: there is no place to cut at."""
    time = PERIOD * np.arange(60_000)
    log = Recording("log", PERIOD, 0.01 * np.tanh(time - 1.0) + 1.0e-5 * np.sin(20.0 * time), np.sin(time))
    _cut(monkeypatch)
    assert parts_of_long([log], CORNER, EffectTerms()) == [[log]]


def test_both_sides_of_the_validation_have_rows() -> None:
    """Parts without rows to use have no chunk of their own, and no part is a chunk as a whole."""
    masks = [np.zeros(500, dtype=bool) for _ in range(30)]
    masks[2][:] = True
    numbers = np.concatenate(chunk_numbers(masks, 30))
    used = numbers[np.concatenate(masks)]
    assert np.array_equal(np.unique(used), np.arange(30))
    assert np.ptp(np.bincount(used)) <= 1
    assert np.all(np.diff(numbers) >= 0)


def test_clusters_run_over_joined_parts() -> None:
    """Rows in two parts have the covariance that they have in one piece, with a cluster on both sides of the cut."""
    rng = np.random.default_rng(5)
    jacobian, residual, cluster = rng.normal(size=(400, 2)), rng.normal(size=400), np.arange(400) // 100
    whole, cut = (confidence._Sandwich(2) for _ in range(2))
    whole.add(jacobian, residual, cluster)
    for rows in (slice(0, 150), slice(150, 400)):
        cut.add(jacobian[rows], residual[rows], cluster[rows])
    assert cut.clustered() == pytest.approx(whole.clustered(), rel=1e-9)


def test_travel_is_that_of_the_uncut_piece(monkeypatch: pytest.MonkeyPatch) -> None:
    """Strokes with short ways back move on through the whole range, of which a part shows little."""
    time = PERIOD * np.arange(60_000)
    position = 1.0e-3 * time + 4.0e-3 * np.sin(2.0 * np.pi * 0.5 * time)
    log = Recording("log", PERIOD, position, np.sin(time))
    whole = scales_of(prepare_all([log], CORNER, EffectTerms())).travel
    _cut(monkeypatch)
    (parts,) = parts_of_long([log], CORNER, EffectTerms())
    data = prepare_all(parts, CORNER, EffectTerms())
    assert max(float(np.ptp(piece.position)) for piece in data) < 0.5 * whole
    assert scales_of(data).travel == pytest.approx(whole, rel=1e-3)
    assert scales_of(data[:1]).travel == scales_of(data).travel


def test_a_trace_of_two_pieces_has_the_times_of_each(log: Recording, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each piece is cut, and its trace counts from its own start, whenever that was."""
    found = identify([log], START, IdentifyOptions(count=2, cutoff=CORNER))
    moving = log.part(20_000, 60_000)
    pieces = [moving.part(0, 18_000), replace(moving.part(20_000, 40_000), start=1000.0)]
    whole = traces_of(found, START, pieces, []).learnt
    _cut(monkeypatch)
    for trace, uncut, piece in zip(traces_of(found, START, pieces, []).learnt, whole, pieces, strict=True):
        assert uncut.time[0] <= trace.time[0] < 3.0
        assert uncut.time[-1] - 0.2 < trace.time[-1] <= uncut.time[-1] + 0.2
        at: Floats = np.interp(trace.time, piece.time, piece.position)
        assert np.max(np.abs(trace.position - at)) < 1.0e-5
