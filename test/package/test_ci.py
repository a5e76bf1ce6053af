"""What `.ci/run` demands: a test that skips elsewhere because a program is missing fails there."""

from __future__ import annotations

from pathlib import Path

import browser
import c_build
import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def no_browser(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Hide every browser."""
    monkeypatch.setenv("PATH", str(tmp_path))


def test_a_missing_browser_fails_where_it_is_required(no_browser: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(browser.REQUIRED, "1")
    with pytest.raises(pytest.fail.Exception, match="no browser"):
        browser.require_browser()


def test_a_missing_browser_skips_elsewhere(no_browser: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(browser.REQUIRED, raising=False)
    with pytest.raises(pytest.skip.Exception, match="no browser"):
        browser.require_browser()


def test_ci_requires_a_browser_before_it_runs_the_tests() -> None:
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    assert script.index(f"export {browser.REQUIRED}=1") < script.index("make test")
    installing = script[script.index("command -v chromium") : script.index("make setup")]
    assert "||" not in installing, "a browser that cannot be installed stops the script"


@pytest.mark.parametrize(("value", "skips"), [("1", False), ("", True)])
def test_a_missing_compiler_skips_only_where_it_is_not_required(
    value: str, skips: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(c_build.REQUIRED, value)
    assert c_build.needs("no-such-compiler").args == (skips,)


def test_sanitizers_are_required_with_the_compilers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(c_build.REQUIRED, "1")
    assert c_build.can_sanitize("no-such-compiler")


def test_ci_requires_and_installs_the_compilers_before_it_runs_the_tests() -> None:
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    places = [script.index(text) for text in (f"export {c_build.REQUIRED}=1", "build-essential clang", "make test")]
    assert places == sorted(places)
