"""Settings back into a parameter file: whole or not at all, and readable by both parsers."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sgms_observer.settings.axis import Settings
from sgms_observer.settings.normal_form import normal_parameters
from sgms_observer.settings.parameter_file import expanded, our_sections, sections
from sgms_observer.settings.tree import at, put, tree_of, updated_tree
from sgms_observer.settings.yaml_text import text_of
from sgms_observer.whole_file import write_text

__all__ = ["settings_text", "tree_of", "updated_tree", "write_settings", "write_text", "write_yaml", "yaml_of"]

Comments = Mapping[str, str]

_KEY = re.compile(r'( *)(?:"((?:[^"\\]|\\.)*)"|([^\s"#:][^:]*)):( .*)?$')


def yaml_of(
    tree: Mapping[Any, Any], comments: Comments | None = None, *, read_from: Path | None = None, to: Path | None = None
) -> str:
    """Return a tree as the text of a parameter file.

    Args:
        tree: a document with its sections, or the parameters alone.
        comments: parameter's full name to a remark behind it; the empty name for lines at the head of the file.
        read_from: folder that relative file names in the tree start at.
        to: folder that they will have to start at.
    """

    def moved(name: str) -> str:
        if read_from is None or to is None or Path(name).is_absolute() or not (read_from / name).exists():
            return name
        return os.path.relpath(read_from / name, to)

    document = dict(tree) if any(sections(tree)) else {"/**": {"ros__parameters": dict(tree)}}
    for _, place, parameters in our_sections(document):
        if isinstance(parameters, Mapping):
            put(
                document,
                place[:-1],
                {**at(document, place[:-1]), place[-1]: normal_parameters(expanded(parameters), moved)},
            )
    return _commented(text_of(document), comments or {})


def _commented(text: str, comments: Comments) -> str:
    """Return YAML text with remarks; each at the first place where its parameter stands."""
    left = dict(comments)
    lines = [f"# {line}".rstrip() for line in left.pop("", "").splitlines()]
    above: list[tuple[int, str]] = []
    for line in text.splitlines():
        found = _KEY.match(line)
        if found:
            indent, key = len(found[1]), found[2] if found[2] is not None else found[3]
            above = [entry for entry in above if entry[0] < indent] + [(indent, key)]
            names = [name for _, name in above]
            inside = names.index("ros__parameters") + 1 if "ros__parameters" in names else len(names)
            remark = " ".join(left.pop(".".join(names[inside:]), "").split())
            if remark and found[4]:
                line = f"{line}  # {remark}"
            elif remark:
                lines.append(f"{found[1]}# {remark}")
        lines.append(line)
    return "\n".join(lines) + "\n"


def write_yaml(
    tree: Mapping[Any, Any], path: str | Path, comments: Comments | None = None, *, read_from: str | Path | None = None
) -> None:
    """Write a parameter file, whole or not at all.

    Args:
        tree: a document with its sections (those of strangers stay as they are), or the parameters alone.
        path: the file; its folder is made if need be.
        comments: parameter's full name (``x.friction.static_force``) to a remark behind it; the empty name for lines
            at the head of the file.
        read_from: folder that relative file names in the tree start at; they are rewritten for the file's own folder.

    Raises:
        RecordingError: the file cannot be written; nothing is left under its name that was not there before.
    """
    target = Path(path).resolve()
    base = None if read_from is None else Path(read_from).resolve()
    write_text(yaml_of(tree, comments, read_from=base, to=target.parent), path)


def write_settings(
    settings: Settings,
    path: str | Path,
    changes: Mapping[str, Mapping[str, Any]] | None = None,
    comments: Comments | None = None,
) -> None:
    """Write settings as they were read, with changes.

    Args:
        settings: settings with their ``source``.
        path: the file.
        changes: axis (or the empty name for what axes share) to ``{"friction.static_force": 4.2}``.
        comments: as for ``write_yaml``.

    Raises:
        RecordingError: the file cannot be written.
    """
    write_text(settings_text(settings, path, changes, comments), path)


def settings_text(
    settings: Settings,
    path: str | Path,
    changes: Mapping[str, Mapping[str, Any]] | None = None,
    comments: Comments | None = None,
) -> str:
    """Return the text that ``write_settings`` writes.

    Args:
        settings: settings with their ``source``.
        path: the file; relative file names in it are rewritten for its folder.
        changes: as for ``write_settings``.
        comments: as for ``write_yaml``.
    """
    tree: dict[Any, Any] = settings.source or tree_of(settings)
    for axis, own in (changes or {}).items():
        tree = updated_tree(tree, axis, own)
    return yaml_of(tree, comments, read_from=Path(settings.folder).resolve(), to=Path(path).resolve().parent)
