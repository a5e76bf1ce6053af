"""Decisions: which tests a hypothesis has to pass to be named, each with its value and threshold."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sgms_observer.diagnosis.candidates import MOST_COMPARED, Candidate
from sgms_observer.diagnosis.ceiling import FreeForm, free_form
from sgms_observer.diagnosis.coordinates import FREE_FORM
from sgms_observer.diagnosis.criteria import Criteria, Test, at_least, at_most
from sgms_observer.diagnosis.evidence import (
    Improvement,
    held_out_residuals,
    improvement,
    in_blocks,
    learnt_residuals,
    left_out_residuals,
)
from sgms_observer.diagnosis.fit import Judged, Refit, Refits
from sgms_observer.diagnosis.gap import Remainder, residuals, rms, weighted
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import Motion
from sgms_observer.diagnosis.ranges import believable
from sgms_observer.diagnosis.search import CONTACT_SHARE
from sgms_observer.effects.catalogue import effect
from sgms_observer.settings.axis import EffectSettings

Floats = NDArray[np.float64]

START_LAG = 0.01
"""Start of the time in which sliding elements follow the Stribeck curve, where the file's contact has none [s]."""
SLACK_OF_CONTACT = 10.0
"""Factor by which the slip deflections of a contact may differ from the file's."""
LEAST_DELAY = 0.5
"""Shortest delay with a name, in sample periods: whether an effort is held between samples makes as much."""
AT_END = 1.0e-6
"""A parameter lies at the end of its range when it is this near, relative to the end."""
WHOLE_RANGE = ("motion_share", "attraction_rate", "stop")
"""Parameters that may well lie at an end of their range."""
CHANGED = ("changed friction", "changed elements", "unsmoothed contact", "changed contact law")
"""Hypotheses on values of the file, in the order of how much they let go."""


@dataclass(frozen=True)
class Court:
    """The recordings that evidence is taken from.

    Attributes:
        learn: recordings to learn from.
        judge: recordings to judge on; the same where there are no held-out ones.
        judged: ``learn`` with their noise.
        held: held-out recordings with the noise to whiten with; none where there are none.
        floor: rms weighted residual that noise and encoder leave to a perfect model on ``judge`` [N].
        first_gap: the same of the file refitted within its tolerance, before anything was added [N].
        reported_floor, reported_gap: the same two with the weights of the gap as it is reported [N].
        criteria: thresholds.
        seed: of the free-form regression.
    """

    learn: tuple[Motion, ...]
    judge: tuple[Motion, ...]
    judged: Judged
    held: Judged
    floor: float
    first_gap: float
    reported_floor: float
    reported_gap: float
    criteria: Criteria
    seed: int

    @property
    def has_held_out(self) -> bool:
        """Return whether there are recordings that nothing is fitted to."""
        return bool(self.held.motions)

    @property
    def weights(self) -> tuple[Floats, ...]:
        """Return the weights of the samples of ``judge``: what an encoder does not show at rest counts for little."""
        return self.held.weights if self.has_held_out else self.judged.weights

    @property
    def gap_weights(self) -> tuple[Floats, ...]:
        """Return the weights of the samples of ``judge`` in the gap as it is reported."""
        return self.held.gap_weights if self.has_held_out else self.judged.gap_weights

    def rms(self, model: Model) -> float:
        """Return the rms weighted residual of a model on ``judge`` [N]."""
        return rms(weighted(residuals(model, self.judge), self.weights))

    def closed_share(self, gap: Improvement, reported: Improvement) -> float:
        """Return the share of the closable squared gap that an improvement closes.

        Closable is what stands out of the floor in the beginning; all of it where nothing does: an effect may pass for
        noise there. Of the share with weights and that of the gap as it is reported the smaller one counts.

        Args:
            gap: fall of the weighted squared residual on ``judge`` [N^2].
            reported: the same with the weights of the gap as it is reported.
        """
        count = sum(len(motion.thinned(motion.time)) for motion in self.judge)

        def share(one: Improvement, floor: float, first: float) -> float:
            closable = (first**2 - (0.0 if self.criteria.is_noise(first, floor) else floor**2)) * count
            return one.fall / closable if closable > 0.0 else 0.0

        return min(
            share(gap, self.floor, self.first_gap), share(reported, self.reported_floor, self.reported_gap)
        )

    def is_closed(self, model: Model) -> bool:
        """Return whether a model leaves nothing above the floor on ``judge``."""
        return self.is_noise(self.rms(model))

    def explains_all(self, model: Model, first: Model) -> bool:
        """Return whether a model leaves no share of the squared gap of the first one that would count as predictable.

        Args:
            model: what was found.
            first: the file refitted within its tolerance.
        """
        left, closable = (self.rms(one) ** 2 - self.floor**2 for one in (model, first))
        return left <= self.criteria.min_predictable_share * closable

    def is_noise(self, residual: float) -> bool:
        """Return whether an rms weighted residual [N] does not stand out of the floor."""
        return self.criteria.is_noise(residual, self.floor)


