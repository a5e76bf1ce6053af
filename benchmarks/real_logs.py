"""Logs of real machines, from the raw file to an identified model, beside classic friction models on the same data.

    python benchmarks/real_logs.py --data ../shared/data/machines
    python benchmarks/real_logs.py --data ../shared/data/machines --blind

The script runs the commands of docs/real_logs.md, machine by machine, and prints the table that the page shows: the rms
residual on the part that nothing learnt from, in % of its rms effort, within one judging band for all models. With
``--blind`` it runs the same commands with the replacements that the page lists, on logs that nobody looked at before.

The classic models get the same help: mass, offset and, on a revolute joint, gravity. Coulomb-viscous is linear least
squares; Stribeck and LuGre are fitted by ``scipy.optimize.least_squares`` from several starts, LuGre by simulation
along the measured motion. All of them learn on the rows that ``sgms identify`` filters, and are judged on such rows.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import re
import shlex
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import least_squares

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from sgms_observer.arrays import Floats  # noqa: E402
from sgms_observer.cli.main import main as sgms  # noqa: E402
from sgms_observer.identification.effect_terms import EffectTerms  # noqa: E402
from sgms_observer.identification.prepared import Prepared, prepare_all  # noqa: E402
from sgms_observer.jit import njit  # noqa: E402
from sgms_observer.offline.recording import Recordings, read_recordings  # noqa: E402
from sgms_observer.settings.axis import AxisSettings  # noqa: E402
from sgms_observer.settings.load import load_settings  # noqa: E402

PAGE = ROOT / "docs" / "real_logs.md"
_STARTS = (0.3, 0.1, 0.03)  # Stribeck velocity over the largest velocity
_DEFLECTIONS = (1.0e-2, 1.0e-3, 1.0e-4)  # of LuGre's bristles over the travel
_REPLACEMENT = re.compile(r"^\| ([^|]+) \| ([^|]+) \| `([^`|]+)` \| `([^`|]+)` \|$", flags=re.MULTILINE)


@dataclass(frozen=True)
class Machine:
    """One section of the page.

    Attributes:
        name: its heading.
        commands: what it runs, without ``sgms``.
    """

    name: str
    commands: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Row:
    """One line of the table: held-out residuals in % of the rms effort, NaN where a model gives none.

    Attributes:
        machine: heading of its section.
        band: upper corner of the judging band [Hz].
        this_tool, coulomb_viscous, stribeck, lugre: residuals [%].
        said: how ``sgms identify`` ended.
        parameters: what it found, as ``--json`` prints it.
    """

    machine: str
    band: float
    this_tool: float
    coulomb_viscous: float
    stribeck: float
    lugre: float
    said: str
    parameters: dict[str, Any] = field(default_factory=dict)


def machines_of(page: str) -> tuple[Machine, ...]:
    """Return the machines of the page with their commands.

    Args:
        page: the text of docs/real_logs.md.
    """
    found = []
    for section in re.split(r"^## ", page, flags=re.MULTILINE)[1:]:
        title, _, body = section.partition("\n")
        lines = "\n".join(re.findall(r"```\n(.*?)```", body, flags=re.DOTALL)).replace("\\\n", " ").splitlines()
        commands = tuple(tuple(shlex.split(line)[1:]) for line in lines if line.startswith("sgms "))
        if commands:
            found.append(Machine(title.strip(), commands))
    return tuple(found)


def blind_machines_of(page: str) -> tuple[Machine, ...]:
    """Return the logs that nobody looked at: commands of a section of the page, with one word replaced.

    Args:
        page: the text of docs/real_logs.md.
    """
    sections = {machine.name: machine for machine in machines_of(page)}
    found = []
    for name, section, word, other in _REPLACEMENT.findall(page):
        commands = tuple(tuple(part.replace(word, other) for part in command) for command in sections[section].commands)
        if commands == sections[section].commands:
            raise SystemExit(f"{PAGE}: the commands of {section} have no {word}")
        found.append(Machine(name, commands))
    return tuple(found)


@contextlib.contextmanager
def _inside(folder: Path) -> Iterator[None]:
    """Work in a folder."""
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


def run_commands(machine: Machine, data: Path, folder: Path) -> tuple[int, str, str]:
    """Run the commands of a machine in a folder; return the last one's exit code, JSON and messages.

    Args:
        machine: its commands.
        data: folder of the logs, ``$MACHINES`` in the page.
        folder: where bags and parameter files go.
    """
    code, out, messages = 0, "", ""
    with _inside(folder):
        for command in machine.commands:
            given = [argument.replace("$MACHINES", str(data)) for argument in command]
            printed, said = io.StringIO(), io.StringIO()
            is_last = command is machine.commands[-1]
            with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(said):
                code = sgms([*given, "--json"] if is_last else given)
            if code and not is_last:
                raise SystemExit(f"{machine.name}: sgms {' '.join(given)} ended with {code}: {said.getvalue()}")
            out, messages = printed.getvalue(), said.getvalue()
    return code, out, messages


def judged(machine: Machine, data: Path) -> Row:
    """Return the line of one machine.

    Args:
        machine: its commands; the last one is ``identify``.
        data: folder of the logs.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        code, out, messages = run_commands(machine, data, folder)
        options = dict(zip(machine.commands[-1], machine.commands[-1][1:], strict=False))
        nothing = float("nan")
        if not out:
            said = messages.strip().splitlines()[-1]
            return Row(machine.name, nothing, nothing, nothing, nothing, nothing, f"exit {code}: {said}")
        result = json.loads(out)["axes"]["x"]
        axis = load_settings(folder / options["--config"]).axes[0]
        band = float(result["band_hz"][1])
        parts = [_rows(read_recordings(folder / bag, axis), axis, band)
                 for bag in (machine.commands[-1][1], options["--holdout"])]  # fmt: skip
        peers = [fit(*parts, axis) for fit in (coulomb_viscous, stribeck, lugre)]
        return Row(machine.name, band, 100.0 * result["held_out"], *peers, f"exit {code}", result["parameters"])


