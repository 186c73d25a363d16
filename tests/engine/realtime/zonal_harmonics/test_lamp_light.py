"""Lamps that light points while they move: caps in closed form, a dense sum over the lamp as slow twin, paths, and what
a mix does to them."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.special import eval_legendre

from engine.core.generators import run_to_end
from engine.light.cones import ALL_ROUND, Cone, cone_shares
from engine.light.environment import constant_environment
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.direct.pipeline import LightLink, Placement, SkyState
from engine.realtime.zonal_harmonics import _lamp_light_kernels as kernels
from engine.realtime.zonal_harmonics.deform_engine import Deform, finish_deform
from engine.realtime.zonal_harmonics.lamp_light import lamp_light
from engine.realtime.zonal_harmonics.picture_renderer import Quality
from engine.realtime.zonal_harmonics.pose import Poses
from engine.realtime.zonal_harmonics.posed_scene import pose_scene
from engine.realtime.zonal_harmonics.scene_lamps import Lamp, PosedLamps
from engine.realtime.zonal_harmonics.shading import Lobes, unshadowed_points
from engine.render.still import render_paths
from engine.scene.scene_loader import load_scene
from engine.scene.transform import Transform
from tests.engine.realtime.conftest import icosphere
from tests.engine.realtime.zonal_harmonics.test_deform_engine import seen
from tests.scene_text import camera, environment, facing_down, facing_up, placed, scaled

N = 6
SIZE = (48, 36)
DARK = SkyState(None)
GREY = make_layer(MODELS["lambert"], {"albedo": 0.5})
FLOOR = placed("floor", "quad", facing_up(4))
EMISSION = np.array([5.0, 4.0, 3.0])


def lamp_of(folder: Path, shape: str, transform: str, more: str = "") -> Lamp:
    (folder / "lamp.toml").write_text(
        camera((0, 1, 3), 40, SIZE) + placed("lamp", shape, transform, f"emission = {EMISSION.tolist()}\n{more}")
    )
    scene = load_scene(folder / "lamp.toml")
    found = PosedLamps().lamps(scene, ())[0]
    away = scene.origin  # as the file has it
    return replace(found, samples=[s._replace(place=s.place + away, target=s.target + away) for s in found.samples])


def some_lobes(n_points: int, seed: int = 3) -> tuple[Lobes, np.ndarray, np.ndarray]:
    """Lobes of points, their axes, and where they are: half a metre and more below a lamp at the origin."""
    random = np.random.default_rng(seed)
    axes = random.normal(size=(n_points, 2, 3))
    axes /= np.linalg.norm(axes, axis=2, keepdims=True)
    falls = 1.0 / (1.0 + np.arange(N)) ** 2
    numbers = random.normal(size=(n_points, 4)), axes, random.normal(size=(n_points, 2, N)) * falls
    frames = np.linalg.qr(random.normal(size=(n_points, 3, 3)))[0]
    places = random.uniform((-1.0, -2.0, -1.0), (1.0, -0.5, 1.0), (n_points, 3))
    return Lobes(*(each.astype(np.float32) for each in numbers)), frames.astype(np.float32), places.astype(np.float32)


def transfer(lobes: Lobes, frames: np.ndarray, p: int, towards: np.ndarray) -> np.ndarray:
    """What the lobes of a point make of unit power from directions (D, 3): the functions themselves, not their bands'
    coefficients."""
    local = towards @ frames[p].T.astype(np.float64)
    found = lobes.low[p, 0] * math.sqrt(0.25 / math.pi)
    found = found + math.sqrt(0.75 / math.pi) * (local[:, [1, 2, 0]] * (-1.0, 1.0, -1.0)) @ lobes.low[p, 1:]
    for axis, bands in zip(lobes.axes[p].astype(np.float64), lobes.coefficients[p], strict=True):
        for l in range(N):  # noqa: E741
            found = found + bands[l] * (2 * l + 1) / (4.0 * math.pi) * eval_legendre(l, local @ axis)
    return np.asarray(found)


@pytest.mark.parametrize("c", [-0.5, 0.0, 0.6, 0.98, 1.0 - 1e-9])
def test_bands_of_a_cap_are_their_closed_forms(c: float) -> None:
    """Means of P_l over the cap: (1 + c) / 2, c (1 + c) / 2, and by quadrature that is exact for polynomials."""
    window = np.empty(10)
    kernels._window_of_cap(c, window)
    assert window[:3] == pytest.approx([1.0, (1.0 + c) / 2.0, c * (1.0 + c) / 2.0], abs=1e-8)
    x, weights = np.polynomial.legendre.leggauss(10)
    t = c + (1.0 - c) * (x + 1.0) / 2.0
    assert window == pytest.approx([weights @ eval_legendre(k, t) / 2.0 for k in range(10)], abs=1e-6)


# Of one cap: a ball is one. Errors relative to the root mean square over the points.
@pytest.mark.parametrize(
    ("shape", "transform", "more", "places", "bound"),
    [
        ("quad", facing_down(0.1, (0, 0, 0)), "", "quad", 2e-3),
        ("quad", facing_down(1.0, (0, 0, 0)), "", "quad", 0.01),
        ("quad", "1.6,0,0,0, 0,0,-1,0, 0,0.2,0,0, 0,0,0,1", "", "strip", 0.02),
        ("disc", facing_down(0.8, (0, 0, 0)), "", "disc", 0.01),
        ("quad", facing_down(0.3, (0, 0, 0)), "cone = { inner = 20, outer = 45 }\n", "spot", 0.02),
        ("sphere", scaled(0.5), "", "ball", 0.02),  # of which 64 parts are 1 % off
    ],
    ids=["small quad", "wide quad", "strip", "disc", "spot", "ball"],
)
def test_a_lamp_is_projected_as_a_dense_sum_over_it(
    tmp_path: Path, shape: str, transform: str, more: str, places: str, bound: float
) -> None:
    lamp, n = lamp_of(tmp_path, shape, transform, more), 60
    lobes, frames, at = some_lobes(n)
    light, share = np.empty((n, 3), np.float32), np.empty(n, np.float32)
    lobes.low[:, 0] += 4.0  # so that nothing is clamped at 0
    lamp_light(lamp, np.arange(n), lobes, frames, at, False, light, share)
    x, z = ((np.arange(200) + 0.5) / 200 - 0.5 for _ in range(2))
    x, z = (each.ravel() for each in np.meshgrid(x, z))
    inside = np.ones(len(x), bool) if places != "disc" else np.hypot(x, z) < 0.5
    size = {"quad": (float(transform.split(",")[0]),) * 2, "strip": (1.6, 0.2), "disc": (0.8, 0.8), "spot": (0.3, 0.3)}
    row = Cone(20.0, 45.0).row((0.0, -1.0, 0.0)) if more else np.array(ALL_ROUND)
    expected = np.zeros(n)
    for p in range(n):
        if places == "ball":  # its cap, evenly filled
            distance = float(np.linalg.norm(at[p]))
            rim = math.sqrt(1.0 - (0.25 / distance) ** 2)
            cosines, turns = 1.0 - (1.0 - rim) * (np.arange(60) + 0.5) / 60, (np.arange(60) + 0.5) * math.tau / 60
            cosines, turns = (each.ravel() for each in np.meshgrid(cosines, turns))
            axis = -at[p].astype(np.float64) / distance
            one = np.cross(axis, (0.0, 0.0, 1.0))
            one /= np.linalg.norm(one)
            across = np.outer(np.cos(turns), one) + np.outer(np.sin(turns), np.cross(axis, one))
            towards = cosines[:, None] * axis + np.sqrt(1.0 - cosines**2)[:, None] * across
            angles = np.full(len(towards), math.tau * (1.0 - rim) / len(towards))
        else:
            wide, deep = size[places]
            to = np.stack([wide * x[inside], np.zeros(inside.sum()), deep * z[inside]], axis=1) - at[p]
            distance = np.linalg.norm(to, axis=1)
            towards = to / distance[:, None]
            angles = wide * deep / len(x) * towards[:, 1] / distance**2 * cone_shares(row, towards)
        expected[p] = angles @ transfer(lobes, frames, p, towards)
    for c in range(3):
        off = light[:, c] - expected * EMISSION[c]
        assert np.sqrt((off**2).mean()) < bound * np.sqrt((expected**2).mean()) * EMISSION[c]


def test_an_open_point_gets_all_of_the_cosine_and_nothing_from_below(tmp_path: Path) -> None:
    """L sin² cos of a ball that is whole above the horizon, to the 1 % of its parts; 0 of one that is whole below."""
    lamp, n = lamp_of(tmp_path, "sphere", scaled(0.6)), 200
    random = np.random.default_rng(1)
    normals = random.normal(size=(n, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    frames = np.zeros((n, 3, 3), np.float32)
    frames[:, 2], frames[:, 0] = normals, np.cross(normals, (0.3, 0.5, 0.8))
    frames[:, 0] /= np.linalg.norm(frames[:, 0], axis=1, keepdims=True)
    frames[:, 1] = np.cross(frames[:, 2], frames[:, 0])
    at = random.uniform(-1.0, 1.0, (n, 3)).astype(np.float32)
    at *= 1.0 / np.linalg.norm(at, axis=1, keepdims=True)
    light, share = np.empty((n, 3), np.float32), np.empty(n, np.float32)
    lamp_light(lamp, np.arange(n), unshadowed_points(n, 4, N), frames, at, True, light, share)
    up = -np.einsum("pk,pk->p", normals, at)
    above, below = up > 0.32, up < -0.32  # it is 17.5 degrees wide
    assert above.sum() > 40 and below.sum() > 40
    assert light[above] == pytest.approx(np.outer(0.3**2 * up[above], EMISSION), rel=0.02)
    assert light[below] == pytest.approx(0.0, abs=1e-6)
    assert share[above] == pytest.approx(1.0, abs=1e-5)


def moving(folder: Path, text: str, sky: SkyState = DARK, n_points: int = 300) -> Deform:
    (folder / "scene.toml").write_text(camera((0.0, 1.6, 3.0), 45, SIZE) + environment() + text)
    deform = Deform(load_scene(folder / "scene.toml"), n_points=n_points, n_rays=200)
    deform.set_light(sky)
    deform.set_layers(dict.fromkeys(np.flatnonzero(deform.scene.reflecting).tolist(), (GREY,)))
    deform.set_bounces(1)
    return finish_deform(deform)


def board(size: float = 1.0, at: tuple[float, float, float] = (-0.8, 1.5, 0.0)) -> str:
    return placed("lamp", "quad", facing_down(size, at), f"emission = {EMISSION.tolist()}\n")


@pytest.mark.parametrize("shape", ["floor", "ball"])
def test_a_lamp_that_moves_lights_what_nothing_shades_as_paths_do(tmp_path: Path, shape: str) -> None:
    """In the gesture: nothing is prepared between the lamp's movement and the picture. relRMSE, noise of paths
    included, which is 1 %; edges of pixels are not those of paths."""
    made = moving(tmp_path, (FLOOR if shape == "floor" else icosphere(tmp_path, 1.2)) + board())
    poses: Poses = (("lamp", (Transform((1.3, -0.2, 0.3), (0.0, 0.0, 20.0)),)),)
    version, eye = made.version, made.scene.description.camera
    before, found = made.draw(eye, SIZE), made.draw(eye, SIZE, poses)
    assert made.version == version and made.is_done
    posed = pose_scene(made.scene, poses)
    truth = run_to_end(render_paths(Placement(posed), {0: (GREY,)}, DARK, 1, 1024))
    inside = seen(made, 0)
    inside &= np.roll(inside, 1, 0) & np.roll(inside, -1, 0) & np.roll(inside, 1, 1) & np.roll(inside, -1, 1)
    off, was_off = (np.sqrt(((each - truth)[inside] ** 2).mean()) / truth[inside].mean() for each in (found, before))
    assert inside.sum() > 120 and off < 0.03 and was_off > 0.2


def test_shadows_of_what_rests_follow_a_lamp_that_moves(tmp_path: Path) -> None:
    """By few rays, then by all: a block's side is dark where the lamp is not, and lit where it has come to."""
    made = moving(tmp_path, FLOOR + placed("block", "cube", scaled(0.6, (0, 0.3, 0))) + board(0.4), n_points=2000)
    eye, poses = made.scene.description.camera, ((("lamp", (Transform((1.6, 0.0, 0.0)),))),)
    before, found = made.draw(eye, SIZE), made.draw(eye, SIZE, poses)
    made.set_moved((), poses)
    assert not made.is_done and np.array_equal(made.draw(eye, SIZE, poses), found)
    truth = finish_deform(made).draw(eye, SIZE, poses)
    floor = seen(made, 0)
    off, was_off = (np.sqrt(((each - truth)[floor] ** 2).mean()) / truth[floor].mean() for each in (found, before))
    assert off < 0.15 * was_off
    # Mirrored left to right, the scene is the same but for the lamp.
    assert np.abs(found - before[:, ::-1]).mean() < 0.1 * before.mean()


