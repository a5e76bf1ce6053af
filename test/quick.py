"""Which tests are quick: they need no graph, no browser and few kernels."""

from __future__ import annotations

#: Folders and files whose tests together take about a minute: what `colcon test` runs unless it is told ``--whole``.
QUICK = (
    "bags/test_cdr.py", "bags/test_pairing.py", "bags/test_writer.py", "compensation",
    "estimation/test_interval.py", "filters", "friction/test_latched.py", "nodes/test_parts.py", "observer",
    "package/test_launch.py", "package/test_metadata.py", "package/test_optional.py", "plant/test_controller.py",
    "plant/test_reference.py", "settings",
)  # fmt: skip