@dataclass(frozen=True)
class Evidence:
    """What a fit predicts of data it was not fitted to.

    Attributes:
        learn: whitened residual of each block of the recordings to learn from; by the fit without the block where
            there are no held-out recordings.
        held: whitened residual of each block of the held-out recordings.
        force: weighted residual of each block of the recordings to judge on [N].
        reported: the same with the weights of the gap as it is reported.
    """

    learn: list[Floats]
    held: list[Floats]
    force: list[Floats]
    reported: list[Floats]

    @property
    def all(self) -> list[Floats]:
        """Return all whitened blocks."""
        return [*self.learn, *self.held]


def evidence_of(found: Refit, court: Court) -> Evidence:
    """Return what a fit predicts of data it was not fitted to.

    Args:
        found: a fit with derivatives at its solution.
        court: the recordings.
    """
    length = court.criteria.block
    learn = learnt_residuals if court.has_held_out else left_out_residuals
    left = residuals(found.model, court.judge)
    return Evidence(
        learn(found, court.judged, length),
        held_out_residuals(found.model, court.held, length),
        in_blocks(weighted(left, court.weights), court.judge, length),
        in_blocks(weighted(left, court.gap_weights), court.judge, length),
    )


@dataclass(frozen=True)
class Decision:
    """One hypothesis with its tests.

    Attributes:
        candidate: the hypothesis.
        evidence: what its fit predicts.
        improvement: over the model without it, whitened, on all data that was not fitted to.
        gap: over the model without it, weighted, on the recordings to judge on [N^2].
        reported: the same with the weights of the gap as it is reported.
        tests: every test; the first one says whether it surely predicts better.
    """

    candidate: Candidate
    evidence: Evidence
    improvement: Improvement
    gap: Improvement
    reported: Improvement
    tests: tuple[Test, ...]

    @property
    def share(self) -> float:
        """Return the share of the closable squared gap that the hypothesis closes."""
        return next((test.value for test in self.tests if test.name.startswith("share of the closable")), 0.0)

    def predictable(self, criteria: Criteria) -> float:
        """Return the share of the squared gap that the hypothesis surely predicts, named or not; 0 if unsure."""
        is_sure = self.tests[0].passed and self.gap.z_score >= criteria.min_z_score
        return self.reported.share if is_sure else 0.0

    @property
    def passed(self) -> bool:
        """Return whether every test was passed."""
        return all(test.passed for test in self.tests)


def decide(item: Candidate, before: Refit, earlier: Evidence, court: Court) -> Decision:
    """Test one hypothesis against the model without it.

    Args:
        item: the hypothesis.
        before: fit without it.
        earlier: what that fit predicts.
        court: the recordings.
    """
    criteria = court.criteria
    later = evidence_of(item.refit, court)
    gain = improvement(earlier.all, later.all)
    tests = [_predictive(item, gain, earlier, later, court)]
    gap, reported = improvement(earlier.force, later.force), improvement(earlier.reported, later.reported)
    if court.has_held_out:
        tests.append(at_least(item.name, "held-out gap: z-score", gap.z_score, criteria.interval_z_score))
    share = court.closed_share(gap, reported)
    tests.append(at_least(item.name, "share of the closable squared gap", share, criteria.min_closed_share))
    tests += bounds(item, court)
    if item.settings is not None:
        tests += physical(item, court)
        if all(test.passed for test in tests):  # the regression takes longer than all the other tests together
            tests += earned(item, before, later, court)
    return Decision(item, later, gain, gap, reported, tuple(tests))


