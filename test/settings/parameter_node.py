"""A node that declares all parameters and prints their tree: run by test_real_rcl.py in a process of its own."""

from __future__ import annotations

import json
import sys
from typing import Any

import rclpy
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter

from sgms_observer.errors import ConfigurationError
from sgms_observer.settings.arguments import rewrite_arguments
from sgms_observer.settings.parameters import ParameterDeclaration, declare_all

LARGEST = sys.float_info.max


def declare(node: Node, declaration: ParameterDeclaration) -> Any:
    """Declare one parameter on a real node and return its value."""
    descriptor = ParameterDescriptor(description=declaration.description, read_only=declaration.read_only)
    low, high = declaration.minimum, declaration.maximum
    if (low is not None or high is not None) and declaration.type == "double":
        low, high = -LARGEST if low is None else low, LARGEST if high is None else high
        descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
    if (low is not None or high is not None) and declaration.type == "integer":
        low, high = -(2**63) if low is None else int(low), 2**63 - 1 if high is None else int(high)
        descriptor.integer_range = [IntegerRange(from_value=low, to_value=high)]
    kind = Parameter.Type[declaration.type.upper()]
    if declaration.default == []:  # an empty list has no type for rclpy: declare the type, without a value
        node.declare_parameter(declaration.name, kind, descriptor)
        return node.get_parameter_or(declaration.name).value
    return node.declare_parameter(declaration.name, declaration.default, descriptor).value


def main() -> int:
    """Print ``{"tree": ..., "names": ...}``, or the sentences on stderr."""
    try:
        rewritten = rewrite_arguments(sys.argv)
    except ConfigurationError as error:
        print(*error.sentences, sep="\n", file=sys.stderr)
        return 1
    rclpy.init(args=rewritten.argv)
    rewritten.discard()
    node = Node("observer_node")
    tree = declare_all(lambda declaration: declare(node, declaration))
    print(json.dumps(tree))
    node.destroy_node()
    rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
