"""A node's arguments before ROS reads them."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from sgms_observer.errors import ConfigurationError
from sgms_observer.settings.arguments import normalise_params_file, rewrite_arguments
from sgms_observer.settings.load import load_settings, settings_from_tree

CONFIG = Path(__file__).parents[2] / "config"


def written(folder: Path, text: str, name: str = "table.yaml") -> str:
    """Return the name of a file with this text."""
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return str(path)


def test_without_parameters_the_arguments_stay() -> None:
    argv = ["observer_node", "--ros-args", "-r", "position:=/joint_states", "--log-level", "info", "--", "-p", "mine"]
    rewritten = rewrite_arguments(argv)
    assert rewritten.argv == argv and rewritten.file is None
    assert rewritten.settings == settings_from_tree({})
    rewritten.discard()


def test_files_and_values_become_one_file(tmp_path: Path) -> None:
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
    rewritten = rewrite_arguments(argv)
    assert rewritten.file is not None
    assert rewritten.argv == ["observer_node", "--ros-args", "--params-file", str(rewritten.file), "-r", "a:=b"]
    x, y = rewritten.settings.axes
    assert (x.mass, x.filter.degree, x.friction.static_force, y.mass) == (4.0, 2, 6.0, 5.0)
    assert rewritten.settings.sample_period == 1e-3
    assert load_settings(rewritten.file) == rewritten.settings
    rewritten.discard()
    assert not rewritten.file.exists()
    rewritten.discard()


def test_later_ones_decide(tmp_path: Path) -> None:
    file = written(tmp_path, "/**: {ros__parameters: {x: {mass: 3}}}")
    before = rewrite_arguments(["n", "--ros-args", "-p", "x.mass:=4", "--params-file", file])
    after = rewrite_arguments(["n", "--ros-args", "--params-file", file, "-p", "x.mass:=4"])
    assert (before.settings.axes[0].mass, after.settings.axes[0].mass) == (3.0, 4.0)
    before.discard()
    after.discard()


def test_the_nodes_name_and_namespace_choose_the_section(tmp_path: Path) -> None:
    text = "/**: {ros__parameters: {x: {mass: 1.0}}}\n/table/eyes: {ros__parameters: {x: {mass: 2.0}}}"
    file = written(tmp_path, text)
    argv = ["n", "--ros-args", "-r", "__ns:=/table", "--remap", "__node:=eyes", "--params-file", file]
    named = rewrite_arguments(argv)
    plain = rewrite_arguments(["n", "--ros-args", "--params-file", file])
    assert (named.settings.axes[0].mass, plain.settings.axes[0].mass) == (2.0, 1.0)
    named.discard()
    plain.discard()


def test_the_file_for_rcl_has_one_type_per_parameter(tmp_path: Path) -> None:
    text = """
/**:
  ros__parameters:
    axes: [x, y]
    use_sim_time: true
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
    tree = yaml.safe_load(normalise_params_file(written(tmp_path, text)))
    assert list(tree) == ["/**"]
    assert tree["/**"]["ros__parameters"] == {
        "axes": ["x", "y"],
        "use_sim_time": True,
        "sample_period": 1e-4,
        "x": {
            "mass": 3.0,
            "friction": {"element_stiffness": [12e6, 2.0, 3e5], "element_fraction": [0.3, 0.3, 0.4]},
            "effects": {"names": ["cogging", "offset"], "cogging": {"amplitude": 1.0}},
            "estimator": {"horizon": 4},
            "stage": {"effects": {"names": ["none"]}},
        },
    }
    x = tree["/**"]["ros__parameters"]["x"]
    assert isinstance(x["mass"], float) and isinstance(x["estimator"]["horizon"], int)
    assert {type(entry) for entry in x["friction"]["element_stiffness"]} == {float}
    assert isinstance(x["effects"]["cogging"]["amplitude"], float)


@pytest.mark.parametrize("name", ["paper", "table", "emps"])
def test_shipped_files_mean_the_same_after_it(name: str, tmp_path: Path) -> None:
    path = CONFIG / f"{name}.yaml"
    assert load_settings(written(tmp_path, normalise_params_file(path))) == load_settings(path)


def test_relative_files_still_work_from_the_new_place(tmp_path: Path) -> None:
    written(tmp_path, "0,0\n", "lap.csv")
    file = written(tmp_path, "/**: {ros__parameters: {x: {stage: {reference: {kind: file, file: lap.csv}}}}}")
    rewritten = rewrite_arguments(["n", "--ros-args", "--params-file", file])
    assert rewritten.file is not None
    assert Path(load_settings(rewritten.file).axes[0].stage.reference.file) == tmp_path / "lap.csv"
    rewritten.discard()


def test_faults_of_all_files_and_values_at_once(tmp_path: Path) -> None:
    file = written(tmp_path, "/**:\n  ros__parameters:\n    x:\n      mass: 1\n      mass: -1\n")
    with pytest.raises(ConfigurationError) as error:
        rewrite_arguments(["n", "--ros-args", "--params-file", file, "-p", "sample_perid:=1", "-p", "x.filter.kind:=y"])
    assert error.value.sentences == (
        f"x.mass in line 5 of {file} must be given once; remove one of the two",
        "sample_perid is not a setting; did you mean sample_period?",
        "x.mass = -1 kg must be > 0; raise it",
        "x.filter.kind = 'y' must be lowpass, savgol or kalman; choose one",
    )


@pytest.mark.parametrize(
    ("argv", "sentence"),
    [
        (["--params-file"], "--params-file = (nothing) must have a value; write it behind --params-file"),
        (["-p", "x.mass=3"], "-p x.mass=3 must have the form name:=value; write for instance -p x.mass:=10.0"),
        (["-p", ":=3"], "-p :=3 must have the form name:=value; write for instance -p x.mass:=10.0"),
        (
            ["--params-file", "no/such.yaml"],
            "no/such.yaml cannot be read: No such file or directory; check the path of the parameter file",
        ),
    ],
)
def test_arguments_that_cannot_work(argv: list[str], sentence: str) -> None:
    with pytest.raises(ConfigurationError) as error:
        rewrite_arguments(["n", "--ros-args", *argv])
    assert error.value.sentences == (sentence,)


def test_only_strangers_parameters_is_a_fault(tmp_path: Path) -> None:
    file = written(tmp_path, "/other: {ros__parameters: {a: 1}}")
    with pytest.raises(ConfigurationError) as error:
        rewrite_arguments(["n", "--ros-args", "--params-file", file])
    assert "has parameters for /other only" in error.value.sentences[0]
    beside = rewrite_arguments(["n", "--ros-args", "--params-file", file, "-p", "axes:=[y]"])
    assert beside.settings.axes[0].name == "y"
    beside.discard()