def _predictive(item: Candidate, gain: Improvement, earlier: Evidence, later: Evidence, court: Court) -> Test:
    """Return the test that the hypothesis surely predicts better.

    Held-out recordings were not searched; all of them together were, over every shape that was tried. Either may tell:
    a held-out recording need not excite an effect as much as the one that was made to show it.
    """
    criteria = court.criteria
    title = "z-score on data not fitted to"
    if court.has_held_out:
        held = improvement(earlier.held, later.held)
        alone = at_least(item.name, f"{title}, held-out recordings", held.z_score, criteria.z_score_of(MOST_COMPARED))
        if alone.passed:
            return alone
        title = "z-score over all recordings"
    return at_least(item.name, title, gain.z_score, criteria.z_score_of(item.trials))


def bounds(item: Candidate, court: Court) -> list[Test]:
    """Return the test that no parameter of an effect lies at the end of its physical or believable range."""
    settings = item.settings
    if settings is None:
        return []
    return [within_range(settings, court.learn, item.refits.nominal)]


def within_range(settings: EffectSettings, motions: Sequence[Motion], nominal: Model) -> Test:
    """Return the test that no parameter of an effect lies at the end of its physical or believable range.

    Args:
        settings: the effect.
        motions: recordings to learn from.
        nominal: the given model.
    """
    at_end = 0
    for parameter, value in zip(effect(settings.name).parameters, settings.values, strict=True):
        if parameter.name in WHOLE_RANGE or parameter.unit == "rad" or value == parameter.default:
            continue
        limits = believable(settings.name, parameter.name, motions, nominal)
        ends = [end for end in (parameter.minimum, parameter.maximum, *limits) if math.isfinite(end)]
        at_end += any(abs(value - end) <= AT_END * abs(end) for end in ends)
    return at_most(settings.name, "parameters at the end of their range", at_end, 0.0)


def physical(item: Candidate, court: Court) -> list[Test]:
    """Return tests that the recordings reach what the effect acts on."""
    settings = item.settings
    assert settings is not None
    tests = [at_least(item.name, "strength over its standard error", strength(item), court.criteria.min_z_score)]
    values = dict(zip((p.name for p in effect(settings.name).parameters), settings.values, strict=True))
    rate = min(motion.step / motion.period for motion in court.learn)
    if "frequency" in values:
        tests.append(
            at_most(item.name, "frequency over sample rate", values["frequency"] / rate, court.criteria.max_rate_share)
        )
    if settings.name == "actuator_delay":
        tests.append(at_least(item.name, "delay over sample period", values["delay"] * rate, LEAST_DELAY))
    if settings.name == "actuator_saturation":
        effort = np.abs(np.concatenate([motion.effort for motion in court.learn]))
        tests.append(
            at_most(
                item.name, "share of samples beyond the limit", float(np.mean(effort > values["limit"])),
                court.criteria.max_unexplained,
            )
        )  # fmt: skip
    return tests


def strength(item: Candidate) -> float:
    """Return the largest strength of an effect over its standard error; infinite where it has no free strength."""
    settings = item.settings
    assert settings is not None
    place = [one.name for one in item.refit.effects].index(settings.name)
    found = [
        abs(settings.values[j]) / error
        for (i, j), error in zip(item.refit.free, item.refit.deviations(), strict=True)
        if i == place and effect(settings.name).parameters[j].is_strength and error > 0.0
    ]
    return max(found, default=math.inf)


