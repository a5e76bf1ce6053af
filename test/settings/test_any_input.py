"""Whatever a file holds, the loader answers with settings or with sentences: property tests."""

from __future__ import annotations

import random
from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml
from fresh_file import write_fresh
from hypothesis import HealthCheck, assume, example, given, settings
from hypothesis import strategies as st

from sgms_observer.errors import ConfigurationError
from sgms_observer.settings.axis import AxisSettings, Settings
from sgms_observer.settings.check import as_number
from sgms_observer.settings.declaration import Declared, declared_sections, declared_settings
from sgms_observer.settings.load import installed_catalogue, load_settings, settings_from_tree
from sgms_observer.settings.node_parameters import declare_all, tree_from_parameters
from sgms_observer.settings.write import given_parameters, normal_parameters, tree_of, yaml_of
from sgms_observer.settings.yaml_text import parse, text_of
from sgms_observer.whole_file import write_text

CONFIG = Path(__file__).parents[2] / "config"
SHIPPED = [(CONFIG / f"{name}.yaml").read_text(encoding="utf-8") for name in ("paper", "table", "emps")]
REPEATABLE = settings(deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))

EFFECTS = installed_catalogue(())


def catalogue(files: Any) -> Any:
    """Return the effects of the package; looking for plug-ins each time would take most of the tests' time."""
    return EFFECTS


def read(text: str, folder: Path) -> Settings | None:
    """Return what a file with this text holds, or None with at least one whole sentence."""
    path = folder / "any.yaml"
    write_fresh(path, text.encode("utf-8", errors="surrogatepass"))
    try:
        return load_settings(path, catalogue=catalogue)
    except ConfigurationError as error:
        assert error.sentences
        assert all(sentence.strip() and "\n" not in sentence for sentence in error.sentences)
        return None


words = st.sampled_from(
    ["x", "y", "axes", "mass", "friction", "effects", "names", "stage", "model", "filter", "/**", "<<"]
)
scalars = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=8), words, st.dates(), st.binary(max_size=3)
)
trees = st.recursive(
    scalars,
    lambda inside: st.one_of(
        st.lists(inside, max_size=4),
        st.dictionaries(st.one_of(words, st.text(max_size=6), st.integers(), st.booleans()), inside, max_size=5),
    ),
    max_leaves=25,
)


@REPEATABLE
@given(text=st.text())
@example(text="/**: {ros__parameters: {axes: [x], x: {mass: 2024-13-45}}}")
@example(text="/**: {ros__parameters: &a {x: *a}}")
@example(text="/**: {ros__parameters: {x: &a {friction: *a}}}")
@example(text="/**: {ros__parameters: {x: {mass: !!python/object:os.system {}}}}")
@example(text="/**: {ros__parameters: {? [a, b] : 1}}")
@example(text="/**: {ros__parameters: {? {a: b} : 1}}")
@example(text="/**:\n\tros__parameters: 3")
@example(text="/**: {ros__parameters: 3}")
@example(text="/**: {ros__parameters: {x: {mass: 0o7, friction: {static_force: 09}}}}")
@example(text="a: 1\n---\nb: 2")
@example(text="/**: {ros__parameters: {x: {mass: " + "9" * 5000 + "}}}")
@example(text="[" * 300_000)
@example(text="? " * 300_000)
@example(text="{a: " * 300)
@example(text="=: 1")
@example(text="a: !!int ''\nb: !!float x\nc: !!timestamp y\nd: !!bool z")
@example(text="/**: {ros__parameters: {'': {'.': 1, 'a..b': 2, '.x': 3, 'x.': 4}}}")
@example(text="%YAML 3.0\n---\na")
def test_any_text(text: str, tmp_path_factory: Any) -> None:
    read(text, tmp_path_factory.getbasetemp())


@REPEATABLE
@given(text=st.sampled_from(SHIPPED), data=st.data())
def test_any_slip_of_the_pen(text: str, data: Any, tmp_path_factory: Any) -> None:
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(text)))
        text = (
            text[:at]
            + data.draw(st.text("xyn0123.-e:[]{}, #\n\t'\"&*!|>%@`", max_size=3))
            + text[at + data.draw(st.integers(0, 3)) :]
        )
    read(text, tmp_path_factory.getbasetemp())


@REPEATABLE
@given(tree=trees)
def test_any_tree(tree: Any) -> None:
    for candidate in (tree, {"/**": {"ros__parameters": tree}}, {"axes": ["x"], "x": tree}):
        try:
            settings_from_tree(candidate, catalogue=catalogue)
        except ConfigurationError as error:
            assert error.sentences


def value_of(declared: Declared, chance: random.Random) -> Any:
    """Return a plausible value of a setting, written in one of the ways that mean it."""
    if declared.choices:
        usable = [word for word in declared.choices if word not in ("file", "multi_sine")]
        return chance.sample(usable, chance.randrange(len(usable))) if declared.is_list else chance.choice(usable)
    if declared.kind == "bool":
        return chance.choice([True, False, "true", "no"])
    if declared.kind == "string":
        return "".join(chance.choices("yn01e-. /x:#'\"ä", k=chance.randrange(5)))
    if declared.kind == "integer":
        return chance.choice([declared.default, declared.default + 1, str(declared.default), float(declared.default)])
    value = (declared.default or 0.01) * chance.choice([1.0, 0.99, 1.0 - 0.01 * chance.random()])
    return chance.choice([value, repr(value), f"{value:.3e}"])


