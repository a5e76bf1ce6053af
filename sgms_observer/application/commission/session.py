"""State that the steps of a commissioning share: request, plan, axis on the graph, and remaining time."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from sgms_observer.application.commission.ledger import CONTENT, Ledger
from sgms_observer.application.commission.motion import Motion, longest_approach
from sgms_observer.application.commission.table import Guard, Heard, HeldUp, Table, Watch
from sgms_observer.application.commission.tracking import Tracker
from sgms_observer.errors import DataError, SgmsError
from sgms_observer.excitation.limits import ExcitationLimits, limits_of
from sgms_observer.settings.axis import AxisSettings, Settings
from sgms_observer.settings.load import load_settings
from sgms_observer.settings.node_parameters import refuse_missing

REPEATS = 3
"""How often a motion is played again after a busy computer stopped it."""
MEETING = 3.0
"""Time of a motion in addition to itself and the move to its start: discovery of subscribers, and rest [s]."""


class OutOfTime(SgmsError):
    """The time of --time is over, or too short for what comes next."""


@dataclass(frozen=True)
class Request:
    """Options of a commissioning.

    Attributes:
        config: parameter file to start from.
        out: folder of everything.
        axis: the axis; the first of the file if None.
        stroke: full width of all motions [m]; None for a cautious one, as are the next two.
        speed: largest speed [m/s].
        acceleration: largest acceleration [m/s^2].
        motion: the user's own motion, a bag or a CSV; empty for a representative one.
        seconds: time for everything [s].
        topics: names of topics on the graph where they differ, by their key.
    """

    config: str
    out: Path
    axis: str | None = None
    stroke: float | None = None
    speed: float | None = None
    acceleration: float | None = None
    motion: str = ""
    seconds: float = 1800.0
    topics: Mapping[str, str] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """Return the options that a folder belongs to; reads the parameter file for its hash."""
        return {
            "config": str(Path(self.config).resolve()),
            CONTENT: hashlib.sha256(Path(self.config).read_bytes()).hexdigest(),
            "axis": self.axis,
            "stroke": self.stroke,
            "speed": self.speed,
            "acceleration": self.acceleration,
            "motion": str(Path(self.motion).resolve()) if self.motion else "",
            "topics": dict(self.topics),
        }


@dataclass(frozen=True)
class Plan:
    """A request that was checked.

    Attributes:
        request: the request.
        settings: of the file.
        axis: settings of the axis that is commissioned.
        limits: stroke, speed and acceleration that the axis may use.
    """

    request: Request
    settings: Settings
    axis: AxisSettings
    limits: ExcitationLimits

    @classmethod
    def of(cls, request: Request) -> Plan:
        """Return the plan of a request.

        Raises:
            ConfigurationError: file, axis or limits cannot be used.
        """
        settings = load_settings(request.config)
        axis = settings.wanted_axes([request.axis] if request.axis else (), request.config)[0]
        refuse_missing(settings, [axis])
        limits = limits_of(axis.joint_type, request.stroke, request.speed, request.acceleration)
        return cls(request, settings, axis, limits)


class Session:
    """One run of a commissioning.

    Args:
        plan: the checked request.
        ledger: results of the steps so far.
        table: the axis on the graph.
        confirm: asks the user a question; returns whether to go on.
        say: prints a sentence.
        progress: called with the title of long work and the completed share, 0 to 1.

    Attributes:
        reserved: time that is kept for the steps after the running one [s].
    """

    def __init__(
        self,
        plan: Plan,
        ledger: Ledger,
        table: Table,
        confirm: Callable[[str], bool],
        say: Callable[[str], None],
        progress: Callable[[str, float], None],
    ) -> None:
        self.plan, self.ledger, self.table = plan, ledger, table
        self.say = say
        self.reserved = 0.0
        self._progress, self._confirm = progress, confirm
        self._warnings: list[str] = []
        self._end = time.monotonic() + plan.request.seconds

    @property
    def axis(self) -> AxisSettings:
        """Return the settings of the axis as the file gives them."""
        return self.plan.axis

    @property
    def seconds_left(self) -> float:
        """Return how much of the time is left for what runs now [s]."""
        return self._end - time.monotonic() - self.reserved

    @property
    def origin(self) -> float:
        """Return where the axis stood when the commissioning began [m]."""
        return float(self.ledger.facts["origin"])

    @property
    def delay(self) -> float:
        """Return how long after its stamp the axis follows a set-point [s]."""
        return float(self.ledger.facts.get("delay", 0.0))

    def path(self, name: str) -> Path:
        """Return a file of the folder."""
        return self.ledger.folder / name

    def warn(self, warning: str) -> None:
        """Print a warning, a sentence that begins with ``Warning:``, and keep it for the ledger and the page."""
        self.say(warning)
        self._warnings.append(warning)

    def take_warnings(self) -> list[str]:
        """Return the warnings since the last call."""
        warnings, self._warnings = self._warnings, []
        return warnings

    def need(self, seconds: float, what: str) -> None:
        """Raise if the remaining time is too short for the next work.

        Args:
            seconds: about how long it takes [s].
            what: name of the work, for the sentence.

        Raises:
            OutOfTime: it cannot end in time.
        """
        left = self.seconds_left
        if left <= 0.0:
            raise OutOfTime("not begun, because the time of --time is over; start again to go on from here")
        if seconds > left:
            raise OutOfTime(
                f"not begun: {what} takes about {seconds:.0f} s, and {left:.0f} s of --time are left; start again to go"
                " on from here"
            )

    def progress(self, title: str, share: float) -> None:
        """Show the progress of long work.

        Args:
            title: of the work.
            share: the completed share, 0 to 1.

        Raises:
            OutOfTime: the time is over; the work is stopped.
        """
        self._progress(title, share)
        if share < 1.0:
            self._raise_end()

    def _raise_end(self) -> None:
        if self.seconds_left <= 0.0:
            raise OutOfTime("stopped, because the time of --time was over; start again with more to go on from here")

    def duration_of(self, motion: Motion) -> float:
        """Return about how long it takes to play a motion, with the way to its start [s]."""
        return motion.duration + longest_approach(self.plan.limits, motion.period) + MEETING

    def confirm_motion(self, motion: Motion, purpose: str, times: int = 1) -> None:
        """Ask whether the axis may move.

        Args:
            motion: the motion.
            purpose: its purpose, for the question.
            times: how often the motion is played.

        Raises:
            OutOfTime: it cannot end in time.
            DataError: the user did not confirm the motion.
        """
        self.need(times * self.duration_of(motion), f"the motion ({purpose})")
        readable, origin = self.axis.units.readable, self.origin
        low, high = self.axis.units.readable_positions(
            origin + float(motion.position.min()), origin + float(motion.position.max())
        )
        sentence = (
            f"{purpose}: axis {self.axis.name} moves between {low} and {high} for {motion.duration:.0f} s,"
            f" at up to {readable(motion.peak_speed, 'm/s')} and {readable(motion.peak_acceleration, 'm/s^2')}"
        )
        if not self._confirm(sentence):
            raise DataError("the motion was not confirmed, so nothing moved; start again to go on")

    def play(
        self,
        motion: Motion,
        *watches: Watch,
        guard: Callable[[], Guard] | None = None,
        prepare: Callable[[], None] | None = None,
    ) -> Tracker:
        """Play a motion under guard; repeat it where a busy computer stopped it.

        Args:
            motion: the motion.
            watches: further functions that get the samples.
            guard: makes another guard than the usual one, for every attempt.
            prepare: called before every attempt, because a stopped attempt has switched the compensation off.

        Returns:
            The collected samples.
        """
        return self._repeated(motion, watches, None, guard, prepare)

    def record(self, motion: Motion, bag: str, *watches: Watch, prepare: Callable[[], None] | None = None) -> Tracker:
        """Play a motion under guard and record it; repeat it as ``play`` does.

        Args:
            motion: the motion.
            bag: name of the recording in the folder.
            watches: further functions that get the samples.
            prepare: as for ``play``.
        """
        return self._repeated(motion, watches, self.path(bag), None, prepare)

    def _repeated(
        self,
        motion: Motion,
        watches: Sequence[Watch],
        bag: Path | None,
        guard: Callable[[], Guard] | None,
        prepare: Callable[[], None] | None,
    ) -> Tracker:
        def play() -> Tracker:
            self.need(self.duration_of(motion), "the motion")  # a user may have answered late
            if prepare is not None:
                prepare()
            stops = Guard(self.axis, self.plan.limits, self.origin, self.delay) if guard is None else guard()
            return self._play(motion, watches, bag, stops)

        for _ in range(REPEATS):
            try:
                return play()
            except HeldUp as error:
                self.warn(f"Warning: {error}. The motion is played again.")
        return play()

    def _play(self, motion: Motion, watches: Sequence[Watch], bag: Path | None, stops: Guard) -> Tracker:
        tracker = Tracker(motion, self.origin, self.delay)

        def watch(heard: Heard) -> None:
            stops(heard)
            self._raise_end()
            tracker(heard)
            for one in watches:
                one(heard)

        self.table.play(motion, self.origin, watch, bag)
        return tracker
