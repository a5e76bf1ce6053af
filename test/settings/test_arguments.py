"""A node's arguments before ROS reads them."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import pytest

from sgms_observer.errors import ConfigurationError
from sgms_observer.settings.load import load_settings, settings_from_tree
from sgms_observer.settings.node_parameters import read_arguments, refuse_incomplete, tree_from_parameters

CONFIG = Path(__file__).parents[2] / "config"


def written(folder: Path, text: str, name: str = "table.yaml") -> str:
    """Return the name of a file with this text."""
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return str(path)


def test_without_parameters_the_arguments_stay() -> None:
    argv = ["observer_node", "--ros-args", "-r", "position:=/joint_states", "--log-level", "info", "--", "-p", "mine"]
    given = read_arguments(argv)
    assert given.argv == argv and given.parameters is None
    assert given.settings == settings_from_tree({})


def test_files_and_values_become_the_nodes_parameters(tmp_path: Path) -> None:
    first = written(tmp_path, "/**: {ros__parameters: {axes: [x, y], x: {mass: 3, filter: {degree: 2}}}}", "first.yaml")
    second = written(tmp_path, "observer_node: {ros__parameters: {x.mass: 4}}", "second.yaml")
    argv = [
        "observer_node",
        "--ros-args",
        "--params-file",
        first,
        "-r",
        "a:=b",
        "-p",
        "y.mass:=5",
        "--params-file",
        second,
    ]
    argv += [
        "--param",
        "x.friction.static_force:=6",
        "-p",
        "other:x.mass:=9",
        "-p",
        "observer_node:sample_period:=1e-3",
    ]
    given = read_arguments(argv)
    assert given.argv == ["observer_node", "--ros-args", "-r", "a:=b"]
    x, y = given.settings.axes
    assert (x.mass, x.filter.degree, x.friction.static_force, y.mass) == (4.0, 2, 6.0, 5.0)
    assert given.settings.sample_period == 1e-3
    assert given.parameters == {
        "axes": ["x", "y"],
        "x.mass": 4.0,
        "x.filter.degree": 2,
        "x.friction.static_force": 6.0,
        "y.mass": 5.0,
        "sample_period": 1e-3,
        "save_file": str(tmp_path / "learnt.yaml"),
    }


def test_later_ones_decide(tmp_path: Path) -> None:
    file = written(tmp_path, "/**: {ros__parameters: {x: {mass: 3}}}")
    before = read_arguments(["n", "--ros-args", "-p", "x.mass:=4", "--params-file", file])
    after = read_arguments(["n", "--ros-args", "--params-file", file, "-p", "x.mass:=4"])
    assert (before.settings.axes[0].mass, after.settings.axes[0].mass) == (3.0, 4.0)


def test_the_nodes_name_and_namespace_choose_the_section(tmp_path: Path) -> None:
    text = "/**: {ros__parameters: {x: {mass: 1.0}}}\n/table/eyes: {ros__parameters: {x: {mass: 2.0}}}"
    file = written(tmp_path, text)
    argv = ["n", "--ros-args", "-r", "__ns:=/table", "--remap", "__node:=eyes", "--params-file", file]
    named = read_arguments(argv)
    plain = read_arguments(["n", "--ros-args", "--params-file", file])
    assert (named.settings.axes[0].mass, plain.settings.axes[0].mass) == (2.0, 1.0)


@pytest.mark.parametrize(
    ("rules", "mass"),
    [
        (["__node:=eyes", "__ns:=/table"], 2.0),
        (["__ns:=/table", "__ns:=/other", "__node:=eyes"], 2.0),  # the first rule counts
        (["other:__ns:=/table", "n:__name:=eyes", "eyes:__ns:=/table"], 2.0),
        (["n:__node:=eyes", "n:__ns:=/table"], 1.0),  # it is called eyes when its namespace is looked for
        (["other:__node:=eyes", "__ns:=/table"], 1.0),
    ],
)
def test_the_rule_that_rcl_takes_decides_about_the_section(rules: list[str], mass: float, tmp_path: Path) -> None:
    text = "/**: {ros__parameters: {x: {mass: 1.0}}}\n/table/eyes: {ros__parameters: {x: {mass: 2.0}}}"
    remaps = [word for rule in rules for word in ("-r", rule)]
    given = read_arguments(["n", "--ros-args", *remaps, "--params-file", written(tmp_path, text)], "n")
    assert given.settings.axes[0].mass == mass
    assert given.argv == ["n", "--ros-args", *remaps]


def test_every_parameter_is_given_in_the_type_that_it_is_declared_with(tmp_path: Path) -> None:
    text = """
