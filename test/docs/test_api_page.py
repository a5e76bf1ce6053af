"""The Python in docs/api.md runs as it stands, and does what it says."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np

import sgms_observer

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)


def test_the_example_runs_and_estimates(tmp_path: Path) -> None:
    observer, over_a_bag, _ = BLOCKS
    check = """
from sgms_observer.bags.writer import BagWriter
with BagWriter("bag", "mcap") as bag:
    bag.write_joint_states("position", record.stamp_ns, ["x"], position=record.measured_position[:, None])
    bag.write_joint_states("control_effort", record.stamp_ns, ["x"], effort=record.control_effort[:, None])
import numpy as np
again = np.concatenate([block.friction for block in friction_of("bag", settings)])
print(len(again), np.array_equal(again, estimates.friction[: len(again)]))
"""
    program = observer.replace('"config/', f'"{ROOT.as_posix()}/config/') + over_a_bag + check
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    result = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, env=environment, capture_output=True, text=True
    )
    assert result.returncode == 0, result.stderr
    said, replayed = result.stdout.splitlines()
    assert float(said.split()[0]) < 0.5
    count, is_equal = replayed.split()
    assert int(count) > 1900 and is_equal == "True"


def test_the_effect_of_your_own_is_one(tmp_path: Path) -> None:
    from sgms_observer.effects.compiled import CompiledEffects
    from sgms_observer.settings.load import load_settings

    (tmp_path / "mine.py").write_text(BLOCKS[2], encoding="utf-8")
    (tmp_path / "mine.yaml").write_text(
        "/**: {ros__parameters: {axes: [x], effect_files: [mine.py], x: {effects: {names: [end_stop_rubber],"
        " end_stop_rubber: {strength: 2.0, width: 0.01}}}}}",
        encoding="utf-8",
    )
    axis = load_settings(tmp_path / "mine.yaml").axes[0]
    effects = CompiledEffects(axis.effects, 1e-3)
    position = np.array([-0.01, 0.0, 0.01])
    rest = np.zeros(3)
    period, level = np.full(3, 1e-3), np.full(3, 4.0)
    force, factor = effects.evaluate(position, rest, rest, rest, rest, period, level, effects.initial_state())
    assert np.allclose(force, 2.0 * np.tanh(position / 0.01))
    assert np.all(factor == 1.0)


def test_the_page_shows_every_public_name() -> None:
    section = PAGE.split("## What can be imported")[1].split("\n## ")[0]
    table = re.findall(r"^\| [a-z ]+ \| (`.*) \|$", section, re.MULTILINE)
    assert sorted(re.findall(r"`(\w+)`", " ".join(table))) == sorted(set(sgms_observer.__all__) - {"__version__"})


def test_every_public_name_is_there_and_the_package_loads_nothing_before() -> None:
    code = (
        "import sys, sgms_observer; print('numpy' in sys.modules);"
        "print([name for name in sgms_observer.__all__ if getattr(sgms_observer, name) is None])"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
    assert done.stdout.splitlines() == ["False", "[]"]
    assert not hasattr(sgms_observer, "no_such_name")
