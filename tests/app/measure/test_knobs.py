"""Knobs: the Pareto front in closed form, the loop on knobs whose errors are known, and what is written of them."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.measure import run
from app.measure.knob_report import REPORT, report_text, write_report
from app.measure.knob_study import KnobEffort
from app.measure.knobs import Knob, KnobRow, Shown, measured, pareto_front, write_knobs
from app.measure.knobs_deform import DeformKnobs
from app.measure.knobs_orbit import WHOLE, OrbitKnobs, in_bits
from app.measure.knobs_placement import QUICKLY, SIMPLE_SERIES, PlacementKnobs, placement_knobs
from app.measure.markdown import table
from app.measure.subject import open_subject
from app.measure.turning import spent
from engine.precompute.indirect.sampling_settings import ROUGH
from tests.app.measure.test_run import EFFORT

FACTS = {
    "scene": "none", "resolution": [4, 3], "repetitions": 3, "load_average_after": None,
    "machine": {"cpu": "a cpu", "cores": 2, "ram_gib": 8.0, "system": "a system", "python": "3", "date": "a day",
                "versions": {"numpy": "2"}, "load_average": [0.25, 0.0, 0.0]},
}  # fmt: skip


@pytest.mark.parametrize(
    ("costs", "wrongs", "front"),
    [
        ([1, 2, 3], [3, 2, 1], [True, True, True]),  # each cheaper one is more wrong: all stand
        ([1, 2, 3], [1, 2, 3], [True, False, False]),  # the cheapest is the most right: it beats all
        ([1, 2, 2, 3], [2, 1, 1.5, 1], [True, True, False, False]),  # as cheap but more wrong; as right but dearer
        ([1, 1], [1, 1], [True, True]),  # equal settings stand together
        ([math.nan, 1], [0.5, 1], [False, True]),  # of unknown cost: it cannot stand
        ([], [], []),
    ],
)
def test_pareto_front(costs: list[float], wrongs: list[float], front: list[bool]) -> None:
    assert pareto_front(costs, wrongs) == front


def test_points_on_a_hyperbola_all_stand_and_those_above_it_all_fall() -> None:
    cost = np.linspace(1.0, 10.0, 40)
    # 1/x falls strictly; (1 + 1e-6)/x lies above the point with the same x.
    front = pareto_front([*cost, *cost], [*(1 / cost), *((1 + 1e-6) / cost)])
    assert front == [True] * 40 + [False] * 40


def known(name: str, timed: bool = True) -> Knob:
    """Whose setting is its error: all radiance is too bright by so much."""
    truth = np.ones((50, 3))
    return Knob("orbit", name, (0.5, 0.25), lambda off: lambda: Shown(truth + off, 2.0), truth, 0.25, "nothing", timed)


def test_the_loop_finds_errors_that_are_known() -> None:
    told: list[str] = []
    # Clamped at the truth's 99.9 percentile, what is too bright would count nothing: darker it is.
    truth = np.ones((50, 3))
    darker = Knob("orbit", "dark", (0.5, 0.25), lambda off: lambda: Shown(truth - off), truth, 0.25, "nothing")
    rows = measured([darker], 3, told.append)
    assert [(row.setting, row.present) for row in rows] == [("0.5", False), ("0.25", True)]
    assert [row.error for row in rows] == pytest.approx([0.5, 0.25])
    assert [row.mean for row in rows] == pytest.approx([-0.5, -0.25])
    assert all(0.0 <= row.least <= row.seconds <= row.most for row in rows)
    assert rows[1].on_front and told == ["orbit: dark"]


def test_a_knob_that_is_not_timed_has_no_seconds_and_one_without_settings_no_rows() -> None:
    rows = measured([known("alone", timed=False)], 3, lambda _: None)
    assert all(math.isnan(row.seconds) for row in rows) and [row.mib for row in rows] == [2.0, 2.0]
    none = Knob("orbit", "none", (), lambda _: lambda: Shown(np.ones((1, 3))), np.ones((1, 3)), None, "")
    assert measured([none], 3, lambda _: None) == []


def row(knob: str, setting: str, error: float, seconds: float, **others: Any) -> KnobRow:
    found: dict[str, Any] = {"mib": None, "present": False, "on_front": True, "cost": "a picture"} | others
    return KnobRow("placement", knob, setting, error, -0.001, seconds, seconds / 2, seconds * 2, **found)


ROWS = [
    row("lights", "400", 0.01, 2.0, present=True, mib=3.0),
    row("lights", "100", 0.05, 1.0),
    row("lights", "200", 0.06, 1.5, on_front=False),
    row("wavelets, by |c|", "8", 0.5, math.nan),
]


def test_the_front_and_the_table_read_back(tmp_path: Path) -> None:
    write_knobs(tmp_path, ROWS, FACTS)
    with open(tmp_path / "knobs.csv", newline="", encoding="utf-8") as file:
        lines = list(csv.DictReader(file))
    assert [line["seconds"] for line in lines] == ["2", "1", "1.5", ""]
    content = json.loads((tmp_path / "front.json").read_text(encoding="utf-8"))
    assert content["scene"] == "none"
    # Quickest first, what is beaten and what has no time left out.
    assert content["placement"] == {
        "lights": {
            "present": "400",
            "front": [
                {"setting": "100", "error": 0.05, "seconds": 1.0},
                {"setting": "400", "error": 0.01, "seconds": 2.0},
            ],
        }
    }


def test_the_page_says_machine_spread_and_present(tmp_path: Path) -> None:
    write_report(tmp_path, ROWS, FACTS)
    text = (tmp_path / REPORT).read_text(encoding="utf-8")
    assert text == report_text(ROWS, FACTS)
    assert "a cpu, 2 cores" in text and "numpy 2" in text and "load 0.2 and unknown" in text
    assert "| **400** | **1** | **-0.1** | **2 (1 to 4)** | **3** | ★ |" in text
    assert "| 200 | 6 | -0.1 | 1.5 (0.75 to 3) |  |  |" in text
    assert "by \\|c\\|" in text  # no column of its own
    assert (tmp_path / "knobs_placement.png").read_bytes()[:4] == b"\x89PNG"


def test_a_table_has_its_first_column_to_the_left() -> None:
    assert table(["a", "b"], [[1, "x|y"]]) == "| a | b |\n| --- | ---: |\n| 1 | x\\|y |\n"


def test_ways_to_spend_a_frame_in_closed_form() -> None:
    first, wanted = np.array([[8.0], [1.0], [0.0]]), np.array([[8.0], [1.5], [0.25]])
    levels, even = np.array([0, 1, 1]), np.ones(3)
    # Anew the one number that counts most is the old peak; incremented it is what has changed most.
    assert spent(even, levels, [first, wanted], 1, "anew")[-1].tolist() == [[8.0], [0.0], [0.0]]
    assert spent(even, levels, [first, wanted], 1, "incremented")[-1].tolist() == [[8.0], [1.5], [0.0]]
    # Where the last counts four times as much, its change of 0.25 is worth more than one of 0.5.
    assert spent(np.array([1.0, 1.0, 4.0]), levels, [first, wanted], 1, "incremented")[-1].tolist() == [
        [8.0],
        [1.0],
        [0.25],
    ]


def test_numbers_in_few_bits() -> None:
    values = np.array([[1.0], [-0.49], [0.1]])
    assert in_bits(values, 2).tolist() == [[1.0], [0.0], [0.0]]  # -1, 0 and 1 are all there are
    assert in_bits(values, WHOLE) is values
    near = in_bits(values, "bfloat16")
    assert 0.0 < np.abs(near - values).max() <= 2.0**-9  # eight bits of mantissa: half a step below 1
    assert in_bits(np.zeros((2, 1)), 4).tolist() == [[0.0], [0.0]]


@pytest.mark.sweep
def test_all_knobs_of_a_tiny_scene(tiny_scene: str, tmp_path: Path) -> None:
    effort = KnobEffort(
        PlacementKnobs(
            16, 8, 4, 6, 64, (50, 400), (2, 3), (4, 16), (), (1, 16), (0, 4), ("ours", "cut alone", "OPT", "TRUE"),
            (SIMPLE_SERIES, "16,1"), (), (), ROUGH, (2, 2, 12),
        ),
        OrbitKnobs(6, 4, (80,), (20,), (), (20, 320), (4, WHOLE), 20),
        DeformKnobs(8, 6, 64, (2, 3), (3,), (1, 3), (64,), 64),
        1,
    )  # fmt: skip

    run(tiny_scene, tmp_path, report=lambda _: None, effort=replace(EFFORT, knobs=effort), only=["knobs"])
    content = json.loads((tmp_path / "front.json").read_text(encoding="utf-8"))
    assert {"lights", "bands", "shadows", "precision", "series", "representation of indirect light"} <= set(
        content["placement"]
    )
    assert content["deform"] and content["orbit"]["coefficients at rest"]["front"]
    with open(tmp_path / "knobs.csv", newline="", encoding="utf-8") as file:
        lines = list(csv.DictReader(file))
    found = {(line["knob"], line["setting"]): float(line["error"]) for line in lines}
    assert found["shadows", "TRUE"] <= found["shadows", "cut alone"] + 0.05
    assert found["bands", "16"] < found["bands", "4"]
    # Both representations are the plain sum, in single precision.
    assert max(error for (knob, _), error in found.items() if knob.startswith("representation")) < 1e-5
    assert found["order, harmonics themselves", "3"] < found["order, harmonics themselves", "2"]


def test_under_lamps_alone_the_skys_knobs_are_left_out(tiny_scene: str) -> None:
    lit = open_subject(tiny_scene)
    effort = replace(QUICKLY, side=12, n_points=4, level=2)
    dark = replace(lit, sky=replace(lit.sky, environment=None))
    found = {
        name: [knob.name for knob in islice(placement_knobs(subject, effort), count)]
        for name, subject, count in (("sky", lit, 4), ("lamps", dark, 2))
    }
    assert found["sky"] == ["lights", "sphere level", "bands", "shadows"]
    assert found["lamps"] == ["bands", "precision"]