/**:
  ros__parameters:
    axes: [x, y]
    use_sim_time: on
    qos_overrides: &a {b: *a, c: [1, 2.0]}
    sample_period: 1e-4
    effect_files: []
    x:
      mass: 3
      friction: {element_stiffness: [12.0e6, 2, 3e5], element_fraction: [0.3, 0.3, 0.4]}
      effects: {names: [cogging, offset], cogging: {amplitude: 1}}
      estimator: {parameters: [], horizon: 4.0}
      stage: {effects: {names: []}, friction: null, reference: {amplitudes: []}}
/other: {ros__parameters: {a: [1, 2.0]}}
"""
    given = read_arguments(["n", "--ros-args", "--params-file", written(tmp_path, text)]).parameters
    assert given == {
        "axes": ["x", "y"],
        "use_sim_time": True,
        "sample_period": 1e-4,
        "save_file": str(tmp_path / "learnt.yaml"),
        "x.mass": 3.0,
        "x.friction.element_stiffness": [12e6, 2.0, 3e5],
        "x.friction.element_fraction": [0.3, 0.3, 0.4],
        "x.effects.names": ["cogging", "offset"],
        "x.effects.cogging.amplitude": 1.0,
        "x.estimator.horizon": 4,
        "x.stage.effects.names": ["none"],
    }
    assert isinstance(given["x.mass"], float) and isinstance(given["x.estimator.horizon"], int)
    assert {type(entry) for entry in given["x.friction.element_stiffness"]} == {float}
    assert isinstance(given["x.effects.cogging.amplitude"], float)


@pytest.mark.parametrize("name", ["paper", "table", "emps"])
def test_shipped_files_mean_the_same_as_parameters(name: str) -> None:
    path = CONFIG / f"{name}.yaml"
    given = read_arguments(["n", "--ros-args", "--params-file", str(path)], "observer_node")
    loaded = load_settings(path, node_names=("observer_node",))
    beside = replace(loaded, save_file=str(path.resolve().parent / loaded.save_file))  # where a node saves
    assert given.parameters is not None
    assert settings_from_tree(tree_from_parameters(given.parameters)) == given.settings == beside


def test_relative_files_are_those_beside_the_file(tmp_path: Path) -> None:
    written(tmp_path, "0,0\n", "lap.csv")
    file = written(tmp_path, "/**: {ros__parameters: {x: {stage: {reference: {kind: file, file: lap.csv}}}}}")
    given = read_arguments(["n", "--ros-args", "--params-file", file])
    assert Path(given.settings.axes[0].stage.reference.file) == tmp_path / "lap.csv"
    assert given.parameters is not None
    assert given.parameters["x.stage.reference.file"] == str(tmp_path / "lap.csv")


def test_faults_of_all_files_and_values_at_once(tmp_path: Path) -> None:
    file = written(tmp_path, "/**:\n  ros__parameters:\n    x:\n      mass: 1\n      mass: -1\n")
    with pytest.raises(ConfigurationError) as error:
        read_arguments(["n", "--ros-args", "--params-file", file, "-p", "sample_perid:=1", "-p", "x.filter.kind:=y"])
    assert error.value.sentences == (
        f"x.mass in line 5 of {file} must be given once; remove one of the two",
        "sample_perid is not a setting; did you mean sample_period?",
        "x.mass = -1 kg must be > 0; raise it",
        "x.filter.kind = 'y' must be lowpass, savgol or kalman; choose one",
    )


@pytest.mark.parametrize(
    ("argv", "sentence"),
    [
        (["--params-file"], "--params-file = (nothing) must have a value; write it after --params-file"),
        (["-p", "x.mass=3"], "-p x.mass=3 must have the form name:=value; write for instance -p x.mass:=10.0"),
        (["-p", ":=3"], "-p :=3 must have the form name:=value; write for instance -p x.mass:=10.0"),
        (["-p", "use_sim_time:=3"], "use_sim_time = 3 must be true or false; write one of the two"),
        (
            ["--params-file", "no/such.yaml"],
            "no/such.yaml cannot be read: No such file or directory; check the path of the parameter file",
        ),
    ],
)
def test_arguments_that_cannot_work(argv: list[str], sentence: str) -> None:
    with pytest.raises(ConfigurationError) as error:
        read_arguments(["n", "--ros-args", *argv])
    assert error.value.sentences == (sentence,)


def test_only_strangers_parameters_is_a_fault(tmp_path: Path) -> None:
    file = written(tmp_path, "/other: {ros__parameters: {a: 1}}")
    with pytest.raises(ConfigurationError) as error:
        read_arguments(["n", "--ros-args", "--params-file", file])
    assert "has parameters for /other only" in error.value.sentences[0]
    beside = read_arguments(["n", "--ros-args", "--params-file", file, "-p", "axes:=[y]"])
    assert beside.settings.axes[0].name == "y"


def test_a_folder_whose_name_ros_cannot_write_is_told(tmp_path: Path) -> None:
    folder = tmp_path / os.fsdecode(b"\xff")
    folder.mkdir()
    file = written(folder, "/**: {ros__parameters: {axes: [x], x: {mass: 3.0}}}")
    with pytest.raises(ConfigurationError, match=r"save_file = .* must be text in UTF-8; rename the file or folder"):
        read_arguments(["n", "--ros-args", "--params-file", file])


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("/**: {ros__parameters: {}}", "axes must be given"),
        ("/**: {ros__parameters: {axes: [x, 'y'], x: {mass: 3.0}, 'y': {joint_type: prismatic}}}", "y.mass must be"),
        ("/**: {ros__parameters: {axes: [x], x.mass: 3.0}}", ""),
    ],
)
def test_a_node_needs_axes_and_their_masses(text: str, sentence: str, tmp_path: Path) -> None:
    given = read_arguments(["n", "--ros-args", "--params-file", written(tmp_path, text)])
    if not sentence:
        refuse_incomplete(given, "n")
        return
    with pytest.raises(ConfigurationError, match=sentence):
        refuse_incomplete(given, "n")
