"""Ten thousand generated inputs for every parser: each gives an answer or sentences, never another exception.

The cases are mutations of good inputs and pieces of their grammar, drawn from seeded generators: a failure names its
seed and is repeated by it. ``SGMS_CASES`` sets another number of cases.
"""

from __future__ import annotations

import contextlib
import io
import os
import random
import struct
import types
import zlib
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from fresh_file import write_fresh

from sgms_observer.bags.cdr import JointStateDecoder, JointStateEncoder
from sgms_observer.bags.conversion import parse_map, read_table
from sgms_observer.bags.diagnostics_cdr import DiagnosticStatus, decode_diagnostics, encode_diagnostics
from sgms_observer.bags.reader import read_samples
from sgms_observer.bags.writer import BagWriter
from sgms_observer.cli import main as command_line
from sgms_observer.cli.main import COMMANDS
from sgms_observer.errors import ConfigurationError, SgmsError
from sgms_observer.settings import load
from sgms_observer.settings.node_parameters import read_arguments
from sim_plant.reference_file import read_reference_file

CASES = int(os.environ.get("SGMS_CASES", "10000"))
SEED = 20_240_607
START = 1_700_000_000_000_000_000
CONFIG = Path(__file__).parents[2] / "config"
NASTY = (b"\x00", b"\xff", b"\x7f", b"\x80\x00\x00\x00", b"\xff\xff\xff\x7f", b"\xff" * 8, b"\r\n", b"nan", b"1e999")
WORDS = ("x", "axes", "mass", "friction", "effects", "names", "model", "1e-4", "-1", "nan", ".inf", "[]", "{}", "true",
         "null", "~", "&a", "*a", "!!python/object:os.system", "? ", ": ", "- ", "\t", "\n", "'", '"', "#", "|", "<<: ",
         "/**", "9" * 400, "0x1f", "\u2028", "\ufeff", "ä")  # fmt: skip

Case = Callable[[], object]
decode_joint_state = JointStateDecoder().decode


def damage(chance: random.Random, whole: bytes) -> bytes:
    """Return bytes with some of them changed, cut, doubled or put in."""
    data = bytearray(whole)
    for _ in range(chance.randint(1, 4)):
        at = chance.randrange(len(data) + 1)
        kind = chance.randrange(6)
        if kind == 0:
            del data[at:]
        elif kind == 1:
            data[at:at] = chance.choice(NASTY)
        elif kind == 2:
            del data[at : at + chance.randint(1, 16)]
        elif kind == 3:
            data[at:at] = data[at : at + chance.randint(1, 32)]
        elif data and at < len(data):
            data[at] = chance.randrange(256) if kind == 4 else data[at] ^ (1 << chance.randrange(8))
    return bytes(data)


def slip(chance: random.Random, text: str, most: int = 4) -> str:
    """Return text with slips of the pen: words of the grammar put in, pieces left out, lines moved."""
    for _ in range(chance.randint(1, most)):
        at, end = chance.randrange(len(text) + 1), chance.randint(0, 12)
        text = text[:at] + chance.choice(WORDS) + text[at + chance.choice((0, end)) :]
        if chance.random() < 0.1:
            lines = text.splitlines(keepends=True)
            chance.shuffle(lines)
            text = "".join(lines)
    return text


def yaml_files(folder: Path) -> Iterator[Case]:
    """Parameter files, as commands read them."""
    shipped = [
        "\n".join(line.partition(" #")[0] for line in (CONFIG / f"{name}.yaml").read_text().splitlines())
        for name in ("paper", "table", "emps")
    ]
    small = "/**: {ros__parameters: {axes: [x], sample_period: 1e-3, x: {mass: 3, effects: {names: [offset]}}}}"
    shipped += [small] * 9
    known = load.installed_catalogue(())
    path = folder / "any.yaml"
    for chance in chances():
        if chance.random() < 0.3:
            text = "".join(chance.choices(WORDS, k=chance.randint(0, 30)))
        else:
            text = slip(chance, chance.choice(shipped), 2)
        write_fresh(path, text.encode("utf-8", "surrogatepass"))
        yield lambda: load.load_settings(path, catalogue=lambda files: known)


def node_arguments(folder: Path) -> Iterator[Case]:
    """Parameters and remappings on a node's command line."""
    names = ("x.mass", "axes", "x.friction.element_stiffness", "sample_period", "x.compensation.enabled", "y.mass", "")
    values = ("3", "1e-4", "true", "[1, 2e5, 3]", "[x, y]", "heavy", "", "{}", "!!int x", "[[", "nan", "9" * 400)
    for chance in chances():
        arguments = ["observer_node", "--ros-args"]
        for _ in range(chance.randint(1, 4)):
            flag = chance.choice(("-p", "--param", "-r", "--remap", "--params-file", "--", "--log-level", "-x"))
            value = f"{chance.choice(names)}:={chance.choice(values)}"
            arguments += [flag, slip(chance, value) if chance.random() < 0.5 else value][: chance.choice((2, 2, 2, 1))]
        yield lambda given=tuple(arguments): read_arguments(given)


