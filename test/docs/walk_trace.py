"""Prints every call of the package in one run, from a YAML file to a compensation; without numba, so that kernels show.

Run by ``test_walks.py``.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from types import FrameType

sys.modules["numba"] = None  # type: ignore[assignment]

import sgms_observer  # noqa: E402
from sgms_observer.bags.cdr import JointStateEncoder  # noqa: E402
from sgms_observer.nodes.engine import Engine  # noqa: E402
from sgms_observer.settings.load import load_settings  # noqa: E402

ROOT = Path(sgms_observer.__file__).parent
YAML = """/**:
  ros__parameters:
    axes: [x]
    sample_period: 1.0e-3
    x:
      mass: 3.0
      friction: {element_stiffness: [2.0e6, 1.0e6], element_fraction: [0.5, 0.5]}
      filter: {window: 8.0e-3}
      compensation: {enabled: true, limit: 5.0}
      estimator: {kind: ekf, correction_every: 2}
"""


def note(frame: FrameType, event: str, _: object) -> None:
    """Print the name of a function of the package that is entered."""
    path = Path(frame.f_code.co_filename)
    if event == "call" and path.is_relative_to(ROOT):
        module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        print(f"{module}.{frame.f_code.co_qualname}")


def main(folder: Path) -> None:
    """Load, observe forty samples, and print the calls of the loading and of the last of them."""
    (folder / "axis.yaml").write_text(YAML)
    sys.setprofile(note)
    engine = Engine(load_settings(folder / "axis.yaml"))
    sys.setprofile(None)
    encoder = JointStateEncoder(["x"], ["position", "effort"])
    for number in range(40):
        message = encoder.encode(10**9 + number * 10**6, [1.0e-4 * math.sin(0.1 * number)], [0.5])
        if number == 39:
            print("a sample")
            sys.setprofile(note)
        engine.intake.position_and_effort(message)
        engine.process(lambda block: None)
    sys.setprofile(None)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
