"""Visibility textures beside placed points: what an atlas keeps, and that both see the same in the end."""

from pathlib import Path

import numpy as np
import pytest

from app.project.project import open_project
from benchmarks.visibility_textures import (
    FILE,
    PLOT,
    Charts,
    TextureEffort,
    at_points,
    at_texels,
    measure,
    nearest_within,
    write_textures,
)
from engine.precompute.direct.pipeline import Placement
from engine.realtime.core.shading_points import shading_points
from tests.engine.realtime.conftest import SCENE


@pytest.fixture
def placement(tmp_path: Path) -> Placement:
    (tmp_path / "ball.toml").write_text(SCENE)
    return Placement(open_project(str(tmp_path / "ball.toml"), (24, 18)).scene)


def test_an_atlas_covers_all_triangles_once_and_has_as_many_texels_as_are_asked_for(placement: Placement) -> None:
    atlas, n_kept = Charts(placement.scene).atlas(4000)
    assert n_kept == pytest.approx(4000, rel=0.05) and atlas.kept().sum() == n_kept
    middles = atlas.uvs.mean(axis=1)
    found, shares = atlas.triangle_at(np.floor(middles).astype(np.intp))
    near = found >= 0  # tiny triangles may cover no texel's middle
    at = np.einsum("nk,nki->ni", shares[near], atlas.uvs[found[near]])
    np.testing.assert_allclose(at, np.floor(middles[near]) + 0.5, atol=1e-3)


def test_the_nearest_place_of_a_triangle_is_on_its_edges() -> None:
    corners = np.tile(np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]]), (4, 1, 1))
    outside = np.array([[1.0, -3.0], [2.0, 2.0], [-1.0, -1.0], [5.0, -1.0]])
    at = np.einsum("nk,nki->ni", nearest_within(corners, outside), corners)
    np.testing.assert_allclose(at, [[1, 0], [1, 1], [0, 0], [2, 0]], atol=1e-12)


def test_both_interpolate_between_places_about_the_pixel(placement: Placement) -> None:
    rows = np.arange(0, len(placement.hits.pixel), 7)
    pixels, position = placement.hits.pixel[rows], placement.hits.position[rows]
    points = shading_points(placement.scene, placement.caster, 1500)
    textures = at_texels(Charts(placement.scene), 4000, pixels, placement)
    size = np.ptp(placement.scene.vertices, axis=0).max()
    for places in (at_points(placement.scene, points, pixels, placement.scene.resolution), textures):
        np.testing.assert_allclose(places.weights.sum(axis=1), 1.0, atol=1e-5)
        mean = np.einsum("nk,nki->ni", places.weights, places.lifted)
        assert np.quantile(np.linalg.norm(mean - position, axis=1), 0.9) < 0.01 * size


def test_more_places_see_better_and_the_table_is_written(tmp_path: Path, placement: Placement) -> None:
    effort = TextureEffort((str(tmp_path / "ball.toml"),), (200, 9000), 40, (24, 18))
    rows = list(measure(effort.scenes[0], effort))
    assert [row.way for row in rows] == 2 * ["placed points", "visibility textures"]
    for few, many in zip(rows[:2], rows[2:], strict=True):
        assert many.n_kept > 1.5 * few.n_kept and many.visibility < few.visibility < 0.2
    assert rows[1].n_kept == pytest.approx(rows[0].n_kept, rel=0.15)
    lines: list[str] = []
    write_textures(tmp_path, effort, lines.append)
    assert len(lines) == 4 and (tmp_path / FILE).read_text().count("\n") == 5
    assert (tmp_path / PLOT).read_bytes()[:4] == b"\x89PNG"
