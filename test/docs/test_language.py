"""Pages, messages, help texts and docstrings use one term for each thing, and no word that only insiders understand."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", ROOT / "examples" / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
SOURCES = sorted([*ROOT.glob("sgms_observer/**/*.py"), *ROOT.glob("sim_plant/**/*.py"), *ROOT.glob("examples/*.py")])

PREFERRED = {
    r"sureness": "z_score",
    r"\btwins\b": "bootstrap replicates",
    r"left to the controller after compensation": "friction not cancelled by the feedforward",
    r"nobody subscribes": "no node subscribes",
    r"found no descent": "the MHE step failed; the EKF estimate was used",
    r"a fault of its own": "Internal error",
    r"was absurd|were absurd": "a sample was rejected",
    r"search stopped before it converged": "the fit did not converge",
    r"acts at its stamp, not until the next": "the effort is not held between samples",
    r"told (?:as|to be) (?:not )?shown": "(not) identifiable from this recording",
    r"is told(?:,| of)": "is reported",
    r"grain of salt": "what follows from it",
    r"has no say": "has no effect",
    r"nobody (?:told|knows of)": "the subject that does not know",
    r"\d(?:\.\d)? times smaller and \d(?:\.\d)? times larger": "rms 4.6x smaller, peak 1.4x larger",
    r"takes? leave of": "leaves",
    r"judging band": "band",
    r"count(?:s|ed) against the (?:motion|position)": "the sign of control_effort is reversed relative to position",
    r"squared rest\b": "squared residual",
    r"seed of all chance": "seed of all random numbers",
}
"""What is not written (a regular expression), and what is."""

TERMS = {
    r"\b[Ss]et ?points?\b": "set-point",
    r"\b[Hh]old-out\b": "held-out",
    r"\b[Ff]eed-forward\b": "feedforward",
    r"\bset-value\b|\bsetting value\b": "set-point, or setting",
    r"\b[Tt]ime ?stamps? of arrival\b": "arrival time",
    r"\bco-efficient\b": "coefficient",
    r"\b[Pp]re-sliding\b": "presliding",
}
"""One spelling for each term."""

PLACES = ("sgms_observer", "sim_plant", "examples")
CHECKED = sorted(path for place in PLACES for path in (ROOT / place).rglob("*.py"))
"""Every source whose names are checked below, top level and folders inside folders included."""
FOLDERS = sorted({path.parent.relative_to(ROOT).as_posix() for path in CHECKED})

NAMES = {
    r"[Cc]ourt(_of)?": "EvaluationData, evaluation",
    r"[Jj]udged(_with|_as)?": "WhitenedData, data",
    r"doubts?": "stick_indicator",
    r"(\w+_)?reach(es)?": "slip_deflection",
    r"(is_)?sharp": "is_unsmoothed",
    r"twins?|sureness|SURE|KIN|BOLD|LOUD|FAR|NOBODYS|AGAIN|PLAY|LOOK": "the statistic, with MIN_ or MAX_",
    r"(MOST|LEAST|LONGEST|SHORTEST|WIDEST|SLOWEST)_\w+": "MAX_... or MIN_...",
    r"[Ll]ooks?": "Screening",
    r"apart": "z_score_between",
    r"bent": "unnamed_contact_effects",
    r"told|said|seen|taken|kept|earned|unhomed|narrowed|let_go|to_the_end": "the quantity that the name holds",
    r"explains_all|is_law|without_flicker|beside\w*": "a term of the field",
    r"own(ed)?": "whose it is: file_effects, errors_of_fit",
}
"""Identifiers that are not used (a regular expression of the whole), and what is."""

MODULES = ("beside", "closing", "court", "kin", "learnt", "level", "moving", "state", "told", "twins")
"""Names that a module does not have: it has the noun of what lives there."""

_MACHINE_TEXT = re.compile(r"^[\w./:<>{}%*#-]+$")


def _texts(path: Path) -> Iterator[tuple[int, str]]:
    """Yield every string of a source that a reader may see: messages, help texts, docstrings."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and not _MACHINE_TEXT.match(node.value):
            yield node.lineno, " ".join(node.value.split())


def _found(text: str) -> list[str]:
    return [
        f"write {better!r} in place of {hit.group(0)!r}"
        for words in (PREFERRED, TERMS)
        for pattern, better in words.items()
        for hit in [re.search(pattern, text, re.IGNORECASE if words is PREFERRED else 0)]
        if hit
    ]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_pages_use_the_preferred_terms(page: Path) -> None:
    text = " ".join(page.read_text(encoding="utf-8").split())
    assert _found(text) == []


def test_sentences_of_the_source_use_the_preferred_terms() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{line}: {fault}"
        for path in SOURCES
        for line, text in _texts(path)
        for fault in _found(text)
    ]
    assert found == []


def _identifiers(source: str) -> Iterator[tuple[int, str]]:
    """Yield every name of a source with its line: of variables, attributes, arguments, functions and classes."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.lineno, node.name
        elif isinstance(node, ast.Name):
            yield node.lineno, node.id
        elif isinstance(node, ast.Attribute):
            yield node.lineno, node.attr
        elif isinstance(node, ast.arg | ast.keyword) and node.arg:
            yield node.lineno, node.arg


def _bad_names(source: str) -> list[str]:
    return [
        f"{line}: {name!r}; write {better}"
        for line, name in sorted(set(_identifiers(source)))
        for pattern, better in NAMES.items()
        if re.fullmatch(pattern, name)
    ]


def test_every_folder_with_a_source_is_checked() -> None:
    assert {"examples", "sgms_observer", "sgms_observer/nodes", "sim_plant", "sim_plant/blind"} <= set(FOLDERS)
    assert "sgms_observer/application/commission" in FOLDERS
    assert len(CHECKED) > 300


@pytest.mark.parametrize("folder", FOLDERS)
def test_names_are_terms_of_the_field(folder: str) -> None:
    paths = [path for path in CHECKED if path.parent == ROOT / folder]
    assert [path.name for path in paths if path.stem in MODULES] == []
    assert [f"{path.name}:{fault}" for path in paths for fault in _bad_names(path.read_text(encoding="utf-8"))] == []


def test_warnings_begin_alike() -> None:
    for path in SOURCES:
        for line, text in _texts(path):
            assert not re.match(r"(?:WARNING|warning|caution|Caution|CAUTION):", text), f"{path.name}:{line}"


def test_scan_finds_what_it_forbids() -> None:
    assert _found("Nobody subscribes to reference")
    assert _found("the node met a fault of its own")
    assert not _found("No node subscribes to `reference`.")
    assert len(_bad_names("def apart(court: Judged) -> None:\n    court.doubt = MOST_KEPT")) == 6
    assert _bad_names("distance = evaluation.slip_deflection") == []
