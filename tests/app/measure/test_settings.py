"""Settings: the Pareto front in closed form, the loop on settings whose errors are known, and what is written."""

from __future__ import annotations

import csv
import json
import math
import re
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.__main__ import Desktop
from app.cli.program import run
from app.measure.report import REPORT, report_text, table, write_report
from app.measure.settings import Outcome, Setting, SettingRow, measure_values, pareto_front, write_settings
from app.measure.settings_deform import DeformValues
from app.measure.settings_orbit import OrbitValues
from app.measure.settings_placement import QUICK, SIMPLE_SERIES, PlacementValues, frame_coefficients, placement_settings
from app.measure.study import StudyEffort, measure_settings
from app.measure.subject import open_subject
from engine.core.errors import InsituError
from engine.precompute.indirect.sampling_settings import ROUGH

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


def known(name: str, timed: bool = True) -> Setting:
    """Whose value is its error: all radiance is too bright by so much."""
    truth = np.ones((50, 3))
    return Setting(
        "orbit", name, (0.5, 0.25), lambda off: lambda: Outcome(truth + off, 2.0), truth, 0.25, "nothing", timed
    )


def test_the_loop_finds_errors_that_are_known() -> None:
    told: list[str] = []
    # Clamped at the truth's 99.9 percentile, what is too bright would count nothing: darker it is.
    truth = np.ones((50, 3))
    darker = Setting("orbit", "dark", (0.5, 0.25), lambda off: lambda: Outcome(truth - off), truth, 0.25, "nothing")
    rows = measure_values([darker], 3, told.append)
    assert [(row.value, row.present) for row in rows] == [("0.5", False), ("0.25", True)]
    assert [row.error for row in rows] == pytest.approx([0.5, 0.25])
    assert [row.mean for row in rows] == pytest.approx([-0.5, -0.25])
    assert all(0.0 <= row.least <= row.seconds <= row.most for row in rows)
    assert rows[1].on_front and told == ["orbit: dark"]


def test_a_setting_that_is_not_timed_has_no_seconds_and_one_without_values_no_rows() -> None:
    rows = measure_values([known("alone", timed=False)], 3, lambda _: None)
    assert all(math.isnan(row.seconds) for row in rows) and [row.mib for row in rows] == [2.0, 2.0]
    none = Setting("orbit", "none", (), lambda _: lambda: Outcome(np.ones((1, 3))), np.ones((1, 3)), None, "")
    assert measure_values([none], 3, lambda _: None) == []


def row(setting: str, value: str, error: float, seconds: float, **others: Any) -> SettingRow:
    found: dict[str, Any] = {"mib": None, "present": False, "on_front": True, "cost": "a picture"} | others
    return SettingRow("placement", setting, value, error, -0.001, seconds, seconds / 2, seconds * 2, **found)


ROWS = [
    row("lights", "400", 0.01, 2.0, present=True, mib=3.0),
    row("lights", "100", 0.05, 1.0),
    row("lights", "200", 0.06, 1.5, on_front=False),
    row("wavelets, by |c|", "8", 0.5, math.nan),
]


