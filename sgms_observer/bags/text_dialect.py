"""How a text file writes its table: separator, decimal sign, where the numbers start, what the columns are called."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

_SEPARATORS = (";", "\t", ",", "|", None)
_COMMENTS = "#%/!"
_ISO_DATE = re.compile(r"\d{4}-\d\d-\d\d([T ]\d\d:\d\d(:\d\d([.,]\d+)?)?(Z|[+-]\d\d:?\d\d)?)?")
_LOCAL_DATE = re.compile(
    r"(?:(\d\d?)\.(\d\d?)\.|(\d\d?)/(\d\d?)/)(\d{4})[T ](\d\d?):(\d\d):(\d\d)(?:[.,](\d{1,6})\d*)?(?: ?([AP])M)?"
)
"""Day.month.year or month/day/year, and the time of day, with AM or PM or without."""
_FORTRAN = re.compile(r"[+-]?[\d.,]+[dD][+-]?\d+")
_GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}(\.\d{3})+(,\d+)?")
"""A number with points between thousands, in a table with decimal commas."""
_TIME_OF_DAY = re.compile(r"(\d{1,2}):(\d\d):(\d\d(?:[.,]\d+)?)")
_WORD = re.compile(r"[^\W\d_][\w .:+-]*")
_MISSING = frozenset(("", "-", "--", "---", "null", "none", "n/a", "na", "#n/a", "nan", "-nan(ind)", "nan(ind)"))
_UNIT = re.compile(
    r"[\[(<]?(s|sec|seconds?|sekunden?|ms|us|µs|ns|min|h|m|meters?|metres?|mm|um|µm|nm|cm|inch|rad|mrad|urad|deg|degrees?|°"
    r"|[mk]?N|newtons?|[mk]?N ?[*·]?m+|[mk]?A|amp(ere)?s?|[mk]?V|volts?|[mk]?W|Hz|kHz|rpm|rev|°?C|K|bar|%|-|1"
    r"|counts?|inc|incr|bits?|n/?a|float|double|real|integer|u?int\d*|bool|string|text|(m|mm|um|µm|rad|deg|°|N|A|V)/s(\^?2|²)?)?[\])>]?",
)


@dataclass(frozen=True)
class Dialect:
    """How a table is written.

    Attributes:
        separator: between two columns; None for any white space.
        has_decimal_comma: numbers are written 0,5.
        first_row: number of the first line of the table, from 0.
        names: what the columns are called; 1, 2, ... where the file does not say.
        sample: the fields of a row, to see what kind of column each is.
        has_quotes: fields may stand in quotation marks.
    """

    separator: str | None
    has_decimal_comma: bool
    first_row: int
    names: tuple[str, ...]
    sample: tuple[str, ...]
    has_quotes: bool

    def converter(self, column: int) -> Callable[[str], float] | None:
        """Return what turns a field into a number where that is more than reading one.

        Args:
            column: number of the column, from 0.
        """
        field = self.sample[column].strip().strip('"')
        if _is_date(field):
            origin = _moment(field)
            return lambda text: (_moment(text.strip().strip('"')) - origin).total_seconds()
        return _seconds_of_day if _TIME_OF_DAY.fullmatch(field) else None

    def is_time_of_day(self, column: int) -> bool:
        """Return whether a column holds times such as 13:45:02.5, which restart at midnight.

        Args:
            column: number of the column, from 0.
        """
        return _TIME_OF_DAY.fullmatch(self.sample[column].strip().strip('"')) is not None


def find_dialect(lines: Sequence[str]) -> tuple[Dialect, int] | None:
    """Find the table in the first lines of a file.

    The way of reading that finds most numbers in lines of equal width is the file's.

    Args:
        lines: the first lines, without their ends.

    Returns:
        The dialect and the number of rows that were seen, or None if no line holds a number.
    """
    has_quotes = any('"' in line for line in lines)
    best: tuple[int, str | None, bool, list[int]] = (0, None, False, [])
    for separator in _SEPARATORS:
        for is_comma in (False, True):
            if separator == "," and is_comma and not has_quotes:
                continue
            rows, width = _longest_run(lines, separator, is_comma)
            if len(rows) * width > best[0]:
                best = (len(rows) * width, separator, is_comma, rows)
    cells, separator, is_comma, rows = best
    if not cells:
        return None
    fields = [tuple(split(lines[row], separator)) for row in (rows[0], rows[-1])]
    names = _names(lines[: rows[0]], separator, len(fields[0]))
    sample = tuple(a if _is_date(a.strip().strip('"')) or not b.strip() else b for a, b in zip(*fields, strict=True))
    return Dialect(separator, is_comma, rows[0], names, sample, has_quotes), len(rows)


def split(line: str, separator: str | None) -> list[str]:
    """Return the fields of a line.

    Args:
        line: without its end.
        separator: between two columns; None for any white space.
    """
    if separator is None:
        return line.split()
    if '"' in line:
        with_quotes = next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])
        return with_quotes
    return line.split(separator)


def number(field: str, has_decimal_comma: bool) -> float:
    """Return the number that a field holds, NaN for an empty field and its like.

    Args:
        field: as written.
        has_decimal_comma: numbers are written 0,5.

    Raises:
        ValueError: it is no number.
    """
    text = field.strip()
    if text.lower() in _MISSING:
        return float("nan")
    return _float(text, has_decimal_comma)


def _float(text: str, has_decimal_comma: bool) -> float:
    """Return the number of a field; beside decimal commas a point can only stand between thousands."""
    if has_decimal_comma and "." in text:
        if _GROUPED.fullmatch(text) is None:
            raise ValueError(f"could not convert string {text!r} to a number")
        text = text.replace(".", "")
    if _FORTRAN.fullmatch(text):
        text = text.replace("D", "e").replace("d", "e")
    return float(text.replace(",", ".") if has_decimal_comma else text)


def unreadable_field(lines: Sequence[str]) -> tuple[int, str] | None:
    """Return the number of the line, from 1, that is nearest to a row of numbers, and its first field that is none.

    Args:
        lines: the first lines, without their ends.

    Returns:
        None if no line holds a number.
    """
    for separator in _SEPARATORS:
        best: tuple[int, int, str] = (0, 0, "")
        for i, line in enumerate(lines):
            fields = [field.strip() for field in split(line, separator)]
            is_number = [_is_number(field) for field in fields]
            if sum(is_number) > best[0] and not all(is_number):
                best = (sum(is_number), i + 1, fields[is_number.index(False)])
        if best[0]:
            return best[1:]
    return None


def _is_number(text: str) -> bool:
    """Return whether a field is a number in either way of writing."""
    for has_decimal_comma in (False, True):
        try:
            _float(text, has_decimal_comma)
        except ValueError:
            continue
        return True
    return False


def _is_date(text: str) -> bool:
    return _ISO_DATE.fullmatch(text) is not None or _LOCAL_DATE.fullmatch(text) is not None


def _seconds_of_day(text: str) -> float:
    """Return the seconds since midnight of a text such as 13:45:02.5; ValueError where it is no time of day."""
    found = _TIME_OF_DAY.fullmatch(text.strip().strip('"'))
    if found is None:
        raise ValueError(f"could not convert string {text!r} to a time of day")
    return 3600.0 * int(found[1]) + 60.0 * int(found[2]) + float(found[3].replace(",", "."))


def _moment(text: str) -> datetime:
    """Return the moment that a date names, ISO, German or American; without a zone, as if the clock stood in UTC."""
    local = _LOCAL_DATE.fullmatch(text)
    if local is not None:
        return _local_moment(local)
    if _ISO_DATE.fullmatch(text) is None:
        raise ValueError(f"could not convert string {text!r} to a date")
    moment = datetime.fromisoformat(text.replace(",", "."))
    return (
        moment
        if moment.tzinfo
        else datetime.fromisoformat(text.replace(",", ".") + ("T00:00Z" if len(text) == 10 else "Z"))
    )


def _local_moment(found: re.Match[str]) -> datetime:
    """Return the moment of a German or American date, as if the clock stood in UTC."""
    day, month = (found[1], found[2]) if found[1] else (found[4], found[3])
    hour = int(found[6])
    if found[10]:
        hour = hour % 12 + (12 if found[10] == "P" else 0)
    fraction = int((found[9] or "0").ljust(6, "0"))
    return datetime(int(found[5]), int(month), int(day), hour, int(found[7]), int(found[8]), fraction, UTC)


def _longest_run(lines: Sequence[str], separator: str | None, is_comma: bool) -> tuple[list[int], int]:
    """Return the numbers of the lines of the longest table, and its width."""
    best: tuple[list[int], int] = ([], 0)
    for rows, width in _runs(lines, separator, is_comma):
        if len(rows) * width > len(best[0]) * best[1]:
            best = (rows, width)
    return best


def _runs(lines: Sequence[str], separator: str | None, is_comma: bool) -> Iterator[tuple[list[int], int]]:
    """Yield consecutive lines of equal width that hold numbers; empty lines do not end a table."""
    rows: list[int] = []
    words: list[frozenset[int]] = []
    width = 0
    for i, line in enumerate((*lines, None)):
        if line is not None and not line.strip():
            continue
        found = None if line is None else _words(split(line, separator), is_comma)
        here = 0 if found is None else found[0]
        if here != width or here == 0:
            if rows:
                yield rows[_header_rows(words) :], width
            rows, words, width = [], [], here
        if found is not None:
            rows.append(i)
            words.append(found[1])


def _header_rows(words: Sequence[frozenset[int]]) -> int:
    """Return how many rows have words where the rest of the table has numbers: such rows are names."""
    if len(words) < 3:
        return 0
    usual = frozenset().union(*words[2:])
    return next((i for i, here in enumerate(words) if here <= usual), 0)


def _words(fields: Sequence[str], is_comma: bool) -> tuple[int, frozenset[int]] | None:
    """Return the width of a row of a table and where it holds words; None for a line that is no row.

    A row holds at least one number, at most as many words as numbers, and nothing else.
    """
    words, numbers = [], 0
    for i, field in enumerate(fields):
        text = field.strip()
        try:
            _float(text, is_comma)
            numbers += 1
        except ValueError:
            if _is_date(text) or _TIME_OF_DAY.fullmatch(text):
                numbers += 1
            elif _WORD.fullmatch(text):
                words.append(i)
            elif text.lower() not in _MISSING:
                return None
    if not numbers or len(words) > numbers:
        return None
    return len(fields), frozenset(words)


def _names(lines: Sequence[str], separator: str | None, width: int) -> tuple[str, ...]:
    """Return the names of the columns from the lines above the table; an empty or repeated one gives way to a number.

    The lines just above it that have as many fields are looked at from the last one upwards; lines of units and data
    types are passed over, unless there is nothing else.
    """
    numbered = [str(k + 1) for k in range(width)]
    units: list[str] | None = None
    for line in reversed(lines):
        if not line.strip(_COMMENTS + " \t\r"):
            continue
        names = _as_names(line, separator, width)
        if names is None:
            break
        if not all(_UNIT.fullmatch(name) for name in names):
            break
        units = units or names
        names = None
    else:
        names = None
    names = names or units
    if names is None:
        return tuple(numbered)
    return tuple(name if name and name not in names[:k] else numbered[k] for k, name in enumerate(names))


def _as_names(line: str, separator: str | None, width: int) -> list[str] | None:
    """Return the fields of a line if there are as many as columns."""
    text = line.strip().lstrip(_COMMENTS + " ") if separator is None else line.strip(" \r").lstrip(_COMMENTS + " ")
    tries = [split(text, separator)]
    if separator is None:
        tries.append(re.split(r"\s{2,}|\t", text))  # names of several words, set apart by more than one space
    else:
        tries += [tries[0][:-1]] if not tries[0][-1].strip() else [[*tries[0], ""]]  # a separator at the line's end
        if not any(map(_is_number, tries[0])):
            tries.append(tries[0][:-1])  # a column of comments that no row fills
    found = next((fields for fields in tries if len(fields) == width), None)
    return None if found is None else [name.strip().strip("\"'").strip() for name in found]
