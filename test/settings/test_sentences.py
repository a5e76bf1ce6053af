"""Every sentence that a wrong parameter file earns, word for word."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pytest

from sgms_observer.errors import ConfigurationError
from sgms_observer.settings.load import settings_from_tree


@dataclass(frozen=True)
class Entry:
    """A parameter of an effect, as the catalogue has it."""

    name: str
    unit: str = "N"
    default: float = 0.0
    minimum: float = -1e3
    maximum: float = 1e3
    description: str = ""
    prismatic_default: float | None = None


@dataclass(frozen=True)
class Known:
    """An effect, as the catalogue has it."""

    parameters: tuple[Entry, ...]
    lists: tuple[Any, ...] = ()
    list_faults: Any = None


CATALOGUE = {
    "cogging": Known((Entry("amplitude", minimum=0.0), Entry("pitch", "m", 0.01, 1e-6, 10.0), Entry("phase", "rad"))),
    "offset": Known((Entry("force"),)),
    "spring": Known((Entry("stiffness", "N/m"),)),
}


def sentences_of(tree: Any) -> tuple[str, ...]:
    """Return what the loader says of a tree; nothing if it takes it."""
    try:
        settings_from_tree(tree, "table.yaml", catalogue=lambda files: CATALOGUE)
    except ConfigurationError as error:
        return error.sentences
    return ()


def axis(**groups: Any) -> dict[str, Any]:
    """Return a tree whose axis x has these groups."""
    return {"axes": ["x"], "x": groups}


ONE_FAULT = [
    # types
    (axis(mass="heavy"), "x.mass = 'heavy' must be a finite number in kg; write it like 10.0"),
    (axis(mass=True), "x.mass = true must be a finite number in kg; write it like 10.0"),
    (axis(mass=[1.0]), "x.mass = [1] must be a finite number in kg; write it like 10.0"),
    (axis(mass=float("nan")), "x.mass = nan must be a finite number in kg; write it like 10.0"),
    (axis(mass="1e999"), "x.mass = '1e999' must be a finite number in kg; write it like 10.0"),
    (axis(mass=10**400), None),
    (axis(mass="4,5"), "x.mass = '4,5' must be a finite number in kg; write it like 10.0"),
    (axis(mass=None), "x.mass has no value; give one or remove the line"),
    (axis(estimator={"horizon": 2.5}), "x.estimator.horizon = 2.5 must be a whole number; write it like 4"),
    (
        {"autostart": "maybe"},
        "autostart = 'maybe' must be true or false; write one of the two",
    ),
    (axis(stage={"reference": {"file": 3}}), "x.stage.reference.file = 3 must be text; put it in quotes"),
    (
        axis(friction={"element_stiffness": {"a": 1}}),
        "x.friction.element_stiffness = (a group of settings) must be a list; write it like [1.0]",
    ),
    (axis(friction=3), "x.friction = 3 must be a group of settings; write them below it, indented"),
    (axis(friction={"model": True}), "x.friction.model = true must be sgms or gms; choose one"),
    # ranges and choices
    (axis(mass=-1), "x.mass = -1 kg must be > 0; raise it"),
    (axis(estimator={"horizon": 0}), "x.estimator.horizon = 0 must be >= 1; raise it"),
    (axis(compensation={"gain": 1.5}), "x.compensation.gain = 1.5 must be <= 1; lower it"),
    ({"sample_period": 1000}, "sample_period = 1000 s must be <= 1; lower it"),
    (
        axis(friction={"element_stiffness": [12e6, -2, 3e5, 4e5]}),
        "x.friction.element_stiffness = -2 N/m in entry 2 must be > 0; raise it",
    ),
    (axis(friction={"model": "sgsm"}), "x.friction.model = 'sgsm' must be sgms or gms; did you mean sgms?"),
    (
        axis(filter={"kind": "moving average"}),
        "x.filter.kind = 'moving average' must be lowpass, savgol or kalman; choose one",
    ),
    (
        axis(estimator={"parameters": ["kapa"]}),
        "x.estimator.parameters = 'kapa' must be kappa, viscous_coefficient, coulomb_force, static_force, "
        "stribeck_velocity, mass or offset; did you mean kappa?",
    ),
    # names
    ({"sample_time": 1e-3}, "sample_time is not a setting; did you mean sample_period?"),
    (axis(masss=3), "x.masss is not a setting; did you mean x.mass?"),
    (
        axis(friction={"kappa": 3}),
        "x.friction.kappa is not a setting; remove it, or look its name up in docs/parameters.md",
    ),
    (
        axis(viscous_coefficient=3),
        "x.viscous_coefficient is not a setting; did you mean x.friction.viscous_coefficient?",
    ),
    (axis(sample_period=1e-3), "x.sample_period is not a setting; did you mean sample_period?"),
    (axis(**{"3": 1}), "x.3 is not a setting; remove it, or look its name up in docs/parameters.md"),
    (
        {"axes": ["x"], "x": {True: 1}},
        "x.true is not the name of a setting; put quotes around it if it is a name, or remove it",
    ),
    # axes
    ({"axes": []}, "axes = [] must name at least one axis; write axes: [x]"),
    ({"axes": ["x", "x"]}, "axes = ['x', 'x'] must name each axis once; remove the second x"),
    ({"axes": ["x/"]}, "axes = 'x/' must be a word of letters, digits, -, _ and / between them; rename the axis"),
    ({"axes": ["autostart"]}, "axes = 'autostart' must not be the name of a setting; rename the axis"),
    ({"axes": [1]}, "axes = 1 must be text; put it in quotes"),
    (
        {"axes": ["x"], "y": {"mass": 3}},
        "y has settings of an axis but axes = ['x'] must name it; add y to axes or remove it",
    ),
    # between settings
    (
        axis(friction={"static_force": 1.2, "coulomb_force": 1.5}),
        "x.friction.static_force = 1.2 N must be >= coulomb_force = 1.5 N; swap them or raise static_force",
    ),
    (
        axis(friction={"element_fraction": [0.1, 0.2, 0.3, 0.3]}),
        "x.friction.element_fraction = [0.1, 0.2, 0.3, 0.3] must sum to 1, not 0.9; divide each entry by the sum",
    ),
    (
        axis(friction={"element_stiffness": [1e6, 1e5]}),
        "x.friction.element_fraction = [0.067, 0.056, 0.047, 0.83] (the default) must have 2 entries like "
        "element_stiffness; write one per element",
    ),
    (
        axis(friction={"element_damping": [0.0]}),
        "x.friction.element_damping = [0] must have 4 entries like element_stiffness; write one per element",
    ),
    (
        axis(friction={"element_stiffness": []}),
        "x.friction.element_stiffness = [] must have at least one element; write its stiffness",
    ),
    (
        axis(stage={"friction": {"coulomb_force": 9.0}}),
        "x.stage.friction.static_force = 4.5 N must be >= coulomb_force = 9 N; swap them or raise static_force",
    ),
    (
        axis(stage={"reference": {"kind": "multi_sine", "amplitudes": [1e-4], "frequencies": [1.0, 2.0]}}),
        "x.stage.reference.amplitudes = [0.0001] must have as many entries as frequencies = [1, 2], at least one; "
        "write one of each per sine",
    ),
    (
        axis(stage={"reference": {"kind": "multi_sine"}}),
        "x.stage.reference.amplitudes = [] must have as many entries as frequencies = [], at least one; "
        "write one of each per sine",
    ),
    (
        axis(stage={"reference": {"kind": "multi_sine", "amplitudes": [1e-4], "frequencies": [1.0], "phases": [0, 1]}}),
        "x.stage.reference.phases = [0, 1] must have 1 entries like frequencies; write one per sine, or none for zero",
    ),
    (
        axis(stage={"reference": {"frequency": 6000.0}}),
        "x.stage.reference.frequency = 6000 Hz must be < 5000 Hz, half the sample rate; "
        "lower it or shorten sample_period",
    ),
    (
        axis(stage={"reference": {"kind": "file"}}),
        'x.stage.reference.file = "" must name a CSV file because kind is file; write its path',
    ),
    (
        axis(stage={"controller": {"bandwidth": 5000}}),
        "x.stage.controller.bandwidth = 5000 Hz must be < 5000 Hz, half the sample rate; "
        "lower it or shorten sample_period",
    ),
    (
        axis(filter={"kind": "lowpass", "cutoff": 5000}),
        "x.filter.cutoff = 5000 Hz must be < 5000 Hz, half the sample rate; lower it or shorten sample_period",
    ),
    (
        axis(filter={"window": 3e-4}),
        "x.filter.window = 0.0003 s must be >= 0.0004 s, 4 times sample_period, for degree = 3; "
        "lengthen it or lower degree",
    ),
    (axis(filter={"window": 3}), "x.filter.window = 3 s must be <= 1 s, 10000 times sample_period; shorten it"),
    (
        axis(filter={"maximum_gap": 1e-4}),
        "x.filter.maximum_gap = 0.0001 s must be >= 0.0002 s, two sample periods; raise it or correct sample_period",
    ),
    (
        axis(estimator={"parameter_minimum": 1.0}),
        "x.estimator.parameter_minimum = 1 must be < 1, the share that the start value has; lower it",
    ),
    (axis(estimator={"parameter_maximum": 0.9}), "x.estimator.parameter_maximum = 0.9 must be > 1; raise it"),
    (
        axis(estimator={"parameters": ["kappa", "kappa"]}),
        "x.estimator.parameters = ['kappa', 'kappa'] must name each parameter once; remove the repeated one",
    ),
    (
        axis(compensation={"timeout": 1e-4}),
        "x.compensation.timeout = 0.0001 s must be > sample_period = 0.0001 s, or it would never compensate; raise it",
    ),
    ({"effect_files": ["mine.py"]}, "effect_files = 'mine.py' must be a readable Python file; correct the path"),
    # effects
    (
        axis(effects=["cogging"]),
        "x.effects = ['cogging'] must be a group of settings; write names: [...] below it, indented",
    ),
    (
        axis(effects={"names": ["coging"]}),
        "x.effects.names = 'coging' must be an effect of the catalogue; did you mean cogging?",
    ),
    (
        axis(effects={"names": ["zzz"]}),
        "x.effects.names = 'zzz' must be an effect of the catalogue; choose from cogging, offset or spring",
    ),
    (
        axis(effects={"names": ["offset", "offset"]}),
        "x.effects.names = ['offset', 'offset'] must name each effect once; remove the second offset",
    ),
    (
        axis(effects={"names": ["offset"], "spring": {"stiffness": 1.0}}),
        "x.effects.spring has values but x.effects.names = ['offset'] must name it for it to act; "
        "add spring to names or remove its values",
    ),
    (axis(effects={"name": ["offset"]}), "x.effects.name is no effect; did you mean names?"),
    (
        axis(effects={"names": ["cogging"], "cogging": {"amplitud": 1.0}}),
        "x.effects.cogging.amplitud is no parameter of cogging; did you mean amplitude?",
    ),
    (
        axis(effects={"names": ["cogging"], "cogging": {"zzz": 1.0}}),
        "x.effects.cogging.zzz is no parameter of cogging; it has amplitude, pitch, phase",
    ),
    (
        axis(effects={"names": ["cogging"], "cogging": 1.4}),
        "x.effects.cogging = 1.4 must be a group of parameters; write them below it, indented",
    ),
    (
        axis(effects={"names": ["cogging"], "cogging": {"amplitude": -1}}),
        "x.effects.cogging.amplitude = -1 N must be >= 0; raise it",
    ),
    (
        axis(stage={"effects": {"names": ["cogging"], "cogging": {"pitch": 20.0}}}),
        "x.stage.effects.cogging.pitch = 20 m must be <= 10; lower it",
    ),
]


@pytest.mark.parametrize(("tree", "sentence"), ONE_FAULT, ids=[str(entry[1])[:50] for entry in ONE_FAULT])
def test_one_fault_earns_one_sentence(tree: dict[str, Any], sentence: str | None) -> None:
    found = sentences_of(tree)
    assert len(found) == 1
    if sentence is not None:
        assert found[0] == sentence


def test_all_faults_are_said_at_once() -> None:
    tree = axis(mass=-1, masss=2, friction={"static_force": 1.0, "element_fraction": [0.5]}, filter={"kind": "x"})
    assert sentences_of(tree) == (
        "x.mass = -1 kg must be > 0; raise it",
        "x.masss is not a setting; did you mean x.mass?",
        "x.filter.kind = 'x' must be lowpass, savgol or kalman; choose one",
        "x.friction.element_fraction = [0.5] must have 4 entries like element_stiffness; write one per element",
        "x.friction.static_force = 1 N must be >= coulomb_force = 4 N; swap them or raise static_force",
    )


def test_an_inherited_fault_is_not_said_twice() -> None:
    tree = axis(friction={"element_fraction": [0.1, 0.2, 0.3, 0.3]}, stage={"friction": {"model": "gms"}})
    assert len(sentences_of(tree)) == 1


def test_no_catalogue_sentence_stands_alone_when_a_user_file_is_broken() -> None:
    def broken(files: Any) -> Any:
        raise ConfigurationError(["effect file mine.py cannot be used: SyntaxError; correct it"])

    with pytest.raises(ConfigurationError) as error:
        settings_from_tree(axis(effects={"names": ["mine"]}), catalogue=broken)
    assert error.value.sentences == ("effect file mine.py cannot be used: SyntaxError; correct it",)


def test_a_default_window_stretches_to_slow_samples() -> None:
    assert sentences_of({"sample_period": 1e-3}) == ()


def test_the_faults_of_a_tree_that_is_no_mapping() -> None:
    assert sentences_of([1]) == ("table.yaml = [1] must be a tree of parameters; start with axes: [x]",)


def test_defaults_are_without_fault() -> None:
    assert [entry.name for entry in settings_from_tree({"axes": ["a", "b"]}).axes] == ["a", "b"]