def _rows(recordings: Recordings, axis: AxisSettings, band: float) -> list[Prepared]:
    """Return recordings as ``identify`` prepares them."""
    return prepare_all(list(recordings), band, EffectTerms())


def _linear_columns(piece: Prepared, axis: AxisSettings) -> list[Floats]:
    """Return the columns that every classic model has: inertia, viscous friction, offset, gravity."""
    columns = [piece.acceleration, piece.velocity, np.ones(len(piece.time))]
    if axis.units.is_revolute:
        columns += [piece.low_pass(np.sin(piece.position)), piece.low_pass(np.cos(piece.position))]
    return columns


def _held_out(
    learn: Sequence[Prepared], held: Sequence[Prepared], axis: AxisSettings, force: Callable[[Prepared], Floats]
) -> tuple[float, float]:
    """Fit what is linear beside given friction columns; return the squared residual and the held-out error [%]."""

    def stacked(pieces: Sequence[Prepared]) -> tuple[Floats, Floats]:
        matrix = [np.column_stack([*_linear_columns(piece, axis), piece.low_pass(force(piece))])[piece.usable]
                  for piece in pieces]  # fmt: skip
        effort = [piece.effort(piece.time)[piece.usable] for piece in pieces]
        return np.concatenate(matrix), np.concatenate(effort)

    matrix, effort = stacked(learn)
    scale = np.linalg.norm(matrix, axis=0)
    weights = np.linalg.lstsq(matrix / scale, effort, rcond=1e-9)[0] / scale
    rest = effort - matrix @ weights
    matrix, effort = stacked(held)
    return float(rest @ rest), 100.0 * float(np.linalg.norm(effort - matrix @ weights) / np.linalg.norm(effort))


def coulomb_viscous(learn: Sequence[Prepared], held: Sequence[Prepared], axis: AxisSettings) -> float:
    """Return the held-out error of Coulomb and viscous friction [%]."""
    return _held_out(learn, held, axis, lambda piece: np.sign(np.gradient(piece.position)))[1]


