"""Values of the file that the fit moved beyond their tolerance and their interval."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from sgms_observer.diagnosis.fit import FRICTION_VALUES, SLIDING_FRICTION_VALUES, WRITTEN_EVALUATIONS, Refit
from sgms_observer.effects.catalogue import effect
from sgms_observer.settings.axis import FrictionSettings
from sgms_observer.settings.declaration import declared_settings

if TYPE_CHECKING:
    from sgms_observer.diagnosis.diagnosis import Diagnosis, Options


@dataclass(frozen=True)
class Changed:
    """One changed value of the file.

    Attributes:
        name: path below the axis, for instance ``friction.coulomb_force``.
        before: value in the file.
        after: fitted value.
        std_error: standard error of ``after``; 0 if it is not known.
        closes: share of the closable gap that all changed values together close beside the effects.
    """

    name: str
    before: float | str
    after: float | str
    std_error: float
    closes: float = 0.0

    @property
    def is_friction(self) -> bool:
        """Return whether it is a friction value, not one of the elements or an effect."""
        return self.name.removeprefix("friction.") in FRICTION_VALUES

    @property
    def acts_in_fast_sliding(self) -> bool:
        """Return whether it is a part of the friction far above the Stribeck velocity."""
        return self.name.removeprefix("friction.") in SLIDING_FRICTION_VALUES

    @property
    def unit(self) -> str:
        """Return the unit that the value has on a prismatic axis; empty for none."""
        group, *path = self.name.split(" ")[0].split(".")
        if group == "friction":
            unit = declared_settings(FrictionSettings)[path[0]].unit
        else:
            unit = next(one.unit for one in effect(path[0]).parameters if one.name == path[1])
        return "" if unit == "-" else unit


def changed_values(diagnosis: Diagnosis, fit: Refit, options: Options) -> tuple[Changed, ...]:
    """Return the values of the file that moved beyond their tolerance by more than their 90 % interval.

    Args:
        diagnosis: the diagnosis.
        fit: the fit that augmented.yaml holds.
        options: tolerance and criteria.
    """
    listed: list[Changed] = []
    criteria = options.criteria
    freedom = diagnosis.written.setup.freedom
    errors = np.sqrt(np.maximum(np.diag(np.linalg.pinv(fit.jacobian.T @ fit.jacobian)), 0.0))
    old, new = diagnosis.nominal.friction, fit.model.friction
    names = [name for name in fit.model.parameter_names() if not name.startswith("element")]
    for place, name in enumerate(names):
        if name not in freedom.friction:
            continue
        one, other = float(getattr(old, name)), float(getattr(new, name))
        error = float(errors[place])
        width = np.log1p(options.tolerance) + criteria.interval_z_score * error
        is_beyond = one > 0.0 and abs(np.log(other / one)) > width
        if is_beyond:
            listed.append(Changed(f"friction.{name}", one, other, other * error))
    if freedom.elements:
        one, other = float(sum(old.element_stiffness)), float(sum(new.element_stiffness))
        listed.append(Changed("friction.element_stiffness (sum)", one, other, 0.0))
    if fit.model.relaxation > 0.0 and diagnosis.nominal.relaxation == 0.0:
        total = fit.model.relaxation * float(sum(new.element_stiffness))
        listed.append(Changed("friction.element_damping (sum)", 0.0, total, 0.0))
    if (fit.model.is_unsmoothed or new.model == "gms") and not (diagnosis.nominal.is_unsmoothed or old.model == "gms"):
        listed.append(Changed("friction.model", old.model, "gms", 0.0))
    held = diagnosis.written.setup.held_effects
    file_values = {item.name: item.values for item in diagnosis.file_effects}
    for (place, number), error in fit.standard_errors().items():
        item = fit.effects[place]
        parameter, after = effect(item.name).parameters[number], float(item.values[number])
        if item.name in held:  # it is within its tolerance
            continue
        if item.name in file_values:
            before = float(file_values[item.name][number])
        elif item.name in diagnosis.unnamed_contact_effects and parameter.is_strength:
            before = 0.0
        else:
            continue
        if before != after:
            listed.append(Changed(f"effects.{item.name}.{parameter.name}", before, after, error))
    closes = _closed(diagnosis, fit) if listed else 0.0
    return tuple(replace(one, closes=closes) for one in listed)


def _closed(diagnosis: Diagnosis, fit: Refit) -> float:
    """Return the share of the closable gap that the changed values close beside the effects.

    They are compared with the values of the file, fitted again within its tolerance with the same effects.

    Args:
        diagnosis: the diagnosis.
        fit: the fit that augmented.yaml holds.
    """
    evaluation, written = diagnosis.evaluation, diagnosis.written
    before = evaluation.rms(written.before.model)
    values = {item.name for item in diagnosis.file_effects} | set(diagnosis.unnamed_contact_effects)
    added = [item for item in fit.effects if item.name not in values]
    with_file_values = before
    if added:
        setup = replace(diagnosis.file_state.setup, nominal=diagnosis.nominal, data=written.setup.data)
        effects, start = (*diagnosis.file_effects, *added), written.before.logs
        with_file_values = evaluation.rms(setup.fit(effects, start, evaluations=WRITTEN_EVALUATIONS).model)
    closable = max(before - evaluation.floor, 1e-300)
    return float(np.clip((with_file_values - evaluation.rms(fit.model)) / closable, 0.0, 1.0))
