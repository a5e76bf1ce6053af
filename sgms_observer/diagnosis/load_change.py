"""Held-out recordings with another load than the fitted ones: then no model of the fitted ones can predict them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis.candidates import with_effect
from sgms_observer.diagnosis.criteria import Test, at_most
from sgms_observer.diagnosis.fit import Refit, fixed_parameters
from sgms_observer.diagnosis.gap import WeightedResidual, residuals
from sgms_observer.diagnosis.gap_data import GapData
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import Motion
from sgms_observer.diagnosis.pruning import MASS_ERROR
from sgms_observer.diagnosis.whitened import data_with_own_noise
from sgms_observer.effects.catalogue import effect
from sgms_observer.settings.axis import EffectSettings
from sgms_observer.settings.units import Units


@dataclass(frozen=True)
class OtherLoad:
    """A held-out recording beside the fitted ones.

    Attributes:
        name: of the recording.
        fitted_mass, mass: moving mass of the fitted recordings and of this one [kg].
        test: test that a load of its own closes at most half of its squared gap.
    """

    name: str
    fitted_mass: float
    mass: float
    test: Test

    def warning(self, units: Units) -> str:
        """Return what the recordings say, and what to do."""
        return (
            f"the recordings disagree about the moving mass: {self.fitted_mass:.3g} {units.mass} in those that were"
            f" fitted, {self.mass:.3g} {units.mass} in {self.name}. Record all of them with the same load, or diagnose"
            " each load by itself"
        )


def other_load(data: GapData, fit: Refit) -> OtherLoad | None:
    """Return the held-out recording whose gap a load of its own closes most, or None where none surely has another.

    Mass and strengths of effects of the model are fitted to each recording alone; the friction stays within the
    tolerance. A load counts where its mass surely differs by more than the tolerance from that of the fitted
    recordings, which have an error too. What the strengths close with the mass of these is not due to a load.

    Args:
        data: recordings of the gap.
        fit: the model.
    """
    recordings = zip(data.motions, data.whitened.weights, strict=True) if data.has_held_out else ()
    found = [_load_of(data, fit, motion, weights) for motion, weights in recordings]
    return max((one for one in found if one), key=lambda one: one.test.value, default=None)


def _load_of(data: GapData, fit: Refit, motion: Motion, weights: Floats) -> OtherLoad | None:
    """Return one held-out recording beside the fitted ones, or None where its mass is not surely another.

    Args:
        data, fit: as above.
        motion: the recording.
        weights: of its residual in the gap.
    """
    criteria, diagnosis = data.options.criteria, data.diagnosis
    file_setup = replace(diagnosis.file_state.setup, nominal=diagnosis.nominal)
    of_fit = file_setup if fit is diagnosis.written.before else diagnosis.written.setup
    start = next((item for item in fit.effects if item.name == MASS_ERROR), EffectSettings(MASS_ERROR, (0.0,)))
    effects = with_effect(fit.effects, start)
    shapes = [
        (i, j) for i, item in enumerate(effects) for j, one in enumerate(effect(item.name).parameters)
        if not one.is_strength
    ]  # fmt: skip
    fixed = [*fixed_parameters(effects), *shapes]
    setup = replace(of_fit, held_effects=frozenset(), data=data_with_own_noise((motion,), fit.model))
    alone = setup.fit(effects, fit.logs, fixed)
    place = [item.name for item in effects].index(MASS_ERROR)
    learnt = replace(setup, data=diagnosis.file_state.setup.data).fit(effects, fit.logs, fixed, evaluations=1)
    errors = [one.standard_errors().get((place, 0), 0.0) for one in (alone, learnt)]
    mass, fitted_mass = _moving_mass(alone.model), _moving_mass(fit.model)
    least = data.options.tolerance * fitted_mass + criteria.interval_z_score * math.hypot(*errors)
    if abs(mass - fitted_mass) <= least:
        return None
    same_load = setup.fit(effects, fit.logs, [*fixed, (place, 0)])
    before, left, after = (
        WeightedResidual((motion,), residuals(model, (motion,)), (weights,)).rms
        for model in (fit.model, same_load.model, alone.model)
    )
    share = (left**2 - after**2) / before**2 if before > 0.0 else 0.0
    title = "share of the squared gap that another load of the recording closes"
    return OtherLoad(motion.name, fitted_mass, mass, at_most("model", title, share, criteria.min_imitable_share))


def _moving_mass(model: Model) -> float:
    """Return the mass of a model, with a mass error if it has one [kg]."""
    return model.mass + sum(item.values[0] for item in model.effects if item.name == MASS_ERROR)
