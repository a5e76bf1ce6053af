"""Which tolerance of the elements predicts better is asked again where an effect was in the residual at first."""

from pathlib import Path

import pytest

from sgms_observer.cli.main import main
from sgms_observer.diagnosis.changed_contact import CHANGE_HYPOTHESES
from sgms_observer.diagnosis.diagnosis import Options
from sgms_observer.diagnosis.workflow import diagnose
from sgms_observer.effects.catalogue import names
from sgms_observer.offline.recording import Recording, read_recordings
from sgms_observer.settings.axis import AxisSettings
from sgms_observer.settings.load import load_settings

FILE = """
/**:
  ros__parameters:
    axes: [x]
    sample_period: 1.0e-3
    x:
      mass: 10.0
      friction:
        model: sgms
        element_stiffness: [12.0e6, 2.5e6, 0.71e6, 0.79e6]
        element_fraction: [0.067, 0.056, 0.047, 0.83]
        viscous_coefficient: 20.0
        static_force: 4.5
        coulomb_force: 4.0
        stribeck_velocity: 1.0e-3
        attraction_rate: 200.0
      filter: {window: 9.0e-3, position_noise: 2.0e-8}
      stage:
        controller: {bandwidth: 40.0}
        encoder: {resolution: 1.0e-8, noise: 2.0e-8}
        force_noise: 0.05
"""
HEAVIER = """
        effects:
          names: [mass_error]
          mass_error: {mass: 2.0}
"""


def simulated(folder: Path, name: str, reference: str, duration: float, seed: int) -> tuple[Recording, AxisSettings]:
    """Return a recording of a stage that is heavier than its file, and the settings of the file."""
    given, heavier = folder / "given.yaml", folder / f"{name}.yaml"
    heavier.write_text(f"{FILE}{HEAVIER}        reference: {reference}\n        seed: {seed}\n", encoding="utf-8")
    command = ["simulate", "--config", str(heavier), "--out", str(folder / name), "--duration", str(duration)]
    assert main([*command, "--quiet"]) == 0
    axis = load_settings(given).axes[0]
    (recording,) = read_recordings(folder / name, axis)
    return recording, axis


def test_a_wrong_mass_is_found_beside_elements_that_were_narrow_with_it_in_the_residual(tmp_path: Path) -> None:
    given, motion = tmp_path / "given.yaml", tmp_path / "motion.csv"
    given.write_text(FILE, encoding="utf-8")
    designed = ["excite", "--config", str(given), "--for", "diagnose", "--duration", "40", "--out", str(motion)]
    assert main([*designed, "--quiet"]) == 0
    learn, axis = simulated(tmp_path, "learn", f"{{kind: file, file: {motion}}}", 40.0, 10)
    sines = "{kind: multi_sine, amplitudes: [8.0e-3, 1.0e-3, 1.0e-4], frequencies: [0.23, 1.3, 4.1]}"
    held_out, _ = simulated(tmp_path, "held_out", sines, 25.0, 11)
    others = frozenset(name for name in names() if name != "mass_error") | frozenset(CHANGE_HYPOTHESES)
    found = diagnose([learn], [held_out], axis, Options(workers=1, excluded=others))
    assert not found.file_state.setup.freedom.has_narrow_elements
    (mass,) = [item.accepted.candidate.settings for item in found.accepted if item.accepted]
    assert mass is not None and mass.values[0] == pytest.approx(2.0, rel=0.05)
