"""Options and data of the examples: a parameter file, and recordings of a stage with cogging that the file lacks."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

from sgms_observer.bags.writer import BagWriter
from sgms_observer.settings.load import load_settings
from sim_plant.stage import SimulatedStage

STAGE = """\
/**:
  ros__parameters:
    axes: [x]
    sample_period: 1.0e-3
    x:
      mass: {mass}
      friction: {{model: sgms, element_stiffness: [4.0e6, 0.8e6], element_fraction: [0.3, 0.7],
                  element_damping: [0.0, 0.0], viscous_coefficient: 20.0, static_force: 4.5, coulomb_force: 4.0,
                  stribeck_velocity: 1.0e-3}}
      effects: {effects}
      filter: {{position_noise: 5.0e-9}}
      estimator: {{correction_every: 2, parameters: []}}
      compensation: {{limit: 6.75, look_ahead: 1.5e-3}}
      stage:
        encoder: {{resolution: 1.0e-8, noise: 5.0e-9}}
        force_noise: 0.1
        controller: {{bandwidth: 100.0, feedforward_mass: 0.7}}
        reference: {reference}
        seed: {seed}
"""

SINES = "{{kind: multi_sine, amplitudes: [4.0e-3, 2.0e-4], frequencies: [{slow}, 7.1]}}"
FROM_TOPIC = "{kind: topic}"
COGGING = "{names: [cogging], cogging: {amplitude: 1.0, pitch: 2.0e-3, phase: 0.3}}"


def options(description: str, out: str, seconds: float) -> argparse.Namespace:
    """Read the options of an example: ``--out``, a folder, and ``--seconds``, the length of each recording [s]."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--out", type=Path, default=Path(out), help="folder of all files")
    parser.add_argument("--seconds", type=float, default=seconds, help="length of each recording [s]")
    return parser.parse_args()


@dataclass(frozen=True)
class Data:
    """The owner's parameter file (3 % wrong mass, no cogging), a recording to fit to, and a held-out one."""

    config: Path
    learn: Path
    judge: Path


def make(folder: Path, seconds: float, effects: str = COGGING) -> Data:
    """Write file and recordings of that length [s] into a folder; the stage has effects that the file lacks."""
    folder.mkdir(parents=True, exist_ok=True)
    config = folder / "mine.yaml"
    config.write_text(_stage(10.3, "{}", SINES.format(slow=0.31), 1), encoding="utf-8")
    for seed, name, slow in ((1, "learn", 0.31), (2, "judge", 0.23)):
        truth = folder / f"{name}.yaml"
        truth.write_text(_stage(10.0, effects, SINES.format(slow=slow), seed), encoding="utf-8")
        settings = load_settings(truth)
        stage = SimulatedStage(settings.axes[0], settings.sample_period)
        with BagWriter(folder / name, "mcap", is_overwriting=True) as bag:
            record = stage.step(round(seconds / settings.sample_period))
            bag.write_joint_states("reference", record.stamp_ns, ["x"], position=record.reference_position[:, None])
            bag.write_joint_states("position", record.stamp_ns, ["x"], position=record.measured_position[:, None])
            bag.write_joint_states("control_effort", record.stamp_ns, ["x"], effort=record.control_effort[:, None])
    return Data(config, folder / "learn", folder / "judge")


def make_machine(folder: Path) -> tuple[Path, Path]:
    """Write the file of a stage that follows the topic ``reference``, with cogging, and the owner's file without it."""
    folder.mkdir(parents=True, exist_ok=True)
    machine, mine = folder / "machine.yaml", folder / "mine.yaml"
    machine.write_text(_stage(10.0, COGGING, FROM_TOPIC, 1), encoding="utf-8")
    mine.write_text(_stage(10.3, "{}", FROM_TOPIC, 1), encoding="utf-8")
    return machine, mine


def _stage(mass: float, effects: str, reference: str, seed: int) -> str:
    """Return the text of a parameter file."""
    return STAGE.format(mass=mass, effects=effects, reference=reference, seed=seed)
