"""Follows one stiffness and one sample through the package and prints the steps they take; run by ``test_walks.py``.

Two runs differ in that number alone. A call carries the number where the two runs differ in what it returns or in what
it leaves in its arguments. A step is such a call from another file: a file and its own helpers are one step. What a
kernel calls is part of it, as numba compiles them into one; here numba is blocked, so that kernels are seen at all.
"""

from __future__ import annotations

import json
import linecache
import math
import sys
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from inspect import CO_GENERATOR
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

sys.modules["numba"] = None  # type: ignore[assignment]
np.empty = np.zeros  # what memory held before differs from run to run

import sgms_observer  # noqa: E402
from sgms_observer import AxisObserver, Samples, load_settings  # noqa: E402
from sgms_observer.bags.cdr import JointStateEncoder  # noqa: E402
from sgms_observer.nodes.engine import Engine  # noqa: E402

ROOT = Path(sgms_observer.__file__).parent
YAML = """/**:
  ros__parameters:
    axes: [x]
    sample_period: 1.0e-3
    x:
      mass: 3.0
      friction: {{element_stiffness: [{stiffness}, 1.0e6], element_fraction: [0.5, 0.5]}}
      filter: {{window: 8.0e-3}}
      compensation: {{enabled: true, limit: 5.0}}
      estimator: {{kind: ekf, correction_every: 2}}
"""
#: Steps that hand the number on, but not to the end of the walk.
BESIDE = {
    "settings.parameter_file.our_sections": "looks for settings that a file gives twice",
    "compensation.feedforward.Compensator.__init__": "the feedforward has the model too",
    "observer.samples._Block.of": "the constructor of Samples; that of other dataclasses is not seen either",
}


def digest(value: Any, above: tuple[int, ...] = ()) -> int:
    """Return a number that differs where the numbers and texts inside a value differ."""
    if isinstance(value, np.ndarray):
        return hash(value.tobytes())
    if id(value) in above:
        return 0
    above = (*above, id(value))
    if isinstance(value, dict):
        return hash(tuple((key, digest(one, above)) for key, one in value.items()))
    if isinstance(value, list | tuple | deque):
        return hash(tuple(digest(one, above) for one in value))
    if type(value).__module__.startswith("sgms_observer") and hasattr(value, "__dict__"):
        return digest(vars(value), above)
    return hash(value) if isinstance(value, int | float | str | bytes) else 0


@dataclass
class Call:
    """One call of a function of the package: its name, whether it is a step, and digests of what it left behind."""

    name: str
    is_step: bool
    arguments: list[Any]
    before: list[int]
    after: list[int]
    returned: int = 0

    def carries(self, other: Call) -> bool:
        """Return whether this call and the same call of another run left different things behind."""
        changed = (a != b and a != old for old, a, b in zip(self.before, self.after, other.after, strict=True))
        return self.returned != other.returned or any(changed)


def is_kernel(frame: FrameType) -> bool:
    """Return whether a function is decorated as a kernel."""
    return linecache.getline(frame.f_code.co_filename, frame.f_code.co_firstlineno).startswith("@njit")


def calls_of(work: Callable[[], object]) -> list[Call]:
    """Return the calls of functions of the package during some work, in order."""
    calls: list[Call] = []
    open_calls: list[Call] = []

    def note(frame: FrameType, event: str, value: object) -> None:
        code = frame.f_code
        if event not in ("call", "return") or not (path := Path(code.co_filename)).is_relative_to(ROOT):
            return
        if event == "return":
            ended = open_calls.pop()
            ended.after, ended.returned = [digest(one) for one in ended.arguments], digest(value)
            return
        caller = frame.f_back
        while caller is not None and not Path(caller.f_code.co_filename).is_relative_to(ROOT):
            caller = caller.f_back
        is_helper = caller is not None and (caller.f_code.co_filename == code.co_filename or is_kernel(caller))
        name = ".".join((*path.relative_to(ROOT).with_suffix("").parts, code.co_qualname))
        arguments = [frame.f_locals[one] for one in code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]]
        before = [digest(one) for one in arguments]
        # A generator hands nothing on that the function which asks it does not hand on.
        is_step = not is_helper and not code.co_flags & CO_GENERATOR
        open_calls.append(Call(name, is_step, arguments, before, before))
        calls.append(open_calls[-1])

    sys.setprofile(note)
    try:
        work()
    finally:
        sys.setprofile(None)
    return calls


def steps(one: list[Call], other: list[Call]) -> list[str]:
    """Return the names of the steps that carry what differs between two runs, each once."""
    pairs = list(zip(*([call for call in run if call.is_step] for run in (one, other)), strict=True))
    assert all(a.name == b.name for a, b in pairs), "the two runs went different ways"
    return list(dict.fromkeys(a.name for a, b in pairs if a.carries(b) and a.name not in BESIDE))


def stiffness_run(file: Path, stiffness: str) -> list[Call]:
    """Return the calls of the Python API from a YAML file with this stiffness to the end of some samples."""
    file.write_text(YAML.format(stiffness=stiffness))
    count = np.arange(40)
    none = np.full(40, np.nan)
    samples = Samples(count * 10**6, 1.0e-4 * np.sin(0.1 * count), np.full(40, 0.5), none, none)

    def work() -> None:
        settings = load_settings(file)
        AxisObserver(settings.axes[0], settings.sample_period).step(samples)

    return calls_of(work)


def sample_run(file: Path, moved: float, is_prepared: bool) -> list[Call]:
    """Return the calls of a node's engine for the last of some samples, which is off by this much [m, N]."""
    file.write_text(YAML.format(stiffness="2.0e6"))
    engine = Engine(load_settings(file))
    encoder = JointStateEncoder(["x"], ["position", "effort"])
    messages = [encoder.encode(10**9 + k * 10**6, [1.0e-4 * math.sin(0.1 * k)], [0.5]) for k in range(39)]
    last = encoder.encode(10**9 + 39 * 10**6, [1.0e-4 * math.sin(3.9) + moved], [0.5 + moved])

    def take(message: bytes) -> None:
        engine.intake.position_and_effort(message)
        engine.process(lambda block: None)

    for message in messages:
        take(message)
    if is_prepared:
        engine.prepare(lambda stamp_ns, forces: None)
    return calls_of(lambda: take(last))


def main(folder: Path) -> None:
    """Print the steps of the walks as JSON."""
    file = folder / "axis.yaml"
    stiffness_run(file, "2.0e6")  # what is kept from a first time on is left out
    walks = {"One stiffness": steps(stiffness_run(file, "2.0e6"), stiffness_run(file, "2.1e6"))}
    for name, is_prepared in (("One sample", False), ("The next sample", True)):
        walks[name] = steps(sample_run(file, 0.0, is_prepared), sample_run(file, 1.0e-7, is_prepared))
    print(json.dumps(walks, indent=1))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