def earned(item: Candidate, before: Refit, later: Evidence, court: Court) -> list[Test]:
    """Return the test that a free-form term over the same coordinates predicts no better than the effect."""
    names = FREE_FORM.get(item.name)
    if names is None:
        return []
    criteria = court.criteria
    free = term(names, before.model, court)
    judge = Remainder(court.judge, residuals(before.model, court.judge), court.weights)
    better = improvement(later.force, judge.less(free.predicted).blocks(criteria.block))
    title = f"z-score of a free-form term over {', '.join(names)}"
    return [at_most(item.name, title, better.z_score, criteria.min_z_score)]


def term(names: Sequence[str], model: Model, court: Court) -> FreeForm:
    """Return what a free-form term predicts of a model's residual on the recordings to judge on."""
    learn = Remainder(court.learn, residuals(model, court.learn), court.judged.gap_weights)
    judge = learn
    if court.has_held_out:
        judge = Remainder(court.judge, residuals(model, court.judge), court.gap_weights)
    return free_form(names, learn, judge, court.criteria, court.seed)


def apart(one: Decision, other: Decision) -> float:
    """Return the z-score by which one hypothesis predicts better than another.

    Over all recordings; over the held-out ones alone where these say the opposite.

    Args:
        one, other: decisions of the same round.
    """
    z_score = improvement(other.evidence.all, one.evidence.all).z_score
    if one.evidence.held:
        held = improvement(other.evidence.held, one.evidence.held).z_score
        return z_score if held * z_score >= 0.0 else held
    return z_score


def alternatives(best: Decision, others: Sequence[Decision], criteria: Criteria) -> tuple[str, ...]:
    """Return the names that data which nothing was fitted to do not tell from the best one.

    Args:
        best: the accepted decision.
        others: the other decisions of the same round.
        criteria: thresholds.
    """
    found = []
    for item in others:
        if item.candidate.settings is None or item.candidate.name == best.candidate.name:
            continue
        is_apart = apart(best, item) > criteria.min_z_score
        is_possible = all(test.passed for test in item.tests)
        if not is_apart and is_possible:
            found.append(item.candidate.name)
    return tuple(found)


def changed_refits(refits: Refits, name: str) -> Refits:
    """Return refits in which values of the owner's file are let go.

    Args:
        refits: so far.
        name: one of ``CHANGED``.
    """
    if name == CHANGED[0]:
        return replace(refits, freedom=replace(refits.freedom, friction=True))
    if name == CHANGED[1]:
        model = refits.nominal.spread(*deflections(refits))
        return replace(refits, nominal=model, freedom=replace(refits.freedom, friction=True, elements=True))
    if name == CHANGED[2]:
        return replace(refits, nominal=replace(refits.nominal, is_sharp=True))
    whole = with_damping(changed_refits(refits, CHANGED[1]))
    friction = whole.nominal.friction
    if friction.model == "gms":
        return whole
    attraction = friction.coulomb_force / START_LAG
    return replace(
        whole, nominal=replace(whole.nominal, friction=replace(friction, model="gms", attraction_rate=attraction))
    )


def with_damping(refits: Refits) -> Refits:
    """Return refits in which the elements have a damping of their own, from one sample of relaxation time on."""
    if refits.nominal.relaxation > 0.0:
        return refits
    period = min(motion.period for motion in refits.judged.motions)
    return replace(refits, nominal=replace(refits.nominal, relaxation=period))


def deflections(refits: Refits) -> tuple[float, float]:
    """Return the smallest and largest slip deflection that a contact unknown to the file may have.

    From a tenth of the file's smallest to ten times its largest, within what the encoder resolves and what is still a
    contact beside the stroke.

    Args:
        refits: recordings and model so far.
    """
    friction, motions = refits.nominal.friction, refits.judged.motions
    reach = np.array(friction.element_fraction) * friction.coulomb_force / np.array(friction.element_stiffness)
    stroke = float(np.ptp(np.concatenate([motion.position for motion in motions])))
    step = max(motion.resolution for motion in motions)
    largest = min(SLACK_OF_CONTACT * float(reach.max()), CONTACT_SHARE * stroke)
    smallest = max(float(reach.min()) / SLACK_OF_CONTACT, 2.0 * step, 1.0e-4 * largest)
    return min(smallest, 0.1 * largest), largest
