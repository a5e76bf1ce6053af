"""What the steps of a commissioning share: request, table, folder, time, and their ledger, ``commission.json``."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from sgms_observer.application.commission.motion import Motion
from sgms_observer.application.commission.table import Guard, Heard, HeldUp, Table, Watch
from sgms_observer.application.commission.tracking import Tracker
from sgms_observer.errors import ConfigurationError, DataError, RecordingError
from sgms_observer.excitation.limits import ExcitationLimits, limits_of
from sgms_observer.settings.axis import AxisSettings, Settings
from sgms_observer.settings.load import load_settings
from sgms_observer.whole_file import write_text

FILE = "commission.json"
SCHEMA = 1
DONE, SKIPPED, FAILED = "done", "skipped", "failed"

LEARN_BAG, OWN_BAG = "recordings/learn", "recordings/own"
BEFORE_BAG, AFTER_BAG = "recordings/before", "recordings/after"
EXCITATION, OWN_MOTION = "excitation.csv", "motion.csv"
IDENTIFIED = "identification/identified.yaml"
REPEATS = 3
"""How often a motion is played again after a busy computer stopped it."""
CANDIDATE, COMMISSIONED, REPORT = "candidate.yaml", "commissioned.yaml", "report.html"


@dataclass(frozen=True)
class Step:
    """What became of one step.

    Attributes:
        name: of the step.
        state: ``done``, ``skipped`` or ``failed``.
        seconds: how long it took [s].
        sentence: what it found, or why it failed or was skipped.
        files: what it wrote, relative to the folder; a rerun skips a step whose files are there.
    """

    name: str
    state: str
    seconds: float
    sentence: str
    files: tuple[str, ...] = ()


@dataclass
class Ledger:
    """The file ``commission.json`` of a folder.

    Attributes:
        folder: everything of the commissioning is in it.
        request: what was asked for; a folder goes with one request.
        steps: by name, in their order.
        facts: what later steps and reruns need.
        effects: as in result.json.
        tracking: rms and peak of the tracking error before and after, with their unit.
        is_usable: whether ``yaml`` may be used as it is.
        yaml: name of the commissioned parameter file; None until it is there.
    """

    folder: Path
    request: Mapping[str, Any]
    steps: dict[str, Step] = field(default_factory=dict)
    facts: dict[str, Any] = field(default_factory=dict)
    effects: list[Any] = field(default_factory=list)
    tracking: dict[str, Any] = field(default_factory=dict)
    is_usable: bool = False
    yaml: str | None = None

    @classmethod
    def open(cls, folder: Path, request: Mapping[str, Any], is_overwriting: bool) -> Ledger:
        """Return the ledger of a folder, with the steps that an earlier run finished.

        Args:
            folder: the folder.
            request: what is asked for.
            is_overwriting: start anew, whatever is there.

        Raises:
            ConfigurationError: the folder belongs to another request.
            RecordingError: its ledger cannot be read.
        """
        path = folder / FILE
        if is_overwriting or not path.exists():
            return cls(folder, request)
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
            earlier = found["request"]
            steps = {entry["name"]: Step(**{**entry, "files": tuple(entry["files"])}) for entry in found["steps"]}
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise RecordingError(f"{path} cannot be read ({error}); give another --out, or --overwrite") from None
        differing = [name for name in request if request[name] != earlier.get(name)]
        if differing:
            raise ConfigurationError(
                [
                    f"{path} belongs to a commissioning with another {', '.join(differing)}; give the same again to go"
                    " on, another --out, or --overwrite to start anew"
                ]
            )
        return cls(
            folder, request, steps, found["facts"], found["effects"], found["tracking"], found["usable"], found["yaml"]
        )

    def is_finished(self, name: str) -> bool:
        """Return whether a rerun may skip a step."""
        step = self.steps.get(name)
        if step is None or step.state == FAILED or not step.files:
            return False
        return all((self.folder / file).exists() for file in step.files)

    def note(self, name: str, state: str, seconds: float, sentence: str, files: Sequence[str] = ()) -> None:
        """Write down what became of a step; the steps behind it have to be done again.

        Args:
            name: of the step.
            state: ``done``, ``skipped`` or ``failed``.
            seconds: how long it took [s].
            sentence: what it found.
            files: what it wrote, relative to the folder.
        """
        kept = {}
        for known, step in self.steps.items():
            if known == name:
                break
            kept[known] = step
        self.steps = {**kept, name: Step(name, state, round(seconds, 2), sentence, tuple(files))}
        self.write()

    def repeat(self, name: str) -> None:
        """Note that a rerun skipped a step that was finished before."""
        step = self.steps[name]
        self.steps[name] = Step(name, SKIPPED, step.seconds, step.sentence, step.files)

    def as_json(self) -> dict[str, Any]:
        """Return the content of the file."""
        return {
            "schema": SCHEMA,
            "steps": [{**asdict(step), "files": list(step.files)} for step in self.steps.values()],
            "effects": self.effects,
            "tracking": self.tracking,
            "usable": self.is_usable,
            "yaml": self.yaml,
            "request": dict(self.request),
            "facts": self.facts,
        }

    def write(self) -> None:
        """Write the file, whole or not at all."""
        write_text(json.dumps(self.as_json(), indent=1) + "\n", self.folder / FILE)


@dataclass(frozen=True)
class Request:
    """What to commission, and how.

    Attributes:
        config: parameter file to start from.
        out: folder of everything.
        axis: the axis; the first of the file if None.
        stroke: full width of all motions [m]; None for a cautious one, as are the next two.
        speed: largest speed [m/s].
        acceleration: largest acceleration [m/s^2].
        motion: the user's own motion, a bag or a CSV; empty for one that stands for it.
        seconds: no step is begun after this time [s].
    """

    config: str
    out: Path
    axis: str | None = None
    stroke: float | None = None
    speed: float | None = None
    acceleration: float | None = None
    motion: str = ""
    seconds: float = 1800.0

    def as_json(self) -> dict[str, Any]:
        """Return what a folder belongs to."""
        return {
            "config": str(Path(self.config).resolve()),
            "axis": self.axis,
            "stroke": self.stroke,
            "speed": self.speed,
            "acceleration": self.acceleration,
            "motion": str(Path(self.motion).resolve()) if self.motion else "",
        }


@dataclass(frozen=True)
class Plan:
    """A request that was checked.

    Attributes:
        request: the request.
        settings: of the file.
        axis: of the axis that is commissioned.
        limits: what the table may do.
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
        limits = limits_of(axis.joint_type, request.stroke, request.speed, request.acceleration)
        return cls(request, settings, axis, limits)


