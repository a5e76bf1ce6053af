"""``commission.json``: what is done, what it found, and where a rerun goes on."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from sgms_observer.errors import ConfigurationError, RecordingError
from sgms_observer.whole_file import write_text

FILE = "commission.json"
SCHEMA = 1
DONE, SKIPPED, FAILED = "done", "skipped", "failed"


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
        """Return whether a rerun may skip a step.

        Args:
            name: of the step.
        """
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
        """Note that a rerun skipped a step that was finished before.

        Args:
            name: of the step.
        """
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
