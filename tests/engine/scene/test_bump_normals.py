"""Normals perturbed by normal and bump maps, against closed forms; images that are flat or cannot be used."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engine.core.errors import LoadError
from engine.material.bumps import NO_BUMPS, Bumps, bump_values, bumps_from, set_bump_field
from engine.material.parameters import ParameterError
from engine.scene.bump_normals import MIN_REFLECTED_COSINE, offset_normals
from engine.scene.primary_hits import PrimaryHits, trace_primary
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene, load_scene
from tests.scene_text import LAMBERT, camera, placed, scaled

# Two metres by four, seen from the front: u grows along +X, v along +Y.
CARD = scaled((2, 4, 1))
LAYER = f"smooth = false\n{LAMBERT}"
TAN = 0.5


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a normal map that leans by tan 0.5 to the right, a flat one, and waves along u."""
    folder = tmp_path_factory.mktemp("relief")
    lean = np.array([TAN, 0.0, 1.0]) / np.hypot(TAN, 1.0)
    Image.fromarray(np.tile(np.round(128 + 127 * lean).astype(np.uint8), (4, 4, 1))).save(folder / "lean.png")
    Image.fromarray(np.tile(np.uint8([128, 128, 255]), (4, 4, 1))).save(folder / "flat.png")
    wave = 0.5 + 0.5 * np.sin(2 * np.pi * (np.arange(256) + 0.5) / 256)
    Image.fromarray(np.tile(np.round(65535 * wave).astype(np.uint16), (8, 1))).save(folder / "wave.png")
    Image.fromarray(np.full((8, 8), 77, np.uint8)).save(folder / "even.png")
    return folder


def scene_of(folder: Path, bumps: str, transform: str = CARD, primitive: str = "quad") -> Scene:
    text = camera((0, 0, 50), 3, (32, 32)) + placed("card", primitive, transform, bumps + LAYER)
    (folder / "scene.toml").write_text(text)
    return load_scene(folder / "scene.toml")


def hits_of(scene: Scene) -> PrimaryHits:
    return trace_primary(scene, RayCaster(scene.vertices, scene.triangles))


def slopes_of(hits: PrimaryHits) -> np.ndarray:
    return hits.normal[:, :2] / hits.normal[:, 2:]


def test_a_normal_map_leans_to_where_it_points(folder: Path) -> None:
    # Green up, red to the right, as glTF has it; from the middle code 128 an 8-bit texel is off by half a code.
    slopes = slopes_of(hits_of(scene_of(folder, 'normal_map = { file = "lean.png" }\n')))
    np.testing.assert_allclose(slopes, np.tile([TAN, 0.0], (len(slopes), 1)), atol=0.01)
    stronger = slopes_of(hits_of(scene_of(folder, 'normal_map = { file = "lean.png", scale = 1.5 }\n')))
    np.testing.assert_allclose(stronger, 1.5 * slopes, rtol=1e-5, atol=1e-6)


def test_a_mirrored_image_mirrors_what_it_shows(folder: Path) -> None:
    # Repeats of -1 turn the image round: what leaned to the right leans to the left; so does a card seen from behind.
    for bumps, transform in (('{ file = "lean.png", repeats = [-1, 1] }', CARD),
                             ('{ file = "lean.png" }', scaled((-2, 4, 1)))):  # fmt: skip
        slopes = slopes_of(hits_of(scene_of(folder, f"normal_map = {bumps}\n", transform)))
        np.testing.assert_allclose(slopes, np.tile([-TAN, 0.0], (len(slopes), 1)), atol=0.01)


def test_what_rises_on_the_front_falls_away_on_the_back(folder: Path) -> None:
    turned = scaled((-2, 4, -1))  # half a turn about Y: the eye sees the back
    hits = hits_of(scene_of(folder, 'normal_map = { file = "lean.png" }\n', turned))
    assert not hits.front.any()
    # The surface's own normal leans along u, which is -X now; its back is what the eye sees of it.
    np.testing.assert_allclose(slopes_of(hits)[:, 0], TAN, atol=0.01)


