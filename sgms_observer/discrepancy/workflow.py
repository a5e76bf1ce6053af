"""The workflow: refit the nominal model, calibrate on null twins, name, refit fully, repeat, judge on held-out data."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

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
from sgms_observer.discrepancy.fit import ELEMENT_SLACK, Judged, Refit, Refits
from sgms_observer.discrepancy.gate import Gate
from sgms_observer.discrepancy.homing import unhomed
from sgms_observer.discrepancy.lateness import late_effort
from sgms_observer.discrepancy.model import KNEE, Model, largest_reach
from sgms_observer.discrepancy.motion import HELD, Motion
from sgms_observer.discrepancy.name import POLISH, candidates
from sgms_observer.discrepancy.prune import pruned
from sgms_observer.discrepancy.record import Record
from sgms_observer.discrepancy.rename import renamed
from sgms_observer.discrepancy.screen import Screen
from sgms_observer.discrepancy.state import LIMITED, STEPS, Recordings, State, started
from sgms_observer.discrepancy.structure import excess, frequencies
from sgms_observer.discrepancy.timing import NOT_HELD
from sgms_observer.discrepancy.tolerance import BEYOND_BELIEF, Deviation, is_beyond_belief, named_deviation
from sgms_observer.discrepancy.twins import Calibration, calibrate
from sgms_observer.effects.catalogue import effect
from sgms_observer.effects.catalogue import names as catalogue_names
from sgms_observer.settings.axis import AxisSettings, EffectSettings

Report = Callable[[str, float], None]

MOST_EFFECTS = 3
WITH_EFFECTS = 16
"""Steps of the last fit, with the owner's own elements and the effects."""
HARD = 1.2
"""Hard limit of parameters that have swallowed an effect, in tolerances."""
BLIND = 0.1
"""An encoder whose grid is coarser than told, and this share of the contact's largest reach, does not show the motion
that the contact felt: nothing else is named until its resolution is set right."""
NEVER_SEARCHED = (
    "actuator_gain", "gravity", "mass_error", "quantisation", "learnt_map", "learnt_map_2", "learnt_map_3",
)  # fmt: skip
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
        unhomed: a sentence for each recording to judge on that counts its position from elsewhere.
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
    unhomed: tuple[str, ...] = ()


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
    report("audit", 0.0)
    told = HELD if axis.filter.effort_is_held else 0.0
    recordings = Recordings(tuple(records), tuple(holdouts), told, told)
    notes, is_poor = audit.findings(recordings.motions, axis)
    resolution = audit.coarser_grid(recordings.motions, axis.stage.encoder.resolution)
    nominal, own = replace(Model.of(axis), effects=()), axis_effects(axis)
    report("refit of the nominal model", 0.03)
    state = started(recordings, nominal, own, options.tolerance, options.seed)
    if axis.filter.effort_is_held and state.recordings.lag < NOT_HELD:
        notes.append("the effort acts at its stamp, not until the next one: set filter.effort_is_held to false")
    is_hard = is_limited or is_beyond_belief(state.found, state.refits.nominal, options.tolerance)
    moved = np.max(np.abs(state.found.logs[KNEE + 1 :]))
    has_bent = not is_hard and moved > BEYOND_BELIEF * options.tolerance * ELEMENT_SLACK
    if is_hard:
        state = state.limited(HARD * options.tolerance)
    state = state.with_floor()
    names = [name for name in catalogue_names() if name not in NEVER_SEARCHED]
    names = [name for name in names if name not in {item.name for item in own}]
    if is_poor or (resolution is not None and resolution > BLIND * largest_reach(nominal.friction)):
        names = []
    state, rounds, calibration = _looked(state, names, resolution is not None, options, report)
    state, rounds = _reconsidered(state, rounds, calibration, options.workers)
    report("refit of the model as it is", 0.9)
    before, after, limit = _as_it_is(state, own)
    if state.nominal.is_sharp:
        notes.append(
            "the contact sticks and slips more sharply than S-GMS lets it, and was judged so:"
            " model: gms with a high attraction_rate may fit better"
        )
    if rounds[-1].listed and any(item.accepted for item in rounds):
        notes.append("something still stands out of the noise that no effect explains well enough to be named")
    elsewhere = unhomed([item.listed[0].refit.model for item in rounds if item.listed], state.gate)
    is_clear = len(state.current.effects) == len(own) and resolution is None
    deviation = None if not is_clear else named_deviation(state.nominal, after, options.tolerance)
    verdict = verdict_of(
        rounds, state.current, deviation, resolution, is_poor, state.gate, state.found, (before, after)
    )
    return Diagnosis(
        verdict, state.nominal, own, before, after, tuple(rounds), calibration, deviation, resolution,
        state.refits.judged, state.recordings.motions, state.recordings.held_out, (*notes, *elsewhere), limit,
        state.gate, bool(has_bent), tuple(elsewhere),
    )  # fmt: skip


