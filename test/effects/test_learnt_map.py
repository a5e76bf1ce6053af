"""A learnt map: read, checked, written back, linear inside its grid, zero far outside, calm at rest."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sgms_observer.effects.compiled import CompiledEffects
from sgms_observer.effects.learnt_map import LearntMap, MotionPath, learnt_coordinates
from sgms_observer.errors import ConfigurationError
from sgms_observer.settings.axis import EffectSettings
from sgms_observer.settings.declaration import Declared
from sgms_observer.settings.load import load_settings, settings_from_tree
from sgms_observer.settings.node_parameters import declare_all, read_arguments
from sgms_observer.settings.write import tree_of, yaml_of
from sgms_observer.whole_file import write_text

PERIOD = 1e-3
RAIL = """
/**:
  ros__parameters:
    axes: [x]
    x:
      effects:
        names: [learnt_map, offset, learnt_map_2]
        learnt_map:
          coordinates: [position, direction]
          position: [0, 0.2, 0.5]
          values: [-2.3, 2.3, -6, 4.0, -3, 2.5]
        learnt_map_2: {coordinates: [velocity], velocity: [-0.1, 0.0, 0.1], values: [1, 0, 1], scale: 0.5}
        offset: {force: 0.25}
"""


def along(position: np.ndarray) -> MotionPath:
    return MotionPath(PERIOD, position, np.gradient(position) / PERIOD)


def evaluated(effects: CompiledEffects, path: MotionPath, state: np.ndarray, part: slice = slice(None)) -> np.ndarray:
    q, v, a, t = (column[part].copy() for column in path.columns())
    one = np.ones(len(q))
    return effects.evaluate(q, v, a, t, 0.0 * q, PERIOD * one, one, state)[0]


def rail(tmp_path: Path) -> Path:
    file = tmp_path / "rail.yaml"
    file.write_text(RAIL)
    return file


def test_the_file_gives_the_force_that_its_table_says(tmp_path: Path) -> None:
    listed = load_settings(rail(tmp_path)).axes[0].effects
    assert [item.name for item in listed] == ["learnt_map", "offset", "learnt_map_2"]
    position = np.concatenate([np.linspace(0.0, 0.5, 5001), np.linspace(0.5, 0.0, 5001)])
    path = along(position)
    force = evaluated(effects := CompiledEffects(listed, PERIOD), path, effects.initial_state())
    forward = np.interp(position[10:5000], [0, 0.2, 0.5], [2.3, 4.0, 2.5])
    backward = np.interp(position[5010:], [0, 0.2, 0.5], [-2.3, -6.0, -3.0])
    assert force[10:5000] == pytest.approx(forward + 0.25 + 0.5, rel=1e-9)
    assert force[5010:] == pytest.approx(backward + 0.25 + 0.5, rel=1e-9)


def test_settings_come_back_from_what_is_written(tmp_path: Path) -> None:
    before = load_settings(rail(tmp_path))
    write_text(yaml_of(before.source), tmp_path / "again.yaml")
    write_text(yaml_of(tree_of(before)), tmp_path / "all.yaml")
    assert load_settings(tmp_path / "again.yaml") == before == load_settings(tmp_path / "all.yaml")


def test_ros_gets_lists_of_one_type(tmp_path: Path) -> None:
    given = read_arguments(["n", "--ros-args", "--params-file", str(rail(tmp_path))]).parameters
    assert given is not None
    table = {name.rpartition(".")[2]: value for name, value in given.items() if ".effects.learnt_map." in name}
    assert all(isinstance(entry, float) for entry in table["position"] + table["values"])
    assert table["coordinates"] == ["position", "direction"]
    declared: dict[str, Declared] = {}

    def declare(parameter: Declared) -> object:
        declared[parameter.name] = parameter
        return given.get(parameter.name)

    declare_all(declare)
    assert declared["x.effects.learnt_map.values"].kind == "double_array"
    assert declared["x.effects.learnt_map.coordinates"].kind == "string_array"
    assert declared["x.effects.learnt_map.position"].default == []


@pytest.mark.parametrize(
    ("given_lists", "sentences"),
    [
        ({"coordinates": ["position"], "position": [0.0, 1.0], "values": [1.0, 2.0]}, []),
        (
            {"coordinates": ["position", "dwell"], "position": [0.0, 1.0, 0.5], "velocity": [0.0, 1.0]},
            [
                "learnt_map.position must rise from entry to entry, but entry 3 is 0.5 after 1 m; sort the grid",
                "learnt_map.velocity has a grid, but x.effects.learnt_map.coordinates does not name velocity;",
                "learnt_map.dwell has 0 grid points and must have at least 2 in s,",
            ],
        ),
        ({"coordinates": ["direction", "direction"]}, ["must name one coordinate or two different ones"]),
        ({"coordinates": []}, ["must name one coordinate or two different ones"]),
        ({"coordinates": ["postion"]}, ["did you mean position?"]),
        ({"coordinates": "position"}, ["must be a list; write it like [position]"]),
        (
            {"coordinates": ["direction", "velocity"], "velocity": [0.0, 1.0, 2.0], "values": [0.0] * 5},
            ["learnt_map.values has 5 entries and must have 6 (2 of direction x 3 of velocity)"],
        ),
        ({"values": [0.0, float("nan")]}, ["learnt_map.values = nan in entry 2 must be a finite number in N"]),
        ({"reversal_distance": 0.0}, ["learnt_map.reversal_distance = 0 m must be >= 1e-09"]),
    ],
)
def test_every_fault_of_a_table_is_told_at_once(given_lists: dict[str, object], sentences: list[str]) -> None:
    tree = {"axes": ["x"], "x": {"effects": {"names": ["learnt_map"], "learnt_map": given_lists}}}
    if not sentences:
        assert settings_from_tree(tree).axes[0].effects
        return
    with pytest.raises(ConfigurationError) as caught:
        settings_from_tree(tree)
    assert len(caught.value.sentences) == len(sentences)
    for told, expected in zip(caught.value.sentences, sentences, strict=True):
        assert expected in told


def test_outside_the_grid_the_force_fades_to_zero_without_a_jump() -> None:
    one = LearntMap(("position",), ((-1.0, 0.0, 2.0),), (5.0, -1.0, 3.0))
    x = np.linspace(-2.0, 3.0, 50_001)
    force = one.force(MotionPath(PERIOD, x))
    assert np.all(force[(x < -1.31) | (x > 2.31)] == 0.0)
    assert np.abs(np.diff(force)).max() < 30.0 * np.diff(x).max()  # no steeper than 1.5 values per margin of 0.3
    assert force[np.searchsorted(x, -1.15)] == pytest.approx(2.5, abs=0.01)
    assert np.abs(one.force(MotionPath(PERIOD, np.array([np.nan, np.inf, -np.inf])))).max() == 0.0


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=5, unique=True),
    st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=5, unique=True),
    st.integers(0, 2**31),
)
def test_the_force_is_never_larger_than_the_largest_value(x: list[float], y: list[float], seed: int) -> None:
    rng = np.random.default_rng(seed)
    values = rng.normal(0.0, 10.0, len(x) * len(y))
    try:
        one = LearntMap(("position", "velocity"), (tuple(sorted(x)), tuple(sorted(y))), tuple(values))
    except ConfigurationError:  # two grid points nearer than a number can tell
        return
    force = one.force(MotionPath(PERIOD, rng.uniform(-2e3, 2e3, 500), rng.uniform(-2e3, 2e3, 500)))
    assert np.all(np.isfinite(force)) and np.abs(force).max() <= np.abs(values).max() * (1.0 + 1e-12)


def test_the_direction_turns_over_its_distance_and_noise_at_rest_does_not_move_it() -> None:
    one = LearntMap(("direction",), ((),), (-3.0, 3.0), reversal_distance=1e-5)
    rng = np.random.default_rng(1)
    way = np.concatenate([np.linspace(0.0, 1e-2, 1000), np.full(5000, 1e-2), np.linspace(1e-2, 0.0, 20_000)])
    noisy = way + 1e-7 * rng.standard_normal(len(way))
    force = one.force(along(noisy))
    assert force[990] == 3.0 and force[-1] == -3.0
    assert np.abs(force[1010:5990] - 3.0).max() < 0.5  # six standard deviations of noise on both sides
    assert np.abs(np.diff(one.force(along(way)))[900:]).max() < 0.5  # 5e-7 m a sample while it turns


def test_the_dwell_is_the_rest_before_the_motion_and_does_not_jump() -> None:
    rest, move = np.zeros(3000), np.linspace(0.0, 0.1, 1000)
    position = np.concatenate([rest, move, 0.1 + np.zeros(700), 0.1 + move])
    dwell = learnt_coordinates(("dwell",), along(position))[:, 0]
    assert dwell[3100:4000] == pytest.approx(3.0, abs=0.02)
    assert dwell[4800:] == pytest.approx(0.7, abs=0.02)
    assert np.abs(np.diff(dwell)).max() < 3.0 * PERIOD / 0.05 * 1.1


def test_the_rest_is_the_time_at_rest_so_far_and_does_not_jump() -> None:
    move = np.linspace(0.0, 0.1, 1000)
    position = np.concatenate([np.zeros(3000), move, 0.1 + np.zeros(700), 0.1 + move])
    rest = learnt_coordinates(("rest",), along(position))[:, 0]
    assert rest[2999] == pytest.approx(3.0, abs=0.06) and rest[4699] == pytest.approx(0.7, abs=0.06)
    assert np.abs(rest[3300:4000]).max() < 0.01 and np.abs(rest[5000:]).max() < 0.01
    assert np.abs(np.diff(rest)).max() < 3.0 * PERIOD / 0.05 * 1.1


def test_coordinates_are_what_their_names_say() -> None:
    t = np.arange(2000) * PERIOD
    q, v, a = 0.1 * np.sin(3.0 * t), 0.3 * np.cos(3.0 * t), -0.9 * np.sin(3.0 * t)
    path = MotionPath(PERIOD, q, v, a)
    found = learnt_coordinates(("position", "velocity", "acceleration", "load", "time", "travel", "direction"), path)
    assert found[:, :5] == pytest.approx(np.stack([q, v, a, np.abs(a), t], axis=1))
    assert found[-1, 5] == pytest.approx(np.sum(np.abs(np.diff(q))), rel=0.01)
    assert found[500, 6] == 1.0 and found[-1, 6] == np.sign(v[-1])


def test_a_linear_fit_finds_the_table_again_and_the_kernel_agrees_to_the_last_bit() -> None:
    grids = ((-0.06, -0.02, 0.01, 0.06), ())
    truth = np.array([[-1.0, 2.0], [-1.5, 2.5], [-3.0, 1.0], [-2.0, 2.0]])
    t = np.arange(8000) * PERIOD
    path = along(0.06 * np.sin(2.0 * t))
    empty = LearntMap.zero(("position", "direction"), grids)
    force = empty.filled(truth).force(path)
    found = np.linalg.lstsq(empty.basis(path).toarray(), force, rcond=None)[0]
    assert found == pytest.approx(truth.ravel(), abs=1e-9)
    learnt = empty.filled(found)
    assert LearntMap.of(learnt.settings()) == learnt and learnt.table().shape == (4, 2)
    effects = CompiledEffects([learnt.settings(), EffectSettings("offset", (1.0,))], PERIOD)
    whole = evaluated(effects, path, effects.initial_state())
    assert whole == pytest.approx(learnt.force(path) + 1.0, abs=1e-12)
    state = effects.initial_state()
    parts = [evaluated(effects, path, state, slice(i, i + 77)) for i in range(0, 8000, 77)]
    assert np.array_equal(np.concatenate(parts), whole)
