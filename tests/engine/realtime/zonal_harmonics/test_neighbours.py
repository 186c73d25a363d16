"""Light between objects: closed forms of a bounce, of what is around an object that bends, and of lamps; and paths."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import trimesh

from engine.light.emitters import emitter_tree
from engine.light.environment import constant_environment
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.stills import PathReference
from engine.realtime.zonal_harmonics.deform_engine import Deform, finish_deform
from engine.realtime.zonal_harmonics.picture_renderer import Quality
from engine.realtime.zonal_harmonics.scene_lamps import _bright_centres
from engine.scene.scene_loader import load_scene
from tests.engine.realtime.zonal_harmonics.test_deform_engine import SIZE, seen
from tests.scene_text import camera, environment, facing_down, facing_up, placed, scaled

ALBEDO = 0.6
GREY = make_layer(MODELS["lambert"], {"albedo": (ALBEDO,) * 3})
WHITE_SKY = SkyState(constant_environment((1.0, 1.0, 1.0)))
ABOVE = camera((0.0, 1.0, 3.0), 40, SIZE)
FLOOR = placed("floor", "quad", facing_up(40))
LEAF = placed("leaf", "quad", facing_down(0.2, (0, 1.0, 0)))
LAMP = "emission = [5, 4, 3]\n"


def made(
    folder: Path,
    text: str,
    sky: SkyState = WHITE_SKY,
    bends: tuple[str, ...] = (),
    n_bounces: int = 2,
    n_points: int = 300,
) -> Deform:
    (folder / "scene.toml").write_text(ABOVE + environment() + text)
    deform = Deform(load_scene(folder / "scene.toml"), n_points=n_points, n_rays=500)
    deform.set_light(sky)
    deform.set_layers(dict.fromkeys(np.flatnonzero(deform.scene.reflecting).tolist(), (GREY,)))
    deform.set_bending(bends)
    deform.set_bounces(n_bounces)
    return finish_deform(deform)


def white(deform: Deform, name: str, quality: Quality = "moving") -> np.ndarray:
    """Radiance of an object's white points at rest (P, 3), all on its front."""
    deform.draw(deform.scene.description.camera, SIZE, (), quality)
    assert deform._pictures is not None and deform._pictures._white is not None
    return deform._pictures._white[1].white[front(deform, name)]


def front(deform: Deform, name: str) -> np.ndarray:
    """The points on an object's front."""
    points, i = deform._points, deform.scene.object_index(name)
    assert points is not None
    return np.unique(points.surface.sides[points.surface.i_object == i, 0])


@pytest.mark.parametrize("varies", [True, False])
def test_a_part_of_a_lamp_is_where_the_centre_of_its_light_is(varies: bool) -> None:
    # Radiance x on one triangle of a square and y on the other. On a triangle with corners p_i the mean of f p is
    # (sum f_i p_i + sum f sum p) / 12 for linear f; of a sixteenth in each direction a quarter, so that its centre
    # misses 1/16 of what the centre of light is off the centre.
    square = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], float)

    def grey(parts: np.ndarray, roots: np.ndarray) -> np.ndarray:
        return np.repeat(parts.mean(axis=1)[np.arange(len(parts)), roots][:, None], 3, axis=1)

    varying = grey if varies else None
    tree = emitter_tree(square, grey(square, np.arange(2)), 24, varying=varying)
    corners, owner = tree.leaves.corners.astype(np.float64), tree.leaves.owner
    f, middle = corners[np.arange(len(corners)), :, owner], corners.mean(axis=1)
    of_products = (np.einsum("ni,nik->nk", f, corners) + f.sum(axis=1)[:, None] * corners.sum(axis=1)) / 12.0
    off = of_products / f.mean(axis=1)[:, None] - middle
    assert len(corners) == 24 and set(owner) == {0, 1} and np.abs(off).max() > 0.01
    np.testing.assert_allclose(_bright_centres(tree, varying), middle + 15 / 16 * off * varies, atol=1e-6)


def places(deform: Deform, name: str) -> np.ndarray:
    """Where these are (P, 3), in the file's coordinates."""
    assert deform._points is not None
    return deform._points.places[front(deform, name)] + deform.scene.origin


@pytest.mark.parametrize("bends", [(), ("leaf",)])
def test_the_underside_of_a_leaf_is_lit_by_the_floor_alone(tmp_path: Path, bends: tuple[str, ...]) -> None:
    """A floor that is wide sends its albedo under a white sky, whether the leaf rests or bends; else nothing."""
    assert white(made(tmp_path, FLOOR + LEAF, bends=bends), "leaf") == pytest.approx(ALBEDO, abs=0.03)
    assert white(made(tmp_path, FLOOR + LEAF, bends=bends, n_bounces=1), "leaf") == pytest.approx(0.0, abs=0.03)


@pytest.mark.parametrize("bends", [(), ("leaf",)])
def test_a_lamp_lights_what_rests_and_what_bends(tmp_path: Path, bends: tuple[str, ...]) -> None:
    """Facing a lamp of side s at distance d, far away: L s² / (π d²); on its other side and behind a board nothing."""
    lamp = placed("lamp", "quad", facing_up(0.2, (0, -1.0, 0)), LAMP)
    expected = np.array([5.0, 4.0, 3.0]) * 0.04 / (math.pi * 4.0)
    dark = SkyState(None)
    found = white(made(tmp_path, LEAF + lamp, dark, bends), "leaf")
    assert found == pytest.approx(np.broadcast_to(expected, found.shape), rel=0.05)
    board = placed("board", "quad", facing_up(1.0, (0, 0, 0)))
    assert white(made(tmp_path, LEAF + lamp + board, dark, bends, 1), "leaf") == pytest.approx(0.0, abs=1e-6)
    turned = placed("lamp", "quad", facing_down(0.2, (0, -1.0, 0)), LAMP)
    assert white(made(tmp_path, LEAF + turned, dark, bends), "leaf") == pytest.approx(0.0, abs=1e-6)


