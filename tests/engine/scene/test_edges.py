"""Shading points at edges: shares by area, none inside of objects, and unchanged points at the pixels' centres."""

import math

import numpy as np
import pytest

from engine.scene.edges import nearest_centres, ray_offsets
from engine.scene.primary_hits import PrimaryHits, trace_primary
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import load_scene
from tests.engine.scene.test_primary_hits import ALL, SPHERE, check_invariants
from tests.scene_text import camera, placed, scaled

SIZE = 32, 24


FLOOR = placed("floor", "quad", scaled((20, 20, 1), (0, 0, -1)))


def half_plane(slope: float, shift: float, rest: str = "") -> str:
    """A large card whose edge passes the picture's middle at `shift` and leans by an angle."""
    c, s = math.cos(slope), math.sin(slope)
    return placed(
        "card", "quad", f"{20 * c},{-20 * s},0,{10 * c + shift}, {20 * s},{20 * c},0,{10 * s}, 0,0,1,0, 0,0,0,1", rest
    )


def seen(path, n_edge_rays: int) -> PrimaryHits:
    scene = load_scene(path)
    hits = trace_primary(scene, RayCaster(scene.vertices, scene.triangles), n_edge_rays=n_edge_rays)
    check_invariants(scene, hits)
    return hits


def covered(slope: float, shift: float, size: tuple[int, int] = SIZE, fine: int = 64) -> np.ndarray:
    """The share (H, W) of each pixel on the card's side of its edge, seen from (0, 0, 3) with an angle of 40°."""
    (width, height), half = size, 3 * math.tan(math.radians(20))
    x = ((np.arange(width * fine) + 0.5) / (width * fine) * 2 - 1) * half * width / height
    y = (1 - (np.arange(height * fine) + 0.5) / (height * fine) * 2) * half
    inside = (x - shift) * math.cos(slope) + y[:, None] * math.sin(slope) > 0.0
    return inside.reshape(height, fine, width, fine).mean(axis=(1, 3))


@pytest.mark.parametrize("n_rays", [4, 8, 16])
def test_the_rays_of_a_pixel_are_spread_evenly(n_rays: int) -> None:
    offsets = ray_offsets(n_rays)
    assert offsets.shape == (n_rays, 2) and np.abs(offsets).max() < 0.5 and offsets.any(axis=1).all()
    assert np.abs(offsets.mean(axis=0)).max() < 1e-6
    for axis in offsets.T:  # one in each column and each row of an n × n grid
        assert sorted(np.floor((axis + 0.5) * n_rays).astype(int)) == list(range(n_rays))


@pytest.mark.parametrize(("n_rays", "off"), [(4, 0.13), (8, 0.08), (16, 0.05)])
@pytest.mark.parametrize("before", ["", FLOOR])
def test_a_card_has_the_share_of_a_pixel_that_it_covers(scene_file, n_rays: int, off: float, before: str) -> None:
    slope, shift = 0.3, 0.013
    hits = seen(scene_file(before + half_plane(slope, shift), camera((0, 0, 3), 40, SIZE)), n_rays)
    mine = hits.objects == len(hits.object_ranges) - 1
    share = np.bincount(hits.pixel[mine], hits.share[mine], SIZE[0] * SIZE[1]).reshape(SIZE[::-1])
    expected = covered(slope, shift)
    edge = (expected > 0.0) & (expected < 1.0)
    assert edge.sum() > 20 and (share[~edge] == expected[~edge]).all()
    assert np.sqrt(np.mean((share - expected)[edge] ** 2)) < off
    # Of two objects in a pixel each has one point, however many rays said where the edge is.
    assert np.bincount(hits.pixel[mine]).max() == 1
    assert len(hits.pixel) <= (1 + bool(before)) * edge.sum() + np.round(
        share.sum() if not before else SIZE[0] * SIZE[1]
    )


def test_lamps_and_background_share_pixels_too(scene_file) -> None:
    card = half_plane(0.3, 0.013, "emission = [4, 2, 1]\n")
    hits = seen(scene_file(card, camera((0, 0, 3), 40, SIZE)), 16)
    expected = covered(0.3, 0.013)
    np.testing.assert_allclose(hits.emission_image, (1.0 - hits.open_image)[..., None] * [4, 2, 1], rtol=1e-6)
    assert np.abs(1.0 - hits.open_image - expected).max() < 0.13
    assert (np.bincount(hits.lamps.pixel, hits.lamps.share, expected.size) == 1.0 - hits.open_image.ravel()).all()


