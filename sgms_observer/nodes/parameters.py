"""Declares the settings as parameters of a node, with type, range and meaning, and checks changed values."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.exceptions import ParameterUninitializedException
from rclpy.node import Node
from rclpy.parameter import Parameter

from sgms_observer.errors import ConfigurationError
from sgms_observer.settings.axis import CompensationSettings, Settings
from sgms_observer.settings.declaration import Declared
from sgms_observer.settings.load import settings_from_tree
from sgms_observer.settings.node_parameters import declare_all, tree_from_parameters
from sgms_observer.settings.parameter_file import overlaid, parameter_tree

_TYPES = {
    "double": Parameter.Type.DOUBLE,
    "integer": Parameter.Type.INTEGER,
    "bool": Parameter.Type.BOOL,
    "string": Parameter.Type.STRING,
    "double_array": Parameter.Type.DOUBLE_ARRAY,
    "string_array": Parameter.Type.STRING_ARRAY,
}
#: They determine which parameters exist, so they are fixed while the node runs.
_STRUCTURE = ("axes", "effect_files", "autostart")
_TUNABLE = tuple(f".compensation.{field.name}" for field in fields(CompensationSettings))
#: Largest value of a parameter that may change while a force is published, as a multiple of its start value. One notch
#: of a slider in rqt is then a tenth of the start value, not a tenth of the physical range.
_TUNING = 10.0


def _descriptor(declaration: Declared, value: Any) -> ParameterDescriptor:
    """Return the ROS descriptor of a parameter with this start value."""
    is_fixed = declaration.name in _STRUCTURE or declaration.name.endswith("effects.names")
    descriptor = ParameterDescriptor(
        name=declaration.name,
        type=_TYPES[declaration.kind].value,
        description=declaration.description,
        read_only=is_fixed,
    )
    if declaration.choices:
        descriptor.additional_constraints = "one of " + ", ".join(declaration.choices)
    if declaration.minimum is None or declaration.maximum is None:
        return descriptor
    low, high = declaration.minimum, declaration.maximum
    if declaration.kind.startswith("double"):
        if declaration.name.endswith(_TUNABLE) and 0.0 < _TUNING * declaration.default < high:
            high = min(high, _TUNING * max(declaration.default, value))
        descriptor.floating_point_range = [FloatingPointRange(from_value=float(low), to_value=float(high))]
    else:
        descriptor.integer_range = [IntegerRange(from_value=int(low), to_value=int(high))]
    return descriptor


class NodeParameters:
    """The parameters of one node, and the settings that follow from them.

    Args:
        node: the node, made with its parameters as overrides; they become the values.
        settings: the checked settings in them, and in the parameters that other nodes declare.
        has_stage: whether the node simulates, so that it declares the parameters below ``stage``.

    Attributes:
        names: full names of the declared parameters.
        settings: the settings; after ``check_change`` allowed a change, those with it.
    """

    def __init__(self, node: Node, settings: Settings, has_stage: bool) -> None:
        self._node = node
        self.settings = settings
        names: list[str] = []

        def declare(declaration: Declared) -> Any:
            if not has_stage and ".stage." in declaration.name:
                return None
            names.append(declaration.name)
            return _declare(node, declaration)

        declare_all(declare)
        self.names = tuple(names)

    def check_change(self, parameters: Sequence[Parameter], is_configured: bool) -> SetParametersResult:
        """Check a change of parameters at run time.

        Args:
            parameters: the new values.
            is_configured: whether the node works with its settings already; then only the compensation's may change.
        """
        changed = {parameter.name: parameter.value for parameter in parameters if parameter.name in self.names}
        for name in changed:
            if is_configured and not name.endswith(_TUNABLE):
                return SetParametersResult(
                    successful=False,
                    reason=f"{name} can change only before the node is configured; deactivate, clean up, set",
                )
        if changed:
            values = {name: self._node.get_parameter_or(name).value for name in self.names} | changed
            given = parameter_tree(self.settings.source, "the parameters")
            try:
                self.settings = settings_from_tree(overlaid(given, tree_from_parameters(values)))
            except ConfigurationError as error:
                return SetParametersResult(successful=False, reason=" ".join(error.sentences))
        return SetParametersResult(successful=True)


def _declare(node: Node, declaration: Declared) -> Any:
    """Declare one parameter and return its value; rclpy cannot infer the type of an empty list, so it is given."""
    if declaration.default != []:
        wide = _descriptor(declaration, math.inf)
        value = node.declare_parameter(declaration.name, declaration.default, wide).value
        if declaration.name.endswith(_TUNABLE):
            node.set_descriptor(declaration.name, _descriptor(declaration, value))
        return value
    kind = _TYPES[declaration.kind]
    try:
        value = node.declare_parameter(declaration.name, kind, ParameterDescriptor(name=declaration.name)).value
    except ParameterUninitializedException:
        value = None
    if value is None:
        node.set_parameters([Parameter(declaration.name, kind, [])])
        value = []
    node.set_descriptor(declaration.name, _descriptor(declaration, value))
    return value