def test_a_near_lamp_lights_each_place_of_what_bends(tmp_path: Path) -> None:
    """L s² cos cos / (π d²) at each place, at rest by rays and in motion by lobes."""
    lamp = placed("lamp", "quad", facing_up(0.05, (0.3, 0.5, 0.1)), LAMP)
    leaf = placed("leaf", "quad", facing_down(1.0, (0, 1.0, 0)))
    deform = made(tmp_path, leaf + lamp, SkyState(None), ("leaf",))
    away = places(deform, "leaf") - (0.3, 0.5, 0.1)
    # Both cosines are height over distance, which is a half and more: the lamp is a tenth of that wide.
    expected = np.outer(0.05**2 * away[:, 1] ** 2 / (math.pi * (away**2).sum(axis=1) ** 2), (5.0, 4.0, 3.0))
    assert expected[:, 0].max() > 5.0 * expected[:, 0].min()
    assert white(deform, "leaf", "rest") == pytest.approx(expected, rel=0.02)
    assert white(deform, "leaf") == pytest.approx(expected, rel=0.03)


def test_what_bends_has_its_own_shadow_and_that_of_others_by_a_near_lamp(tmp_path: Path) -> None:
    square = np.array([[-0.5, 0, -0.5], [0.5, 0, -0.5], [0.5, 0, 0.5], [-0.5, 0, 0.5]])
    sheets = np.concatenate([square + (0, 1.0, 0), 0.3 * square + (0, 0.75, 0)])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    trimesh.Trimesh(sheets, np.concatenate([faces, faces + 4]), process=False).export(tmp_path / "sheets.ply")
    lamp = placed("lamp", "quad", facing_up(0.02, (0, 0.25, 0)), LAMP)
    card = placed("card", "quad", facing_up(0.1, (0.2, 0.5, 0)))
    bends = ("sheets", "card")
    deform = made(tmp_path, placed("sheets", "sheets.ply") + lamp + card, SkyState(None), bends, n_points=2000)
    found, at = white(deform, "sheets", "rest")[:, 0], places(deform, "sheets")
    upper = at[:, 1] > 0.9
    across = np.abs(at[:, [0, 2]]).max(axis=1)
    # As seen from the lamp the lower sheet, 0.3 m wide at 0.5 m, covers 0.45 m of the upper one at 0.75 m; the card,
    # 0.1 m wide at 0.25 m and 0.2 m aside, covers 0.3 m around x = 0.6.
    in_shadow = upper & (across < 0.2)
    by_card = upper & (at[:, 0] > 0.475) & (np.abs(at[:, 2]) < 0.12)
    lit = upper & (across > 0.25) & (at[:, 0] < 0.4)
    assert in_shadow.any() and by_card.any() and lit.any()
    np.testing.assert_array_equal(found[in_shadow | by_card], 0.0)
    assert (found[lit] > 0.0).all() and (found[~upper] > 0.0).all()


def test_lamps_change_with_their_emission_alone(tmp_path: Path) -> None:
    lamp = placed("lamp", "quad", facing_up(0.2, (0, -1.0, 0)), LAMP)
    deform = made(tmp_path, LEAF + lamp, SkyState(None), ("leaf",))
    before, paths = white(deform, "leaf"), deform._between._paths
    deform.set_emission({"lamp": (10.0, 4.0, 0.0)})
    assert deform.is_done and deform._between._paths is paths
    assert white(deform, "leaf") == pytest.approx(before * (2.0, 1.0, 0.0), rel=1e-4)


def test_a_ball_on_the_middle_of_a_ground_that_was_moved_hides_what_it_hides_on_average(tmp_path: Path) -> None:
    # Half of the directions from a ball, of area 4 π r², end on a ground of area A: it hides 2 π r² / A of the light
    # there; of 0.9 of the ground's sides, in which it is known.
    ball = placed("ball", "sphere", scaled(0.8, (0, 0.42, 0)))
    ground = placed("ground", "quad", facing_up(6))
    deform = made(tmp_path, ground + ball, bends=("ground",), n_bounces=1)
    deform.set_moved(("ground",), ())
    found = white(finish_deform(deform), "ground")
    assert found == pytest.approx(1.0 - 2.0 * math.pi * 0.4**2 / (0.9 * 6.0) ** 2, abs=0.01)


@pytest.mark.parametrize("bends", [(), ("box",)])
def test_a_box_on_a_floor_comes_near_paths(tmp_path: Path, bends: tuple[str, ...]) -> None:
    """After two bounces; without light between objects a third of the box's is missing."""
    text = FLOOR + placed("box", "cube", scaled(0.7, (0, 0.6, 0)))
    found, once = (made(tmp_path, text, bends=bends, n_bounces=n) for n in (2, 1))
    reference = PathReference(found.scene, ())
    for _ in range(6):
        for _ in reference.trace({0: (GREY,), 1: (GREY,)}, WHITE_SKY, 2):
            pass
    assert reference.picture is not None
    eye, truth = found.scene.description.camera, reference.picture
    near, far = (each.draw(eye, SIZE) for each in (found, once))
    is_box = seen(found, 1)
    assert abs((near - truth)[is_box].mean()) < 0.1 * abs((far - truth)[is_box].mean())
    assert abs((near - truth)[~is_box].mean()) < 0.03