def test_a_wall_behind_a_lamp_that_moves_hides_none_of_its_light(tmp_path: Path) -> None:
    """In a closed box no light comes from afar, and all from the lamp; a plate between hides it."""
    walls = placed("walls", "cube", scaled(-3.0, (0, 1.5, 0)), "smooth = false\n")
    plate = placed("plate", "quad", facing_up(0.8, (0.8, 0.4, 0.0)))
    made = moving(tmp_path, FLOOR + walls + plate + board(0.3), n_points=2000)
    poses: Poses = (("lamp", (Transform((1.6, 0.0, 0.0)),)),)
    white, points = {}, made._points
    assert points is not None
    for name in "moving", "rest":
        made.draw(made.scene.description.camera, SIZE, poses)
        white[name] = made._pictures._white[1].white[points.points_of(0), 0]  # type: ignore[union-attr, index]
        made.set_moved((), poses)
        finish_deform(made)
    at = points.places[points.points_of(0)] + made.scene.origin
    front = (points.frames[points.points_of(0), 2, 1] > 0.5) & (np.abs(at[:, (0, 2)]) < 1.4).all(axis=1)
    under = front & (np.abs(at - (0.8, 0.0, 0.0)) < 0.25).all(axis=1)
    assert front.sum() > 50 and white["rest"][front].mean() > 0.01
    off = np.abs(white["moving"] - white["rest"])[front]  # less where few rays see edges of shadows
    assert np.quantile(off, 0.9) < 0.05 * white["rest"][front].max()
    assert under.any() and white["moving"][under].max() < 1e-6


