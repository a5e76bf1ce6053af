"""Comments of a YAML file, read by the parameter that they stand at, and put into another text of the same tree."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

_KEY = re.compile(r'( *)(?:"((?:[^"\\]|\\.)*)"|([^\s"#:\-][^:]*)):( .*)?$')
_BEHIND = re.compile(r"""^((?:[^"'#]|"(?:[^"\\]|\\.)*"|'[^']*'|(?<!\s)#)*?)\s+#\s?(.*)$""")


@dataclass(frozen=True)
class KeptComment:
    """The comments at one key.

    Attributes:
        name: full name of the key, from the head of the file, joined by points.
        above: lines in front of it, without ``#``; an empty line is an empty text.
        behind: what follows on its line.
    """

    name: str
    above: tuple[str, ...]
    behind: str


def comments_in(text: str) -> tuple[tuple[KeptComment, ...], tuple[str, ...]]:
    """Return the comments of a YAML text, key by key, and those behind the last key."""
    found, above = [], []
    for line, name, _indent in _keys(text):
        stripped = line.strip()
        if stripped.startswith("#"):
            above.append(stripped[1:].removeprefix(" "))
        elif not stripped:
            above.append("")
        elif name:
            behind = _BEHIND.match(line)
            while above and not above[0]:
                above.pop(0)
            found.append(KeptComment(name, tuple(above), behind[2] if behind else ""))
            above = []
    return tuple(one for one in found if any(one.above) or one.behind), tuple(above) if any(above) else ()


def with_comments(
    text: str,
    kept: Sequence[KeptComment],
    last: Sequence[str] = (),
    is_stale: Callable[[str], bool] = lambda line: False,
) -> str:
    """Return a YAML text with comments at its keys; a key that already has a remark gets its old one in front.

    Args:
        text: the text, with remarks of its own.
        kept: comments of the file that it was made from.
        last: comments behind its last key.
        is_stale: whether a comment no longer holds where the key has a new remark.
    """
    waiting = {one.name: one for one in kept}
    lines: list[str] = []
    for line, name, indent in _keys(text):
        one = waiting.pop(name, None) if name else None
        if one is not None:
            lines += [f"{indent}# {comment}".rstrip() if comment else "" for comment in one.above]
            has_remark = _BEHIND.match(line) is not None
            if one.behind and not has_remark:
                line = f"{line}  # {one.behind}"
            elif one.behind and not is_stale(one.behind):
                lines.append(f"{indent}# {one.behind}")
        lines.append(line)
    lines += [f"# {comment}".rstrip() if comment else "" for comment in last]
    return "\n".join(lines) + "\n"


def _keys(text: str) -> Iterator[tuple[str, str, str]]:
    """Yield each line, the full name of its key (empty without one) and its indentation."""
    above: list[tuple[int, str]] = []
    for line in text.splitlines():
        match = None if line.lstrip().startswith("#") else _KEY.match(line)
        if match is None:
            yield line, "", ""
            continue
        indent, key = len(match[1]), match[2] if match[2] is not None else match[3]
        above = [entry for entry in above if entry[0] < indent] + [(indent, key.strip())]
        yield line, ".".join(part for _, part in above), match[1]