def test_edges_add_to_what_the_centres_see(scene_file) -> None:
    lamp = placed("lamp", "quad", scaled(1, (1, 1, 0)), "emission = [3, 2, 1]\n")
    path = scene_file(FLOOR + SPHERE + lamp, camera((0, 0, 3), 40, (64, 48)))
    plain, hits = seen(path, 0), seen(path, 8)
    centred = np.flatnonzero(hits.is_centred)
    assert plain.is_centred.all() and (plain.share == 1.0).all()
    assert (hits.pixel[centred] == plain.pixel).all() and (hits.object_image == plain.object_image).all()
    for name in ALL:
        np.testing.assert_array_equal(getattr(hits, name)[centred], getattr(plain, name), name)
    # Inside of objects nothing is added: a pixel with several points has neighbours that differ.
    ids = np.pad(plain.object_image, 1, mode="edge")
    around = [ids[1 + dy : 49 + dy, 1 + dx : 65 + dx] for dy in (-1, 0, 1) for dx in (-1, 0, 1)]
    differs = np.any([each != plain.object_image for each in around], axis=0).ravel()
    ball = plain.object_image.ravel() == 1
    several = np.bincount(hits.pixel, minlength=differs.size) > 1
    assert several[differs].mean() > 0.25 and not (several & ~differs & ~ball).any()
    assert len(hits.pixel) < 1.25 * len(plain.pixel)


def test_narrow_rims_are_seen_from_several_sides_within_a_pixel(scene_file) -> None:
    """Of a ball four pixels wide the normals of a pixel's points differ, and their mean is that of the ball there."""
    path = scene_file(SPHERE, camera((0, 0, 30), 20, SIZE))
    few, many = seen(path, 0), seen(path, 16)
    scene = load_scene(path, (SIZE[0] * 16, SIZE[1] * 16))
    fine = trace_primary(scene, RayCaster(scene.vertices, scene.triangles))
    lines, columns = np.divmod(fine.pixel, SIZE[0] * 16)
    own = lines // 16 * SIZE[0] + columns // 16

    def means(pixel, share, normal) -> np.ndarray:
        return np.stack([np.bincount(pixel, share * axis, SIZE[0] * SIZE[1]) for axis in normal.T], axis=1)

    truth = means(own, np.full(len(own), 1 / 256), fine.normal)
    off = [np.linalg.norm(means(h.pixel, h.share, h.normal) - truth) for h in (few, many)]
    assert off[1] < 0.35 * off[0]


def test_a_point_beside_the_centre_is_near_one_on_its_surface(scene_file) -> None:
    hits = seen(scene_file(FLOOR + SPHERE, camera((0.3, 1.2, 3), 40, SIZE)), 16)
    rows, nearest = nearest_centres(hits, hits.normal, np.array([0.5, 0.9]))
    assert (rows == np.flatnonzero(~hits.is_centred)).all()
    found = nearest >= 0
    mine, theirs = rows[found], nearest[found]
    assert found.mean() > 0.6 and hits.is_centred[theirs].all() and (hits.objects[mine] == hits.objects[theirs]).all()
    assert np.abs(hits.places[mine] - hits.places[theirs]).max() < 1.5
    alike = np.einsum("nk,nk->n", hits.normal[mine], hits.normal[theirs])
    assert (alike >= np.array([0.5, 0.9])[hits.objects[mine]] - 1e-6).all()
    # The nearest of all that may: by brute force.
    for row, chosen in zip(rows[:40], nearest[:40], strict=True):
        others = np.flatnonzero(hits.is_centred & (hits.objects == hits.objects[row]))
        near = others[
            (np.abs(np.divmod(hits.pixel[others], SIZE[0])[0] - hits.pixel[row] // SIZE[0]) <= 1)
            & (np.abs(hits.pixel[others] % SIZE[0] - hits.pixel[row] % SIZE[0]) <= 1)
        ]
        step = hits.position[near] - hits.position[row]
        length = np.linalg.norm(step, axis=1)
        least = [0.5, 0.9][hits.objects[row]]
        allowed = (
            (hits.normal[near] @ hits.normal[row] >= least)
            & (np.abs(step @ hits.normal[row]) <= 0.259 * length)
            & (np.abs(np.einsum("nk,nk->n", step, hits.normal[near])) <= 0.259 * length)
        )
        near = near[allowed]
        far = np.linalg.norm(hits.places[near] - hits.places[row], axis=1)
        assert (
            (chosen == -1)
            if not len(near)
            else far.min() == pytest.approx(np.linalg.norm(hits.places[chosen] - hits.places[row]), abs=1e-5)
        )