def _best(
    learn: Sequence[Prepared], held: Sequence[Prepared], axis: AxisSettings, starts: Sequence[Floats],
    columns: Callable[[Prepared, Floats], Floats],
) -> float:  # fmt: skip
    """Fit the nonlinear parameters from several starts, the linear ones inside; return the held-out error [%]."""

    def residuals(shape: Floats) -> Floats:
        matrix = np.concatenate(
            [np.column_stack([*_linear_columns(piece, axis), piece.low_pass(columns(piece, shape))])[piece.usable]
             for piece in learn]
        )  # fmt: skip
        scale = np.linalg.norm(matrix, axis=0)
        scale = np.where(scale > 0.0, scale, 1.0)
        effort = np.concatenate([piece.effort(piece.time)[piece.usable] for piece in learn])
        return np.asarray(effort - matrix @ (np.linalg.lstsq(matrix / scale, effort, rcond=1e-9)[0] / scale))

    fits = [least_squares(residuals, start, method="trf", x_scale=1.0, diff_step=1e-3, max_nfev=60) for start in starts]
    best = min(fits, key=lambda fit: float(fit.cost))
    return _held_out(learn, held, axis, lambda piece: columns(piece, best.x))[1]


def stribeck(learn: Sequence[Prepared], held: Sequence[Prepared], axis: AxisSettings) -> float:
    """Return the held-out error of Coulomb, viscous and Stribeck friction [%]."""
    top = max(float(np.max(np.abs(piece.velocity))) for piece in learn)

    def columns(piece: Prepared, shape: Floats) -> Floats:
        velocity = np.gradient(piece.position, piece.period)
        bump = np.exp(-((velocity / np.exp(np.clip(shape[0], -50.0, 50.0))) ** 2))
        return np.column_stack([np.sign(velocity), np.sign(velocity) * bump])

    return _best(learn, held, axis, [np.log([share * top]) for share in _STARTS], columns)


@njit
def _lugre(velocity: Floats, period: float, stiffness: float, level: Floats, out: Floats) -> None:
    """Write the bristle deflection of LuGre and its rate, exact within each sample."""
    z = 0.0
    for k in range(velocity.shape[0]):
        speed = abs(velocity[k])
        before = z
        if speed > 0.0:
            end = level[k] / stiffness * (1.0 if velocity[k] > 0.0 else -1.0)
            z = end + (z - end) * np.exp(-stiffness * speed / level[k] * period)
        out[k, 0] = stiffness * z
        out[k, 1] = stiffness * (z - before) / period


def lugre(learn: Sequence[Prepared], held: Sequence[Prepared], axis: AxisSettings) -> float:
    """Return the held-out error of LuGre [%].

    With Coulomb friction 1 the shape is stiffness, ratio of static to Coulomb friction and Stribeck velocity; its force
    and its damping are then linear.
    """
    top = max(float(np.max(np.abs(piece.velocity))) for piece in learn)
    travel = max(float(np.ptp(piece.position)) for piece in learn)

    def columns(piece: Prepared, shape: Floats) -> Floats:
        stiffness, ratio, slow = np.exp(np.clip(shape, -50.0, 50.0))
        velocity = np.gradient(piece.position, piece.period)
        level = 1.0 + ratio * np.exp(-((velocity / slow) ** 2))
        out = np.empty((len(velocity), 2))
        _lugre(velocity, piece.period, float(stiffness), level, out)
        return out

    starts = [np.log([1.0 / (share * travel), 0.2, 0.1 * top]) for share in _DEFLECTIONS]
    return _best(learn, held, axis, starts, columns)


def table_of(rows: Sequence[Row]) -> str:
    """Return the table of the page."""
    lines = [
        "| machine | band [Hz] | this tool | Coulomb-viscous | Stribeck | LuGre |",
        "|---|---|---|---|---|---|",
    ]
    for row in rows:
        if np.isnan(row.this_tool):
            lines.append(f"| {row.machine} | - | refused | - | - | - |")
        else:
            errors = " | ".join(f"{one:.1f}" for one in (row.this_tool, row.coulomb_viscous, row.stribeck, row.lugre))
            lines.append(f"| {row.machine} | {row.band:.1f} | {errors} |")
    return "\n".join(lines)


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder with ur10e, kr300, cart, ...")
    parser.add_argument("--only", metavar="WORD", default="", help="machines whose heading has this word")
    parser.add_argument("--blind", action="store_true", help="the logs that nobody looked at before")
    args = parser.parse_args()
    listed = (blind_machines_of if args.blind else machines_of)(PAGE.read_text(encoding="utf-8"))
    machines = [one for one in listed if args.only in one.name]
    rows = []
    for machine in machines:
        rows.append(judged(machine, args.data.resolve()))
        print(f"{machine.name}: {rows[-1].said}", flush=True)
    print()
    print("Held-out rms residual in % of the rms effort")
    print(table_of(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
