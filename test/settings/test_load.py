"""Parameter files as people write them: what is meant is what is loaded."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from sgms_observer.errors import ConfigurationError
from sgms_observer.settings.axis import EffectSettings
from sgms_observer.settings.load import load_settings, settings_from_tree

ROOT = Path(__file__).parents[2]


def written(folder: Path, text: str) -> Path:
    """Return a file with this text."""
    path = folder / "table.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_ways_to_write_a_number(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        """
/**:
  ros__parameters:
    axes: [x, y]
    sample_period: 1e-4
    publish_every: 2.0
    x:
      mass: 3
      friction:
        element_stiffness: [12.0e6, 2, 3e5]
        element_fraction: [.3, "0.3", 4e-1]
        static_force: 010.5
        viscous_coefficient: 1_000
    y: {mass: +2., estimator: {parameters: kappa, horizon: "3"}, compensation: {enabled: yes}}
""",
    )
    settings = load_settings(path)
    x, y = settings.axes
    assert (x.name, y.name) == ("x", "y")
    assert settings.sample_period == 1e-4
    assert settings.publish_every == 2 and isinstance(settings.publish_every, int)
    assert x.mass == 3.0 and isinstance(x.mass, float)
    assert x.friction.element_stiffness == (12e6, 2.0, 3e5)
    assert x.friction.element_fraction == (0.3, 0.3, 0.4)
    assert x.friction.element_damping == (0.0, 0.0, 0.0)
    assert x.friction.static_force == 10.5
    assert x.friction.viscous_coefficient == 1000.0
    assert y.mass == 2.0 and y.estimator.parameters == ("kappa",) and y.estimator.horizon == 3
    assert y.compensation.enabled is True


def test_a_nodes_own_section_lies_over_the_common_one(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        """
/stage_node: {ros__parameters: {x: {mass: 2.0, friction: {static_force: 6.0}}}}
observer_node: {ros__parameters: {x: {mass: 3.0}}}
/**: {ros__parameters: {axes: [x], x: {mass: 1.0, friction: {static_force: 5.0, viscous_coefficient: 7.0}}}}
/controller_manager: {ros__parameters: {update_rate: 1000, masss: 3}}
""",
    )
    both = load_settings(path).axes[0]
    assert (both.mass, both.friction.static_force, both.friction.viscous_coefficient) == (3.0, 6.0, 7.0)
    stage = load_settings(path, node_names=("stage_node",)).axes[0]
    assert (stage.mass, stage.friction.static_force) == (2.0, 6.0)
    observer = load_settings(path, node_names=("observer_node",)).axes[0]
    assert (observer.mass, observer.friction.static_force) == (3.0, 5.0)


@pytest.mark.parametrize(
    ("section", "node", "is_ours"),
    [
        ("/**", "/observer_node", True),
        ("/*", "/observer_node", True),
        ("/*", "/table/observer_node", False),
        ("/**/observer_node", "/table/observer_node", True),
        ("/table/*", "/table/observer_node", True),
        ("/table/observer_node", "/table/observer_node", True),
        ("table/observer_node", "/table/observer_node", True),
        ("/observer_node", "/table/observer_node", False),
        ("/other/observer_node", "/table/observer_node", False),
        ("/other/observer_node", "/observer_node", False),
        ("/*/observer_node", "/observer_node", False),
        ("/**/observer_node", "/observer_node", True),
        ("/table/observer_node", "observer_node", True),
        ("/observer", "observer_node", False),
    ],
)
def test_which_sections_are_for_a_node(section: str, node: str, is_ours: bool, tmp_path: Path) -> None:
    path = written(
        tmp_path, f"{section}: {{ros__parameters: {{x: {{mass: 3.0}}}}}}\n/**/**: {{ros__parameters: {{axes: [x]}}}}"
    )
    assert load_settings(path, node_names=(node,)).axes[0].mass == (3.0 if is_ours else 10.0)


def test_nested_namespaces_and_dotted_names(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        """
table:
  observer_node:
    ros__parameters: {axes: [x], x.mass: 3.0, x.friction.static_force: 5.0, x: {friction.coulomb_force: 4.5}}
""",
    )
    axis = load_settings(path).axes[0]
    assert (axis.mass, axis.friction.static_force, axis.friction.coulomb_force) == (3.0, 5.0, 4.5)


def test_the_truth_of_the_stage() -> None:
    effects = {"names": ["offset"], "offset": {"force": 1}}
    friction = {"element_stiffness": [1e6, 1e5], "element_fraction": [0.4, 0.6], "viscous_coefficient": 9.0}
    tree = {"x": {"friction": friction, "effects": effects}}
    assert settings_from_tree(tree).axes[0].stage_friction is None
    assert settings_from_tree(tree).axes[0].stage_effects is None
    tree["x"]["stage"] = {"friction": {"model": "gms"}, "effects": {"names": []}}
    axis = settings_from_tree(tree).axes[0]
    assert axis.effects == (EffectSettings("offset", (1.0,)),)
    assert axis.stage_friction is not None
    assert axis.stage_friction.model == "gms" and axis.stage_friction.viscous_coefficient == 9.0
    assert axis.stage_effects == ()
    tree["x"]["stage"] = {"effects": {"names": ["none"]}}
    assert settings_from_tree(tree).axes[0].stage_effects == ()


