"""Diagnose recordings: read them, run the workflow, test the feedforward, and write the files of the answer."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy import signal
from threadpoolctl import threadpool_limits

from sgms_observer.application.bag_info import refuse_learnt_from
from sgms_observer.arrays import Floats
from sgms_observer.bags.bag_folder import refuse_bag_folder, refuse_own_recording
from sgms_observer.diagnosis.answer import Answer, answer_of
from sgms_observer.diagnosis.compensation_check import (
    SKIPPED,
    CompensationCheck,
    can_look_ahead,
    check_compensation,
    with_whole_compensation,
)
from sgms_observer.diagnosis.criteria import Test, at_most
from sgms_observer.diagnosis.diagnosis import Options
from sgms_observer.diagnosis.gap import rms
from sgms_observer.diagnosis.motion import EDGE_TIME, long_enough, motion_of
from sgms_observer.diagnosis.recorded_controller import RecordedController, recorded_controller
from sgms_observer.diagnosis.report import Run, diagnosis_page
from sgms_observer.diagnosis.residual_log import RESIDUAL_LOG, write_residual_log
from sgms_observer.diagnosis.result import AUGMENTED, augmented_text, write_augmented, write_result
from sgms_observer.diagnosis.traces import traces_of
from sgms_observer.diagnosis.tracking import MIN_COMPENSATED_SHARE, PredictedTracking, TrackingError
from sgms_observer.diagnosis.workflow import diagnose_from, fitted_file
from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.offline.band import choose_band, refuse_cutoff
from sgms_observer.offline.recording import Recording, read_recordings
from sgms_observer.report.page import write_page
from sgms_observer.settings.axis import AxisSettings, Settings
from sgms_observer.settings.load import load_settings, settings_from_tree
from sgms_observer.settings.node_parameters import refuse_missing
from sgms_observer.settings.units import Units
from sgms_observer.settings.yaml_text import parse
from sgms_observer.whole_file import try_folder
from sim_plant.record import StageRecord
from sim_plant.reference_file import PiecewiseCubic, through_points
from sim_plant.stage import SimulatedStage

MAX_SAMPLES = 200_000
MAX_SECONDS = 60.0
"""Largest number of samples and time [s] of the simulated tracking error, from the end of the recording."""
HOLD = 1.5
"""Time from a sample to the middle of the interval in which its compensation acts, in samples."""
SUBSTEPS = 1
"""Integration steps per 0.1 ms: the errors differ from those with ten by less than a thousandth."""

FILES = ("result.json", AUGMENTED, "report.html", RESIDUAL_LOG)
"""Files of a diagnosis in its folder."""


def predict_tracking(
    record: Recording, given: AxisSettings, augmented: AxisSettings, band: float
) -> PredictedTracking | None:
    """Return the tracking errors that the augmented model predicts; None where the simulated loop does not stay finite.

    The stage has the mass, friction and effects of ``augmented``, the controller of ``given`` and the encoder of the
    recording. Its effort limit is never below an effort that was recorded. Where it does not follow as the machine did,
    it gets the controller that the recording shows, if it follows with that one as the machine did. Along a reference
    the compensation is a feedforward: it is computed from the run without it.

    Args:
        record: gives the motion, the rate and the encoder.
        given: settings as they were given.
        augmented: the same with the found effects and values.
        band: a measured motion is filtered at a multiple of this frequency before the stage follows it [Hz].
    """
    part = record.part(len(record) - min(len(record), MAX_SAMPLES, round(MAX_SECONDS / record.period)), len(record))
    loop = _Loop(part, _truth(part, given, augmented), band)
    first = loop.tracking(given, augmented)
    if part.whole_reference is None or (first is not None and first.agrees):
        return first
    compensation = AxisObserver(with_whole_compensation(augmented), part.period).step(part.samples).compensation
    shown = recorded_controller(part, augmented.mass, loop.truth.stage.controller, np.nan_to_num(compensation), band)
    if shown is None:
        return first
    second = loop.with_controller(shown).tracking(given, augmented)
    return second if second is not None and second.agrees else first


@dataclass(frozen=True)
class _Loop:
    """A simulated loop along a recording.

    Attributes:
        record: gives the motion, the rate and the encoder.
        truth: the axis whose stage is simulated.
        band: a measured motion is filtered at a multiple of this frequency before the stage follows it [Hz].
        shown: the controller, where it is the one that the recording shows.
    """

    record: Recording
    truth: AxisSettings
    band: float
    shown: RecordedController | None = None

    def with_controller(self, shown: RecordedController) -> _Loop:
        """Return the loop with the controller that the recording shows."""
        stage = replace(self.truth.stage, controller=shown.settings)
        truth = replace(self.truth, mass=stage.mass, stage=stage)  # its gains are scaled with the mass of the stage
        return replace(self, truth=truth, shown=shown)

    def tracking(self, given: AxisSettings, augmented: AxisSettings) -> PredictedTracking | None:
        """Return the tracking errors without compensation and with that of both models; None if one is not finite.

        Args:
            given: settings as they were given.
            augmented: the same with the found effects and values.
        """
        record, period = self.record, self.record.period
        count = len(record)
        counted = slice(round(SKIPPED / period), count - round(EDGE_TIME / period))
        reference = record.whole_reference
        runs, share = [self._run(0.0)], 1.0
        for axis in (given, augmented):
            if np.all(np.isfinite(runs[0].position)):
                compensation, friction = _compensation(axis, self.truth, runs[0], period)
                whole = axis.compensation.gain * rms([friction[counted]])
                share = rms([compensation[counted]]) / whole if whole > 0.0 else 1.0
                runs.append(self._run(compensation))
        errors = [(run.position - run.reference_position)[counted] for run in runs]
        if len(errors) < 3 or not all(np.all(np.isfinite(error)) for error in errors):
            return None
        recorded = None
        if reference is not None:
            errors.append((record.position - reference)[counted])
            recorded = TrackingError.of(errors[-1])
        without, given_error, augmented_error = (TrackingError.of(error) for error in errors[:3])
        return PredictedTracking(
            without,
            given_error,
            augmented_error,
            recorded,
            record.duration,
            record.time[counted],
            tuple(errors),
            self.shown,
            share,
        )

    @cached_property
    def _followed(self) -> PiecewiseCubic:
        """The recorded reference, or the measured motion without its noise."""
        reference, moves = self.record.whole_reference, self.truth.stage.reference
        path = _smooth(self.record, self.band) if reference is None else reference
        return through_points(
            self.record.time, path, "cubic",
            velocity=moves.velocity, acceleration=moves.acceleration, jerk=moves.jerk,
        )  # fmt: skip

    def _run(self, compensation: float | Floats) -> StageRecord:
        """Return a run with a compensation [N]."""
        feedforward = compensation if self.shown is None else compensation + self.shown.feedforward
        stage = SimulatedStage(self.truth, self.record.period, reference=self._followed)
        return stage.step(len(self.record), feedforward)


def _smooth(record: Recording, band: float) -> Floats:
    """Return the measured motion without its noise [m]."""
    return np.asarray(signal.sosfiltfilt(motion_of(record, band=band).smoothing, record.position))


def _truth(record: Recording, given: AxisSettings, augmented: AxisSettings) -> AxisSettings:
    """Return the axis whose stage is the augmented one."""
    noise = math.sqrt(max(record.position_noise**2 - record.encoder_step**2 / 12.0, 0.0))
    controller, largest = given.stage.controller, float(np.max(np.abs(record.effort)))
    return replace(
        given,
        stage_friction=augmented.friction,
        stage_effects=augmented.effects,
        stage=replace(
            given.stage,
            mass=augmented.mass,
            substeps=given.stage.substeps if given.stage.actuation_delay else SUBSTEPS,  # a delay is whole steps
            encoder=replace(given.stage.encoder, resolution=record.encoder_step, noise=noise),
            controller=replace(controller, effort_limit=max(controller.effort_limit, largest)),
            accept_compensation=True,
        ),
    )


def _compensation(axis: AxisSettings, truth: AxisSettings, plain: StageRecord, period: float) -> tuple[Floats, Floats]:
    """Return the compensation that acts at each sample of a run, one sample after it was computed, and the friction
    that the observer estimates [N]."""
    look_ahead = HOLD * period + truth.stage.actuation_delay
    switched_on = replace(axis.compensation, enabled=True, look_ahead=look_ahead)
    estimates = AxisObserver(replace(axis, compensation=switched_on), period).step(plain.samples)
    return np.concatenate(([0.0], np.nan_to_num(estimates.compensation[:-1]))), np.nan_to_num(estimates.friction)


@dataclass(frozen=True)
class DiagnoseRequest:
    """Inputs and options of a diagnosis.

    Attributes:
        bags: fitted recordings.
        config: parameter file.
        out: folder of ``FILES``.
        holdout: recordings to evaluate the model on, never fitted to.
        axis: axis to diagnose; the first of the file if None.
        topics: names of the input topics where they differ.
        tolerance: how far the file's mass and friction may be off, as a share.
        cutoff: upper corner of the band [Hz]; 0 chooses it from rate and encoder.
        seed: of all random numbers.
        workers: threads.
    """

    bags: Sequence[str]
    config: str
    out: str
    holdout: Sequence[str] = ()
    axis: str | None = None
    topics: dict[str, str] = field(default_factory=dict)
    tolerance: float = 0.05
    cutoff: float = 0.0
    seed: int = 1
    workers: int = 1


@dataclass(frozen=True)
class DiagnoseResult:
    """The answer, checks of observer and compensation before and after, notes on the recordings, and units."""

    answer: Answer
    checks: tuple[CompensationCheck, ...]
    tracking: PredictedTracking | None
    notes: tuple[str, ...]
    units: Units


def diagnose_bags(request: DiagnoseRequest, show: Callable[[float], None] = lambda share: None) -> DiagnoseResult:
    """Run the diagnosis and write its files.

    Args:
        request: what to diagnose.
        show: called with the completed share, 0 to 1.

    Raises:
        SgmsError: something cannot be read, written or made sense of.
    """
    settings = load_settings(request.config)
    axis = settings.wanted_axes([request.axis] if request.axis else (), request.config)[0]
    refuse_missing(settings, [axis])
    refuse_cutoff(request.cutoff)
    other = settings.coupled_to(axis)
    refuse_learnt_from(request.bags, request.holdout)
    refuse_own_recording(request.out, [*request.bags, *request.holdout])
    refuse_bag_folder(request.out)
    try_folder(request.out)
    notes: list[str] = []

    def read(bags: Sequence[str]) -> list[Recording]:
        found = []
        for bag in bags:
            pieces = long_enough(read_recordings(bag, axis, other, topics=request.topics))
            notes.extend(pieces.notes)
            found += list(pieces)
        return found

    learn, judge = read(request.bags), read(request.holdout)
    band = choose_band([*learn, *judge], axis, request.cutoff)
    notes.append(band.sentence())
    options = Options(request.tolerance, request.seed, request.workers, band.corner)
    with threadpool_limits(
        limits=1
    ):  # the workers are threads; threads of the libraries would only wait for each other
        folder = Path(request.out)
        step = _CompensationStep((judge or learn)[0], settings, axis, options)
        answer, written, after, step = _diagnosed(learn, judge, step, show)
        checks = (step.before, after)
        tracking = predict_tracking(step.record, axis, written, band.corner)
        caution = "" if tracking is None else tracking.caution(axis.units)
        if tracking is not None and tracking.recorded is None:
            notes.append(caution)
        elif caution:
            answer = replace(answer, warnings=(*answer.warnings, caution))
        if tracking is not None and tracking.compensated_share < MIN_COMPENSATED_SHARE:
            notes.append(tracking.limits_sentence(written.compensation, axis.units))
    traces = traces_of(answer)
    run = Run(axis, options, [*request.bags, *request.holdout], notes)
    page = diagnosis_page(answer, traces, checks, tracking, run)
    write_augmented(answer, settings, axis.name, folder)  # all files at the end: a signal before leaves none of them
    write_result(answer, checks, tracking, axis.units, folder)
    write_residual_log(traces, axis.name, folder)
    write_page(page, folder)
    return DiagnoseResult(answer, checks, tracking, tuple(notes), axis.units)


@dataclass(frozen=True)
class _CompensationStep:
    """Computes the friction that the feedforward of a model does not cancel, over one recording.

    Attributes:
        record: the recording.
        settings: of all axes, as given.
        axis: the diagnosed axis.
        options: of the diagnosis.
    """

    record: Recording
    settings: Settings
    axis: AxisSettings
    options: Options

    @cached_property
    def before(self) -> CompensationCheck:
        """Return the check of observer and compensation with the given model."""
        return self.of(self.axis)

    def along(self, record: Recording) -> _CompensationStep:
        """Return the step over another recording; the same step if it is the same recording."""
        return self if record is self.record else replace(self, record=record)

    def of(self, axis: AxisSettings) -> CompensationCheck:
        """Return the check of observer and compensation with a model."""
        return check_compensation(self.record, axis, self.options.band, self.options.criteria.block)

    def written(self, answer: Answer) -> AxisSettings:
        """Return the axis as the augmented file of an answer has it; the file itself is written with the others."""
        folder = self.settings.folder  # it exists, so relative file names work
        text = augmented_text(answer, self.settings, self.axis.name, Path(folder))
        settings = settings_from_tree(parse(text, AUGMENTED), AUGMENTED, folder=folder)
        return next(one for one in settings.axes if one.name == self.axis.name)

    def growth(self, of: str, later: CompensationCheck, earlier: CompensationCheck) -> Test:
        """Return the test that the feedforward of the later model leaves no more than that of the earlier one."""
        title = "friction not cancelled by the feedforward: z-score of its growth"
        return at_most(of, title, later.growth(earlier), self.options.criteria.min_z_score)

    def worst(self, written: AxisSettings, later: CompensationCheck, answer: Answer) -> Test | None:
        """Return the failed test of the added effect whose feedforward increases the residual most, or None."""
        tests = []
        for name in (*(item.settings.name for item in answer.effects), *answer.diagnosis.unnamed_contact_effects):
            others = replace(written, effects=tuple(one for one in written.effects if one.name != name))
            tests.append(self.growth(name, later, self.of(others)))
        return max((test for test in tests if not test.passed), key=lambda test: test.value, default=None)


def _diagnosed(
    learn: Sequence[Recording], judge: Sequence[Recording], step: _CompensationStep, show: Callable[[float], None]
) -> tuple[Answer, AxisSettings, CompensationCheck, _CompensationStep]:
    """Return an answer whose feedforward leaves no more than that of the given file; the axis with it; what it leaves;
    the step with the recording as it was judged, whose positions may be shifted.

    An effect that leaves a predictable part over its own coordinates is withdrawn, and so is one whose feedforward
    increases the residual. If no effect does, the changes of the file's values are withdrawn. If those do not either,
    nothing is named or learnt.
    """
    options, axis, refused = step.options, step.axis, list[Test]()
    done = 0.0

    def go_on(_: str, share: float) -> None:
        nonlocal done  # a repeated search continues the progress of the first one
        done = max(done, share)
        show(done)

    file = fitted_file(learn, judge, axis, options, go_on)
    while True:
        found = diagnose_from(file, options, go_on)
        recordings = found.final_state.recordings
        step = step.along((*recordings.holdouts, *recordings.records)[0])
        answer = answer_of(found, axis, options)
        if answer.doubtful:
            refused.append(max(answer.doubtful, key=lambda test: test.excess))
            options = replace(options, excluded=options.excluded | {refused[-1].of})
            continue
        written = step.written(answer)
        later = step.of(written)
        test = step.growth("model", later, step.before)
        contradicts = not test.passed and can_look_ahead(written)
        worst = step.worst(written, later, answer) if contradicts else None
        if not contradicts or (worst is None and not found.changes):
            break
        refused.append(worst or replace(test, of=", ".join(sorted(found.changes))))
        options = replace(options, excluded=options.excluded | (frozenset([worst.of]) if worst else found.changes))
    if contradicts and (answer.effects or answer.learnt):
        answer = answer_of(found, axis, options, test)
        written = step.written(answer)
        later = step.of(written)
    else:
        answer = replace(answer, tests=(*answer.tests, test))
    return replace(answer, tests=(*answer.tests, *refused)), written, later, step
