"""Rules between settings: values that are valid alone can be invalid together."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from sgms_observer.settings.axis import (
    AxisSettings,
    EstimatorSettings,
    FilterSettings,
    FrictionSettings,
    ReferenceSettings,
    StageSettings,
)
from sgms_observer.settings.check import Faults, shown
from sgms_observer.settings.units import Units

#: Largest distance of the sum of the element fractions from one; printed tables round to two or three digits.
FRACTION_TOLERANCE = 1e-3

#: Longest window of the filter [samples]: a longer one is a wrong unit.
MAX_WINDOW = 10_000


def friction_consistency(
    path: str, friction: FrictionSettings, given: Sequence[str], faults: Faults, units: Units, inherited_from: str = ""
) -> None:
    """Check the lists against each other and the Stribeck curve.

    Args:
        path: full name of the group, ``x.friction``.
        friction: the values, each valid alone.
        given: the keys in the file, to distinguish a wrong list from a missing one.
        faults: receives the sentences.
        units: of the axis.
        inherited_from: full name of the group that the other keys come from, whose faults are not reported twice.
    """

    def is_faulty(*names: str) -> bool:
        """Return whether one of these has a fault already, here or in the parent group."""
        places = (inherited_from if inherited_from and name not in given else path for name in names)
        return faults.has(*(f"{place}.{name}" for place, name in zip(places, names, strict=True)))

    n_z = len(friction.element_stiffness)
    if n_z == 0 and not is_faulty("element_stiffness"):
        faults.add(
            f"{path}.element_stiffness",
            f"{path}.element_stiffness = [] must have at least one element; write its stiffness",
        )
    for name in ("element_fraction", "element_damping"):
        values = getattr(friction, name)
        if n_z and len(values) != n_z and not is_faulty(name, "element_stiffness"):
            default = "" if name in given else " (the default)"
            faults.add(
                f"{path}.{name}",
                f"{path}.{name} = {shown(list(values))}{default} must have {n_z} entries like element_stiffness; "
                f"write one per element",
            )
    total = sum(friction.element_fraction)
    if abs(total - 1.0) > FRACTION_TOLERANCE and not is_faulty("element_fraction"):
        faults.add(
            f"{path}.element_fraction",
            f"{path}.element_fraction = {shown(list(friction.element_fraction))} must sum to 1, not {total:.6g}; "
            f"divide each entry by the sum",
        )
    if friction.static_force < friction.coulomb_force and not is_faulty("static_force", "coulomb_force"):
        faults.add(
            f"{path}.static_force",
            f"{path}.static_force = {shown(friction.static_force)} {units.effort} must be >= coulomb_force = "
            f"{shown(friction.coulomb_force)} {units.effort}; swap them or raise static_force",
        )


def _stage_consistency(path: str, stage: StageSettings, period: float, faults: Faults) -> None:
    """Check reference and controller of a simulated stage, each valid alone, against the sample period [s]."""
    nyquist = 0.5 / period
    bandwidth = stage.controller.bandwidth
    if bandwidth >= nyquist and not faults.has(f"{path}.controller.bandwidth", "sample_period"):
        faults.add(
            f"{path}.controller.bandwidth",
            f"{path}.controller.bandwidth = {shown(bandwidth)} Hz must be < {shown(nyquist)} Hz, half the sample rate; "
            f"lower it or shorten sample_period",
        )
    _reference_consistency(f"{path}.reference", stage.reference, nyquist, faults)


def _reference_consistency(path: str, reference: ReferenceSettings, nyquist: float, faults: Faults) -> None:
    """Check that the chosen kind of reference has all its settings."""
    if reference.kind == "sine":
        _check_frequencies(f"{path}.frequency", (reference.frequency,), nyquist, faults)
    if reference.kind == "multi_sine":
        count = len(reference.frequencies)
        lists_sound = not faults.has(f"{path}.frequencies", f"{path}.amplitudes")
        if lists_sound and (count == 0 or len(reference.amplitudes) != count):
            faults.add(
                f"{path}.amplitudes",
                f"{path}.amplitudes = {shown(list(reference.amplitudes))} must have as many entries as frequencies = "
                f"{shown(list(reference.frequencies))}, at least one; write one of each per sine",
            )
        if lists_sound and len(reference.phases) not in (0, count) and not faults.has(f"{path}.phases"):
            faults.add(
                f"{path}.phases",
                f"{path}.phases = {shown(list(reference.phases))} must have {count} entries like frequencies; "
                f"write one per sine, or none for zero",
            )
        _check_frequencies(f"{path}.frequencies", reference.frequencies, nyquist, faults)
    if reference.kind == "file" and not faults.has(f"{path}.file") and not reference.file:
        faults.add(f"{path}.file", f'{path}.file = "" must name a CSV file because kind is file; write its path')


def _check_frequencies(path: str, frequencies: Sequence[float], nyquist: float, faults: Faults) -> None:
    """Check that these frequencies are below half the sample rate."""
    for frequency in frequencies:
        if frequency >= nyquist and not faults.has(path, "sample_period"):
            faults.add(
                path,
                f"{path} = {shown(frequency)} Hz must be < {shown(nyquist)} Hz, half the sample rate; "
                f"lower it or shorten sample_period",
            )


def is_file(name: str) -> bool:
    """Return whether there is a file of this name; False for an impossible name."""
    try:
        return Path(name).is_file()
    except (OSError, ValueError):
        return False


def _filter_consistency(path: str, filter_: FilterSettings, period: float, faults: Faults) -> None:
    """Check block V, each value valid alone, against the sample period [s]."""
    if faults.has("sample_period"):
        return
    nyquist = 0.5 / period
    if filter_.kind == "lowpass" and filter_.cutoff >= nyquist and not faults.has(f"{path}.cutoff"):
        faults.add(
            f"{path}.cutoff",
            f"{path}.cutoff = {shown(filter_.cutoff)} Hz must be < {shown(nyquist)} Hz, half the sample rate; "
            f"lower it or shorten sample_period",
        )
    intervals = 2 * (
        filter_.degree // 2 + 1
    )  # the shortest window that smooths; the default window is lengthened to it
    is_short = filter_.window < intervals * period * (1 - 1e-9) and filter_.window != FilterSettings().window
    if filter_.kind == "savgol" and is_short and not faults.has(f"{path}.window", f"{path}.degree"):
        faults.add(
            f"{path}.window",
            f"{path}.window = {shown(filter_.window)} s must be >= {shown(intervals * period)} s, {intervals} times "
            f"sample_period, for degree = {filter_.degree}; lengthen it or lower degree",
        )
    if filter_.kind == "savgol" and filter_.window > MAX_WINDOW * period and not faults.has(f"{path}.window"):
        faults.add(
            f"{path}.window",
            f"{path}.window = {shown(filter_.window)} s must be <= {shown(MAX_WINDOW * period)} s, "
            f"{MAX_WINDOW} times sample_period; shorten it",
        )
    if filter_.maximum_gap < 2 * period and not faults.has(f"{path}.maximum_gap"):
        faults.add(
            f"{path}.maximum_gap",
            f"{path}.maximum_gap = {shown(filter_.maximum_gap)} s must be >= {shown(2 * period)} s, two sample "
            f"periods; raise it or correct sample_period",
        )


def _estimator_consistency(path: str, estimator: EstimatorSettings, faults: Faults) -> None:
    """Check the bounds of the estimated parameters."""
    if estimator.parameter_minimum >= 1.0 and not faults.has(f"{path}.parameter_minimum"):
        faults.add(
            f"{path}.parameter_minimum",
            f"{path}.parameter_minimum = {shown(estimator.parameter_minimum)} must be < 1, the share that the "
            f"start value has; lower it",
        )
    names = estimator.parameters
    if len(set(names)) != len(names) and not faults.has(f"{path}.parameters"):
        faults.add(
            f"{path}.parameters",
            f"{path}.parameters = {shown(list(names))} must name each parameter once; remove the repeated one",
        )


def axis_consistency(axis: AxisSettings, period: float, faults: Faults) -> None:
    """Check one axis against the sample period (its friction models are checked where they are read).

    Args:
        axis: the axis, each value valid alone.
        period: nominal sample period [s].
        faults: receives the sentences.
    """
    _stage_consistency(f"{axis.name}.stage", axis.stage, period, faults)
    _filter_consistency(f"{axis.name}.filter", axis.filter, period, faults)
    _estimator_consistency(f"{axis.name}.estimator", axis.estimator, faults)
    path = f"{axis.name}.compensation.timeout"
    if axis.compensation.timeout <= period and not faults.has(path, "sample_period"):
        faults.add(
            path,
            f"{path} = {shown(axis.compensation.timeout)} s must be > sample_period = {shown(period)} s, or it would "
            f"never compensate; raise it",
        )
