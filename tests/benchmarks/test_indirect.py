"""The figures of indirect light, from what the programs and the references say."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import benchmarks.indirect as indirect
from app.project.project import open_project
from benchmarks.figures import Figure, NotMeasured
from benchmarks.indirect import IndirectEffort, indirect_figures
from benchmarks.indirect_memory import GrowthRow
from benchmarks.indirect_representations import RepresentationRow as Compared
from benchmarks.peer import FIGURE as PEER
from benchmarks.references import masked_reference
from engine.precompute.direct.pipeline import Placement
from tests.pictures import write_exr

FOUND: dict[str, Any] = {
    "renderer": "a renderer",
    "resolution": [8, 6],
    "n_bounces": 4,
    "first_s": 2.5,
    "freeze_s": {"floor": [0.1, 0.2, 0.9], "wall": [0.3, 0.3, 0.3]},
    "freeze_whole_s": {"floor": [0.1, 0.2, 0.9], "wall": [1.3, 1.3, 1.3]},
    "edit_ms": {"floor": [10.0, 11.0, 90.0], "wall": [20.0, 21.0, 22.0]},
    "exact_ms": {"floor": [12.0], "wall": [25.0]},
    "memory_mb": 80.0,
}


@pytest.fixture
def found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Figure]:
    """Figures of programs that answer at once; the room's does not."""
    file = tmp_path / "pictures.npz"
    fine = np.full((6, 8, 3), 2.0)
    first, seen = fine.copy(), np.ones((6, 8), bool)
    first[3:] *= 0.8
    first[0], seen[0] = 1e6, False  # what shines does not count
    np.savez(file, first=first, fine=fine, seen=seen)

    def answer(name: str, *others: object) -> tuple[dict[str, Any], Path]:
        if name == "room":
            raise NotMeasured("no room")
        return FOUND, file

    monkeypatch.setattr(indirect, "measure_indirect", answer)
    monkeypatch.setattr(
        indirect, "memory_rows", lambda *arguments: iter([GrowthRow(2, 10.0, 0.0), GrowthRow(4, 15.0, 0.0)])
    )
    rows = [Compared("dense", 2, 4, 100, 10.0, 0.25, 0.5, 1e-7)]
    monkeypatch.setattr(indirect, "representation_rows", lambda *arguments: iter(rows))
    figures = indirect_figures(IndirectEffort(), 1, False, tmp_path, tmp_path, 10.0, lambda line: None)
    return {figure.name: figure for figure in figures}


def test_freezing_counts_the_slowest_object_by_its_median(found: dict[str, Figure]) -> None:
    assert found["freeze_s_cornell"].value == pytest.approx(0.3)  # medians 0.2 and 0.3
    assert found["freeze_s_room"].value is None and "no room" in found["freeze_s_room"].how


def test_edits_are_those_of_the_slowest_object(found: dict[str, Figure]) -> None:
    assert found["gi_edit_ms"].samples == (20.0, 21.0, 22.0) and "wall" in found["gi_edit_ms"].how


def test_memory_first_picture_and_its_error(found: dict[str, Figure], tmp_path: Path) -> None:
    assert (found["gi_memory_mb_cornell"].value, found["gi_first_s"].value) == (80.0, 2.5)
    # Three of five rows that count are a fifth too dark.
    assert found["gi_first_error"].value == pytest.approx(0.2 * np.sqrt(3 / 5))
    assert found["gi_memory_growth"].value == pytest.approx(0.75)
    assert (tmp_path / indirect.CSV).read_text().startswith("objects,")
    compared = (tmp_path / indirect.REPRESENTATIONS_CSV).read_text().splitlines()
    assert compared[0].startswith("representation,objects,") and compared[1] == "dense,2,4,100,10,0.25,0.5,1e-07"


def test_what_takes_long_is_left_out_of_a_quick_run(found: dict[str, Figure]) -> None:
    for name in ("gi_error_cornell", "gi_mean_teatray", PEER):
        assert found[name].value is None and "quick" in found[name].how


def test_references_that_are_absent_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(indirect, "reference_folder", lambda: None)
    figures = indirect._reference_figures("teatray")
    assert [figure.name for figure in figures] == ["gi_error_teatray", "gi_mean_teatray", "gi_error_8_teatray"]
    assert all(figure.value is None and "shared/reference" in figure.how for figure in figures)


def test_the_sign_of_a_mean_is_told_beside_its_size(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(indirect, "reference_folder", lambda: tmp_path)
    monkeypatch.setattr(indirect, "series_errors", lambda folder, name, series: indirect.Errors(0.02, -0.004))
    error, mean, _ = indirect._reference_figures("cornell")
    assert (error.value, mean.value, mean.parts["signed"]) == (0.02, 0.004, -0.004)


def test_normals_seen_edge_on_do_not_count(tmp_path: Path, tiny_scene: str) -> None:
    # Where they would lean away from the eye, the references are dark dots.
    hits = Placement(open_project(tiny_scene).scene).hits
    across = np.cross(hits.wo[7], hits.geometric_normal[7])
    normals = hits.normal.copy()
    normals[7] = across / np.linalg.norm(across)
    height, width = hits.object_image.shape
    write_exr(tmp_path / "tiny_1.exr", np.ones((height, width, 3), np.float32))
    Image.fromarray(np.full((height, width), 255, np.uint8)).save(tmp_path / "tiny_mask.png")
    assert masked_reference(tmp_path, "tiny", 1, hits)[1].all()
    mask = masked_reference(tmp_path, "tiny", 1, replace(hits, normal=normals))[1]
    assert np.flatnonzero(~mask).tolist() == [hits.pixel[7]]
