"""Blind tests of the diagnosis: recordings with a hidden effect, the sealed truth, and its scorer.

Nothing here shares a formula with ``sgms_observer``: the plant, its friction, its controller and every hidden effect
are written again, in other shapes, so that the workflow is not graded by its own equations (``docs/blind.md``).
"""

from sim_plant.blind.case import CasePaths, make_case

__all__ = ["CasePaths", "make_case"]
