"""The numeric core by itself: no ROS near it, and the same answers without a compiler."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
CORE = (
    "formulas", "settings.load", "friction.sgms", "friction.gms", "effects.compiled", "filters.differentiator",
    "estimators.estimator", "compensation.feedforward", "observer.axis_observer", "observer.pairing",
    "identification.identify", "diagnosis.workflow", "bags.reader", "bags.writer", "report.page",
)  # fmt: skip
SYMBOLIC = ("friction.symbolic", "estimators.reference") if importlib.util.find_spec("casadi") else ()

FORBIDDEN = ("rclpy", "rosidl_runtime_py", "sensor_msgs", "diagnostic_msgs", "std_msgs", "sim_plant")
BLOCKED = f"""
import importlib, sys
class Wall:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {FORBIDDEN!r}:
            raise ImportError("the core asked for " + name)
sys.meta_path.insert(0, Wall())
for name in {CORE + SYMBOLIC!r}:
    importlib.import_module("sgms_observer." + name)
"""

OBSERVE = """
import json, sys
import numpy as np
from dataclasses import replace
from sgms_observer.jit import HAS_NUMBA
from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.observer.samples import Samples
from sgms_observer.settings.axis import AxisSettings, EffectSettings
from sgms_observer.settings.axis import EstimatorSettings

assert HAS_NUMBA == (sys.argv[1] == "compiled")
axis = AxisSettings(estimator=EstimatorSettings(parameters=("kappa",)), effects=(EffectSettings("cogging"),))
seconds = np.arange(500) * 1e-3
omega = 2 * np.pi * 5
position = 2e-4 * np.sin(omega * seconds)
effort = 4 * np.sign(np.cos(omega * seconds)) - 10 * 2e-4 * omega**2 * np.sin(omega * seconds)
nothing = np.full(500, np.nan)
samples = Samples(np.rint(seconds * 1e9).astype(np.int64), position, effort, nothing, nothing)
estimates = AxisObserver(axis, 1e-3).step(samples)
print(json.dumps([estimates.friction.tolist(), estimates.parameters[:, 0].tolist()]))
"""


def python(code: str, *arguments: str, **environment: str) -> str:
    """Return what a fresh Python prints."""
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments], cwd=ROOT, env={**os.environ, **environment},
        capture_output=True, text=True, timeout=600,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_core_imports_neither_ros_nor_the_simulated_truth() -> None:
    python(BLOCKED)


def test_without_a_compiler_the_answers_are_the_same() -> None:
    pytest.importorskip("numba", reason="without numba there is nothing to compare with")
    compiled = np.array(json.loads(python(OBSERVE, "compiled")))
    plain = np.array(json.loads(python(OBSERVE, "plain", SGMS_OBSERVER_NO_NUMBA="1")))
    assert np.all(np.isfinite(compiled))
    # the two differ by the rounding of exp, tanh and contracted sums
    np.testing.assert_allclose(plain, compiled, rtol=1e-9, atol=1e-9)
