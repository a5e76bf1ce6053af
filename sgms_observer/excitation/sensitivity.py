"""Sensitivity of the effort to parameters and effects along a reference, in units of the noise.

The motion is assumed to equal the reference. The effort of the model for it is differentiated by the parameters of the
force balance, relative to their values, and by the strength of each effect. All columns pass the low-pass of the
residuals. Their noise is white: ``estimator.measurement_std``, and where the contact sticks the position noise times
the sticking stiffness.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import signal

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis.contact import element_friction
from sgms_observer.effects.catalogue import effect
from sgms_observer.effects.compiled import CompiledEffects
from sgms_observer.effects.effect import Place
from sgms_observer.filters.zero_phase import zero_phase
from sgms_observer.formulas import vectorised
from sgms_observer.identification.prepared import MOTION_OVER_BALANCE
from sgms_observer.identification.problem import ElementShape, friction_and_slopes
from sgms_observer.settings.axis import AxisSettings, EffectSettings, FrictionSettings

stribeck_level = vectorised("friction").stribeck_level

BAND = 100.0
"""Efforts are compared below this frequency [Hz] where the sample rate allows it, the band of a compensation."""
RATE_SHARE = 0.1
"""Largest band over the sample rate, as for identification."""
ROW_RATE = 2.5
"""Rows per period of the band."""
SIZE = 0.1
"""Largest force of an effect that the file does not have, over the Coulomb force."""
LOG_SPACED_COUNT = 6
"""Number of elements of an assumed contact other than that of the file. Their shares rise with the root of the
deflection, as in a contact whose force grows with the root of the travel."""
HALF_DECADE = 10.0**0.5
"""Assumed error of the values of a start file, a factor in either direction; the Stribeck velocity, which is unknown
before an identification, may also be lower by its square."""
_QUANTILE = 0.999  # quantile of a force over time: its largest value without single samples
_DELAY_UNIT = 1.0e-3  # s
_LEAST_RISE = 1.1  # static over Coulomb force, assumed where the file has no Stribeck effect
_DIFFERENCE = 1.0e-4
_LOWER_CORNER = 2.0**-0.5  # corner of the low-pass of the friction over the band, as in identification
_DRAWS = 4  # of the position's noise: a common error does not average out
_PARAMETERS = ("offset", "actuator_delay", "mass_error")  # effects that are parameters of the force balance


@dataclass(frozen=True)
class Contact:
    """A contact that the design assumes.

    Attributes:
        friction: its friction.
        is_from_file: whether its elements are those of the file.
    """

    friction: FrictionSettings
    is_from_file: bool


def contacts(friction: FrictionSettings, smallest: float) -> list[Contact]:
    """Return the contact of the file, and others that differ from it by up to a decade in speed and in deflections.

    Args:
        friction: of the file.
        smallest: smallest reversal that the axis can do [m].
    """
    known = replace(friction, static_force=max(friction.static_force, _LEAST_RISE * friction.coulomb_force))
    share = np.array(friction.element_fraction)
    deflection = share * friction.coulomb_force / np.array(friction.element_stiffness)
    places = np.geomspace(
        max(smallest, float(deflection.min()) / HALF_DECADE), HALF_DECADE * float(deflection.max()), LOG_SPACED_COUNT
    )
    shares = np.sqrt(places) / np.sum(np.sqrt(places))
    spread = replace(
        known,
        element_stiffness=tuple((shares * friction.coulomb_force / places).tolist()),
        element_fraction=tuple(shares.tolist()),
        element_damping=(0.0,) * LOG_SPACED_COUNT,
    )
    return [
        Contact(known, True),
        *(
            Contact(replace(spread, stribeck_velocity=factor * friction.stribeck_velocity), False)
            for factor in (HALF_DECADE, 1.0 / HALF_DECADE, HALF_DECADE**-2)
        ),
    ]


@dataclass(frozen=True)
class Parameters:
    """Columns of the parameters of the force balance.

    Attributes:
        names: of each column.
        columns: derivative of the effort by the logarithm of each, in units of the noise, shape (rows, columns).
        asked: asked quantities by name: weights of the columns in their logarithm.
    """

    names: tuple[str, ...]
    columns: Floats
    asked: dict[str, Floats]


class Sensitivity:
    """The effort along a reference, and its derivatives.

    Args:
        axis: settings.
        contact: the assumed friction.
        position: reference [m], shape (n,).
        period: time between two samples [s].
    """

    def __init__(self, axis: AxisSettings, contact: Contact, position: Floats, period: float) -> None:
        self.axis, self.contact, self.position, self.period = axis, contact, position, period
        self.velocity: Floats = np.gradient(position, period)
        self.acceleration: Floats = np.gradient(self.velocity, period)
        self.time = np.asarray(period * np.arange(len(position)))
        self.band = min(BAND, RATE_SHARE / period)
        self.stride = max(1, round(1.0 / (ROW_RATE * self.band * period)))
        self._sections = signal.butter(4, min(2.0 * self.band * period, 0.9), output="sos")
        friction = contact.friction
        level = np.array(friction.element_fraction) * friction.coulomb_force
        self._kappa, self._level = np.array(friction.element_stiffness), level
        ratio = friction.static_force / friction.coulomb_force
        rate = friction.attraction_rate / friction.coulomb_force
        self._shared = np.array([ratio, friction.stribeck_velocity, rate])
        self._shape = ElementShape.of(friction, friction.model)
        self.stribeck: Floats = np.asarray(
            stribeck_level(self.velocity, friction.static_force, friction.coulomb_force, friction.stribeck_velocity)
        )
        listed = [item for item in axis.effects if effect(item.name).place in (Place.ADDED_FORCE, Place.LEVEL_FACTOR)]
        self._force, self._factor = self._evaluate(listed, np.zeros(len(position)))
        self.friction, self._slopes = self._elements(self.position, self._factor)
        self.effort = self._needed(self.position, self.velocity, self.acceleration, self.friction) + self._force
        self._weights = self._row_weights()

    def _evaluate(self, effects: Sequence[EffectSettings], effort: Floats) -> tuple[Floats, Floats]:
        """Return the force and the factor on the level of effects."""
        compiled = CompiledEffects(effects, self.period)
        force, factor = compiled.evaluate(
            self.position, self.velocity, self.acceleration, self.time, effort,
            np.full(len(self.position), self.period), self.stribeck, compiled.initial_state(),
        )  # fmt: skip
        return force + compiled.added_mass * self.acceleration, factor

    def _elements(self, position: Floats, factor: Floats) -> tuple[Floats, Floats]:
        """Return the elements' force and its slopes."""
        return friction_and_slopes(position, self.period, self._kappa, self._level, self._shared, self._shape, factor)

    def _needed(self, position: Floats, velocity: Floats, acceleration: Floats, friction: Floats) -> Floats:
        """Return the effort without added forces."""
        return self.axis.mass * acceleration + self.axis.friction.viscous_coefficient * velocity + friction

    def _row_weights(self) -> Floats:
        """Return the weights of the rows: one over the noise, for rows that are independent of each other."""
        travel = np.diff(self.position, prepend=self.position[:1])
        friction = self.contact.friction
        _force, stiffness = element_friction(
            friction, 0.5 * travel, 0.5 * travel, self.period, self.stribeck * self._factor
        )
        variance = self.axis.estimator.measurement_std**2 + (stiffness * self.axis.filter.position_noise) ** 2
        independent = min(1.0, 2.0 * self.band * self.stride * self.period)
        return np.sqrt(independent / variance[:: self.stride])

    def rows(self, columns: Floats) -> Floats:
        """Return columns below the band, at the rate of rows, in units of the noise.

        Args:
            columns: forces [N], shape (n,) or (n, k).
        """
        filtered = zero_phase(self._sections, columns)[:: self.stride]
        return np.asarray(filtered * (self._weights if columns.ndim == 1 else self._weights[:, None]))

    def errors(self) -> Floats:
        """Return the error of the friction from the measured motion that drives it, shape (rows, 2).

        The first column is from the low-pass of the measured motion, the second from its noise, which moves a contact
        that is at rest. Neither averages out.
        """
        corner = min(2.0 * _LOWER_CORNER * MOTION_OVER_BALANCE * self.band * self.period, 0.9)
        sections = signal.butter(4, corner, output="sos")
        smooth = zero_phase(sections, self.position)
        exact = self._elements(smooth, self._factor)[0]
        noisy = np.zeros(len(exact))
        for seed in range(_DRAWS):
            noise = np.random.default_rng(seed).normal(0.0, self.axis.filter.position_noise, len(exact))
            noisy += self._elements(smooth + zero_phase(sections, noise), self._factor)[0] / _DRAWS
        return self.rows(np.column_stack([exact - self.friction, noisy - exact]))

    def parameters(self) -> Parameters:
        """Return the columns of the parameters of the force balance."""
        friction, n_z = self.contact.friction, len(self._kappa)
        viscous = self.axis.friction.viscous_coefficient * self.velocity
        if not np.any(viscous):
            viscous = SIZE * friction.coulomb_force * self.velocity / max(float(np.max(np.abs(self.velocity))), 1e-300)
        shared = self._slopes[:, 2 * n_z :] * self._shared
        found = {
            "mass": self.axis.mass * self.acceleration,
            "viscous_coefficient": viscous,
            "offset": np.full(len(self.position), friction.coulomb_force),
            "delay": -_DELAY_UNIT * np.gradient(self.effort, self.period),
            "stribeck_ratio": shared[:, 0],
            "stribeck_velocity": shared[:, 1],
        }
        if friction.model == "gms":
            found["attraction_rate"] = shared[:, 2]
        elements = np.arange(1, n_z + 1)
        for i in range(n_z):
            found[f"element_stiffness[{elements[i]}]"] = self._kappa[i] * self._slopes[:, i]
        for i in range(n_z):
            found[f"element_force[{elements[i]}]"] = self._level[i] * self._slopes[:, n_z + i]
        names = tuple(found)
        asked = {name: np.eye(len(names))[names.index(name)] for name in names if name != "stribeck_ratio"}
        coulomb = np.zeros(len(names))
        coulomb[-n_z:] = friction.element_fraction
        asked["coulomb_force"] = coulomb
        asked["static_force"] = coulomb + np.eye(len(names))[names.index("stribeck_ratio")]
        return Parameters(names, np.column_stack([self.rows(column) for column in found.values()]), asked)

    def effect_column(self, settings: EffectSettings) -> Floats:
        """Return the effort of an effect [N], shape (n,)."""
        entry = effect(settings.name)
        if entry.place in (Place.ADDED_FORCE, Place.PLANT):
            return self._evaluate([settings], self.effort)[0]
        if entry.place is Place.LEVEL_FACTOR:
            factor = self._evaluate([settings], self.effort)[1]
            return self._elements(self.position, self._factor * factor)[0] - self.friction
        compiled = CompiledEffects([settings], self.period)
        if entry.place is Place.EFFORT_PATH:
            return compiled.needed_command(self.effort) - self.effort
        position = compiled.corrected_position(self.position)
        velocity: Floats = np.gradient(position, self.period)
        friction = self._elements(position, self._factor)[0]
        acceleration: Floats = np.gradient(velocity, self.period)
        return self._needed(position, velocity, acceleration, friction) + self._force - self.effort

    def level_column(self) -> Floats:
        """Return the effort of a friction level that is higher by a small share [N], shape (n,)."""
        return self._elements(self.position, self._factor * (1.0 + _DIFFERENCE))[0] - self.friction

    @staticmethod
    def largest_force(column: Floats) -> float:
        """Return the largest force of an effect's column [N]."""
        return float(np.quantile(np.abs(column), _QUANTILE))

    def unit_rows(self, column: Floats, strength: float = SIZE) -> Floats:
        """Return an effect's column scaled to a certain strength; zeros if it has no force.

        Args:
            column: from ``effect_column`` [N].
            strength: largest force over the Coulomb force [-].
        """
        largest = self.largest_force(column)
        if not largest > 1.0e-9 * self.contact.friction.coulomb_force:
            return np.zeros(len(self._weights))
        return self.rows(strength * self.contact.friction.coulomb_force / largest * column)

    def slopes_of_listed(self) -> tuple[tuple[str, ...], Floats]:
        """Return the columns of the parameters of the file's own effects, shape (rows, k), and each one's effect."""
        owners, out = [], []
        for item in self.axis.effects:
            if item.name in _PARAMETERS:
                continue
            values = item.values or effect(item.name).defaults
            for number, entry in enumerate(effect(item.name).parameters):
                step = _DIFFERENCE * (abs(values[number]) or (1.0 if entry.unit == "-" else SIZE))
                if values[number] + step > entry.maximum:
                    step = -step
                moved = (*values[:number], values[number] + step, *values[number + 1 :])
                change = self.effect_column(EffectSettings(item.name, moved)) - self.effect_column(
                    EffectSettings(item.name, tuple(values))
                )
                rows = self.unit_rows(change / step)
                if np.any(rows):
                    owners.append(item.name)
                    out.append(rows)
        return tuple(owners), np.column_stack(out) if out else np.zeros((len(self._weights), 0))