def test_what_begins_to_bend_keeps_the_others_as_a_lamp_lit_them(tmp_path: Path) -> None:
    walls = placed("walls", "cube", scaled(-3.0, (0, 1.5, 0)), "smooth = false\n")
    block = placed("block", "cube", scaled(0.4, (0.9, 0.2, 0)))
    made = moving(tmp_path, FLOOR + walls + block + board(0.3), n_points=300)
    before = made.draw(made.scene.description.camera, SIZE)
    made.set_bending(["block"])
    floor = seen(made, 0)
    assert made.draw(made.scene.description.camera, SIZE)[floor] == pytest.approx(before[floor], rel=1e-4)


def test_nothing_else_is_prepared_anew_for_a_lamp_that_has_moved(tmp_path: Path) -> None:
    made = moving(tmp_path, FLOOR + placed("block", "cube", scaled(0.6, (0, 0.3, 0))) + board(0.4), n_points=100)
    paths, known = made._between._paths, dict(made._found.known)
    made.set_bending(["lamp"])
    made.set_moved(("lamp",), (("lamp", (Transform((1.0, 0.0, 0.0)),)),))
    assert not made.is_done
    finish_deform(made)
    assert made._between._paths is paths and made._found.known == known
    assert made.is_done and made._desired.alone == ()


