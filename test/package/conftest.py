"""Launch files start nodes on the real graph; without ROS their tests skip."""

from __future__ import annotations

import importlib.util

if importlib.util.find_spec("rclpy") is not None:
    from ros_fixtures import graph, ros

    __all__ = ["graph", "ros"]
