"""What least squares with more and more freedom reaches on EMPS: fitted to the train record, judged on the pulses.

    python examples/emps.py --data FOLDER --out out/emps
    python benchmarks/emps_bound.py out/emps

It bounds what an effect of the catalogue can be expected to add. The measure is the published one: force error of the
inverse model at 100 Hz. Beside it stands the error of seven blocks of the train record, each foretold by the others.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sgms_observer.discrepancy.motion import Motion, motion_of
from sgms_observer.discrepancy.record import read_records
from sgms_observer.identification.least_squares import decimate_from_end

Floats = NDArray[np.float64]

DECIMATION = 10
BORDER = 49  # samples at the start where the filters settle
LEAD = 2.5014e-3  # m, of the screw
REST = 1e-4  # m/s
BLOCKS = 7
COARSE = (0.0, 0.01, 0.03, 0.08, 0.15)  # m/s
FINE = (0.0, 0.003, 0.006, 0.012, 0.03, 0.06, 0.1, 0.15)  # m/s
REACHES = (1e-5, 1e-4, 1e-3)  # m


def columns(motion: Motion, speeds: tuple[float, ...], reaches: tuple[float, ...], along_stroke: bool) -> Floats:
    """Return regressors and, last, the effort, at 100 Hz.

    Args:
        motion: the record.
        speeds: knots of the curve of friction over speed, one curve for each direction [m/s].
        reaches: over which elements of their own build up [m].
        along_stroke: let force and friction also vary along the stroke.
    """
    position, speed, effort = motion.position, np.abs(motion.velocity), motion.effort
    side = np.tanh(motion.velocity / REST)
    listed = [motion.acceleration, np.gradient(motion.acceleration, motion.period), np.gradient(effort, motion.period)]
    for way in (1.0, -1.0):
        listed += [np.where(way * side > 0.0, side, 0.0) * np.interp(speed, speeds, one) for one in np.eye(len(speeds))]
    for phase in (2.0 * np.pi * position / LEAD, 4.0 * np.pi * position / LEAD):
        listed += [np.cos(phase), np.sin(phase)]
    for reach in reaches:
        state, held = 0.0, np.empty(len(position))
        for k, moved in enumerate(np.diff(position, prepend=position[0])):
            state = min(max(state + moved / reach, -1.0), 1.0)
            held[k] = state
        listed.append(held)
    if along_stroke:
        listed += [position, position * side, position**2, position**2 * side]
    return decimate_from_end(np.column_stack([*listed, effort])[BORDER:], DECIMATION)


def solve(rows: Floats) -> Floats:
    """Return the weights of the regressors."""
    scale = np.linalg.norm(rows[:, :-1], axis=0)
    weights: Floats = np.linalg.lstsq(rows[:, :-1] / scale, rows[:, -1], rcond=1e-8)[0] / scale
    return weights


def error(rows: Floats, weights: Floats) -> float:
    """Return the relative force error [%]."""
    return float(100.0 * np.linalg.norm(rows[:, -1] - rows[:, :-1] @ weights) / np.linalg.norm(rows[:, -1]))


def foretold(rows: Floats) -> float:
    """Return the error of blocks, each from a fit to the others [%]."""
    missed = []
    for block in np.array_split(np.arange(len(rows)), BLOCKS):
        weights = solve(np.delete(rows, block, axis=0))
        missed.append(rows[block, -1] - rows[block, :-1] @ weights)
    return float(100.0 * np.linalg.norm(np.concatenate(missed)) / np.linalg.norm(rows[:, -1]))


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="where examples/emps.py wrote its bags")
    folder = parser.parse_args().folder
    train, pulses = (motion_of(read_records(folder / name, "x")[0]) for name in ("train", "pulses"))
    cases = {
        "straight line over speed": ((0.0, 0.15), (), False),
        "curve over speed": (FINE, (), False),
        "coarser curve, three elements": (COARSE, REACHES, False),
        "the same, along the stroke": (COARSE, REACHES, True),
    }
    print(f"{'':32}{'train':>8}{'blocks':>8}{'pulses':>8}{'own fit of the pulses':>24}")
    for name, case in cases.items():
        taught, judged = columns(train, *case), columns(pulses, *case)
        weights = solve(taught)
        figures = (error(taught, weights), foretold(taught), error(judged, weights), error(judged, solve(judged)))
        print(f"{name:32}{figures[0]:7.2f}%{figures[1]:7.2f}%{figures[2]:7.2f}%{figures[3]:23.2f}%")
    return 0


if __name__ == "__main__":
    sys.exit(main())
