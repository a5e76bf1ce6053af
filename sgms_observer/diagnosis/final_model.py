"""The model that a diagnosis ends with, and the maps that it learns beside the named effects."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis.coordinates import is_confusable_with_contact
from sgms_observer.diagnosis.criteria import Test, at_least, at_most
from sgms_observer.diagnosis.diagnosis import Round, accepted_candidates
from sgms_observer.diagnosis.evidence import improvement
from sgms_observer.diagnosis.fit import Refit
from sgms_observer.diagnosis.gap import WeightedResidual, residuals
from sgms_observer.diagnosis.gap_data import GapData
from sgms_observer.diagnosis.map_fit import (
    AT_REST,
    COORDINATES,
    MAP_NAMES,
    OF_CONTACT,
    FittedMap,
    effect_and_map,
    fit_map,
    left_by_best_map,
    maps_over,
    with_map,
)
from sgms_observer.diagnosis.map_formula import Formula, formula_of
from sgms_observer.diagnosis.model import Model
from sgms_observer.effects.catalogue import effect
from sgms_observer.settings.axis import EffectSettings
from sgms_observer.settings.units import Units

PLACE = "position"
"""Coordinate of the effects that are tested together."""
DIFFERS_BY_DIRECTION = "z-score of a force that differs between the directions"
"""Test of a force over the position."""
OFFSET = "offset"
CONSTANT_FORCES = (OFFSET, "asymmetric_coulomb")
"""Effects that a learnt map may hold a part of."""
UNEXPLAINED_WHILE_SLIDING = "unexplained share of the effort, with the weights of the gap"
"""Test of the model with everything that was added: the gap hardly counts samples where the contact sticks."""


@dataclass(frozen=True)
class FinalModel:
    """What the diagnosis adds to the model in the end.

    Attributes:
        fit: the model without learnt maps.
        accepted: rounds that named an effect.
        before, after: residual of each recording of the gap without and with what is added [N].
        noise: rms residual of a perfect model [N].
        tests: tests of everything that was added together.
    """

    fit: Refit
    accepted: Sequence[Round]
    before: Sequence[Floats]
    after: Sequence[Floats]
    noise: float
    tests: tuple[Test, ...]

    @property
    def names(self) -> frozenset[str]:
        """Return the named effects."""
        return frozenset(one.name for one in accepted_candidates(self.accepted))


def final_model(data: GapData, contradiction: Test | None) -> FinalModel:
    """Return what is added to the model: everything that was accepted, or nothing if the gap does not confirm it."""
    diagnosis = data.diagnosis
    written = diagnosis.written
    before = data.residuals(written.before, replace(diagnosis.file_state.setup, nominal=diagnosis.nominal))
    after = before if written.after is written.before else data.residuals(written.after, written.setup)
    # A residual on data that nothing was fitted to bounds the noise.
    noise = min(data.noise(), data.rms(before), data.rms(after))
    added = FinalModel(written.after, diagnosis.accepted, before, after, noise, ())
    if written.after is written.before:
        return added
    tests = tuple(_confirmation_tests(data, added))
    if contradiction is None and all(test.passed for test in tests):
        return replace(added, tests=tests)
    return FinalModel(written.before, (), before, before, noise, tests)


def _confirmation_tests(data: GapData, added: FinalModel) -> list[Test]:
    """Return the tests of everything that was added together, on the recordings of the gap.

    If the gap before is not above the noise, the whole gap is closable, because the noise may contain the effect.
    """
    criteria, diagnosis = data.options.criteria, data.diagnosis
    names = ", ".join(one.name for one in accepted_candidates(diagnosis.rounds))
    before, after = data.rms(added.before), data.rms(added.after)
    reduction = data.reduction(added.before, added.after)
    floor = 0.0 if criteria.is_noise(before, added.noise) else added.noise
    closed = (before**2 - after**2) / max(before**2 - floor**2, 1e-300)
    return [
        at_least(names, "gap of the written model: z-score", reduction.z_score, criteria.interval_z_score),
        at_least(
            names, "gap of the written model: share of the closable squared gap", closed, criteria.min_closed_share
        ),
        at_most(names, UNEXPLAINED_WHILE_SLIDING, after / data.effort, criteria.max_unexplained),
    ]


def learnt_maps(data: GapData, final: FinalModel, units: Units) -> list[FittedMap]:
    """Return maps of the remaining residual, fitted one after the other while the next one surely predicts more of it.

    Args:
        data: recordings of the gap.
        final: the model without maps.
        units: units of the axis.
    """
    learnt: list[FittedMap] = []
    while (more := _with_another_map(data, final, learnt, units)) is not None:
        learnt = more
    return [replace(item, formula=_formula(data, final, learnt, item, units)) for item in learnt]


def _with_another_map(
    data: GapData, final: FinalModel, learnt: Sequence[FittedMap], units: Units
) -> list[FittedMap] | None:
    """Return maps with one more, or None if no other closes enough. A relaxation at rest is tried last.

    Args:
        data: recordings of the gap.
        final: the model without maps.
        learnt: maps so far.
        units: units of the axis.
    """
    criteria = data.options.criteria
    names = _free_names([*final.fit.effects, *(item.settings for item in learnt)])
    model = final.fit.model.with_effects([item.settings for item in learnt])
    left = residuals(model, data.motions) if learnt else final.after
    least = criteria.min_closed_share if learnt else criteria.min_predictable_share
    for over in (COORDINATES, AT_REST) if names else ():
        found = fit_map(*_to_learn_and_judge(data, model, left), names[0], units, criteria, over)
        if found is None or found.share < least:
            continue
        more = with_map(learnt, found, units)
        total = residuals(final.fit.model.with_effects([item.settings for item in more]), data.motions)
        gain = data.reduction(left, total)
        if gain.z_score >= criteria.interval_z_score and gain.share >= least:
            return more
    return None


def _to_learn_and_judge(
    data: GapData, model: Model, left: Sequence[Floats]
) -> tuple[WeightedResidual, WeightedResidual]:
    """Return the residual on the fitted recordings and on the evaluated ones; one object if they are the same.

    Args:
        data: recordings of the gap.
        model: the model.
        left: its residual on the recordings of the gap [N].
    """
    known = data.fitted(model)
    return (known, data.rest(left)) if data.has_held_out else (known, known)


def _formula(
    data: GapData, final: FinalModel, learnt: Sequence[FittedMap], item: FittedMap, units: Units
) -> Formula | None:
    """Return a formula that predicts as well as a map, beside everything else that was found."""
    model = final.fit.model.with_effects([one.settings for one in learnt if one is not item])
    left = residuals(model, data.motions)
    residual = _to_learn_and_judge(data, model, left)
    return formula_of(item.map, *residual, units, data.options.criteria)


def coordinate_tests(data: GapData, final: FinalModel, units: Units) -> list[Test]:
    """Return for each named effect the test that it explains enough of what its own coordinates predict.

    A map over these coordinates is fitted to what the effect leaves. Of nearly all effects it may predict next to
    nothing. What it predicts beside an effect may also be another force over the same coordinates: then the effect has
    to add to such a map. An effect that another contact law can imitate is judged over the coordinates of a contact:
    what they predict may be the contact's, but if it is more than what the effect closes, the effect may be the
    contact's too. Several effects over the position are tested together, where each passes alone. Effects that only
    describe another contact law are not tested here: see ``answer.answer_of``.

    Args:
        data: recordings of the gap.
        final: the model without maps.
        units: units of the axis.
    """
    criteria, fit = data.options.criteria, final.fit
    known, evaluated = _to_learn_and_judge(data, fit.model, final.after)
    tests, closed_by = list[Test](), dict[str, float]()
    for one in accepted_candidates(final.accepted):
        is_confusable = is_confusable_with_contact(one.name)
        coordinates = OF_CONTACT if is_confusable else set(effect(one.name).coordinates)
        over = maps_over(coordinates)
        if not over or one.is_contact_law:
            continue
        without = _model_without(data, fit, [one.name])
        closed = max(data.reduction(residuals(without, data.motions), final.after).decrease, 0.0)
        found = fit_map(known, evaluated, MAP_NAMES[0], units, criteria, over)
        left = found.improvement.decrease if found else 0.0
        if is_confusable:
            title = "residual predictable over the coordinates of a contact / closed residual"
            tests.append(at_most(one.name, title, left / max(closed, 1.0e-300), 1.0))
            continue
        if PLACE in coordinates:
            closed_by[one.name] = closed
        title = "predictable share left over its coordinates"
        share = left / max(left + closed, 1.0e-300)
        test = at_most(one.name, title, share, criteria.min_predictable_share)
        if not test.passed:
            alone = _to_learn_and_judge(data, without, residuals(without, data.motions))
            both = effect_and_map(one.name, alone, (known, evaluated), over, criteria)
            test = both.added if both else test
        tests.append(test)
    is_closed = criteria.is_noise(data.rms(final.after), final.noise)
    if len(closed_by) > 1 and not is_closed and all(test.passed for test in tests):
        tests.append(_beyond_one_map(data, fit, closed_by, evaluated))
    return tests


def direction_tests(data: GapData, final: FinalModel) -> list[Test]:
    """Return the test that what is left over the position beside a named force is the same in both directions.

    That is what the formulas of the named forces say. A map over position and direction predicts surely better than
    one over the position alone where a force has a part that depends on the direction, such as a spring that pulls
    harder on the way out. On a motion back and forth the speed is a function of the position, so a map over the
    velocity has to do worse, too.

    Args:
        data: recordings of the gap.
        final: the model without maps.
    """
    criteria = data.options.criteria
    named = [one for one in accepted_candidates(final.accepted) if one.settings is not None]
    of_place = [one.name for one in named if effect(one.name).coordinates == (PLACE,)]
    if not of_place or criteria.is_noise(data.rms(final.after), final.noise):
        return []
    left = _to_learn_and_judge(data, final.fit.model, final.after)
    same = left_by_best_map(left, [(PLACE,), ("velocity",)], criteria)
    differing = left_by_best_map(left, [(PLACE, "direction")], criteria)
    if same is None or differing is None:
        return []
    z_score = improvement(same, differing).z_score
    return [at_most(name, DIFFERS_BY_DIRECTION, z_score, criteria.min_z_score) for name in of_place]


def _beyond_one_map(data: GapData, fit: Refit, closed_by: Mapping[str, float], evaluated: WeightedResidual) -> Test:
    """Return the test that several effects over the position surely predict better than one map over it.

    One map is one hypothesis. Where it does as well and the effects leave more than noise, they are pieces of another
    force along the stroke. The one that closes least answers for all.

    Args:
        data: recordings of the gap.
        fit: the model with the effects.
        closed_by: what each of them closes [N^2].
        evaluated: what the model leaves of the evaluated recordings.
    """
    criteria = data.options.criteria
    without = _model_without(data, fit, list(closed_by))
    alone = _to_learn_and_judge(data, without, residuals(without, data.motions))
    best = left_by_best_map(alone, maps_over({PLACE}), criteria)
    z_score = improvement(best, evaluated.blocks(criteria.block)).z_score if best else criteria.min_z_score
    title = "z-score of all effects over the position beyond one map over it"
    return at_least(min(closed_by, key=lambda name: closed_by[name]), title, z_score, criteria.min_z_score)


def constant_force_tests(data: GapData, final: FinalModel, learnt: Sequence[FittedMap]) -> list[Test]:
    """Return for each named constant force the test that half of it acts everywhere, with the learnt maps.

    A map may hold a constant, so a constant force beside it may be a piece of one force that varies: then hardly
    anything of it is left where the map is lowest. While the contact slides an asymmetric Coulomb force is a constant
    force, too. A map over coordinates of the contact is another force.

    Args:
        data: recordings of the gap.
        final: the model without maps.
        learnt: the learnt maps.
    """
    tests, least = [], data.options.criteria.min_imitable_share
    maps = [one for one in learnt if not one.is_of_contact]
    named = [item for item in final.fit.effects if item.name in CONSTANT_FORCES and item.name in final.names]
    for item in named if maps else ():
        size = item.values[0] * (1.0 if item.name == OFFSET else final.fit.model.friction.coulomb_force)
        lowest = min(one.lowest_force(math.copysign(1.0, size)) for one in maps)
        title = "share of a constant force that acts where the learnt maps beside it are lowest"
        tests.append(at_least(item.name, title, 1.0 + lowest / max(abs(size), 1.0e-300), least))
    return tests


def _model_without(data: GapData, fit: Refit, names: Sequence[str]) -> Model:
    """Return the model of a fit without some effects; the other values stay."""
    _, left = data.diagnosis.written.setup.without_all(names, fit.model.effects)
    return replace(fit.model, effects=left)


def _free_names(effects: Sequence[EffectSettings]) -> list[str]:
    """Return the names of learnt maps that the model does not use yet."""
    used = {item.name for item in effects}
    return [name for name in MAP_NAMES if name not in used]
