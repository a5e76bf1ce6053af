"""Which folder imports which, from the source: ``python test/docs/rooms.py`` draws them anew in docs/design.md."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "design.md"
PACKAGES = ("sgms_observer", "sim_plant")
EVERYONES = "everyone's"
"""The room of the files that lie beside the folders of ``sgms_observer``."""
_ENTRIES = ("sgms_observer", "sgms_observer.__main__")  # what users start or import stands above everything
_DRAWING = re.compile(
    r"(?<=<!-- rooms: python test/docs/rooms.py -->\n```\n).*?(?=```\n<!-- end of rooms -->)", re.DOTALL
)

Rooms = dict[str, dict[str, list[str]]]


def modules() -> dict[str, Path]:
    """Return every module of the package by its full name."""
    found = {}
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            parts = path.relative_to(ROOT).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def room_of(module: str, path: Path) -> str:
    """Return the folder of a module, as the page calls it.

    Args:
        module: its full name.
        path: its file.
    """
    folder = path.relative_to(ROOT).parent
    return EVERYONES if str(folder) == "sgms_observer" else str(folder).removeprefix("sgms_observer/")


def imported(path: Path, known: Mapping[str, Path]) -> Iterator[tuple[int, str]]:
    """Yield line and name of every module of the package that a file imports, inside functions and for types too.

    Args:
        path: the file.
        known: modules of the package.
    """
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            inner = [f"{node.module}.{alias.name}" for alias in node.names]
            names = [name if name in known else node.module for name in inner]
        else:
            continue
        yield from ((node.lineno, name) for name in names if name in known)


def rooms() -> Rooms:
    """Return, for each room, the rooms that it imports, each with the places where it does."""
    known = modules()
    found: Rooms = {}
    for module, path in known.items():
        if module in _ENTRIES:
            continue
        own = found.setdefault(room_of(module, path), {})
        for line, name in imported(path, known):
            other = room_of(name, known[name])
            if other != room_of(module, path) and name not in _ENTRIES:
                own.setdefault(other, []).append(f"{path.relative_to(ROOT)}:{line} imports {name}")
    return found


def files() -> Rooms:
    """Return, for each file, the files that it imports, each with the places where it does."""
    known = modules()
    found: Rooms = {module: {} for module in known if module not in _ENTRIES}
    for module, own in found.items():
        for line, name in imported(known[module], known):
            if name not in (module, *_ENTRIES):
                own.setdefault(name, []).append(f"{known[module].relative_to(ROOT)}:{line} imports {name}")
    return found


def cycle(graph: Rooms) -> list[str]:
    """Return the places of the imports that make a cycle; empty where there is none.

    Args:
        graph: as ``rooms`` or ``files`` returns it.
    """
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        way: list[str] = error.args[1]
        return [place for user, used in zip(way[1:], way[:-1], strict=True) for place in graph[user].get(used, [])]
    return []


def drawing(graph: Rooms) -> str:
    """Return the rooms floor by floor, the highest first, each with its arrows.

    A room stands one floor above the highest that it imports. An arrow is left out where others lead there too.

    Args:
        graph: as ``rooms`` returns it, without cycles.
    """
    below: dict[str, set[str]] = {}
    floors: dict[str, int] = {}
    for room in TopologicalSorter(graph).static_order():
        direct = graph.get(room, {})
        below[room] = set(direct).union(*(below[other] for other in direct))
        floors[room] = max((floors[other] + 1 for other in direct), default=0)
    lines = []
    for floor in range(max(floors.values()), -1, -1):
        for number, room in enumerate(sorted(name for name in floors if floors[name] == floor)):
            direct = graph.get(room, {})
            arrows = sorted(other for other in direct if not any(other in below[between] for between in direct))
            arrows.sort(key=lambda other: -floors[other])
            label = f"{'' if number else floor:>2} │ {room:<24}"
            lines.append((label + (" ──▶ " + ", ".join(arrows) if arrows else "")).rstrip())
    return "\n".join(lines) + "\n"


def drawn() -> str:
    """Return the page with the drawing of the source as it is."""
    page = PAGE.read_text(encoding="utf-8")
    if not _DRAWING.search(page):
        raise ValueError(f"{PAGE.name} has lost the marks around the drawing of the rooms; put them back")
    return _DRAWING.sub(lambda _: drawing(rooms()), page)


if __name__ == "__main__":
    PAGE.write_text(drawn(), encoding="utf-8")
