"""One blind case: bags and the owner's YAML in a folder, the truth sealed elsewhere."""

from __future__ import annotations

import contextlib
import hashlib
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import Generator

from sgms_observer.arrays import Floats
from sgms_observer.bags.writer import BagWriter
from sim_plant.blind import menu
from sim_plant.blind.hidden_effect import Hidden, Kind, Maker
from sim_plant.blind.owner import NominalModel, nominal_model, write_owner_file
from sim_plant.blind.recording import NotShownError, Track, coloured_noise, measured_size, record, rms_size, sized
from sim_plant.blind.stage import HELD_OUT, PERIOD, Motion, TrueStage, draw_stage, held_out_motion, rich_motion

SEAL_FILE = "seal.txt"

START_NS = 1_700_000_000_000_000_000
OTHER_AXIS_SHARE = 0.08
"""Share of the seeds that record a second axis though nothing comes from it."""
DRAWS = 5


def digest(truth: dict[str, Any]) -> str:
    """Return the salted SHA-256 of a truth (its ``salt`` is one of its entries)."""
    return hashlib.sha256(json.dumps(truth, sort_keys=True).encode("utf-8")).hexdigest()


def seal(truth: dict[str, Any], truth_file: Path, case_folder: Path) -> None:
    """Write the truth to ``truth_file`` and its digest into ``case_folder``.

    Args:
        truth: what is hidden; must carry a ``salt``.
        truth_file: must lie outside of ``case_folder``.
        case_folder: folder that the workflow reads.

    Raises:
        ValueError: when there is no salt, or the truth would be where the workflow can read it.
    """
    if not truth.get("salt"):
        raise ValueError("a truth without a salt can be guessed from its digest; add an entry 'salt'")
    if case_folder.resolve() in truth_file.resolve().parents:
        raise ValueError(f"{truth_file} lies inside the case {case_folder}; put the truth elsewhere")
    truth_file.parent.mkdir(parents=True, exist_ok=True)
    truth_file.write_text(json.dumps(truth, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    (case_folder / SEAL_FILE).write_text(digest(truth) + "\n", encoding="utf-8")


def open_seal(truth_file: Path, case_folder: Path) -> dict[str, Any]:
    """Return the truth of a case.

    Raises:
        ValueError: when the truth is not the one that was sealed.
    """
    truth: dict[str, Any] = json.loads(truth_file.read_text(encoding="utf-8"))
    if digest(truth) != (case_folder / SEAL_FILE).read_text(encoding="utf-8").strip():
        raise ValueError(f"{truth_file} was changed after {case_folder} was sealed; make the case again")
    return truth


@dataclass(frozen=True)
class CasePaths:
    """Where one case lies.

    Attributes:
        folder: everything that the workflow may read.
        bag: fitted recording.
        config: YAML of the nominal model.
        holdouts: recordings of kinds the first does not contain.
        truth_file: the sealed truth, outside of ``folder``.
    """

    folder: Path
    bag: Path
    config: Path
    holdouts: tuple[Path, ...]
    truth_file: Path


@dataclass(frozen=True)
class Scene:
    """All recordings of one case before they are written.

    Attributes:
        hidden: what is hidden (with nothing in it for a null case).
        nominal: the owner's model by axis.
        motions: first that of the fitted recording.
        tracks: recordings of each motion by axis.
        sizes: strengths used per effect.
        truths: comparable figures per effect.
    """

    hidden: Hidden
    nominal: dict[str, NominalModel]
    motions: tuple[Motion, ...]
    tracks: tuple[dict[str, Track], ...]
    truths: dict[str, dict[str, float]]


def _draw_effect(
    kind: Kind, stage: TrueStage, motion: Motion, size: float, purpose: tuple[int, int], run: Callable[[Hidden], Track]
) -> Hidden:
    """Draw an effect that the main motion shows, at the size asked for (share of the Coulomb force, or 0)."""
    index = list(menu.KINDS).index(kind.name)

    def maker(attempt: int) -> Maker:
        return kind.draw(stage, motion, chance(purpose[0], 20 + purpose[1], index, attempt))

    if size == 0.0:
        return without_effect(maker(0)(0.1))
    for attempt in range(DRAWS - 1):
        with contextlib.suppress(NotShownError):
            return sized(kind, maker(attempt), size, run)
    return sized(kind, maker(DRAWS - 1), size, run)


def without_effect(hidden: Hidden) -> Hidden:
    """Return the stage as its owner knows it: the twin of a case is the same case of size 0."""
    return Hidden(hidden.known, hidden.known)


def chance(seed: int, *purpose: int) -> Generator:
    """Return the random numbers of one purpose of one seed; the hidden effect does not change the others."""
    return np.random.default_rng([seed, *purpose])


def recording_noise(seed: int, index: int, count: int) -> Floats:
    """Return the force noise of recording ``index``, unit rms; its colour belongs to the seed."""
    colour = chance(seed, 10)
    corner, white = float(np.exp(colour.uniform(np.log(10.0), np.log(150.0)))), float(colour.uniform(0.1, 0.6))
    return coloured_noise(count, corner, white, chance(seed, 11, index))


def make_scene(seed: int, effect: str, size: float, duration: float = 30.0, mass_tolerance: float = 0.05) -> Scene:
    """Draw, size and record a case.

    Args:
        seed: everything but the effect follows from it: the same seed with ``nothing`` is the case's twin.
        effect: a name of the menu, two joined by ``+``, or ``nothing``.
        size: share of the Coulomb force, of each effect (see ``recording.sized``); 0 hides nothing.
        duration: of the main recording [s].
        mass_tolerance: largest relative error of the owner's mass.
    """
    stage = draw_stage(chance(seed, 1))
    parts = menu.names(effect)
    has_other = any(menu.KINDS[part].needs_other_axis for part in parts) or chance(seed, 2).random() < OTHER_AXIS_SHARE
    kinds = list(chance(seed, 3).permutation(HELD_OUT)[:2])
    motions = (
        rich_motion(stage, chance(seed, 4), duration),
        *(held_out_motion(str(kind), stage, chance(seed, 5, i)) for i, kind in enumerate(kinds)),
    )
    others: list[Track | None] = [None] * len(motions)
    nominal: dict[str, NominalModel] = {}
    if has_other:
        second = replace(draw_stage(chance(seed, 6)), model=stage.model)
        for i, motion in enumerate(motions):
            count, mate = motion.position.size, rich_motion(second, chance(seed, 7, i), motion.position.size * PERIOD)
            others[i] = record(Hidden(second, second), mate, recording_noise(seed + 1, i, count), chance(seed, 8, i))
        nominal["y"] = nominal_model(second, chance(seed, 9), mass_tolerance=mass_tolerance)

    def run(hidden: Hidden, i: int) -> Track:
        noise = recording_noise(seed, i, motions[i].position.size)
        return record(hidden, motions[i], noise, chance(seed, 12, i), others[i])

    def main_run(hidden: Hidden) -> Track:
        return run(hidden, 0)

    found: list[Hidden] = []
    for i, part in enumerate(parts):
        kind = menu.KINDS[part]
        if 0.0 < size < kind.smallest:
            raise ValueError(f"{part} of {size:g} lies inside the owner's tolerance; use at least {kind.smallest:g}")
        found.append(_draw_effect(kind, found[0].known if found else stage, motions[0], size, (seed, i), main_run))
    hidden = Hidden(stage, stage) if not found else found[0] if len(found) == 1 else menu.together(*found)
    nominal = {"x": nominal_model(hidden.known, chance(seed, 13), mass_tolerance=mass_tolerance)} | nominal
    tracks = []
    for i in range(len(motions)):
        tracks.append({"x": run(hidden, i)} | ({"y": other} if (other := others[i]) is not None else {}))
    return Scene(
        hidden, nominal, motions, tuple(tracks), {part: one.truth for part, one in zip(parts, found, strict=True)}
    )


def write_bag(path: Path, tracks: dict[str, Track], start_ns: int) -> None:
    """Write position, control_effort and reference of all axes."""
    first = next(iter(tracks.values()))
    stamps = start_ns + np.round(first.time * 1.0e9).astype(np.int64)

    def columns(of: Callable[[Track], Floats]) -> Floats:
        return np.stack([of(track) for track in tracks.values()], axis=1)

    with BagWriter(path) as bag:
        names = list(tracks)
        # The reference first: a reader does not wait for the first reference.
        bag.write_joint_states(
            "reference",
            stamps,
            names,
            position=columns(lambda track: track.reference),
            velocity=columns(lambda track: track.reference_velocity),
        )
        bag.write_joint_states("position", stamps, names, position=columns(lambda track: track.position))
        bag.write_joint_states("control_effort", stamps, names, effort=columns(lambda track: track.effort))


def make_case(
    seed: int, effect: str, size: float, out: Path | str, duration: float = 30.0, mass_tolerance: float = 0.05
) -> CasePaths:
    """Make a case and seal its truth.

    Args:
        seed: see ``make_scene``.
        effect: a name of the menu, two joined by ``+``, or ``nothing``.
        size: share of the Coulomb force.
        out: the case goes to ``out/cases``, the truth to ``out/truth``; names do not show the effect.
        duration: of the main recording [s].
        mass_tolerance: largest relative error of the owner's mass.

    Raises:
        ValueError: for an unknown effect, or one too small to be a discrepancy.
    """
    paths = paths_of(case_name(seed, effect, size), Path(out))
    scene = make_scene(seed, effect, size, duration, mass_tolerance)
    paths.folder.mkdir(parents=True)
    for i, (path, tracks) in enumerate(zip((paths.bag, *paths.holdouts), scene.tracks, strict=True)):
        write_bag(path, tracks, START_NS + i * 60_000_000_000)
    write_owner_file(paths.config, scene.nominal)
    seal(describe(scene, seed, effect, size), paths.truth_file, paths.folder)
    return paths


def case_name(seed: int, effect: str, size: float) -> str:
    """Return the name of a case's folder; it does not show what is hidden."""
    return "c" + hashlib.sha256(f"{seed}/{effect}/{size:.6f}".encode()).hexdigest()[:12]


def paths_of(name: str, out: Path) -> CasePaths:
    """Return the paths of the case ``name`` under ``out``."""
    folder = out / "cases" / name
    holdouts = (folder / "holdout_1", folder / "holdout_2")
    return CasePaths(folder, folder / "bag", folder / "config.yaml", holdouts, out / "truth" / f"{name}.json")


def describe(scene: Scene, seed: int, effect: str, size: float) -> dict[str, Any]:
    """Return the truth of a case as it is sealed."""
    coulomb = scene.hidden.known.coulomb_force
    tracks = [track["x"] for track in scene.tracks]
    return {
        "schema": 1,
        "salt": chance(seed, 99, int(size * 1.0e6)).bytes(16).hex(),
        "seed": seed,
        "effect": effect,
        "effects": list(menu.names(effect)) if size > 0.0 else [],
        "is_inside": all(menu.KINDS[part].is_inside for part in menu.names(effect)),
        "size": size,
        "peak": [measured_size(track, coulomb) for track in tracks],
        "rms": [rms_size(track, coulomb) for track in tracks],
        "effort_rms": [float(np.sqrt(np.mean(track.effort**2))) for track in tracks],
        "kinds": [motion.kind for motion in scene.motions],
        "parameters": scene.truths,
        "stage": asdict(scene.hidden.true),
        "nominal": {axis: asdict(model) for axis, model in scene.nominal.items()},
    }
