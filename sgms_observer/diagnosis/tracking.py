"""Predicted tracking error: of the simulated stage, with and without compensation."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis.recorded_controller import RecordedController
from sgms_observer.settings.axis import CompensationSettings
from sgms_observer.settings.units import Units

MAX_RATIO = 1.5
"""Largest ratio of simulated to recorded error, rms and peak, for which the simulated controller counts as that of the
recording."""
MIN_COMPENSATED_SHARE = 0.5
"""Smallest share of the compensation of the whole friction that is not reported: half of it."""


@dataclass(frozen=True)
class TrackingError:
    """Position minus set-point.

    Attributes:
        rms: root mean square [m].
        peak: largest magnitude [m].
    """

    rms: float
    peak: float

    @staticmethod
    def of(error: Floats) -> TrackingError:
        """Return rms and peak of an error [m], shape (n,)."""
        return TrackingError(float(np.sqrt(np.mean(error**2))), float(np.max(np.abs(error))))

    def as_dict(self) -> dict[str, float]:
        """Return the content for JSON."""
        return {"rms": self.rms, "peak": self.peak}


def _agree(simulated: float, recorded: float) -> bool:
    """Return whether the ratio of two errors is at most ``MAX_RATIO``, either way."""
    return recorded > 0.0 and 1.0 / MAX_RATIO <= simulated / recorded <= MAX_RATIO


@dataclass(frozen=True)
class PredictedTracking:
    """Tracking errors of the stage that ``augmented.yaml`` describes, in closed loop.

    Attributes:
        without: without compensation.
        given: with the compensation of the file as it was given.
        augmented: with the compensation of ``augmented.yaml``.
        recorded: of the recording itself; None where it has no reference.
        seconds: simulated time [s].
        time: of each sample that counts [s], shape (n,).
        errors: the errors over time: without, given, augmented, and recorded if there is one [m], each of shape (n,).
        controller: of the loop, where it is the one that the recording shows; None where it is that of the file.
        compensated_share: rms compensation of ``augmented.yaml`` over that of the whole estimated friction.
    """

    without: TrackingError
    given: TrackingError
    augmented: TrackingError
    recorded: TrackingError | None
    seconds: float
    time: Floats = field(default_factory=lambda: np.zeros(0))
    errors: tuple[Floats, ...] = ()
    controller: RecordedController | None = None
    compensated_share: float = 1.0

    @property
    def agrees(self) -> bool:
        """Return whether the simulated loop follows as the machine did: rms and peak without compensation agree."""
        recorded = self.recorded
        return recorded is not None and all(
            _agree(*pair) for pair in ((self.without.rms, recorded.rms), (self.without.peak, recorded.peak))
        )

    @property
    def along(self) -> str:
        """Return the motion that the stage follows, in words."""
        return "the measured motion" if self.recorded is None else "the recorded reference"

    @property
    def of_controller(self) -> str:
        """Return which controller the loop has, in words; empty where it is that of the file."""
        if self.controller is None:
            return ""
        return f" with the controller that the recording shows ({self.controller.sentence})"

    def caution(self, units: Units) -> str:
        """Return why the simulated controller may differ from that of the recording; empty if the errors agree.

        Args:
            units: units of the axis.
        """
        remedy = "compare the predicted errors with each other only, or set stage.controller to the machine's"
        if self.recorded is None:
            return (
                "the recording has no reference, so nothing shows whether stage.controller of the file is the"
                f" controller of the recording; {remedy}"
            )
        if not _agree(self.without.rms, self.recorded.rms):
            return (
                f"the recorded tracking error is {units.readable(self.recorded.rms)} rms, the simulated one without"
                f" compensation {units.readable(self.without.rms)}: stage.controller of the file is not the controller"
                f" of the recording, or a compensation was on; {remedy}"
            )
        if not _agree(self.without.peak, self.recorded.peak):
            return (
                f"the recorded tracking error has a peak of {units.readable(self.recorded.peak)}, the simulated one"
                f" without compensation {units.readable(self.without.peak)}: the model lacks what causes the peak,"
                " stage.controller of the file is not the controller of the recording, or a compensation was on;"
                f" {remedy}"
            )
        return ""

    def limits_sentence(self, compensation: CompensationSettings, units: Units) -> str:
        """Return how much of the friction the compensation gives, and what holds it back.

        Args:
            compensation: settings of the compensation.
            units: units of the axis.
        """
        limit, fade = (units.readable(one, "N") for one in (compensation.limit, compensation.fade_std))
        slew = units.readable(compensation.slew_limit, "N/s")
        return (
            f"the compensation gives {100.0 * self.compensated_share:.2g} % of the friction in the predicted tracking:"
            f" compensation.limit is {limit}, slew_limit {slew}, and fade_std {fade}; one of them, or"
            " standstill_velocity, holds it back"
        )

    def sentence(self, units: Units) -> str:
        """Return the errors in words.

        Args:
            units: of the axis.
        """
        readable = partial(units.readable, largest=self.without.peak)
        rows = [
            f"{readable(error.rms)} rms, {readable(error.peak)} peak {text}"
            for error, text in (
                (self.without, "without compensation"),
                (self.given, "with that of the file as given"),
                (self.augmented, "with that of augmented.yaml"),
            )
        ]
        return f"predicted tracking error along {self.along}{self.of_controller}: {'; '.join(rows)}"

    def as_dict(self, units: Units) -> dict[str, Any]:
        """Return the content for result.json.

        Args:
            units: of the axis.
        """
        return {
            "without": self.without.as_dict(),
            "given": self.given.as_dict(),
            "augmented": self.augmented.as_dict(),
            "recorded": None if self.recorded is None else self.recorded.as_dict(),
            "along": self.along,
            "seconds": self.seconds,
            "unit": units.position,
            "controller": None if self.controller is None else self.controller.as_dict(),
            "caution": self.caution(units) or None,
        }
