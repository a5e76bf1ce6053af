"""The workflow: refit the nominal model, calibrate on null twins, name, refit fully, repeat, judge on held-out data."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from sgms_observer.discrepancy import audit
from sgms_observer.discrepancy.decide import (
    ALARM_GAIN,
    COARSE_ALARM,
    LOUD,
    NAMING,
    Round,
    alarm_threshold,
    judge,
    verdict_of,
)
from sgms_observer.discrepancy.fit import ELEMENT_SLACK, Judged, Refit, Refits, kept, refit
from sgms_observer.discrepancy.gate import Gate, floor_of
from sgms_observer.discrepancy.lateness import late_effort
from sgms_observer.discrepancy.model import KNEE, VISCOUS, Model, largest_reach, predict
from sgms_observer.discrepancy.motion import HELD, Motion, motion_of
from sgms_observer.discrepancy.name import candidates
from sgms_observer.discrepancy.noise import fit_noise
from sgms_observer.discrepancy.prune import pruned
from sgms_observer.discrepancy.record import Record
from sgms_observer.discrepancy.rename import renamed
from sgms_observer.discrepancy.screen import Screen
from sgms_observer.discrepancy.sharp import sharpened
from sgms_observer.discrepancy.structure import excess, frequencies
from sgms_observer.discrepancy.timing import NOT_HELD, timing
from sgms_observer.discrepancy.tolerance import Deviation, named_deviation
from sgms_observer.discrepancy.twins import Calibration, calibrate
from sgms_observer.effects.catalogue import effect
from sgms_observer.effects.catalogue import names as catalogue_names
from sgms_observer.settings.axis import AxisSettings, EffectSettings

Floats = NDArray[np.float64]
Report = Callable[[str, float], None]

MOST_EFFECTS = 3
LEAST_NOISE = 1.0e-3
"""Least rms noise of a measured force, as a share of the effort."""
RETIMED = 0.01
"""The effort's timing is read again once an effect is found, if it moves by this many samples."""
HARD = 1.2
"""Hard limit of parameters that have swallowed an effect, in tolerances."""
BEYOND_BELIEF = 2.5
"""A refit that moves a friction parameter by this many tolerances has swallowed an effect: the tolerance is then kept
hard while effects are named."""
BLIND = 0.1
"""An encoder whose grid is coarser than told, and this share of the contact's largest reach, does not show the motion
that the contact felt: nothing else is named until its resolution is set right."""
NEVER_SEARCHED = ("actuator_gain", "mass_error", "quantisation")
"""Effects that are judged by the parameters' tolerance or read off the data, not by the residual."""


@dataclass(frozen=True)
class Options:
    """How to run.

    Attributes:
        tolerance: largest relative error of the nominal parameters that their owner expects.
        seed: of all chance.
        workers: threads.
    """

    tolerance: float = 0.05
    seed: int = 1
    workers: int = 2


@dataclass(frozen=True)
class Diagnosis:
    """Everything the run decided.

    Attributes:
        verdict: see docs/discrepancy.md.
        nominal: the given model without its effects.
        own: the effects it was given with.
        before: refit of the nominal model alone, with its own number of elements.
        after: refit with the effects that were found; ``before`` when there are none.
        rounds: passes through the loop.
        calibration: twins of the nominal model.
        deviation: mass error or actuator gain, or None.
        resolution: coarser encoder step than the settings say [m], or None.
        judged: recordings as judged in the end.
        motions: recordings to learn from.
        held_out: recordings to judge on.
        notes: sentences of the audit.
        limit: how far parameters were let go, or None.
        gate: recordings to judge on with their floor.
        has_bent: whether nothing kept the refit from moving elements beyond belief.
    """

    verdict: str
    nominal: Model
    own: tuple[EffectSettings, ...]
    before: Refit
    after: Refit
    rounds: tuple[Round, ...]
    calibration: Calibration
    deviation: Deviation | None
    resolution: float | None
    judged: Judged
    motions: tuple[Motion, ...]
    held_out: tuple[Motion, ...]
    notes: tuple[str, ...] = field(default=())
    limit: float | None = None
    gate: Gate | None = None
    has_bent: bool = False


def judged_with(motions: Sequence[Motion], model: Model) -> Judged:
    """Return motions with the noise that the model's residual has."""
    noises, weights = [], []
    for motion in motions:
        prediction = predict(model, motion)
        doubt = motion.thinned(prediction.doubt)
        least = LEAST_NOISE * float(np.std(motion.effort))
        noise = fit_noise(motion.low_pass(prediction.residual), doubt, motion.residual_period, least)
        noises.append(noise)
        weights.append(noise.weights(doubt))
    return Judged(tuple(motions), tuple(noises), tuple(weights))