def test_heights_have_the_slope_of_what_they_draw(folder: Path) -> None:
    # h = 0.05 (1 + sin 2 pi u) / 2 metres over 2 m of u, the wave 3 times: dh/dx = 0.05 pi 3 / 2 cos(6 pi u).
    hits = hits_of(scene_of(folder, 'bump_map = { file = "wave.png", height = 0.05, repeats = [3, 1] }\n'))
    u = (hits.position[:, 0] + 1.0) / 2.0
    np.testing.assert_allclose(slopes_of(hits)[:, 0], -0.075 * np.pi * np.cos(6 * np.pi * u), atol=0.006)
    np.testing.assert_allclose(slopes_of(hits)[:, 1], 0.0, atol=1e-6)
    # A card that is twice as wide is half as steep.
    wide = hits_of(scene_of(folder, 'bump_map = { file = "wave.png", height = 0.05, repeats = [3, 1] }\n',
                            scaled((4, 4, 1))))  # fmt: skip
    assert abs(slopes_of(wide)[:, 0]).max() == pytest.approx(0.0375 * np.pi, rel=0.05)


def test_heights_on_a_ball_stand_across_its_own_normals(folder: Path) -> None:
    bumps = 'bump_map = { file = "wave.png", height = 0.02, repeats = [8, 4] }\n'
    plain, bumpy = (hits_of(scene_of(folder, each, "", "sphere")) for each in ("", bumps))
    cosine = np.einsum("pk,pk->p", plain.normal, bumpy.normal)
    assert cosine.min() > 0.9 and cosine.mean() < 0.9995
    # Waves along longitude lean along circles about the axis, on which the ball's own normal is level.
    around = np.cross([0.0, 1.0, 0.0], plain.normal)
    lean = bumpy.normal - cosine[:, None] * plain.normal
    high = plain.normal[:, 2] > 0.7
    assert abs(np.einsum("pk,pk->p", lean, np.cross(plain.normal, around)))[high].max() < 0.01


@pytest.mark.parametrize("bumps", [
    'normal_map = { file = "flat.png" }', 'normal_map = { file = "flat.png", scale = 10 }',
    'normal_map = { file = "lean.png", scale = 0 }', 'bump_map = { file = "even.png" }',
    'bump_map = { file = "wave.png", height = 0 }',
])  # fmt: skip
def test_what_is_flat_is_as_without_it_to_the_last_bit(folder: Path, bumps: str) -> None:
    for primitive in ("quad", "sphere"):
        plain, flat = (hits_of(scene_of(folder, each, CARD, primitive)) for each in ("", bumps + "\n"))
        for name in ("normal", "horizon", "tangent", "offset_position"):
            np.testing.assert_array_equal(getattr(plain, name), getattr(flat, name))


def test_texture_coordinates_that_say_nothing_are_flat(folder: Path) -> None:
    (folder / "point.obj").write_text("v -1 -1 0\nv 1 -1 0\nv 0 1 0\nvt 0.5 0.5\nf 1/1 2/1 3/1\n")
    for bumps in ('normal_map = { file = "lean.png" }', 'bump_map = { file = "wave.png", height = 1 }'):
        card = placed("card", "point.obj", more=f"{bumps}\n{LAYER}")
        (folder / "scene.toml").write_text(camera((0, 0, 5), 20, (8, 8)) + card)
        hits = hits_of(load_scene(folder / "scene.toml"))
        np.testing.assert_array_equal(hits.normal, hits.horizon)


def test_meshes_without_coordinates_take_them_from_their_box(folder: Path) -> None:
    (folder / "bare.obj").write_text("v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3 4\n")
    card = placed("card", "bare.obj", more=f'normal_map = {{ file = "lean.png" }}\n{LAYER}')
    (folder / "scene.toml").write_text(camera((0, 0, 50), 2, (8, 8)) + card)
    scene = load_scene(folder / "scene.toml")
    assert [note for note in scene.notes if "no texture coordinates" in note]
    np.testing.assert_allclose(slopes_of(hits_of(scene))[:, 0], TAN, atol=0.01)


