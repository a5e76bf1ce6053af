"""The node tests run on the real graph."""

from __future__ import annotations

from ros_fixtures import graph, ros, start

__all__ = ["graph", "ros", "start"]
