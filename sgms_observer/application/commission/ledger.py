"""The ledger of a commissioning, ``commission.json``: state, reason and result of every step."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from sgms_observer.errors import ConfigurationError, RecordingError
from sgms_observer.whole_file import refuse_existing_files, write_text

FILE = "commission.json"
SCHEMA = 1
DONE, SKIPPED, FAILED = "done", "skipped", "failed"

LEARN_BAG, OWN_BAG = "recordings/learn", "recordings/own"
BEFORE_BAG, AFTER_BAG = "recordings/before", "recordings/after"
EXCITATION, OWN_MOTION = "excitation.csv", "motion.csv"
IDENTIFIED = "identification/identified.yaml"
CANDIDATE, COMMISSIONED, REPORT = "candidate.yaml", "commissioned.yaml", "report.html"
LOG = "log"
WRITTEN = (
    EXCITATION, OWN_MOTION, CANDIDATE, COMMISSIONED, REPORT, LOG, "recordings", "identification", "diagnosis"
)  # fmt: skip
"""Files of a commissioning in its folder, without its ledger."""

CONTENT = "config_sha256"
"""Entry of a request: the hash of the parameter file's content."""
OWN_MOTION_GAP = "own_motion_gap"
"""Fact: gap of the user's file and of the identified one on the own motion, before any refit [% of the rms effort]."""
LIGHTS = "lights"
"""Fact: the questions of the diagnosis's report with their answers."""
DIAGNOSED = ("gap", "verdict", "diagnosis", "bags", LIGHTS)
"""Facts that a diagnosis writes."""
EXPERIMENTS = "experiments"
"""Fact: the experiments that were recorded since the first diagnosis."""
SHORTFALL = "shortfall"
"""Fact: the reason why the compensated motion is not good enough; empty without one."""


@dataclass(frozen=True)
class Step:
    """Result of one step.

    Attributes:
        name: of the step.
        state: ``done``, ``skipped`` or ``failed``.
        seconds: how long it took [s].
        sentence: its result, or the reason why it failed or was skipped.
        files: its files, relative to the folder; a rerun skips a step whose files exist.
        warnings: what the user should look at.
    """

    name: str
    state: str
    seconds: float
    sentence: str
    files: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def is_finished(self) -> bool:
        """Return whether this run or one before it finished the step."""
        return self.state == DONE or (self.state == SKIPPED and bool(self.files))


@dataclass
class Ledger:
    """The file ``commission.json`` of a folder.

    Attributes:
        folder: everything of the commissioning is in it.
        request: options of the command; a folder belongs to one request.
        steps: by name, in their order.
        facts: values for later steps and reruns.
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
            request: options of the command.
            is_overwriting: start anew and replace the files.

        Raises:
            ConfigurationError: the folder belongs to another request.
            RecordingError: its ledger cannot be read, or it holds files that no commissioning wrote.
        """
        path = folder / FILE
        if is_overwriting or not path.exists():
            refuse_existing_files([folder / name for name in WRITTEN], is_overwriting)
            return cls(folder, request)
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
            earlier = found["request"]
            lists = ("files", "warnings")
            entries = [{**entry, **{name: tuple(entry[name]) for name in lists}} for entry in found["steps"]]
            steps = {entry["name"]: Step(**entry) for entry in entries}
            results = (found["facts"], found["effects"], found["tracking"], found["usable"], found["yaml"])
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise RecordingError(f"{path} cannot be read ({error}); give another --out, or --overwrite") from None
        differing = [name for name in request if request[name] != earlier.get(name)]
        if differing == [CONTENT]:
            raise ConfigurationError(
                [
                    f"{request['config']} changed since the commissioning in {folder} began; put it back as it was to"
                    " go on, or start anew with --overwrite or another --out"
                ]
            )
        if differing:
            raise ConfigurationError(
                [
                    f"{path} belongs to a commissioning with another {', '.join(differing)}; give the same again to go"
                    " on, another --out, or --overwrite to start anew"
                ]
            )
        return cls(folder, request, steps, *results)

    @property
    def reason(self) -> str | None:
        """Return the reason why ``yaml`` must not be used as it is; None without one."""
        if self.is_usable:
            return None
        for step in self.steps.values():
            if not step.is_finished:
                return f"step {step.name} {'failed' if step.state == FAILED else 'was left out'}: {step.sentence}"
        return self.facts.get(SHORTFALL) or "no step is finished"

    @property
    def warnings(self) -> list[str]:
        """Return the warnings of all steps, each once."""
        return list(dict.fromkeys(warning for step in self.steps.values() for warning in step.warnings))

    def is_finished(self, name: str) -> bool:
        """Return whether a rerun may skip a step."""
        step = self.steps.get(name)
        if step is None or step.state == FAILED or not step.files:
            return False
        return all((self.folder / file).exists() for file in step.files)

    def begin(self, name: str) -> None:
        """Remove a step, the steps after it, their results and the page, before the step is done again."""
        names = list(self.steps)
        for dropped in names[names.index(name) :] if name in names else []:
            del self.steps[dropped]
            if dropped == "identify":
                self.facts.pop(OWN_MOTION_GAP, None)
            elif dropped == "diagnose":
                self.effects = []
                for fact in (*DIAGNOSED, EXPERIMENTS):
                    self.facts.pop(fact, None)
            elif dropped == "compensate":
                self.yaml = None
            elif dropped == "before_and_after":
                self.tracking, self.is_usable = {}, False
                self.facts.pop(SHORTFALL, None)
        self.steps.pop("report", None)
        self.write()

    def note(
        self,
        name: str,
        state: str,
        seconds: float,
        sentence: str,
        files: Sequence[str] = (),
        warnings: Sequence[str] = (),
    ) -> None:
        """Write down the result of a step; the steps after it have to be done again.

        Args:
            name: of the step.
            state: ``done``, ``skipped`` or ``failed``.
            seconds: how long it took [s].
            sentence: what it found.
            files: what it wrote, relative to the folder.
            warnings: what the user should look at.
        """
        earlier = {}
        for known, step in self.steps.items():
            if known == name:
                break
            earlier[known] = step
        self.steps = {**earlier, name: Step(name, state, round(seconds, 2), sentence, tuple(files), tuple(warnings))}
        self.write()

    def repeat(self, name: str) -> None:
        """Note that a rerun skipped a step that was finished before."""
        step = self.steps[name]
        self.steps[name] = Step(name, SKIPPED, step.seconds, step.sentence, step.files, step.warnings)

    def as_json(self) -> dict[str, Any]:
        """Return the content of the file."""
        return {
            "schema": SCHEMA,
            "steps": [asdict(step) for step in self.steps.values()],
            "effects": self.effects,
            "tracking": self.tracking,
            "usable": self.is_usable,
            "reason": self.reason,
            "yaml": self.yaml,
            "request": dict(self.request),
            "facts": self.facts,
        }

    def write(self) -> None:
        """Write the file, whole or not at all."""
        write_text(json.dumps(self.as_json(), indent=1) + "\n", self.folder / FILE)
