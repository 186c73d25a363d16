"""Memory of indirect light by the number of objects: one room, cut differently."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.measure.subject import open_subject
from benchmarks.indirect_memory import GrowthRow, cut, growth_figure, memory_of, write_rows
from engine.scene.scene_loader import Scene
from tests.quick_indirect import light_quickly


@pytest.fixture(scope="module")
def room() -> Scene:
    return open_subject("cornell", (24, 24)).scene


@pytest.mark.parametrize("n_objects", [1, 2, 7])
def test_a_cut_room_is_the_same_room(room: Scene, n_objects: int) -> None:
    parts = cut(room, n_objects)
    assert len(parts.description.objects) == n_objects + int(room.emitters.sum())
    assert len({described.name for described in parts.description.objects}) == len(parts.description.objects)
    assert sorted(map(tuple, parts.triangles)) == sorted(map(tuple, room.triangles))
    for i, (begin, end) in enumerate(parts.triangle_ranges):
        assert begin < end and (parts.object_of_triangle[begin:end] == i).all()

    def shining(scene: Scene) -> set[tuple[int, ...]]:
        return {tuple(t) for t in scene.triangles[scene.emitters[scene.object_of_triangle]]}

    assert shining(parts) == shining(room)


@pytest.mark.slow
def test_memory_is_counted_and_hardly_grows(room: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    light_quickly(monkeypatch)
    few, many = (memory_of(cut(room, n), n) for n in (2, 8))
    assert few.kept_mb > 1.0 and few.frozen_mb > 0.0  # the table of cells alone takes more than that
    assert growth_figure([few, many], 24).value < 0.5


def test_growth_is_told_against_linear_growth(tmp_path: Path) -> None:
    rows = [GrowthRow(2, 10.0, 2.0), GrowthRow(4, 20.0, 4.0), GrowthRow(8, 80.0, 16.0), GrowthRow(12, 12.0, 0.0)]
    figure = growth_figure(rows, 24)
    # 24 MB for twice 2 objects that take 12 MB is linear, 96 for four times as many twice as much.
    np.testing.assert_allclose(figure.samples, [1.0, 2.0, 1.0 / 6.0])
    assert figure.value == pytest.approx(2.0) and figure.met is False
    write_rows(tmp_path / "rows.csv", rows[:2])
    assert (tmp_path / "rows.csv").read_text() == "objects,kept_mb,frozen_mb\n2,10,2\n4,20,4\n"