def joint_states(folder: Path) -> Iterator[Case]:
    """Messages of the input topics."""
    fields = ("position", "velocity", "effort")
    good = [JointStateEncoder(("x", "y"), fields).encode(START, *[(1.0, 2.0)] * 3), JointStateEncoder((), ()).encode(0)]
    for chance in chances():
        data = damage(chance, chance.choice(good)) if chance.random() < 0.8 else chance.randbytes(chance.randrange(99))
        yield lambda message=data: decode_joint_state(message)


def diagnostics(folder: Path) -> Iterator[Case]:
    """Messages of ``/diagnostics`` and ``friction_parameters``."""
    good = encode_diagnostics(START, [DiagnosticStatus(1, "node: axis x", "a sentence", "x", (("kappa", "1.0"),))] * 2)
    for chance in chances():
        data = damage(chance, good) if chance.random() < 0.8 else chance.randbytes(chance.randrange(99))
        yield lambda message=data: decode_diagnostics(message)


def _bag(folder: Path, storage: str) -> Path:
    """Write a small bag and return its data file, without metadata."""
    path = folder / "bag"
    stamps = START + np.arange(8, dtype=np.int64) * 1_000_000
    with BagWriter(path, storage) as bag:
        bag.write_joint_states("position", stamps, ("x",), position=np.arange(8.0))
        bag.flush()
        bag.write_joint_states("control_effort", stamps, ("x",), effort=np.arange(8.0))
    (path / "metadata.yaml").unlink()
    return next(path.iterdir())


def mcap_bags(folder: Path) -> Iterator[Case]:
    """Recordings in MCAP, half of them with check sums that fit the damage."""
    file = _bag(folder, "mcap")
    whole = file.read_bytes()
    for chance in chances():
        data = damage(chance, whole)
        write_fresh(file, _with_check_sums(data) if chance.random() < 0.5 else data)
        yield lambda: list(read_samples(file.parent, "x", 1e-3))


def _with_check_sums(data: bytes) -> bytes:
    """Return an MCAP file whose chunks' check sums are right again, as far as its chunks can be found."""
    fixed = bytearray(data)
    at = 8
    while at + 9 <= len(fixed):
        size = struct.unpack_from("<Q", fixed, at + 1)[0]
        if fixed[at] == 6 and size >= 40 and at + 9 + size <= len(fixed):
            struct.pack_into("<I", fixed, at + 33, zlib.crc32(fixed[at + 49 : at + 9 + size]))
        at += 9 + min(size, len(fixed))
    return bytes(fixed)


def sqlite_bags(folder: Path) -> Iterator[Case]:
    """Recordings in sqlite3."""
    file = _bag(folder, "sqlite3")
    whole = file.read_bytes()
    for chance in chances():
        write_fresh(file, damage(chance, whole))
        yield lambda: list(read_samples(file.parent, "x", 1e-3))


def bag_metadata(folder: Path) -> Iterator[Case]:
    """The metadata.yaml of a recording."""
    path = folder / "bag"
    with BagWriter(path) as bag:
        bag.write_joint_states("position", np.array([START]), ("x",), position=np.zeros(1))
        bag.write_joint_states("control_effort", np.array([START]), ("x",), effort=np.zeros(1))
    metadata = path / "metadata.yaml"
    lines = [line for line in metadata.read_text().splitlines() if "offered_qos" not in line and len(line) < 120]
    text = "\n".join(lines[:14])
    for chance in chances():
        write_fresh(metadata, slip(chance, text).encode("utf-8", "surrogatepass"))
        yield lambda: list(read_samples(path, "x", 1e-3))


def csv_files(folder: Path) -> Iterator[Case]:
    """Logs as text."""
    good = (
        b"t,x,u\n0,1,2\n0.001,2,3\n0.002,3,4\n", b"# log\nt;x;u\n0,0;1,0;2,0\n0,1;2,0;3,0\n", b"0 1 2\n1 2 3\n2 3 4\n",
    )  # fmt: skip
    maps = ({"time": "t", "position": "x"}, {"time": "1", "position": "2*3", "control_effort": "3*1e3"})
    path = folder / "any.csv"
    for chance in chances():
        write_fresh(path, damage(chance, chance.choice(good)))
        wanted = chance.choice(maps)
        yield lambda wanted=wanted: read_table(path, wanted)


