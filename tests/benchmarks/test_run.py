"""`make measure` from end to end on a tiny scene, and the programs it launches."""

from __future__ import annotations

import contextlib
import json
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

import benchmarks.indirect as indirect
from benchmarks.effort import Effort
from benchmarks.figures import SPECS, NotMeasured
from benchmarks.indirect import IndirectEffort
from benchmarks.indirect_memory import GrowthRow
from benchmarks.launches import Screen, launch, measure_indirect, open_screen
from benchmarks.run import run
from benchmarks.sweep import Grid
from benchmarks.visibility_methods import Size, VisibilityEffort
from engine.core.errors import InsituError
from engine.precompute.direct.pipeline import FINAL

EFFORT = Effort(
    "test",
    1,
    1,
    0,
    2,
    32,
    20_000,
    50,
    False,
    600.0,
    Grid((50, 200), (16, 64), (1, 64), side=24, n_points=6, level=3, oracle_lights=400),
    IndirectEffort(1, 1, (2, 4), 12, 12, ((2, 2), (3, 3)), 12, warm_up=False, room=False),
    edges=None,
    rooms=None,
    gloss=None,
    orbit=None,
    deform=None,
    relight=None,
    drags=None,
    turning=None,
    api_edits=None,
)
pytestmark = pytest.mark.slow
WINDOW = ("window_s", "first_picture_s", "worst_stall_ms", "exact_picture_s", "first_picture_cold_s")
NOT_ASKED = {name for name in SPECS if name.startswith(("reference_", "room_", "orbit_", "deform_", "zh_"))}


@contextlib.contextmanager
def no_screen() -> Iterator[Screen]:
    raise NotMeasured("no display in this test")
    yield


@pytest.fixture(scope="module")
def measured(tiny_scene: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a whole measurement, without windows.

    The program that measures indirect light is given the tiny scene in place of the Cornell box; the memory of that is
    `test_growth`'s.
    """
    folder = tmp_path_factory.mktemp("measured")
    twice = folder / "twice.toml"
    twice.write_text(Path(tiny_scene).read_text().replace("bounces = 1", "bounces = 2"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("benchmarks.window.open_screen", no_screen)
        patch.setattr("benchmarks.launches.RENDERER", "tests.benchmarks.quick_renderer")
        patch.setattr("benchmarks.launches.INDIRECT", "tests.benchmarks.quick_indirect")
        for module in ("run", "window", "direct"):
            patch.setattr(f"benchmarks.{module}.FINAL", replace(FINAL, n_lights=200))
        patch.setattr(indirect, "measure_indirect", lambda _, *others: measure_indirect(str(twice), *others))
        patch.setattr(indirect, "memory_rows", lambda *_: [GrowthRow(2, 10.0, 0.0), GrowthRow(4, 15.0, 0.0)])
        run(tiny_scene, folder, report=lambda line: None, effort=EFFORT, only=["figures"])
    return folder


def test_every_figure_is_there_and_finite(measured: Path) -> None:
    content = json.loads((measured / "figures.json").read_text())
    assert content.keys() - {"run", "machine"} >= SPECS.keys() - NOT_ASKED
    for name in SPECS.keys() - NOT_ASKED:
        figure = content[name]
        assert (figure["limit"], figure["unit"]) == (SPECS[name].limit, SPECS[name].unit)
        assert figure["how"]
        if figure["value"] is None:
            assert ("no display in this test" if name in WINDOW else "left out") in figure["how"]
            continue
        assert math.isfinite(figure["value"]) and figure["value"] >= 0, name
        assert figure["met"] is (None if figure["limit"] is None else figure["value"] <= figure["limit"])
        spread = figure["spread"]
        assert spread["min"] <= spread["median"] <= spread["max"]
        assert figure["repetitions"] >= 1


def test_the_machine_and_the_run_are_told(measured: Path) -> None:
    content = json.loads((measured / "figures.json").read_text())
    assert content["run"]["resolution"] == [32, 24]
    machine = content["machine"]
    assert machine["cores"] >= 1 and machine["ram_gib"] > 0 and machine["cpu"]
    assert "OpenGL" in machine["renderer"]
    assert {"numpy", "numba", "embreex"} <= set(machine["versions"])
    assert len(machine["load_average"]) == len(machine["load_average_after"]) == 3


def test_plots_are_pictures_of_a_readable_size(measured: Path) -> None:
    for name in ("error_against_time", "error_against_memory", "error_against_frame_time"):
        with Image.open(measured / f"{name}.png") as picture:
            assert picture.width >= 1000 and picture.height >= 600
            assert len(picture.convert("RGB").getcolors(1 << 24) or []) > 20  # not one blank sheet
    assert (measured / "sweep.csv").read_text().startswith("study,lights,bands")


def test_a_part_alone_and_one_that_is_none(tiny_scene: str, tmp_path: Path) -> None:
    effort = replace(EFFORT, visibility=VisibilityEffort((Size(17, 50),), {"tiny": "shapes"}), textures=None)
    assert run(tiny_scene, tmp_path, report=lambda line: None, effort=effort, only=["visibility"]) == []
    assert {file.name for file in tmp_path.iterdir()} == {"visibility.csv", "visibility.md", "visibility.png"}
    with pytest.raises(InsituError, match="no part 'speed', expected one of settings, figures, visibility"):
        run(tiny_scene, tmp_path, only=["speed"])


@pytest.mark.window
def test_a_launch_tells_its_milestones_in_order(tiny_scene: str, tmp_path: Path) -> None:
    with open_screen() as screen:
        found = launch(screen, tiny_scene, tmp_path, "first_picture", 60.0)
    milestones = found.milestones
    assert 0 < milestones["first_frame"] <= milestones["scene"] <= milestones["first_picture"] < 60.0
    assert found.longest_block_s is not None and 0 < found.longest_block_s < 60.0


def test_a_program_that_ends_early_is_told_with_its_last_words(tmp_path: Path) -> None:
    screen = Screen("a test", {}, ("/bin/sh", "-c", "echo out of luck >&2; exit 3"))
    with pytest.raises(NotMeasured, match="status 3 before exact: out of luck"):
        launch(screen, "scene", tmp_path, "exact", 10.0)
