"""Identify mass and friction from a recording; print each value with its 95 % interval.

python examples/identify_from_a_bag.py
"""

from __future__ import annotations

import sys

import recordings

from sgms_observer.cli.main import main as sgms
from sgms_observer.settings.load import load_settings


def main() -> None:
    """Do the job of the example."""
    args = recordings.options(__doc__, "out/identify", 40.0)
    data = recordings.make(args.out, args.seconds, effects="{}")  # nothing but friction acts on this stage
    found = args.out / "identified.yaml"
    words = ["identify", data.learn, "--config", data.config, "--holdout", data.judge, "--out", found, "--overwrite"]
    code = sgms([str(word) for word in words])
    if code not in (0, 3):  # 3: done, but a warning says why the result must not be used as it is
        sys.exit(code)
    axis = load_settings(found).axes[0]
    print(f"mass {axis.mass:.3f} kg (truth: 10), Coulomb force {axis.friction.coulomb_force:.3f} N (truth: 4)")


if __name__ == "__main__":
    main()
