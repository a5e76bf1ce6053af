"""Every sentence that a node can say, read from the source: the list that the page on troubleshooting must cover."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PLACES = (
    "sgms_observer/status.py",
    "sgms_observer/observer/pairing.py",
    "sgms_observer/bags/diagnostics_cdr.py",
    "sgms_observer/nodes/*.py",
)
HOLE = "…"  # stands for what is filled in

_FEWEST_WORDS = 4
_NO_SENTENCES = ("help", "description", "epilog")  # arguments whose text is no message


def sentences() -> dict[str, str]:
    """Return each sentence of the nodes with the file it stands in, relative to the repository."""
    found: dict[str, str] = {}
    for place in PLACES:
        for path in sorted(ROOT.glob(place)):
            tree = ast.parse(path.read_text(encoding="utf-8"))
            for text in _texts(tree):
                if len(text.replace(HOLE, " ").split()) >= _FEWEST_WORDS:
                    found.setdefault(text, path.relative_to(ROOT).as_posix())
    return found


def _texts(node: ast.AST) -> Iterator[str]:
    """Yield the strings below a node, f-strings with holes, and neither docstrings nor help texts."""
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        return
    if isinstance(node, ast.JoinedStr):
        yield "".join(part.value if isinstance(part, ast.Constant) else HOLE for part in node.values).strip()
        return
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value.strip()
        return
    if isinstance(node, ast.keyword) and node.arg in _NO_SENTENCES:
        return
    if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name) and node.targets[0].id == "_EPILOG":
        return
    for child in ast.iter_child_nodes(node):
        yield from _texts(child)