def test_effects_have_their_values_in_the_catalogues_order() -> None:
    tree = {"x": {"effects": {"names": ["cogging"], "cogging": {"phase": 0.3, "amplitude": 1.4}}}}
    assert settings_from_tree(tree).axes[0].effects[0].values[:3] == (1.4, 0.01, 0.3)


def test_relative_files_start_at_the_parameter_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "config").mkdir()
    (tmp_path / "config" / "lap.csv").write_text("0,0\n1,1\n", encoding="utf-8")
    path = written(
        tmp_path / "config", "/**: {ros__parameters: {x: {stage: {reference: {kind: file, file: lap.csv}}}}}"
    )
    monkeypatch.chdir(tmp_path)
    assert Path(load_settings("config/table.yaml").axes[0].stage.reference.file).is_file()
    assert Path(load_settings(path).axes[0].stage.reference.file) == tmp_path / "config" / "lap.csv"


def test_parameters_that_every_ros_node_has_are_left_alone() -> None:
    assert settings_from_tree({"use_sim_time": True, "qos_overrides": {"/position": {"subscription": {"depth": 1}}}})


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "{path} has no ros__parameters; put all parameters below /**: ros__parameters: as in config/table.yaml"),
        (
            "axes: [x]",
            "{path} has no ros__parameters; put all parameters below /**: ros__parameters: as in config/table.yaml",
        ),
        (
            "- 1",
            "{path} has no ros__parameters; put all parameters below /**: ros__parameters: as in config/table.yaml",
        ),
        (
            "/a: {ros__parameters: {b: 1}}",
            "{path} has parameters for /a only; put those of observer_node below /**: ros__parameters:",
        ),
        ("/**: {ros__parameters: 3}", "{path}: ros__parameters of /** must be a group; indent parameters below it"),
    ],
)
def test_files_that_hold_no_parameters(text: str, sentence: str, tmp_path: Path) -> None:
    path = written(tmp_path, text)
    with pytest.raises(ConfigurationError) as error:
        load_settings(path)
    assert error.value.sentences == (sentence.format(path=path),)


def test_text_that_is_no_yaml_names_the_line(tmp_path: Path) -> None:
    path = written(tmp_path, "/**:\n  ros__parameters:\n    axes: [x\n    x: {mass: 3}\n")
    with pytest.raises(ConfigurationError) as error:
        load_settings(path)
    assert error.value.sentences[0].startswith(f"{path}, line 4, column ")
    assert error.value.sentences[0].endswith("; correct the line")


@pytest.mark.parametrize("name", ["missing.yaml", "", "a\0b", "x" * 5000])
def test_files_that_cannot_be_read(name: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError) as error:
        load_settings(f"{tmp_path}/{name}")
    assert len(error.value.sentences) == 1
    assert "cannot be read" in error.value.sentences[0]


def test_a_file_without_an_end() -> None:
    """A device has no size to look at first."""
    with pytest.raises(ConfigurationError, match="/dev/zero is larger than"):
        load_settings("/dev/zero")


def test_a_file_of_bytes(tmp_path: Path) -> None:
    path = tmp_path / "image.yaml"
    path.write_bytes(bytes(range(256)))
    with pytest.raises(ConfigurationError) as error:
        load_settings(path)
    assert error.value.sentences == (f"{path} is not a text file in UTF-8; name a YAML parameter file",)


def test_a_parameter_given_twice(tmp_path: Path) -> None:
    path = written(tmp_path, "/**:\n  ros__parameters:\n    x:\n      mass: 1.0\n      mass: 2.0\n/a: {b: 1, b: 2}\n")
    with pytest.raises(ConfigurationError) as error:
        load_settings(path)
    assert error.value.sentences == (f"x.mass in line 5 of {path} must be given once; remove one of the two",)


def test_a_section_given_twice(tmp_path: Path) -> None:
    path = written(tmp_path, "/**: {ros__parameters: {axes: [x]}}\n/**: {ros__parameters: {sample_period: 1.0e-3}}\n")
    with pytest.raises(ConfigurationError) as error:
        load_settings(path)
    assert error.value.sentences == (f"/** in line 2 of {path} must be given once; join the two sections",)


def test_aliases_that_multiply_end_at_once(tmp_path: Path) -> None:
    lines = ["a0: &a0 {b: 1}"] + [
        f"a{i}: &a{i} {{{', '.join(f'k{j}: *a{i - 1}' for j in range(9))}}}" for i in range(1, 30)
    ]
    path = written(tmp_path, "\n".join([*lines, "/**: {ros__parameters: {x: *a29}}"]))
    with pytest.raises(ConfigurationError) as error:
        load_settings(path)
    assert len(error.value.sentences) == 9


def test_thousands_of_axes() -> None:
    names = [f"axis_{i}" for i in range(2000)]
    tree: dict[str, Any] = {
        "axes": names,
        **{name: {"mass": i + 1, "filter": {"degree": 2}} for i, name in enumerate(names)},
    }
    assert [axis.mass for axis in settings_from_tree(tree).axes] == [float(i + 1) for i in range(2000)]


def test_an_axis_of_defaults_is_an_empty_tree() -> None:
    assert settings_from_tree({"axes": ["x"], "x": {}}) == settings_from_tree({})


def test_settings_need_no_ros() -> None:
    code = (
        "import sys\nsys.modules['rclpy'] = None\n"
        "from sgms_observer.settings import document, load, node_parameters, write\n"
        "load.load_settings('config/paper.yaml')\n"
        "assert not {'rcl_interfaces', 'casadi', 'numba'} & {name.split('.')[0] for name in sys.modules}\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
