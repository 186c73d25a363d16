"""Tables of a curve as text (CSV): read from files and from the clipboard, and written for other programs.

    # comment
    angle,red,green,blue
    0,12.5,12.1,11.8
    2.5,9.25,9.2,9.1

A row has an angle in degrees, 0 to 90, and one value for all channels or three. Columns are separated by commas,
semicolons (then a comma is a decimal point, as spreadsheets in half of Europe write it), tabs or spaces. One row of
words may come first. Angles do not decrease; two rows of one angle are a step. Between rows a curve is linear.
"""

from __future__ import annotations

import math
from pathlib import Path

from engine.core.errors import LoadError
from engine.core.safe_files import read_regular_file
from engine.curve.drawing import FALLOFF
from engine.curve.tables import HALF_PI, VALUE_LIMIT, TabulatedCurve, Triple

MAX_ROWS = 2048
MAX_BYTES = 2**20
TABLE_ENDINGS = (".csv", ".tsv")
HEADER = "angle,red,green,blue"


def load_table(path: Path) -> TabulatedCurve:
    """Read a table; LoadError names the line of the first error."""
    return parse_table(read_regular_file(path, MAX_BYTES), str(path))


def parse_table(data: bytes, where: str) -> TabulatedCurve:
    """The table in UTF-8 text, called `where` in the message of LoadError.

    It acts from its first to its last angle, and goes over into what is below within 5.4 degrees beside it.
    """
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise LoadError(where, f"byte {error.start}", data[error.start], "text in UTF-8") from None
    gammas: list[float] = []
    values: list[Triple] = []
    width, may_be_header = 0, True
    for number, line in enumerate(text.splitlines(), 1):
        cells = _cells(line)
        if not cells:
            continue
        if may_be_header and not any(map(_is_number, cells)):
            may_be_header = False
            continue
        may_be_header = False
        place = f"line {number}"
        if len(cells) not in (2, 4) or len(cells) != (width or len(cells)):
            expected = f"{width}, as before" if width else "2 (angle, value) or 4 (angle, red, green, blue)"
            raise LoadError(where, f"{place}: number of columns", len(cells), expected)
        width = len(cells)
        gammas.append(_gamma(where, place, cells[0], gammas))
        row = [_number(where, f"{place}: value", cell, VALUE_LIMIT) for cell in cells[1:]]
        values.append((row[0], row[-2] if len(row) == 3 else row[0], row[-1]))
        if len(gammas) > MAX_ROWS:
            raise LoadError(where, "number of rows", f"more than {MAX_ROWS}", f"at most {MAX_ROWS}")
    if len(gammas) < 2:
        raise LoadError(where, "number of rows", len(gammas), "2 or more of angle and value")
    low, high = gammas[0], gammas[-1]
    falloff = FALLOFF * HALF_PI
    regions = (max(low - falloff, 0.0), low, high, min(high + falloff, HALF_PI))
    return TabulatedCurve(tuple(gammas), tuple(values), regions=regions)


def table_text(table: TabulatedCurve) -> str:
    """The table as text that reads back as the same samples, within a few 1e-16 of the angle."""
    rows = zip(table.gammas, table.values, strict=True)
    lines = (",".join(repr(float(number)) for number in (math.degrees(gamma), *value)) for gamma, value in rows)
    return "\n".join((HEADER, *lines)) + "\n"


def _cells(line: str) -> list[str]:
    """The cells of a line without its comment; none where it is empty."""
    line = line.partition("#")[0].strip()
    if ";" in line:
        return [cell.strip().replace(",", ".") for cell in line.split(";")]
    separator = "," if "," in line else "\t" if "\t" in line else None
    return [cell.strip() for cell in line.split(separator)]


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _gamma(where: str, place: str, cell: str, before: list[float]) -> float:
    """The angle in radians, not below those before."""
    degrees = _number(where, f"{place}: angle", cell, math.inf)
    if not 0.0 <= degrees <= 90.0:
        raise LoadError(where, f"{place}: angle", cell, "0 to 90 degrees")
    gamma = min(math.radians(degrees), HALF_PI)
    if before and gamma < before[-1]:
        raise LoadError(where, f"{place}: angle", cell, f"at least {math.degrees(before[-1]):g}, as before")
    return gamma


def _number(where: str, what: str, cell: str, limit: float) -> float:
    number = float(cell) if _is_number(cell) else math.nan
    if not math.isfinite(number) or abs(number) > limit:
        expected = "a number" if math.isinf(limit) else f"a number within {limit:g}"
        raise LoadError(where, what, cell, expected)
    return number