def diagnose(
    records: Sequence[Record],
    holdouts: Sequence[Record],
    axis: AxisSettings,
    options: Options,
    report: Report = lambda text, share: None,
) -> Diagnosis:
    """Find what the model of an axis misses.

    Where no effect explains what is left, and the refit had moved elements beyond belief, they may have swallowed what
    is searched for: then the search is made once more with a hard limit, and counts if it finds a name.

    Args:
        records: recordings to learn from.
        holdouts: recordings to judge on; a part of the first ones if empty.
        axis: settings with the nominal model.
        options: how to run.
        report: called with what is being done and the share that is done.

    Raises:
        DataError: the recordings cannot be judged at all.
    """
    found = _searched(records, holdouts, axis, options, report, is_limited=False)
    if found.verdict == "unknown_effect" and found.has_bent:
        again = _searched(records, holdouts, axis, options, report, is_limited=True)
        found = again if again.verdict in NAMING else found
    return found


def _searched(
    records: Sequence[Record],
    holdouts: Sequence[Record],
    axis: AxisSettings,
    options: Options,
    report: Report,
    is_limited: bool,
) -> Diagnosis:
    """Run the workflow once; arguments as ``diagnose``, and whether the refit is limited from the beginning."""
    tolerance, workers = options.tolerance, options.workers
    report("audit", 0.0)
    lag = told = HELD if axis.filter.effort_is_held else 0.0
    motions = tuple(motion_of(record, lag) for record in records)
    notes, is_poor = audit.findings(motions, axis)
    resolution = audit.coarser_grid(motions, axis.stage.encoder.resolution)
    nominal, own = replace(Model.of(axis), effects=()), axis_effects(axis)
    fine = nominal.refined()
    report("refit of the nominal model", 0.03)
    judged = judged_with(motions, fine.with_effects(own))
    found = refit(judged, fine, tolerance, own, None, kept(own), 6)
    unseen = tuple(motion_of(record, lag) for record in holdouts)
    sharp = sharpened(judged, fine, tolerance, found, kept(own), None, unseen)
    if sharp is not None:
        fine, nominal = replace(fine, is_sharp=True), replace(nominal, is_sharp=True)
        judged = judged_with(motions, sharp.model)
        found = refit(judged, fine, tolerance, own, sharp.logs, kept(own), 4)
    for _ in range(2):
        moved = timing(judged, found, lag, told)
        if moved == lag:
            break
        lag = moved
        motions = tuple(motion_of(record, lag) for record in records)
        judged = judged_with(motions, found.model)
        found = refit(judged, fine, tolerance, found.effects, found.logs, kept(own), 3)
    held_out = tuple(motion_of(record, lag) for record in holdouts)
    if axis.filter.effort_is_held and lag < NOT_HELD:
        notes.append("the effort acts at its stamp, not until the next one: set filter.effort_is_held to false")
    judged = judged_with(motions, found.model)
    found = refit(judged, fine, tolerance, found.effects, found.logs, kept(own), 4)
    limit = None
    is_hard = is_limited or _is_beyond_belief(found, fine, tolerance)
    has_bent = not is_hard and np.max(np.abs(found.logs[KNEE + 1 :])) > BEYOND_BELIEF * tolerance * ELEMENT_SLACK
    if is_hard:
        limit = HARD * tolerance
        judged = judged_with(motions, fine.with_effects(own))
        for _ in range(2):
            found = refit(judged, fine, tolerance, found.effects, found.logs, kept(own), 9, None, limit)
            judged = judged_with(motions, found.model)
    floor = floor_of(held_out or motions, found.model, judged.noise, options.seed)
    gate = Gate(held_out or motions, floor, bool(held_out))
    names = [name for name in catalogue_names() if name not in NEVER_SEARCHED]
    names = [name for name in names if name not in {item.name for item in own}]
    rounds: list[Round] = []
    calibration: Calibration | None = None
    current = found
    if is_poor or (resolution is not None and resolution > BLIND * largest_reach(nominal.friction)):
        names = []
    for number in range(MOST_EFFECTS + 1):
        report(f"first look at {len(names)} effects", 0.15 + 0.2 * number)
        screen = Screen(judged, current, tolerance, names)
        if calibration is None:
            calibration = calibrate(
                screen, options.seed, workers, lambda share: report("null twins", 0.2 + 0.1 * share)
            )
        gains = screen.gains()
        scores = {name: calibration.standardised(name, gains[name][0]) for name in names}
        frequency = frequencies(judged)
        now = excess(current.residual, frequency)
        raised = COARSE_ALARM if resolution is not None else 1.0
        strong = [
            name
            for name in names
            if scores[name] > raised * alarm_threshold(name, calibration) and gains[name][0] > ALARM_GAIN
        ]
        is_loud = now.sum() > 0.0 and resolution is None and bool(names)
        is_loud = is_loud and gate.gap(current.model) > LOUD * gate.floor
        if not (strong or is_loud) or number == MOST_EFFECTS:
            rounds.append(Round(screen, scores, (), now, now, False, ()))
            break
        report("full refits", 0.32 + 0.2 * number)
        listed = candidates(screen, fine, current, workers, limit)
        step = judge(screen, scores, listed, now, current, rounds, strong, gate)
        rounds.append(step)
        if not step.accepted:
            break
        best = step.listed[0].refit
        judged = judged_with(motions, best.model)
        current = refit(judged, fine, tolerance, best.effects, best.logs, kept(best.effects), 6, None, limit)
        moved = timing(judged, current, lag, told)
        if abs(moved - lag) > RETIMED:
            lag = moved
            motions = tuple(motion_of(record, lag) for record in records)
            held_out = tuple(motion_of(record, lag) for record in holdouts)
            gate = replace(gate, motions=held_out or motions)
            judged = judged_with(motions, current.model)
            current = refit(
                judged, fine, tolerance, current.effects, current.logs, kept(current.effects), 4, None, limit
            )
        sharp = sharpened(judged, fine, tolerance, current, kept(current.effects), limit, gate.motions)
        if sharp is not None:
            fine, nominal = replace(fine, is_sharp=True), replace(nominal, is_sharp=True)
            judged = judged_with(motions, sharp.model)
            current = refit(judged, fine, tolerance, sharp.effects, sharp.logs, kept(sharp.effects), 6, None, limit)
            found = refit(judged, fine, tolerance, found.effects, found.logs, kept(own), 6, None, limit)
        gate = replace(gate, floor=min(gate.floor, floor_of(gate.motions, current.model, judged.noise, options.seed)))
        names = [name for name in names if name != step.listed[0].name]
    assert calibration is not None
    refits = Refits(judged, fine, tolerance, limit)
    current, rounds = pruned(refits, current, rounds, gate)
    current, rounds = renamed(refits, current, rounds, gate, workers)
    late = late_effort(fine, current, rounds, calibration, gate, limit)
    if late is not None:
        rounds.insert(len(rounds) - 1, late)  # the last one is the look in which it was seen
        best = late.listed[0].refit
        current = refit(judged, fine, tolerance, best.effects, best.logs, kept(best.effects), 6, None, limit)
    report("refit of the model as it is", 0.9)
    before = refit(judged, nominal, tolerance, found.effects, None, kept(own), 12)
    after = before
    if len(current.effects) > len(own):
        after = refit(judged, nominal, tolerance, current.effects, None, kept(current.effects), 16)
    if limit is not None and _is_beyond_belief(after, nominal, tolerance):
        before = refit(judged, nominal, tolerance, found.effects, None, kept(own), 9, None, limit)
        after = before
        if len(current.effects) > len(own):
            after = refit(judged, nominal, tolerance, current.effects, None, kept(current.effects), 16, None, limit)
    else:
        limit = None
    if nominal.is_sharp:
        notes.append(
            "the contact sticks and slips more sharply than S-GMS lets it, and was judged so:"
            " model: gms with a high attraction_rate may fit better"
        )
    if rounds[-1].listed and any(item.accepted for item in rounds):
        notes.append("something still stands out of the noise that no effect explains well enough to be named")
    is_clear = len(current.effects) == len(own) and resolution is None
    deviation = None if not is_clear else named_deviation(nominal, after, tolerance)
    verdict = verdict_of(rounds, current, deviation, resolution, is_poor, gate, found)
    return Diagnosis(
        verdict, nominal, own, before, after, tuple(rounds), calibration, deviation, resolution, judged, motions,
        held_out, tuple(notes), limit, gate, bool(has_bent),
    )  # fmt: skip


def _is_beyond_belief(found: Refit, nominal: Model, tolerance: float) -> bool:
    """Return whether the refit moved friction parameters so far that it must have swallowed an effect."""
    deviation = named_deviation(nominal, found, tolerance)
    common = -np.log(deviation.value) if deviation is not None and deviation.name == "actuator_gain" else 0.0
    moved = found.logs[VISCOUS : KNEE + 1] - common * np.array([1.0, 1.0, 1.0, 0.0])
    return bool(np.max(np.abs(moved)) > BEYOND_BELIEF * tolerance)


def axis_effects(axis: AxisSettings) -> tuple[EffectSettings, ...]:
    """Return the effects an axis already has, with all their values."""
    return tuple(EffectSettings(item.name, item.values or effect(item.name).defaults) for item in axis.effects)
