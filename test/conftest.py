"""What every test shares: a ROS graph of its own, field checks on, logs out of the home folder, one browser."""

from __future__ import annotations

import os
import signal
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
from browser import Browser, require_browser
from hypothesis import HealthCheck, settings
from selection import ALONE, LIVE, QUICK

from sgms_observer.nodes.transport import claim_domain

# Property tests: the same examples in every run, and none fails because the machine was slow or compiled a kernel.
# ``--hypothesis-profile search`` draws others.
settings.register_profile(
    "repeat", deadline=None, derandomize=True, print_blob=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.register_profile("search", settings.get_profile("repeat"), derandomize=False)
settings.load_profile("repeat")

# Before anything imports rclpy. The domain is this process's own, also where pytest-xdist runs several: two of them on
# one machine must not hear each other, and no test may ever speak to a machine that is really there.
os.environ["ROS_DOMAIN_ID"] = str(claim_domain())
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
os.environ["ROS_PYTHON_CHECK_FIELDS"] = "1"
os.environ["ROS_LOG_DIR"] = str(Path(tempfile.gettempdir()) / "sgms_observer_test_logs" / os.environ["ROS_DOMAIN_ID"])

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # a shell's background job; our processes would inherit it
    signal.signal(signal.SIGINT, signal.default_int_handler)


PACKAGE = "sgms_observer"


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the choice between the quick tests and the whole."""
    parser.addoption("--quick", action="store_true", help="run the tests of about a minute only")
    parser.addoption("--whole", action="store_true", help="run all tests, also under colcon")


def pytest_configure(config: pytest.Config) -> None:
    """Declare the markers of the tests that must not run beside others."""
    config.addinivalue_line("markers", "live: starts nodes or looks at the clock; comes before what computes")
    config.addinivalue_line("markers", "alone: a live test that runs beside no other live one")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark the live tests; keep the quick ones where only these are asked for."""
    for item in items:
        if _is_in(item.path, LIVE) or "ros" in getattr(item, "fixturenames", ()):
            item.add_marker(pytest.mark.live)
        if _is_in(item.path, ALONE):
            item.add_marker(pytest.mark.alone)
    if _is_quick(config):
        config.hook.pytest_deselected(items=[item for item in items if not _is_in(item.path, QUICK)])
        items[:] = [item for item in items if _is_in(item.path, QUICK)]


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leave files that are not asked for unread: importing all of them takes longer than many a quick test."""
    chosen = QUICK if _is_quick(config) else ALONE if config.option.markexpr == "alone" else None
    return True if chosen and collection_path.is_file() and not _is_in(collection_path, chosen) else None


def _is_quick(config: pytest.Config) -> bool:
    """Return whether the quick tests are asked for, or colcon runs pytest, which it shows by its prefix."""
    return not config.option.whole and (config.option.quick or config.option.junitprefix == PACKAGE)


def _is_in(path: Path, names: Sequence[str]) -> bool:
    """Return whether a file is one of these, or in one of these folders."""
    return any(path.is_relative_to(Path(__file__).parent / name) for name in names)


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """Return a headless Chromium."""
    require_browser()
    with Browser() as running:
        yield running
