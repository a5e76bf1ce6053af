"""What `.ci/run` demands of compilers: a test that skips elsewhere because one is missing runs, and fails, there."""

from __future__ import annotations

from pathlib import Path

import c_build
import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize(("value", "skips"), [("1", False), ("", True)])
def test_a_missing_compiler_skips_only_where_it_is_not_required(
    value: str, skips: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(c_build.REQUIRED, value)
    assert c_build.needs("no-such-compiler").args == (skips,)


def test_sanitizers_are_required_with_the_compilers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(c_build.REQUIRED, "1")
    assert c_build.can_sanitize("no-such-compiler", Path())


def test_ci_requires_and_installs_the_compilers_before_it_runs_the_tests() -> None:
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    places = [script.index(text) for text in (f"export {c_build.REQUIRED}=1", "build-essential clang", "make test")]
    assert places == sorted(places)