def test_a_lamp_that_moves_hides_the_sky_where_it_is(tmp_path: Path) -> None:
    """Coarsely, by its clusters, while it moves, by rays at rest: a board that is close to the floor, and black."""
    sky = SkyState(constant_environment((1.0, 1.0, 1.0)))
    made = moving(tmp_path, FLOOR + board(1.0, (-0.8, 0.15, 0.0)), sky, n_points=2000)
    made.set_emission({"lamp": (0.0, 0.0, 0.0)})
    points = made._points
    assert points is not None
    eye = made.scene.description.camera
    for poses, x in ((), -0.8), ((("lamp", (Transform((1.6, 0.0, 0.0)),)),), 0.8):
        for quality, most in ("moving", 0.75), ("rest", 0.35):
            made.draw(eye, SIZE, poses, quality)  # type: ignore[arg-type]
            white = made._pictures._white[1].white[points.points_of(0), 0]  # type: ignore[union-attr, index]
            at = points.places[points.points_of(0)] + made.scene.origin
            front = points.frames[points.points_of(0), 2, 1] > 0.5
            under = front & (np.abs(at - (x, 0.0, 0.0)) < 0.3).all(axis=1)
            beside = front & (np.abs(at - (-x, 0.0, 0.0)) < 0.4).all(axis=1)
            assert under.any() and beside.any()
            assert white[under].mean() < most and white[beside].mean() > 0.9, (poses, quality)


