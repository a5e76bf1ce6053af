"""The layouts for PlotJuggler and Foxglove show topics and fields that the nodes publish, and every panel is placed."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import pytest

from sgms_observer.observer.outgoing import JOINT_STATE_TOPICS
from sgms_observer.settings.load import load_settings

ROOT = Path(__file__).resolve().parents[2]

LAYOUTS = ROOT / "config" / "layouts"
ELEMENTS = len(load_settings(ROOT / "config" / "table.yaml").axes[0].friction.element_stiffness)
FIELDS = {
    "position": {"position"},
    "control_effort": {"effort"},
    "reference": {"position", "velocity"},
    "friction_true": {"position", "velocity", "effort"},
    "friction_estimate": {"position", "velocity", "effort"},
    "friction_std": {"effort"},
    "friction_compensation": {"effort"},
    "friction_elements": {"position", "effort"},
}


def test_the_list_of_fields_is_what_the_observer_publishes() -> None:
    assert set(JOINT_STATE_TOPICS) <= set(FIELDS)


def test_plotjuggler() -> None:
    root = ElementTree.parse(LAYOUTS / "plotjuggler.xml").getroot()
    made = {snippet.get("name") for snippet in root.iter("snippet")}
    curves = list(root.iter("curve"))
    names = [curve.get("name", "") for curve in curves if curve.get("curve_x") is None]
    names += [curve.get(axis, "") for curve in curves for axis in ("curve_x", "curve_y") if curve.get(axis)]
    sources = [element.text or "" for tag in ("linked_source", "v1") for element in root.iter(tag)]
    assert made < {*names} and len(names) > 15
    for name in [name for name in names if name not in made] + sources:
        topic, axis, field = re.fullmatch(r"/(\w+)/(x(?:/\d+)?)/(\w+)", name).groups()  # type: ignore[union-attr]
        assert field in FIELDS[topic], name
        assert ("/" in axis) == (topic == "friction_elements"), name
        assert int(axis.partition("/")[2] or 1) <= ELEMENTS
    for splitter in root.iter("DockSplitter"):
        assert len(splitter.get("sizes", "").split(";")) == int(splitter.get("count", "0")) == len(list(splitter))


def test_foxglove() -> None:
    layout = json.loads((LAYOUTS / "foxglove.json").read_text(encoding="utf-8"))

    def placed(part: Any) -> list[str]:
        return [part] if isinstance(part, str) else placed(part["first"]) + placed(part["second"])

    panels = layout["configById"]
    assert sorted(placed(layout["layout"])) == sorted(panels)
    for name, panel in panels.items():
        if name.startswith("Diagnostic"):
            assert panel["topicToRender"] == "/diagnostics"
            continue
        axis = panel.get("xAxisPath")
        paths = [path["value"] for path in (*panel["paths"], *([axis] if axis else []))]
        assert paths
        for path in paths:
            topic, field, number = re.fullmatch(r"/(\w+)\.(\w+)\[(\d)\]", path).groups()  # type: ignore[union-attr]
            assert field in FIELDS[topic], path
            assert int(number) < (ELEMENTS if topic == "friction_elements" else 1)


@pytest.mark.parametrize("name", ["plotjuggler.xml", "foxglove.json"])
def test_layouts_are_installed(name: str) -> None:
    assert (LAYOUTS / name).stat().st_size > 1000
    assert 'files("config/layouts/*")' in (ROOT / "setup.py").read_text(encoding="utf-8")
