"""The smallest size of each effect that recordings would show: what is twice as large is named, what is half is not."""

import numpy as np
import pytest
from workflow_case import AXIS, record

from sgms_observer.diagnosis.answer import Answer, answer_of
from sgms_observer.diagnosis.detectable import size_with_z_score
from sgms_observer.diagnosis.diagnosis import Options
from sgms_observer.diagnosis.evidence import improvement
from sgms_observer.diagnosis.workflow import diagnose
from sgms_observer.settings.axis import EffectSettings

OPTIONS = Options(workers=1)
SECONDS = 12.0


def answer(*effects: EffectSettings) -> Answer:
    learn, held_out = record(effects, 1, SECONDS), record(effects, 2, SECONDS)
    return answer_of(diagnose([learn], [held_out], AXIS, OPTIONS), AXIS, OPTIONS)


def hidden(name: str, peak: float) -> EffectSettings:
    """Return an effect with its largest force in these recordings as a share of the Coulomb force."""
    values = {
        "cogging": (peak * AXIS.friction.coulomb_force, 4.0e-3, 0.7, 0.0, 0.0),
        "position_dependent_friction": (peak, 0.005, 0.004),
    }
    return EffectSettings(name, values[name])


@pytest.fixture(scope="module")
def sizes() -> dict[str, float]:
    found = answer()
    assert found.verdict == "no_effect"
    return found.detectable


@pytest.mark.parametrize("name", ["cogging", "position_dependent_friction"])
def test_twice_the_smallest_size_is_named(sizes: dict[str, float], name: str) -> None:
    assert sizes[name] < 0.05
    assert [item.settings.name for item in answer(hidden(name, 2.0 * sizes[name])).effects] == [name]


def test_half_the_smallest_size_is_not(sizes: dict[str, float]) -> None:
    assert answer(hidden("cogging", 0.5 * sizes["cogging"])).verdict == "no_effect"


def test_what_the_recordings_hardly_show_has_a_large_size(sizes: dict[str, float]) -> None:
    """A contact hides what changes the effort at rest; parameters of the file absorb a force over the velocity."""
    assert min(sizes["actuator_delay"], sizes["dwell_breakaway"]) > 4.0 * sizes["offset"]
    assert sizes["quadratic_drag"] > 4.0 * sizes["spring"]


def test_the_expected_z_score_is_that_of_the_improvement() -> None:
    """With the effect in either direction what it shares by chance with the noise cancels in the mean."""
    rng = np.random.default_rng(3)
    left = [rng.standard_normal(200) for _ in range(60)]
    change = [np.sin(0.1 * np.arange(200.0) + k) for k in range(60)]
    size = size_with_z_score(4.0, change, left)
    z_scores = [
        improvement([e + sign * size * d for d, e in zip(change, left, strict=True)], left).z_score
        for sign in (1.0, -1.0)
    ]
    assert np.mean(z_scores) == pytest.approx(4.0, rel=1e-9)
