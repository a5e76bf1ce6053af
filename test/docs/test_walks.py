"""docs/design.md tells how one stiffness and one sample go through the source; they go that way."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "design.md").read_text(encoding="utf-8")
WALKS = re.findall(r"^\*\*(One .*?): (\d+) steps\*\*.*?\n\n((?:\d+\. .*\n)+)", PAGE, re.MULTILINE)


@pytest.fixture(scope="module")
def calls(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[str], list[str]]:
    """Return the calls of the package while it loads and makes an observer, and then during one sample."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, str(Path(__file__).with_name("walk_trace.py")), str(tmp_path_factory.mktemp("walk"))]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    names = done.stdout.splitlines()
    place = names.index("a sample")
    return names[:place], names[place + 1 :]


@pytest.mark.parametrize(("number", "title"), [(0, "One stiffness"), (1, "One sample")])
def test_a_walk_goes_as_the_page_says(number: int, title: str, calls: tuple[list[str], list[str]]) -> None:
    heading, count, steps = WALKS[number]
    names = re.findall(r"^\d+\. `([\w.]+)`", steps, re.MULTILINE)
    assert heading.startswith(title) and len(names) == int(count)
    rest = iter([*calls[0], *calls[1]] if number == 0 else calls[1])
    assert [name for name in names if name not in rest] == []  # each is looked for behind the one before it


@pytest.mark.parametrize("name", re.findall(r"`((?:nodes|settings)\.(?:\w+\.)+\w+)`", PAGE))
def test_every_step_of_a_node_exists(name: str) -> None:
    module, _, rest = name.partition(".")
    file, _, rest = rest.partition(".")
    source = (ROOT / "sgms_observer" / module / f"{file}.py").read_text(encoding="utf-8")
    assert all(re.search(rf"(?:def|class) {part}\b", source) for part in rest.split(".")), name