def mat_files(folder: Path) -> Iterator[Case]:
    """Logs of MATLAB."""
    savemat = pytest.importorskip("scipy.io").savemat
    path = folder / "any.mat"
    good = []
    for options in ({}, {"do_compression": True}, {"format": "4"}):
        content = {"t": np.arange(5.0), "x": np.arange(5.0), "n": "words"}
        savemat(path, content if "format" in options else {**content, "s": {"u": np.ones(5)}}, **options)
        good.append(path.read_bytes())
    for chance in chances():
        write_fresh(path, damage(chance, chance.choice(good)))
        yield lambda: read_table(path, {"time": "t", "position": "x", "control_effort": "s.u"})


def reference_files(folder: Path) -> Iterator[Case]:
    """Tables of times and positions for the simulated stage."""
    good = (b"time,position\n# to and fro\n0,0\n0.5,0.001\n1,0\n", b"0;0\n0.1;1e-3\n0.2;2e-3\n", b"0,1\n1,1\n")
    path = folder / "reference.csv"
    for chance in chances():
        write_fresh(path, damage(chance, chance.choice(good)))
        kind = chance.choice(("linear", "cubic"))
        yield lambda kind=kind: read_reference_file(path, kind, velocity=0.1, acceleration=1.0, jerk=100.0)


def column_maps(folder: Path) -> Iterator[Case]:
    """The argument --map of ``sgms convert``."""
    for chance in chances():
        good = ("time=t", "position=x*1e-6", "control_effort=a*b")
        items = [slip(chance, item, 2) if chance.random() < 0.5 else item for item in good]
        yield lambda given=tuple(items): parse_map(given)


def command_lines(folder: Path) -> Iterator[Case]:
    """Command lines of ``sgms``; the commands themselves do nothing here."""
    words = ["--config", "--out", "--map", "--help", "--duration", "--seed", "--storage", "mcap", "x.yaml", "-1", "nan"]
    words += [*COMMANDS, "--rate", "--topic", "position=/p", "--holdout", "--axis", "--wrong", "", "--", "-v"]
    for chance in chances():
        given = chance.choices(words, k=chance.randint(0, 6))
        if chance.random() < 0.7:
            given.insert(0, chance.choice(list(COMMANDS)))
        if chance.random() < 0.3:
            given = [slip(chance, word) for word in given]
        yield lambda arguments=tuple(given): _parse(arguments)


def _parse(arguments: tuple[str, ...]) -> None:
    """Parse a command line; a wrong one ends with code 2 and one sentence."""
    out, errors = io.StringIO(), io.StringIO()
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(errors):
            code = command_line.main(arguments)
    except SystemExit as end:
        code = end.code
    told = errors.getvalue()
    assert code in (0, 1, 2), code
    assert (code == 0) == (told == ""), told
    assert code != 2 or (told.endswith("--help'\n") and "Traceback" not in told), told
    assert "Internal error" not in told, told


PARSERS = (
    yaml_files, node_arguments, joint_states, diagnostics, mcap_bags, sqlite_bags, bag_metadata, csv_files, mat_files,
    reference_files, column_maps, command_lines,
)  # fmt: skip


def chances() -> Iterator[random.Random]:
    """Return a generator of random numbers for each case; the case's number is its seed."""
    return (random.Random(SEED + number) for number in range(CASES))


@pytest.mark.parametrize("cases", PARSERS, ids=lambda cases: cases.__name__)
def test_any_input(cases: Callable[[Path], Iterator[Case]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if cases is command_lines:
        real = {name: command_line.load_command(name) for name in COMMANDS}
        monkeypatch.setattr(command_line, "load_command", lambda name: _idle(real[name]))
        monkeypatch.setattr(command_line, "build_parser", cache(command_line.build_parser))  # else the most of the time
    answers = 0
    for number, case in enumerate(cases(tmp_path)):
        try:
            case()
            answers += 1
        except ConfigurationError as error:
            assert error.sentences and all(s.strip() and "\n" not in s for s in error.sentences), SEED + number
        except SgmsError as error:
            assert str(error).strip() and "\n" not in str(error), SEED + number
        except BaseException as error:
            error.add_note(f"seed {SEED + number}")
            raise
    print(f"{cases.__name__}: {CASES} cases from seed {SEED} on, {answers} of them had an answer")
    assert answers > 0


def _idle(command: command_line.Command | None) -> command_line.Command | None:
    """Return a command that declares its arguments and does nothing."""
    if command is None:
        return None
    return types.SimpleNamespace(HELP=command.HELP, add_arguments=command.add_arguments, run=lambda args: 0)
