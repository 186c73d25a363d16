"""What a picture of Orbit's sees of images: filtered over the pixel, as in Placement."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engine.material import MODELS
from engine.material.layer import make_layer
from engine.material.layer_maps import LayerMaps
from engine.precompute.direct.pipeline import Placement
from engine.realtime.core import view_samples
from engine.realtime.core.shading_points import shading_points
from engine.realtime.core.view_samples import PointMesh, factors, footprints_of
from engine.scene.description import parse_description
from engine.scene.map_sampler import MapFactors
from engine.scene.scene_loader import build_scene
from engine.scene.surface_uvs import pixel_footprints
from tests.engine.realtime.conftest import SCENE

SIZE = 48, 36


@pytest.mark.parametrize("quality", ["rest", "moving"])
def test_images_are_filtered_as_in_placement(tmp_path: Path, quality: str) -> None:
    # A chequerboard finer than the pixels of a floor that is seen at a slant.
    board = (np.indices((64, 64)).sum(axis=0) % 2 * 255).astype(np.uint8)
    Image.fromarray(board).save(tmp_path / "board.png")
    scene = build_scene(parse_description(tomllib.loads(SCENE), "ball"), tmp_path / "ball.toml", SIZE)
    layer = make_layer(MODELS["lambert"]).replace(maps=LayerMaps(texture="board.png", texture_scale=(3.0, 2.0)))
    placement = Placement(scene)
    points = shading_points(scene, placement.caster, 300)
    seen = PointMesh(scene, points).sample_view(scene.description.camera, SIZE)
    which = seen.of(0)
    found = factors(seen, which, scene, 0, [layer], quality)[0]
    begin, end = placement.hits.object_ranges[0]
    expected = MapFactors(scene, {0: [layer]}).at_primary_hits(placement.caster, placement.hits)[begin:end, 0]
    np.testing.assert_array_equal(seen.pixel[which], placement.hits.pixel[begin:end])
    assert np.abs(found - expected).mean() < (0.006 if quality == "rest" else 0.02)
    assert expected.std() < 0.15  # one look-up a pixel would give 0 or 1, of 0.5


def test_footprints_are_those_of_the_neighbouring_pixels_rays() -> None:
    scene = build_scene(parse_description(tomllib.loads(SCENE), "ball"), Path("ball.toml"), SIZE)
    points = shading_points(scene, Placement(scene).caster, 300)
    seen = PointMesh(scene, points).sample_view(scene.description.camera, SIZE)
    for i_object in range(len(scene.smooth)):
        which = seen.of(i_object)
        rows, columns = np.divmod(seen.pixel[which], SIZE[0])
        middles, hits = np.stack([columns, rows], axis=1) + 0.5, seen.in_scene(which)
        uv, left, up = footprints_of(seen, which, scene, i_object)
        # The twin asks the pixel to the right and the one below of a place.
        np.testing.assert_allclose(uv, pixel_footprints(scene, hits, middles, SIZE)[0], atol=1e-5)
        np.testing.assert_allclose(left, pixel_footprints(scene, hits, middles - (2.0, 0.0), SIZE)[1], 2e-3, 2e-4)
        np.testing.assert_allclose(up, pixel_footprints(scene, hits, middles - (0.0, 2.0), SIZE)[2], 2e-3, 2e-4)


def test_rays_at_a_silhouette_that_meet_one_surface_share_a_sample() -> None:
    scene = build_scene(parse_description(tomllib.loads(SCENE), "ball"), Path("ball.toml"), SIZE)
    mesh, camera = PointMesh(scene, shading_points(scene, Placement(scene).caster, 300)), scene.description.camera
    every, grouped = mesh.sample_view(camera, SIZE, 4), mesh.sample_view(camera, SIZE, 4, is_grouped=True)
    # In each pixel each object, and the background, covers as much as by single rays; half of these are left or less.
    n_objects, covered = len(scene.smooth) + 1, []
    for seen in (every, grouped):
        place = seen.pixel * n_objects + seen.samples.i_object + 1
        covered.append(np.bincount(place, seen.share, SIZE[0] * SIZE[1] * n_objects))
    np.testing.assert_allclose(covered[1], covered[0], atol=1e-6)
    reflecting = [int(((seen.share < 1.0) & (seen.samples.corners[:, 0] >= 0)).sum()) for seen in (every, grouped)]
    assert 0 < 2 * reflecting[1] < reflecting[0]


@pytest.mark.parametrize("position", [None, (0.0, 0.02, 1.5)])
def test_triangles_that_are_drawn_are_those_that_rays_meet(
    monkeypatch: pytest.MonkeyPatch, position: tuple[float, float, float] | None
) -> None:
    """Also from just above the floor, which then extends behind the camera."""
    scene = build_scene(parse_description(tomllib.loads(SCENE), "ball"), Path("ball.toml"), SIZE)
    points, camera = shading_points(scene, Placement(scene).caster, 300), scene.description.camera
    camera = camera if position is None else camera.model_copy(update={"position": position})
    drawn = PointMesh(scene, points).sample_view(camera, (160, 120))
    assert len(points.triangles) <= view_samples._TRIANGLES_A_PIXEL * 160 * 120
    monkeypatch.setattr(view_samples, "_TRIANGLES_A_PIXEL", 0)
    traced = PointMesh(scene, points).sample_view(camera, (160, 120))
    same = drawn.found[0] == traced.found[0]
    assert same.mean() > 0.999 and (drawn.found[0] >= 0).any() and (drawn.found[0] < 0).any()
    np.testing.assert_array_equal(drawn.samples.wo, traced.samples.wo)
    met = np.flatnonzero((drawn.found[0] >= 0) & (traced.found[0] >= 0))
    distance = np.linalg.norm(traced.places(met) - traced.camera_position, axis=1)
    apart = np.linalg.norm(drawn.places(met) - traced.places(met), axis=1)
    assert (apart < 1e-4 * distance).mean() > 0.999  # single precision, at a slant
