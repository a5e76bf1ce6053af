"""Every error and warning that a command can print, read from the source: what the troubleshooting page must list."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from node_sentences import HOLE, PLACES, ROOT

ERRORS = (
    "ConfigurationError", "RecordingError", "DataError", "SgmsError", "HiddenError", "HeldUp", "_Silence", "OutOfTime",
    "ArgumentTypeError",
)  # fmt: skip
PREFIX = "Warning: "
ELSEWHERE = ("nodes",)
"""Folders whose sentences `node_sentences` reads."""

CHECKS = ("check.py", "bag_comparison.py")
"""Files that yield their sentences."""

NOT_MESSAGES = {
    "axis … moves between … and … for … s, at up to … and",
    "not diagnosed yet",
    "identify the axis first, or record more motion",
    "record more motion to learn from",
    "record the position with a finer encoder, the motor's for example",
    "with … elements, low-pass … Hz",
    "rms … error on held-out chunks by number of elements […]",
    "% of the rms … unexplained on held-out chunks",
    "% of the rms … unexplained on held-out bags",
    "from sgms_observer.formulas import",
}
"""What the scan finds beside them: a question before a motion, next experiments, results, and a line of a program."""

_HEAD = re.compile(r"^(.*?)(?:[;:(]| - |\. (?=[A-Z])|$)")
MIN_WORDS = 2
INTERNAL = "Internal error"
"""Begins what the page explains in one line below the tables."""


def command_sentences() -> dict[str, str]:
    """Return the fixed beginning of each error and warning with the file that it stands in."""
    found: dict[str, str] = {}
    for path in sorted([*ROOT.glob("sgms_observer/**/*.py"), *ROOT.glob("sim_plant/**/*.py")]):
        file = path.relative_to(ROOT)
        if file.parts[1] in ELSEWHERE or file.as_posix() in PLACES:
            continue
        for sentence in _sentences(path):
            head = beginning(sentence)
            is_message = len(head.replace(HOLE, " ").split()) >= MIN_WORDS and not head.startswith(INTERNAL)
            if is_message and head not in NOT_MESSAGES:
                found.setdefault(head, file.as_posix())
    return found


def without_beginning() -> dict[str, str]:
    """Return each sentence that has words, and no beginning that a row could have, with its file."""
    return {
        sentence: path.relative_to(ROOT).as_posix()
        for path in sorted(ROOT.glob("sgms_observer/**/*.py"))
        if path.relative_to(ROOT).parts[1] not in ELSEWHERE
        for sentence in _sentences(path)
        if not beginning(sentence) and re.search("[a-z]", sentence.removeprefix(PREFIX))
    }


def beginning(sentence: str) -> str:
    """Return the words of a sentence up to its first remedy, list or value in brackets.

    Args:
        sentence: with holes for what is filled in.
    """
    plain = sentence.removeprefix(PREFIX).replace(f"{HOLE}: ", f"{HOLE} ", 1).replace("\n", " ")
    head = _HEAD.match(re.sub(rf"^([{HOLE} .,:=]|\([^()]*\))+", "", plain))
    assert head is not None
    return re.sub(rf"[{HOLE} .,=]+$", "", head.group(1)).strip()


def _sentences(path: Path) -> Iterator[str]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    constants = _constants(tree)
    inside = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
    for node in ast.walk(tree):
        if id(node) in inside:
            continue
        if isinstance(node, ast.Call) and node.args:
            function = _name(node.func)
            if function in (*ERRORS, "warn"):
                yield from _texts(node.args[0])
            elif function == OUTCOME and len(node.args) > 1:
                yield from _texts(constants.get(_name(node.args[1]), node.args[1]))
            elif function in ("append", "extend") and isinstance(node.func, ast.Attribute):
                yield from _texts(node.args[0]) if _name(node.func.value) in LISTS else ()
        elif isinstance(node, ast.Assign | ast.AnnAssign | ast.AugAssign) and node.value is not None:
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            yield from _texts(node.value) if any(_name(target) in LISTS for target in targets) else ()
        elif isinstance(node, ast.keyword | ast.Yield) and node.value is not None:
            is_message = node.arg in LISTS if isinstance(node, ast.keyword) else path.name in CHECKS
            yield from _texts(node.value) if is_message else ()
        elif isinstance(node, ast.FunctionDef) and re.search(RETURNED, node.name):
            for one in ast.walk(node):
                yield from _texts(one.value) if isinstance(one, ast.Return) and one.value else ()
        elif isinstance(node, ast.JoinedStr | ast.Constant) and (text := _text(node) or "").startswith(PREFIX):
            yield text


LISTS = ("warning", "warnings", "_warnings", "faults", "fault", "doubts", "out", "poor", "said", "found", "sentence",
         "sentences", "failure")  # fmt: skip
"""Names of variables, attributes and arguments that hold messages."""
RETURNED = r"_sentence$|^caution$|warnings?$|^_reason_against_|^_missing$|^compile_ahead$"
"""Names of functions that return a message, or several."""
OUTCOME = "Outcome"
"""The result of a job; its second argument is the error."""


def _texts(node: ast.AST) -> Iterator[str]:
    """Yield the messages of an expression: a text, one of two, a list of them, or one for each of something."""
    if isinstance(node, ast.List | ast.Tuple):
        for part in node.elts:
            yield from () if isinstance(part, ast.Tuple) else _texts(part)
    elif isinstance(node, ast.IfExp):
        yield from _texts(node.body)
        yield from _texts(node.orelse)
    elif isinstance(node, ast.ListComp | ast.GeneratorExp):
        yield from _texts(node.elt)
    elif isinstance(node, ast.Subscript):
        yield from _texts(node.value)
    elif isinstance(node, ast.Call) and _name(node.func) in ("tuple", "list") and node.args:
        yield from _texts(node.args[0])
    elif text := _text(node):
        yield text


def _constants(tree: ast.Module) -> dict[str, ast.expr]:
    """Return the constants of a module by their names."""
    return {_name(target): node.value for node in tree.body if isinstance(node, ast.Assign) for target in node.targets}


def _name(node: ast.expr) -> str:
    return node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""


def _text(node: ast.AST) -> str | None:
    """Return a literal string, holes for what is filled in; None for anything else."""
    if isinstance(node, ast.JoinedStr):
        return "".join(str(part.value) if isinstance(part, ast.Constant) else HOLE for part in node.values)
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        left, right = _text(node.left), _text(node.right)
        return None if left is None and right is None else (left or HOLE) + (right or HOLE)
    return None
