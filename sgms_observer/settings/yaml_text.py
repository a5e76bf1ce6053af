"""Converts YAML text to a tree and back, so that PyYAML and rcl read it alike; and keeps its comments."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import yaml

from sgms_observer.errors import ConfigurationError

_SafeLoader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_DEEPEST = 100
_INT = "tag:yaml.org,2002:int"
_FLOAT = "tag:yaml.org,2002:float"
_TIMESTAMP = "tag:yaml.org,2002:timestamp"

#: Words that one of the parsers does not read as text.
_RESERVED = re.compile(r"(y|n|yes|no|true|false|on|off|null|none|nan|inf|infinity)$", re.IGNORECASE)
_SAFE_PLAIN = re.compile(r"[A-Za-z_/][A-Za-z0-9_./*-]*$")

_KEY = re.compile(r'( *)(?:"((?:[^"\\]|\\.)*)"|([^\s"#:\-][^:]*)):( .*)?$')
_BEHIND = re.compile(r"""^((?:[^"'#]|"(?:[^"\\]|\\.)*"|'[^']*'|(?<!\s)#)*?)\s+#\s?(.*)$""")


class PlainText(str):
    """Text without quotes in the YAML."""

    __slots__ = ()


class Group(dict[Any, Any]):
    """A mapping with the keys that the file has twice, as (key, line)."""

    repeated: tuple[tuple[str, int], ...] = ()


class _Reader(_SafeLoader):  # type: ignore[misc]
    """The safe loader, with numbers as both parsers read them and without dates."""

    yaml_implicit_resolvers = {  # noqa: RUF012 - PyYAML's own way to declare them
        first: [(tag, pattern) for tag, pattern in found if tag not in (_INT, _FLOAT, _TIMESTAMP)]
        for first, found in _SafeLoader.yaml_implicit_resolvers.items()
    }


def _construct_group(loader: Any, node: Any) -> Any:
    """Yield a mapping, then fill it; PyYAML fills it late so that a tree may contain itself."""
    group = Group()
    yield group
    given_keys: set[str] = set()
    repeated = []
    for key, _ in node.value:
        if isinstance(key, yaml.ScalarNode) and key.value in given_keys and key.value != "<<":
            repeated.append((key.value, key.start_mark.line + 1))
        given_keys.add(key.value if isinstance(key, yaml.ScalarNode) else "")
    group.repeated = tuple(repeated)
    group.update(loader.construct_mapping(node))


def _construct_text(loader: Any, node: Any) -> str:
    """Return a text, marked if it has no quotes."""
    text: str = loader.construct_scalar(node)
    return text if node.style else PlainText(text)


_Reader.add_implicit_resolver(_INT, re.compile(r"[-+]?(0|[1-9][0-9]*|0x[0-9a-fA-F]+)$"), list("-+0123456789"))
_Reader.add_implicit_resolver(
    _FLOAT,
    re.compile(r"[-+]?([0-9]+\.[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?$|[-+]?\.(inf|Inf|INF)$|\.(nan|NaN|NAN)$"),
    list("-+0123456789."),
)
_Reader.add_constructor("tag:yaml.org,2002:map", _construct_group)
_Reader.add_constructor("tag:yaml.org,2002:str", _construct_text)


def _is_too_deep(text: str) -> bool:
    """Return whether a text nests deeper than any parameter file; libyaml crashes on 100,000."""
    depth = 0
    for event in yaml.parse(text, Loader=_SafeLoader):
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
            if depth > _DEEPEST:
                return True
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
    return False


def parse(text: str, source_name: str) -> Any:
    """Return the tree of a YAML text.

    Raises:
        ConfigurationError: the text is not YAML; one sentence.
    """
    try:
        if _is_too_deep(text):
            raise RecursionError
        return yaml.load(text, Loader=_Reader)  # a safe loader: it makes no objects
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        where = f", line {mark.line + 1}, column {mark.column + 1}," if mark else ""
        reason = " ".join(str(error.problem or error.context or "it cannot be read").split())
    except (yaml.YAMLError, ValueError, ArithmeticError, LookupError, TypeError, AttributeError) as error:
        where, reason = "", " ".join(str(error).split()) or "it cannot be read"
    except RecursionError:
        where, reason = "", "it is nested too deeply"
    raise ConfigurationError([f"{source_name}{where} is not YAML: {reason[:200]}; correct the line"])


class _Writer(yaml.SafeDumper):  # type: ignore[misc]
    """Lists on one line, groups indented, numbers and words that neither parser mistakes."""

    yaml_implicit_resolvers = _Reader.yaml_implicit_resolvers

    def ignore_aliases(self, data: Any) -> bool:
        """Write a repeated value twice: rcl knows no aliases."""
        return True


def _represent_float(writer: yaml.SafeDumper, value: float) -> yaml.ScalarNode:
    """Return a number with a point, as short as it is exact."""
    text = repr(float(value))
    if text in ("inf", "-inf", "nan"):
        text = f"{text[:-3]}.{text[-3:]}"
    elif "e" in text and "." not in text:
        text = text.replace("e", ".0e")
    return writer.represent_scalar(_FLOAT, text)


def _represent_text(writer: yaml.SafeDumper, value: str) -> yaml.ScalarNode:
    """Return text with quotes where one of the parsers would not read it as text."""
    is_plain = _SAFE_PLAIN.match(value) and not _RESERVED.match(value)
    return writer.represent_scalar("tag:yaml.org,2002:str", value, style=None if is_plain else '"')


def _represent_plain(writer: yaml.SafeDumper, value: PlainText) -> yaml.ScalarNode:
    """Return text in the form of the file that it was read from."""
    return writer.represent_scalar("tag:yaml.org,2002:str", str(value))


def _represent_list(writer: yaml.SafeDumper, value: Any) -> yaml.SequenceNode:
    """Return a list on one line."""
    return writer.represent_sequence("tag:yaml.org,2002:seq", list(value), flow_style=True)


def _represent_group(writer: yaml.SafeDumper, value: Mapping[Any, Any]) -> yaml.MappingNode:
    """Return a group in its order; as a key ``y`` is an axis, which both parsers read as text."""
    items = [(PlainText(key) if key in ("y", "Y", "n", "N") else key, entry) for key, entry in value.items()]
    return writer.represent_mapping("tag:yaml.org,2002:map", items, flow_style=False)


_Writer.add_representer(float, _represent_float)
_Writer.add_representer(str, _represent_text)
_Writer.add_representer(PlainText, _represent_plain)
_Writer.add_representer(list, _represent_list)
_Writer.add_representer(tuple, _represent_list)
_Writer.add_representer(dict, _represent_group)
_Writer.add_representer(Group, _represent_group)


def text_of(tree: Any) -> str:
    """Return a tree as YAML text that rcl and ``parse`` read alike.

    Raises:
        ConfigurationError: it contains itself or a type without a YAML form.
    """
    try:
        return str(yaml.dump(tree, Dumper=_Writer, sort_keys=False, width=sys.maxsize, allow_unicode=True))
    except (RecursionError, yaml.YAMLError) as error:
        reason = " ".join(str(error).split())[:200]
        raise ConfigurationError(
            [f"the parameters cannot be written as YAML ({reason}); use plain numbers, texts, lists and groups"]
        ) from None


@dataclass(frozen=True)
class KeptComment:
    """The comments at one key.

    Attributes:
        name: full name of the key, from the head of the file, joined by points.
        above: lines in front of it, without ``#``; an empty line is an empty text.
        behind: the comment on its line.
    """

    name: str
    above: tuple[str, ...]
    behind: str


def comments_in(text: str) -> tuple[tuple[KeptComment, ...], tuple[str, ...]]:
    """Return the comments of a YAML text, key by key, and those after the last key."""
    found, above = [], []
    for line, name, _indent in keyed_lines(text):
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
    comments: Sequence[KeptComment],
    last: Sequence[str] = (),
    is_stale: Callable[[str], bool] = lambda line: False,
) -> str:
    """Return a YAML text with comments at its keys; a key that already has a remark gets its old one in front.

    Args:
        text: the text, with its remarks.
        comments: comments of the original file.
        last: comments after its last key.
        is_stale: whether a comment no longer holds where the key has a new remark.
    """
    waiting = {one.name: one for one in comments}
    lines: list[str] = []
    for line, name, indent in keyed_lines(text):
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


def keyed_lines(text: str) -> Iterator[tuple[str, str, str]]:
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
