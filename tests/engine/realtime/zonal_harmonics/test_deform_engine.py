"""Pictures of bending meshes: what is at rest, what is turned, what collapses; and the triangles of a pixel."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from engine.core.camera import centre_directions
from engine.core.generators import run_to_end
from engine.light.environment import Environment, constant_environment
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.core.raster import RasterTriangles, draw
from engine.realtime.zonal_harmonics.deform_engine import Deform, finish_deform
from engine.realtime.zonal_harmonics.desired_transfers import FEW_RAYS
from engine.realtime.zonal_harmonics.object_transfer import N_LOBES, ORDER
from engine.realtime.zonal_harmonics.pose import Deformation
from engine.realtime.zonal_harmonics.shading import shade
from engine.realtime.zonal_harmonics.transfer import add_bounces, rotate_transfer, simulate_shadows
from engine.realtime.zonal_harmonics.zonal import fit
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene, load_scene
from engine.scene.surface_kinds import DeformSurface, Subsurface
from tests.rooms import solid
from tests.scene_text import camera, environment, facing_up, placed

SIZE = (48, 36)
MATT = make_layer(MODELS["lambert"], {"albedo": (0.6, 0.5, 0.4)})


def sky(seed: int = 2) -> SkyState:
    image = np.random.default_rng(seed).uniform(0.0, 2.0, (16, 32, 3)).astype(np.float32)
    return SkyState(Environment(image, "noise"), 30.0)


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    path = Path(tmp_path_factory.mktemp("scene")) / "two.toml"
    path.write_text(
        camera((1.5, 1.2, 3.0), 40, SIZE, (0.3, 0, 0))
        + environment()
        + placed("box", "cube")
        + placed("floor", "quad", facing_up(9, (0, -0.5, 0)))
    )
    return load_scene(path)


@pytest.fixture(scope="module")
def deform(scene: Scene) -> Deform:
    made = Deform(scene, n_points=400, n_rays=64)
    made.set_light(sky())
    made.set_layers({0: (MATT,), 1: (MATT,)})
    return finish_deform(made)


def test_no_amount_is_the_picture_at_rest(deform: Deform, scene: Scene) -> None:
    eye = scene.description.camera
    at_rest = deform.draw(eye, SIZE)
    deform.draw(eye, SIZE, (("box", (Deformation("bend", 50.0),)),))
    for kind in ("bend", "twist", "taper", "bulge", "wave"):
        assert np.array_equal(deform.draw(eye, SIZE, (("box", (Deformation(kind, 0.0),)),)), at_rest)


def test_a_white_sky_over_a_lone_white_floor_is_white(scene: Scene) -> None:
    made = Deform(scene, n_points=0, n_rays=64)
    made.set_light(SkyState(constant_environment((1.0, 1.0, 1.0))))
    made.set_layers({1: (make_layer(MODELS["lambert"], {"albedo": (1.0, 1.0, 1.0)}),)})
    made.set_bending(["floor", "box"])  # none shades the other
    picture = finish_deform(made).draw(scene.description.camera, SIZE)
    assert picture[-1] == pytest.approx(1.0, abs=2e-3)


@pytest.mark.parametrize(
    "row",
    [
        (Deformation("bend", 720.0),),
        (Deformation("taper", -1.0), Deformation("bulge", -1.0)),
        (Deformation("twist", -1440.0, "x"),),
    ],
)
def test_what_is_bent_too_far_is_finite(deform: Deform, scene: Scene, row: tuple[Deformation, ...]) -> None:
    picture = deform.draw(scene.description.camera, SIZE, (("box", row), ("floor", row)), "rest")
    assert np.isfinite(picture).all() and picture.min() >= 0.0


def test_at_rest_it_is_the_transfer_to_the_error_of_the_fit(deform: Deform) -> None:
    points = deform._points
    assert points is not None and deform._found is not None and deform._sky is not None
    mesh = points.mesh(0, (0, 1))
    vectors = run_to_end(simulate_shadows(mesh, points.caster((0, 1)), ORDER, 64))
    vectors = run_to_end(add_bounces(mesh, points.caster((0, 1)), vectors, 0.5, 2))
    error = run_to_end(fit(vectors, N_LOBES)).errors
    light = np.asarray(deform._sky.bands.harmonics, np.float64)
    truth = rotate_transfer(vectors, mesh.frames.transpose(0, 2, 1)) @ light
    found = shade(deform._found.lobes, points.frames, deform._sky.bands)[points.points_of(0)]
    off = np.sqrt(((found - truth) ** 2).mean()) / truth.mean()
    assert off < 2.0 * np.sqrt((error**2).sum() / (vectors**2).sum())


def test_an_object_that_bends_casts_no_shadow_on_others(deform: Deform, scene: Scene) -> None:
    made = Deform(scene, n_points=400, n_rays=64)
    made.set_light(sky())
    made.set_layers({1: (MATT,)})
    shaded = finish_deform(made).draw(scene.description.camera, SIZE)
    made.set_bending(["box"])
    assert not made.is_done
    alone = finish_deform(made).draw(scene.description.camera, SIZE)
    floor = made._points.points_of(1)
    open_ = made._found.lobes.low[floor, 0]
    assert open_ == pytest.approx(math.sqrt(1.0 / (4.0 * math.pi)), rel=1e-3)
    assert alone.mean() > shaded.mean()


def test_the_shadow_of_what_begins_to_bend_goes_before_anything_else_is_made(scene: Scene) -> None:
    """Roughly and at once: no picture of the floor that is drawn after the first piece of work has it."""
    made = Deform(scene, n_points=400, n_rays=500)
    made.set_light(sky())
    made.set_layers({0: (MATT,), 1: (MATT,)})
    made.set_bounces(1)  # what the box reflects onto the floor stays
    eye = scene.description.camera
    stale = finish_deform(made).draw(eye, SIZE)
    made.set_bending(["box"])
    before = made.version
    work = made.work()
    while made.version == before:
        next(work)
    roughly, floor = made.draw(eye, SIZE), seen(made, 1)
    assert made._found.known[1].casters == (1,) and made._found.known[1].n_rays == FEW_RAYS and 0 in made._found.known
    truth = finish_deform(made).draw(eye, SIZE)
    off, was_off = (np.sqrt(((each - truth)[floor] ** 2).mean()) for each in (roughly, stale))
    assert off < 0.2 * was_off


def test_nothing_opens_between_coarse_and_fine_triangles_that_bend(deform: Deform, scene: Scene) -> None:
    """Each edge of a closed box has a triangle on either side, as they are drawn."""
    points = deform._points
    assert points is not None
    mine = points.surface.corners[points.surface.i_object == 0]
    assert len(mine) > 50  # of 12
    _, place = np.unique(np.round(points.rest_geometry(0).positions, 6), axis=0, return_inverse=True)
    corners = place.ravel()[np.searchsorted(points.points_of(0), mine)]
    edges = np.sort(np.concatenate([corners[:, (0, 1)], corners[:, (1, 2)], corners[:, (2, 0)]]), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()


def test_rays_know_of_what_shades_alone_and_objects_share_them(deform: Deform) -> None:
    points = deform._points
    assert points is not None
    both, floor = points.caster((0, 1)), (points.surface.i_object == 1).sum()
    assert points.caster((0, 1)) is both and points.caster((1,)) is not both
    assert len(points.mesh(1, (1,)).corners) == floor < len(points.mesh(1, (0, 1)).corners)


def test_light_that_goes_through_an_object_leaves_the_others_as_they_are(scene: Scene) -> None:
    """Its points are others from then on, but what is seen stays until there is better."""
    made = Deform(scene, n_points=400, n_rays=500)
    made.set_light(sky())
    made.set_layers({0: (MATT,), 1: (MATT,)})
    eye = scene.description.camera
    before, points, known = finish_deform(made).draw(eye, SIZE), made._points, made._found.known[1]
    made.set_surfaces((("box", DeformSurface(subsurface=Subsurface(scattering=20.0))),))
    assert not made.is_done
    work = made.work()
    while made._points is points:
        next(work)
    assert len(made._points.points_of(0)) != len(points.points_of(0)) and made._points.has_same_points(points, 1)
    stays, floor = made.draw(eye, SIZE), seen(made, 1)
    assert np.array_equal(stays[floor], before[floor]) and stays == pytest.approx(before, abs=0.25)
    for _ in work:
        assert made._found.known[1] is known  # nothing is sought of it anew
    assert not np.allclose(made.draw(eye, SIZE)[~floor], stays[~floor], atol=0.02)
    made.set_surfaces(())
    assert np.array_equal(finish_deform(made).draw(eye, SIZE)[floor], before[floor])


def seen(made: Deform, i: int) -> np.ndarray:
    """Which pixels (H, W) show an object at rest."""
    camera = made.scene.description.camera
    found = draw(made._points.surface, made._points.places, camera, np.array(camera.position), SIZE).found
    return (found >= 0) & (made._points.surface.i_object[found] == i)


def test_a_pixel_shows_what_a_ray_meets(scene: Scene) -> None:
    eye = scene.description.camera
    n = len(scene.triangles)
    surface = RasterTriangles(scene.triangles, np.full((n, 2, 3), 0, np.int32), np.zeros(n, np.int32))
    size = (160, 120)
    for place in (eye, eye.model_copy(update={"position": (0.0, -0.45, 4.0)})):  # the floor reaches behind the second
        drawn = draw(surface, scene.vertices, place, np.array(place.position), size)
        rays = centre_directions(place, size).reshape(-1, 3)
        origins = np.broadcast_to(np.array(place.position, np.float32), rays.shape)
        met = RayCaster(scene.vertices, scene.triangles).intersect(origins, rays)
        same = drawn.found.ravel() == met.triangle
        assert same.mean() > 0.99
        rows, columns = np.divmod(np.flatnonzero(same & (met.triangle >= 0)), size[0])
        weights = drawn.weights(rows, columns)
        expected = np.stack([1 - met.u - met.v, met.u, met.v], axis=1)[rows * size[0] + columns]
        assert weights == pytest.approx(expected, abs=2e-3)


def test_lost_light_is_reported(deform: Deform, scene: Scene) -> None:
    made = Deform(scene, n_points=0, n_rays=16)
    layers = {
        0: (make_layer(MODELS["rough_conductor"], {"alpha": 0.05}),),
        1: (make_layer(MODELS["rough_conductor"], {"alpha": 0.8}),),
    }
    made.set_layers(layers)
    assert made.lost_shares[0] > 0.8 > 0.2 > made.lost_shares[1] > 0.0 and deform.lost_shares == {}


def test_drawing_before_anything_is_ready_is_refused(scene: Scene) -> None:
    with pytest.raises(ValueError, match="nothing is ready"):
        Deform(scene).draw(scene.description.camera, SIZE)


def test_no_pixel_is_nan_where_the_camera_is_exactly_on_a_vertex(scene: Scene) -> None:
    gold = make_layer(MODELS["rough_conductor"], {"alpha": 0.4})
    made = Deform(scene, n_points=100, n_rays=16)
    made.set_light(sky())
    made.set_layers({0: (gold,), 1: (MATT,)})
    finish_deform(made)
    for corner in ((0.5, 0.5, 0.5), (-0.5, 0.5, 0.5)):
        update = {"position": corner, "target": (0.0, 0.4, 0.0)}
        for quality in ("moving", "rest"):
            picture = made.draw(scene.description.camera.model_copy(update=update), SIZE, quality=quality)
            assert np.isfinite(picture).all()


def test_a_block_wound_inwards_is_as_bright_as_one_wound_outwards(tmp_path: Path) -> None:
    pictures = []
    for inward in (False, True):
        made = Deform(load_scene(solid(tmp_path / str(inward), inward)), n_points=200, n_rays=64)
        made.set_light(SkyState(constant_environment((1.0, 1.0, 1.0))))
        made.set_layers({0: (MATT,), 1: (MATT,)})
        pictures.append(finish_deform(made).draw(made.scene.description.camera, (24, 18)))
    outward, inward = pictures
    assert outward.mean() > 0.3
    np.testing.assert_allclose(inward, outward, rtol=0.05, atol=0.02)