def test_the_front_and_the_table_read_back(tmp_path: Path) -> None:
    write_settings(tmp_path, ROWS, FACTS)
    with open(tmp_path / "settings.csv", newline="", encoding="utf-8") as file:
        lines = list(csv.DictReader(file))
    assert [line["seconds"] for line in lines] == ["2", "1", "1.5", ""]
    content = json.loads((tmp_path / "front.json").read_text(encoding="utf-8"))
    assert content["scene"] == "none"
    # Quickest first, what is beaten and what has no time left out.
    assert content["placement"] == {
        "lights": {
            "present": "400",
            "front": [
                {"value": "100", "error": 0.05, "seconds": 1.0},
                {"value": "400", "error": 0.01, "seconds": 2.0},
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
    assert (tmp_path / "settings_placement.png").read_bytes()[:4] == b"\x89PNG"


def test_a_table_has_its_first_column_to_the_left() -> None:
    assert table(["a", "b"], [[1, "x|y"]]) == "| a | b |\n| --- | ---: |\n| 1 | x\\|y |\n"


def test_strategies_for_a_frame_in_closed_form() -> None:
    first, wanted = np.array([[8.0], [1.0], [0.0]]), np.array([[8.0], [1.5], [0.25]])
    levels, even = np.array([0, 1, 1]), np.ones(3)
    # Anew the one number that counts most is the old peak; incremented it is what has changed most.
    assert frame_coefficients(even, levels, [first, wanted], 1, "anew")[-1].tolist() == [[8.0], [0.0], [0.0]]
    assert frame_coefficients(even, levels, [first, wanted], 1, "incremented")[-1].tolist() == [[8.0], [1.5], [0.0]]
    # Where the last counts four times as much, its change of 0.25 is worth more than one of 0.5.
    assert frame_coefficients(np.array([1.0, 1.0, 4.0]), levels, [first, wanted], 1, "incremented")[-1].tolist() == [
        [8.0],
        [1.0],
        [0.25],
    ]


TINY = StudyEffort(
    PlacementValues(
        16, 8, 4, 6, 64, (50, 400), (2, 3), (4, 16), (), (1, 16), (0, 4), (SIMPLE_SERIES, "16,1"), (), (), ROUGH
    ),
    OrbitValues(6, 4, (80,), (20,), (), 20),
    DeformValues(8, 6, 64, (2, 3), (3,), (1, 3), (64,), 64),
    1,
)


@pytest.mark.sweep
def test_all_settings_of_a_tiny_scene(tiny_scene: str, tmp_path: Path) -> None:
    measure_settings(tiny_scene, tmp_path, TINY, lambda _: None)
    content = json.loads((tmp_path / "front.json").read_text(encoding="utf-8"))
    assert set(content["placement"]) == {
        "lights", "sphere level", "bands", "precision", "rays through pixels at edges", "wavelets a frame", "series",
    }  # fmt: skip
    assert content["deform"] and content["orbit"]["coefficients at rest"]["front"]
    with open(tmp_path / "settings.csv", newline="", encoding="utf-8") as file:
        lines = list(csv.DictReader(file))
    found = {(line["setting"], line["value"]): float(line["error"]) for line in lines}
    assert found["bands", "16"] < found["bands", "4"]
    # The edit scales the ground's constant curve: its mean is the only coefficient that changes.
    assert found["wavelets a frame", "1"] == pytest.approx(found["wavelets a frame", "16"])
    assert found["order, harmonics themselves", "3"] < found["order, harmonics themselves", "2"]


def test_one_mode_alone_and_settings_of_others(tiny_scene: str, tmp_path: Path) -> None:
    measure_settings(
        tiny_scene, tmp_path, TINY, lambda _: None, ["deform"],
        others=lambda subject, project: [known(f"of {subject.scene.resolution[0]} pixels across")],
    )  # fmt: skip
    with open(tmp_path / "settings.csv", newline="", encoding="utf-8") as file:
        rows = [(line["mode"], line["setting"]) for line in csv.DictReader(file)]
    # 32 pixels across are 16 in the study, whose longer side this is.
    assert {mode for mode, _ in rows} == {"deform", "orbit"} and rows[-1] == ("orbit", "of 16 pixels across")
    assert (tmp_path / "settings_deform.png").exists() and not (tmp_path / "settings_placement.png").exists()


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("figures", "'figures' measures the project, not a scene: `make measure` of the sources has it"),
        ("speed", "no part 'speed', expected one of settings, placement, orbit, deform"),
    ],
)
def test_a_part_that_is_elsewhere_and_one_that_is_none(name: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(InsituError, match=re.escape(said)):
        measure_settings("teatray", tmp_path, only=["orbit", name])
    assert not list(tmp_path.iterdir())


def test_the_command_line_measures_one_mode(
    tiny_scene: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("app.measure.study.QUICK", TINY)
    words = ["measure", tiny_scene, "-o", str(tmp_path / "out"), "--quick", "--only", "deform"]
    assert run(words, Desktop()) == 0
    assert "deform: rays a point" in capsys.readouterr().out
    assert (tmp_path / "out" / REPORT).exists()


def test_a_command_line_may_name_parts_as_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found: list[list[str]] = []
    monkeypatch.setattr("app.measure.study.measure_settings", lambda *given: found.append(given[-1]))
    for names in (["knobs"], ["settings"], ["orbit", "deform"]):
        words = [word for name in names for word in ("--only", name)]
        assert run(["measure", "teatray", "-o", str(tmp_path), *words], Desktop()) == 0
    assert found == [["settings"], ["settings"], ["orbit", "deform"]]


def test_under_lamps_alone_the_skys_settings_are_left_out(tiny_scene: str) -> None:
    lit = open_subject(tiny_scene)
    effort = replace(QUICK, side=12, n_points=4, level=2)
    dark = replace(lit, sky=replace(lit.sky, environment=None))
    found = {
        name: [setting.name for setting in islice(placement_settings(subject, effort), count)]
        for name, subject, count in (("sky", lit, 4), ("lamps", dark, 2))
    }
    assert found["sky"] == ["lights", "sphere level", "bands", "precision"]
    assert found["lamps"] == ["bands", "precision"]
