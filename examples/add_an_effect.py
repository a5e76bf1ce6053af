"""Add an effect of your own (a rubber end stop), and simulate a stage with it.

python examples/add_an_effect.py
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np

from sgms_observer.effects.effect import Effect, EffectParameter, Place
from sgms_observer.settings.load import load_settings
from sim_plant.stage import SimulatedStage


def rubber(q, p):  # type: ignore[no-untyped-def]
    """Return the force of the end stop [N] at position q [m]; only `math`, because this function is compiled."""
    return p[0] * math.tanh(q / p[1])


EFFECTS = [
    Effect(
        name="end_stop_rubber",
        place=Place.ADDED_FORCE,
        parameters=(
            EffectParameter("strength", "N", 0.0, -100.0, 100.0, "force far from the middle", is_strength=True),
            EffectParameter("width", "m", 0.01, 1e-4, 1.0, "distance over which it rises"),
        ),
        equation="F = A tanh(q / w)",
        signature="a smooth step over position, the same in both directions",
        excitation="travel over the whole stroke, both ways",
        confusable_with=("spring",),
        reference="an example",
        output=rubber,
    )
]


def main() -> None:
    """Name this file in a parameter file, and look at the force."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/effect"), help="folder of the parameter file")
    config = parser.parse_args().out / "mine.yaml"
    config.parent.mkdir(parents=True, exist_ok=True)
    axis = "x: {effects: {names: [end_stop_rubber], end_stop_rubber: {strength: 2.0, width: 1.0e-4}}}"
    config.write_text(
        f"/**: {{ros__parameters: {{axes: [x], effect_files: ['{Path(__file__).resolve()}'], {axis}}}}}\n"
    )
    settings = load_settings(config)
    record = SimulatedStage(settings.axes[0], settings.sample_period).step(4000)
    force = record.effect_force[2000:]  # N, after 0.2 s: the stage has settled
    print(f"{settings.axes[0].effects[0].name}: {np.min(force):.2f} to {np.max(force):.2f} N along the stage's motion")


if __name__ == "__main__":
    main()
