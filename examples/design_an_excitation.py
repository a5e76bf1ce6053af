"""Design the motion that tells cogging from friction that varies with the position.

python examples/design_an_excitation.py
"""

from __future__ import annotations

import recordings

from sgms_observer.excitation.limits import ExcitationLimits
from sgms_observer.excitation.reference import design_excitation
from sgms_observer.settings.load import load_settings


def main() -> None:
    """Do the job of the example."""
    args = recordings.options(__doc__, "out/excite", 40.0)
    axis = load_settings(recordings.make(args.out, 1.0).config).axes[0]
    limits = ExcitationLimits(stroke=0.02, speed=0.05, acceleration=1.0)  # m, m/s, m/s^2: what the machine may do
    motion = design_excitation(axis, limits, ["cogging", "position_dependent_friction"], seconds=args.seconds)
    for sentence in (*motion.summary, *motion.warnings):
        print(sentence)
    rows = zip(motion.time, motion.position, motion.velocity, strict=True)
    lines = [f"{time:.6g},{position:.12f},{velocity:.9g}" for time, position, velocity in rows]
    (args.out / "excite.csv").write_text("\n".join(["time,position,velocity", *lines]) + "\n", encoding="utf-8")
    print(f"wrote {args.out / 'excite.csv'}: load it into the motion controller. This moves the machine.")


if __name__ == "__main__":
    main()
