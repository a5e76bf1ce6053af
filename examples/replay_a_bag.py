"""Run the observer over a recording, block by block, as the node does with live samples.

python examples/replay_a_bag.py
"""

from __future__ import annotations

import numpy as np
import recordings

from sgms_observer.bags.reader import read_samples
from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.settings.load import load_settings
from sgms_observer.status import Status


def main() -> None:
    """Do the job of the example."""
    args = recordings.options(__doc__, "out/replay", 20.0)
    data = recordings.make(args.out, args.seconds)
    settings = load_settings(data.config)
    axis = settings.axes[0]
    observer = AxisObserver(axis, settings.sample_period)
    blocks = [observer.step(samples) for samples in read_samples(data.learn, axis.name, settings.sample_period)]
    friction = np.concatenate([block.friction for block in blocks])  # N
    band = np.concatenate([block.friction_std for block in blocks])  # N
    print(
        f"{len(friction)} samples; friction {np.ptp(friction):.2f} N peak to peak, standard deviation {band[-1]:.2f} N"
    )
    print(f"state at the end: {Status(blocks[-1].status[-1]).sentence}")


if __name__ == "__main__":
    main()
