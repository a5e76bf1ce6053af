"""Faults are made on the real graph, with the same fixtures as the tests of the nodes."""

from __future__ import annotations

from ros_fixtures import graph, ros, start

__all__ = ["graph", "ros", "start"]