def group_of(kind: type, chance: random.Random) -> dict[str, Any]:
    """Return a group of settings with some of its keys."""
    own = {name: entry for name, entry in declared_settings(kind).items() if entry.kind != "double_array"}
    own.pop("effect_files", None)
    group = {name: value_of(entry, chance) for name, entry in own.items() if chance.random() < 0.4}
    below = {name: group_of(nested, chance) for name, (nested, _) in declared_sections(kind).items()}
    return {**group, **{name: nested for name, nested in below.items() if nested or chance.random() < 0.5}}


LISTS: tuple[dict[str, Any], ...] = (
    {},
    {"element_stiffness": [1, "2e5"], "element_fraction": [0.5, "5e-1"]},
    {"element_damping": [0, 1, 0, "1e-3"]},
)


@settings(REPEATABLE, max_examples=60)
@given(seed=st.integers(0, 2**32))
def test_valid_settings_survive_writing_and_ros(seed: int, tmp_path_factory: Any) -> None:
    chance = random.Random(seed)
    axis, shared = group_of(AxisSettings, chance), group_of(Settings, chance)
    true_model: dict[str, Any] = chance.choice([{}, {"model": "gms"}, {"static_force": 99}])
    axis.setdefault("friction", {}).update(chance.choice(LISTS))
    axis.setdefault("stage", {}).update(friction=true_model, effects={"names": []})
    if "coupled_axis" in axis:
        axis["coupled_axis"] = chance.choice(["", "x"])
    axis["effects"] = {"names": ["cogging"], "cogging": {"pitch": "2e-3"}}
    tree = {"axes": ["y", "x"], "y": axis, "x": {}, **shared}
    before = settings_from_tree(tree, catalogue=catalogue)
    path = tmp_path_factory.getbasetemp() / "written.yaml"
    write_text(yaml_of(tree), path)
    assert load_settings(path, catalogue=catalogue) == before
    write_text(yaml_of(tree_of(before, catalogue)), path)
    assert load_settings(path, catalogue=catalogue) == before

    normal = normal_parameters(tree)
    again = parse(text_of(normal), "again")
    assert again == normal
    given_to_ros = given_parameters(again)
    declared: dict[str, Any] = {}

    def declare(parameter: Declared) -> Any:
        declared[parameter.name] = given_to_ros.pop(parameter.name, parameter.default)
        assert is_of_type(declared[parameter.name], parameter.kind), parameter.name
        return declared[parameter.name]

    declare_all(declare, catalogue)
    assert given_to_ros == {}
    assert equal_stage(settings_from_tree(tree_from_parameters(declared), catalogue=catalogue)) == equal_stage(before)


def is_of_type(value: Any, kind: str) -> bool:
    """Return whether ROS, which converts nothing, takes a value for this type."""
    python = {"double": float, "integer": int, "bool": bool, "string": str}[kind.removesuffix("_array")]
    return all(type(entry) is python for entry in (value if kind.endswith("_array") else [value]))


def equal_stage(given: Settings) -> Settings:
    """Return settings where a true friction that does not differ is none of its own, as it is for a node."""
    axes = (replace(a, stage_friction=None if a.stage_friction == a.friction else a.stage_friction) for a in given.axes)
    return replace(given, axes=tuple(axes))


@REPEATABLE
@given(tree=trees)
def test_strangers_sections_come_back_as_they_were(tree: Any) -> None:
    try:
        stranger = parse(text_of({"a": tree}), "stranger")
    except ConfigurationError:
        assume(False)
    document = {"/other/node": {"ros__parameters": stranger["a"]}, "/**": {"ros__parameters": {"axes": ["y"]}}}
    assert repr(parse(yaml_of(document), "again")["/other/node"]) == repr(document["/other/node"])


@REPEATABLE
@given(value=st.floats(allow_nan=False, allow_infinity=False))
def test_every_number_is_the_same_for_every_parser(value: float) -> None:
    text = text_of({"a": value, "b": [value]})
    assert parse(text, "ours") == yaml.safe_load(text) == {"a": value, "b": [value]}
    written = text.splitlines()[0].removeprefix("a: ")
    assert float(written) == value and "." in written  # rcl reads an integer first, then strtod


@REPEATABLE
@given(text=st.text(max_size=6))
@example(text="y")
@example(text="No")
@example(text="1e-4")
@example(text="inf")
@example(text="0x1f")
@example(text="012")
@example(text="")
@example(text="~")
def test_every_text_stays_text(text: str) -> None:
    assume(not any(0xD800 <= ord(letter) <= 0xDFFF for letter in text))
    written = text_of({"a": text})
    try:
        assert parse(written, "ours") == yaml.safe_load(written) == {"a": text}
    except ConfigurationError:
        assert not text.isprintable()  # YAML has no way to hold some control characters
    plain = not written.removeprefix("a: ").startswith('"')
    assert not plain or (
        as_number(text) is None and text.lower() not in ("y", "n", "yes", "no", "on", "off", "inf", "nan")
    )
