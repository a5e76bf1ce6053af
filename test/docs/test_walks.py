"""docs/design.md tells how one stiffness and one sample go through the source; they take these steps and no others."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "design.md").read_text(encoding="utf-8")
ROOMS = "|".join(folder.name for folder in (ROOT / "sgms_observer").iterdir() if folder.is_dir())
WALKS = re.findall(r"^\*\*(\w+ .*?): (\d+) steps\*\*.*?\n\n((?:\d+\. .*\n)+)", PAGE, re.MULTILINE)


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    """Return the steps that the numbers really take, by the title of their walk."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, str(Path(__file__).with_name("walk_trace.py")), str(tmp_path_factory.mktemp("walk"))]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    walks: dict[str, list[str]] = json.loads(done.stdout)
    return walks


@pytest.mark.parametrize("number", range(3))
def test_a_walk_is_what_the_page_says(number: int, measured: dict[str, list[str]]) -> None:
    heading, count, listed = WALKS[number]
    steps = re.findall(r"^\d+\. `([\w.]+)`", listed, re.MULTILINE)
    assert len(steps) == int(count)
    taken = next(found for title, found in measured.items() if heading.startswith(title + ","))
    assert taken[: taken.index(steps[-1]) + 1] == steps


@pytest.mark.parametrize("name", re.findall(rf"`((?:{ROOMS})\.(?:\w+\.)+\w+)`", PAGE))
def test_every_function_of_the_page_exists(name: str) -> None:
    module, _, rest = name.partition(".")
    file, _, rest = rest.partition(".")
    source = (ROOT / "sgms_observer" / module / f"{file}.py").read_text(encoding="utf-8")
    assert all(re.search(rf"(?:def|class) {part}\b", source) for part in rest.split(".")), name