def test_what_a_mix_does_to_a_lamp_counts_while_it_moves(tmp_path: Path) -> None:
    """Its colour and strength multiply; one that is off gives none, nor what does not reach an object."""
    text = icosphere(tmp_path, 0.8, (0, 0.4, 0)) + FLOOR + board(0.5)
    made = moving(tmp_path, text, n_points=200)
    eye = made.scene.description.camera
    poses: Poses = (("lamp", (Transform((1.2, 0.3, 0.2)),)),)
    plain = made.draw(eye, SIZE, poses)
    is_lamp = seen(made, 2) | (plain == EMISSION).all(axis=2)
    made.set_emission({"lamp": (10.0, 2.0, 0.0)})
    mixed = made.draw(eye, SIZE, poses)
    assert mixed[~is_lamp] == pytest.approx(plain[~is_lamp] * (2.0, 0.5, 0.0), rel=1e-4, abs=1e-6)
    made.set_emission({"lamp": (0.0, 0.0, 0.0)})
    assert not made.draw(eye, SIZE, poses).any()
    made.set_emission({"lamp": tuple(EMISSION)})
    made.set_light(replace(DARK, links=(LightLink(frozenset({0}), DARK, frozenset({2})),)))
    linked, is_ball = made.draw(eye, SIZE, poses), seen(made, 0)
    inner = is_ball & np.roll(is_ball, 1, 0) & np.roll(is_ball, -1, 0) & np.roll(is_ball, 1, 1)
    assert not linked[inner].any() and plain[inner].any()
    floor = seen(made, 1) & ~is_lamp
    assert linked[floor] == pytest.approx(plain[floor], rel=1e-5)


def test_a_cone_that_opens_lights_at_once(tmp_path: Path) -> None:
    spot = placed(
        "lamp", "disc", facing_down(0.1, (0, 1.5, 0)), "emission = [90, 90, 90]\ncone = { inner = 5, outer = 8 }\n"
    )
    made = moving(tmp_path, FLOOR + spot, n_points=1500)
    eye = made.scene.description.camera
    narrow, wide = (made.draw(eye, SIZE, poses) for poses in ((), (("lamp", (Cone(40.0, 60.0),)),)))
    assert (wide.sum(axis=2) > 0.02).sum() > 4 * (narrow.sum(axis=2) > 0.02).sum() > 0


def test_of_many_lamps_the_far_ones_light_what_bends_from_afar(tmp_path: Path) -> None:
    """As all do to each place, but for the size of the object: nine small lamps, of which six are near."""
    angles = np.linspace(0.0, math.tau, 9, endpoint=False)
    at = [
        (float(r * math.cos(a)), 2.0, float(r * math.sin(a)))
        for a, r in zip(angles, [1.0] * 6 + [9.0] * 3, strict=True)
    ]
    lamps = "".join(
        placed(f"lamp {k}", "quad", facing_down(0.1 * math.hypot(*place), place), "emission = [50, 40, 30]\n")
        for k, place in enumerate(at)
    )
    made = moving(tmp_path, icosphere(tmp_path, 0.6, (0, 0.6, 0)) + FLOOR + lamps, n_points=200)
    made.set_bending(["ball"])
    finish_deform(made)
    state, pictures = made._posed_state(())
    assert sorted(state.far_lamps[0]) == [6, 7, 8] and sorted(state.unlit) == [0]
    eye, ball = made.scene.description.camera, made._points.points_of(0)  # type: ignore[union-attr]
    white = [pictures.draw(state, eye, SIZE, (), each) is not None and pictures._white[1] for each in QUALITIES]  # type: ignore[index]
    moves, rests = (each.white[ball] for each in white)
    assert np.sqrt(((moves - rests) ** 2).mean()) < 0.08 * rests.mean()  # of low lamps, in six bands
    assert rests.mean() > 0.1


QUALITIES: tuple[Quality, ...] = ("moving", "rest")
