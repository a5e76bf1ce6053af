"""Which tests are quick, and which run by the clock: by folder or file."""

from __future__ import annotations

#: They need no graph, no browser and few kernels, and take together about a minute of one core: what `make check` runs,
#: and `colcon test` unless it is told ``--whole``.
QUICK = (
    "bags/test_cdr.py", "bags/test_pairing.py", "bags/test_writer.py", "compensation/test_effects_ahead.py",
    "compensation/test_feedforward.py", "compensation/test_horizon.py", "compensation/test_motion_ahead.py",
    "compensation/test_safety.py", "compensation/test_worth.py",
    "docs/test_design.py", "docs/test_docstrings.py", "docs/test_troubleshooting.py", "docs/test_words.py",
    "estimation/test_interval.py", "filters", "friction/test_latched.py", "nodes/test_parts.py",
    "observer/test_all_axes.py", "observer/test_axis_observer.py", "observer/test_core.py", "package/test_launch.py",
    "package/test_metadata.py", "package/test_optional.py", "plant/test_controller.py", "plant/test_reference.py",
    "settings",
)  # fmt: skip

#: They start nodes, or look at the clock: beside tests that compute on all cores they could fail for want of time.
#: These, and every test that takes the fixture ``ros``, get the marker ``live``. `make test` runs all others first.
LIVE = (
    "bags/test_live.py", "faults/test_signals.py", "nodes", "package/test_launch_starts.py",
)  # fmt: skip

#: The live tests that the clock judges, or that take all cores: they get the marker ``alone`` too. The other live
#: tests mostly wait, for messages and motions, and `make test` runs as many at once as there are cores; these come
#: last, one by one.
ALONE = (
    "nodes/test_bench_live.py", "nodes/test_commission.py", "nodes/test_demo.py", "nodes/test_first_start.py",
    "nodes/test_reference_player.py",
)  # fmt: skip
