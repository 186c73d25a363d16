"""Tables as text: the ways people write them, one clear line for each error, and the way back."""

from __future__ import annotations

import math

import numpy as np
import pytest

from engine.core.errors import LoadError
from engine.curve.table_text import MAX_ROWS, load_table, parse_table, table_text
from engine.curve.tables import HALF_PI, TabulatedCurve

HALF = "0,1\n45,3\n90,2\n"


@pytest.mark.parametrize(
    "text",
    [HALF, "# made by hand\nangle, value\n" + HALF, "0\t1\n45\t3\n90\t2", "0 1\r\n\r\n45   3 # the peak\r\n90 2\r\n",
     "Winkel;Wert\n0;1,0\n45;3,0\n90;2,0", "\ufeff" + HALF, "0,1,1,1\n45,3,3,3\n90,2,2,2"],
)  # fmt: skip
def test_every_way_of_writing_reads_the_same(text):
    table = parse_table(text.encode(), "clipboard")
    assert table(np.array([0.0, math.radians(22.5), HALF_PI])) == pytest.approx(np.repeat([[1.0], [2.0], [2.0]], 3, 1))
    assert table.replaces_all and table.kind == "curve"


def test_a_part_of_the_angle_goes_over_into_the_rest():
    table = parse_table(b"30,1,2,3\n60,4,5,6", "clipboard")
    assert np.degrees(table.regions) == pytest.approx([24.6, 30.0, 60.0, 65.4])
    assert table.values == ((1.0, 2.0, 3.0), (4.0, 5.0, 6.0))


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("0,1\n45,three", "line 2: value = three, expected a number within 1e+18"),
        ("0,1\nx,3", "line 2: angle = x, expected a number"),
        ("0,1\n45,nan", "line 2: value = nan, expected a number within 1e+18"),
        ("0,1\n95,3", "line 2: angle = 95, expected 0 to 90 degrees"),
        ("45,1\n30,3", "line 2: angle = 30, expected at least 45, as before"),
        ("0,1\n\n45,3,4,5", "line 3: number of columns = 4, expected 2, as before"),
        ("0,1,2\n45,3,4", "line 1: number of columns = 3, expected 2 (angle, value) or 4 (angle, red, green, blue)"),
        ("0,1", "number of rows = 1, expected 2 or more of angle and value"),
        ("", "number of rows = 0, expected 2 or more of angle and value"),
        ("a,b\nc,d", "line 2: angle = c, expected a number"),
        ("0,1\n" * (MAX_ROWS + 1), f"number of rows = more than {MAX_ROWS}, expected at most {MAX_ROWS}"),
    ],
)
def test_an_error_is_one_line_with_file_place_value_and_what_was_expected(text, line):
    with pytest.raises(LoadError) as caught:
        parse_table(text.encode(), "peak.csv")
    assert str(caught.value) == f"peak.csv: {line}; nothing was changed"


def test_what_is_no_text_is_refused():
    with pytest.raises(LoadError, match="byte 2 = 255, expected text in UTF-8"):
        parse_table(b"0,\xff", "peak.csv")


def test_text_reads_back(tmp_path):
    gammas = tuple(np.random.default_rng(1).uniform(0.0, HALF_PI, 40).cumsum() % 1e-9 + np.linspace(0.0, HALF_PI, 40))
    gammas = tuple(min(gamma, HALF_PI) for gamma in gammas)
    table = TabulatedCurve(gammas, tuple((g, 1.0 / 3.0, 1e-17 * g) for g in gammas))
    (tmp_path / "peak.csv").write_text(table_text(table))
    back = load_table(tmp_path / "peak.csv")
    assert back.values == table.values and back.gammas == pytest.approx(table.gammas, abs=4e-16)