def _looked(
    state: State, names: Sequence[str], is_coarse: bool, options: Options, report: Report
) -> tuple[State, list[Round], Calibration]:
    """Look for one effect after another, until nothing stands out or the best candidate is refused.

    Args:
        state: with the nominal refit.
        names: effects to look for.
        is_coarse: whether the encoder is coarser than told.
        options: how to run.
        report: called with what is being done and the share that is done.
    """
    rounds: list[Round] = []
    calibration: Calibration | None = None
    for number in range(MOST_EFFECTS + 1):
        report(f"first look at {len(names)} effects", 0.15 + 0.2 * number)
        judged, current, gate = state.refits.judged, state.current, state.gate
        screen = Screen(judged, current, options.tolerance, names)
        if calibration is None:
            calibration = calibrate(
                screen, options.seed, options.workers, lambda share: report("null twins", 0.2 + 0.1 * share)
            )
        gains = screen.gains()
        scores = {name: calibration.standardised(name, gains[name][0]) for name in names}
        now = excess(current.residual, frequencies(judged))
        raised = COARSE_ALARM if is_coarse else 1.0
        strong = [
            name
            for name in names
            if scores[name] > raised * alarm_threshold(name, calibration) and gains[name][0] > ALARM_GAIN
        ]
        is_loud = now.sum() > 0.0 and not is_coarse and bool(names)
        is_loud = is_loud and gate.gap(current.model) > LOUD * gate.floor
        if not (strong or is_loud) or number == MOST_EFFECTS:
            rounds.append(Round(screen, scores, (), now, now, False, ()))
            break
        report("full refits", 0.32 + 0.2 * number)
        listed = candidates(state.refits, screen, current, options.workers)
        step = judge(screen, scores, listed, now, current, rounds, strong, gate)
        rounds.append(step)
        if not step.accepted:
            break
        state = state.with_effect(step.listed[0].refit)
        names = [name for name in names if name != step.listed[0].name]
    assert calibration is not None
    return state, rounds, calibration


def _reconsidered(
    state: State, rounds: list[Round], calibration: Calibration, workers: int
) -> tuple[State, list[Round]]:
    """Return the state and the rounds after every name was weighed again beside all the others, time last of all."""
    current, rounds = pruned(state.refits, state.current, rounds, state.gate)
    current, rounds = renamed(state.refits, current, rounds, state.gate, workers)
    late = late_effort(state.refits, current, rounds, calibration, state.gate)
    if late is not None:
        rounds.insert(len(rounds) - 1, late)  # the last one is the look in which it was seen
        best = late.listed[0].refit
        current = state.refits.of(best.effects, best.logs, STEPS)
    return replace(state, current=current), rounds


def _as_it_is(state: State, own: Sequence[EffectSettings]) -> tuple[Refit, Refit, float | None]:
    """Return the refits with the owner's own elements, without and with the effects, and their limit if any."""

    def both(refits: Refits, steps: int) -> tuple[Refit, Refit]:
        before = refits.of(state.found.effects, None, steps)
        if len(state.current.effects) == len(own):
            return before, before
        tried = [refits.of(state.current.effects, start, WITH_EFFECTS) for start in (None, before.logs)]
        return before, min(tried, key=lambda fit: fit.cost)

    limited = replace(state.refits, nominal=state.nominal)
    free = replace(limited, limit=None)
    before, after = both(free, POLISH)
    if limited.limit is None or not is_beyond_belief(after, state.nominal, limited.tolerance):
        return before, after, None
    return *both(limited, LIMITED), limited.limit


def axis_effects(axis: AxisSettings) -> tuple[EffectSettings, ...]:
    """Return the effects an axis already has, with all their values."""
    return tuple(EffectSettings(item.name, item.values or effect(item.name).defaults) for item in axis.effects)
