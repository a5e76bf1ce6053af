"""The table of parameters says what to do for each parameter that a recording does not identify."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sgms_observer.identification.problem import DELAY, ELEMENTS, Parameters
from sgms_observer.identification.report import _row
from sgms_observer.identification.table import DAMPING, Row, _element_rows, remarks_of
from sgms_observer.settings.axis import AxisSettings
from sgms_observer.settings.units import REVOLUTE, Units


@pytest.mark.parametrize(("joint_type", "unit"), [("prismatic", "m"), (REVOLUTE, "rad")])
def test_each_element_has_the_note_of_its_own_slip_deflection(joint_type: str, unit: str) -> None:
    """One element slips after 30 nm, one after half a millimetre."""
    level, deflection = np.array([0.3, 0.5]), np.array([30e-9, 0.5e-3])
    parameters = Parameters(np.zeros(ELEMENTS), level / deflection, level)
    known = np.zeros(ELEMENTS + 4, dtype=bool)
    result: Any = SimpleNamespace(parameters=parameters, confidence=SimpleNamespace(is_identifiable=known))
    rows = _element_rows(result, AxisSettings(joint_type=joint_type), np.full(ELEMENTS + 4, 0.1))
    assert [row.name.split("[")[1] for row in rows] == ["1]", "2]", "1]", "2]"]
    for row, size in zip(rows, (f"30 n{unit}", f"500 u{unit}") * 2, strict=True):
        assert f"reverse over less than {size}," in row.note and row.note in row.remark


@pytest.mark.parametrize(
    ("half_width", "is_known", "shown", "remark"),
    [
        (0.01, True, "yes", "N s/m; +- 0.01 (95 %)"),
        (0.07, False, "no: slide faster", "N s/m; +- 0.07 (95 %), wider than 5 %; slide faster"),
        (np.inf, False, "no: slide faster", "N s/m; an estimate without interval; slide faster"),
        (np.nan, False, "not identifiable: slide faster",
         "N s/m; not identifiable from this recording: start value; slide faster"),
    ],
)  # fmt: skip
def test_only_a_value_that_keeps_its_start_is_not_identifiable(
    half_width: float, is_known: bool, shown: str, remark: str
) -> None:
    """A value that is known to 7 % was estimated: the page and the file say the same of it."""
    row = Row("friction.viscous_coefficient", 1.0, half_width, "N s/m", is_known, "slide faster")
    assert _row(row)[-1] == shown and row.remark == remark


def test_the_damping_of_the_elements_has_the_unit_of_the_joint() -> None:
    """A file of a revolute joint had one line in N s/m."""
    names = (f"{DAMPING} over stiffness", "friction.element_stiffness[1]", "friction.element_fraction[1]")
    rows = [Row(name, 1.0, 0.01, "s", True) for name in names]
    result: Any = SimpleNamespace(frozen=(DELAY,))
    remarks = remarks_of(rows, result, Units(REVOLUTE))
    assert remarks[DAMPING].startswith("N m s/rad; over element_stiffness: s; +- 0.01")
