"""The share of the gap that changed values of the file close is theirs, not that of the effects."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import pytest

from sgms_observer.diagnosis.changed import _closed
from sgms_observer.settings.axis import EffectSettings

OFFSET, SPRING = EffectSettings("offset", (0.3,)), EffectSettings("spring", (400.0, 0.0))
MOVED = EffectSettings("offset", (0.9,))
GAPS = {"file": 10.0, "file with the spring": 3.0, "augmented": 1.0}
"""Rms residual of each model [N]."""


@dataclass(frozen=True)
class Setup:
    """Setup whose fit keeps the values of the file."""

    nominal: str = ""
    data: str = ""

    def fit(self, effects: tuple[EffectSettings, ...], start: str, evaluations: int) -> Any:
        """Return the fit of the file with these effects."""
        assert (self.nominal, self.data, start) == ("contact of the file", "recordings", "logs")
        assert effects == (OFFSET, SPRING) and evaluations > 1
        return SimpleNamespace(model="file with the spring")


@pytest.mark.parametrize(
    ("effects", "unnamed", "share"),
    [((MOVED, SPRING), (), 2.0 / 8.0), ((MOVED,), (), 1.0), ((MOVED, SPRING), ("spring",), 1.0)],
)
def test_changed_values_are_compared_with_those_of_the_file_beside_the_same_effects(
    effects: tuple[EffectSettings, ...], unnamed: tuple[str, ...], share: float
) -> None:
    """A contact law effect without a name is a changed value itself."""
    diagnosis: Any = SimpleNamespace(
        evaluation=SimpleNamespace(rms=GAPS.__getitem__, floor=2.0),
        written=SimpleNamespace(before=SimpleNamespace(model="file", logs="logs"), setup=Setup(data="recordings")),
        file_effects=(OFFSET,),
        unnamed_contact_effects=unnamed,
        nominal="contact of the file",
        file_state=SimpleNamespace(setup=Setup()),
    )
    fit: Any = SimpleNamespace(model="augmented", effects=effects)
    assert _closed(diagnosis, fit) == pytest.approx(share)