class Session:
    """One run of a commissioning.

    Args:
        plan: what to do.
        ledger: what is done.
        table: the axis on the graph.
        confirm: asks the user a question; returns whether to go on.
        say: tells the user a sentence.
        progress: is told the title of long work and how much of it is done, from 0 to 1.
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
        self.say, self.progress = say, progress
        self._confirm = confirm
        self._end = time.monotonic() + plan.request.seconds

    @property
    def axis(self) -> AxisSettings:
        """Return the settings of the axis as the file gives them."""
        return self.plan.axis

    @property
    def seconds_left(self) -> float:
        """Return how long steps may still begin [s]."""
        return self._end - time.monotonic()

    @property
    def origin(self) -> float:
        """Return where the axis stood when the commissioning began [m]."""
        return float(self.ledger.facts["origin"])

    @property
    def delay(self) -> float:
        """Return how long after its stamp the table follows a set-point [s]."""
        return float(self.ledger.facts.get("delay", 0.0))

    def path(self, name: str) -> Path:
        """Return a file of the folder."""
        return self.ledger.folder / name

    def confirm_motion(self, motion: Motion, purpose: str) -> None:
        """Ask whether the axis may move.

        Args:
            motion: what it will do.
            purpose: what for.

        Raises:
            DataError: the user does not want that.
        """
        readable, origin = self.axis.units.readable, self.origin
        low, high = origin + float(motion.position.min()), origin + float(motion.position.max())
        sentence = (
            f"{purpose}: axis {self.axis.name} moves between {readable(low)} and {readable(high)} for"
            f" {motion.duration:.0f} s, at up to {readable(motion.peak_speed, 'm/s')} and"
            f" {readable(motion.peak_acceleration, 'm/s^2')}"
        )
        if not self._confirm(sentence):
            raise DataError("the motion was not confirmed, so nothing moved; start again to go on")

    def play(self, motion: Motion, *watches: Watch, guard: Guard | None = None) -> Tracker:
        """Play a motion under guard; again, where a busy computer was the reason that it was stopped.

        Args:
            motion: the motion.
            watches: what looks at it too.
            guard: stops it, in place of the usual one.

        Returns:
            What was heard.
        """
        return self._repeated(lambda: self._play(motion, watches, guard=guard))

    def record(self, motion: Motion, bag: str, *watches: Watch) -> Tracker:
        """Play a motion under guard and record it; again as ``play`` does.

        Args:
            motion: the motion.
            bag: name of the recording in the folder.
            watches: what looks at it too.
        """
        return self._repeated(lambda: self._play(motion, watches, self.path(bag)))

    def _repeated(self, play: Callable[[], Tracker]) -> Tracker:
        for _ in range(REPEATS):
            try:
                return play()
            except HeldUp as error:
                self.say(f"Warning: {error}. The motion is played again.")
        return play()

    def _play(
        self, motion: Motion, watches: Sequence[Watch], bag: Path | None = None, guard: Guard | None = None
    ) -> Tracker:
        stops = guard or Guard(self.axis, self.plan.limits, self.origin, self.delay)
        tracker = Tracker(motion, self.origin, self.delay)

        def watch(heard: Heard) -> None:
            stops(heard)
            tracker(heard)
            for one in watches:
                one(heard)

        self.table.play(motion, self.origin, watch, bag)
        return tracker