def test_normals_turn_no_further_than_the_view_allows() -> None:
    random = np.random.default_rng(3)
    n = 2000
    normals = np.tile([0.0, 0.0, 1.0], (n, 1))
    wo = random.normal(size=(n, 3))
    wo[:, 2] = np.abs(wo[:, 2]) + 1e-3
    wo /= np.linalg.norm(wo, axis=1, keepdims=True)
    lean = 10.0 ** random.uniform(-3, 2, (n, 1)) * random.normal(size=(n, 3)) * [1.0, 1.0, 0.0]
    turned = offset_normals(normals, lean, wo)
    np.testing.assert_allclose(np.linalg.norm(turned, axis=1), 1.0, rtol=1e-12)
    mirrored = 2.0 * np.einsum("pk,pk->p", turned, wo)[:, None] * turned - wo
    least = np.minimum(MIN_REFLECTED_COSINE, 0.9 * wo[:, 2])
    assert (mirrored[:, 2] >= least - 1e-9).all() and (np.einsum("pk,pk->p", turned, wo) > 0.0).all()
    free = normals + lean
    free /= np.linalg.norm(free, axis=1, keepdims=True)
    above = (2.0 * np.einsum("pk,pk->p", free, wo)[:, None] * free - wo)[:, 2] > least + 1e-9
    above &= np.einsum("pk,pk->p", free, wo) > 0.0
    assert 0.3 < above.mean() < 0.9
    np.testing.assert_allclose(turned[above], free[above], atol=1e-9)


def test_bumps_are_written_as_they_are_read() -> None:
    for bumps in (NO_BUMPS, Bumps(normal_map="a.png", bump_strength=0.5, bump_repeats=(2.0, -3.0)),
                  Bumps(bump_map="b.png", bump_height=-0.25)):  # fmt: skip
        assert (bumps_from(bump_values(bumps)) if bumps.file else NO_BUMPS) == bumps
    other = set_bump_field(Bumps(normal_map="a.png"), "bump_map", "b.png")
    assert (other.normal_map, other.bump_map) == ("", "b.png")
    for name, value in (("bump_strength", 10.5), ("bump_strength", float("nan")), ("bump_height", "tall"),
                        ("bump_repeats", [0.0, 1.0]), ("normal_map", 3), ("bumps", 1.0)):  # fmt: skip
        with pytest.raises(ParameterError):
            set_bump_field(NO_BUMPS, name, value)


@pytest.mark.parametrize(("bumps", "said"), [
    ('normal_map = { file = "gone.png" }', "gone.png"),
    ('normal_map = { file = "../out.png" }', "scene's folder"),
    ('normal_map = { file = "wave.png" }', "channels = 1, expected the three of a normal map"),
    ('normal_map = { file = "scene.toml" }', "a PNG, JPEG, WebP, KTX 2 or OpenEXR image"),
    ('normal_map = { file = "flat.png", scale = 11 }', "a number from 0 to 10"),
    ('normal_map = { file = "flat.png", height = 1 }', "a table of file and, where they differ, scale, repeats"),
    ('bump_map = { height = 1 }', "a table of file and, where they differ, scale, height, repeats"),
    ('bump_map = "wave.png"', "a table of file"),
    ('bump_map = { file = "even.png" }\nnormal_map = { file = "flat.png" }', "one of normal_map and bump_map"),
])  # fmt: skip
def test_what_is_wrong_with_bumps_is_one_line(folder: Path, bumps: str, said: str) -> None:
    with pytest.raises(LoadError, match=".*") as caught:
        scene_of(folder, bumps + "\n")
    assert said in str(caught.value) and "\n" not in str(caught.value)
