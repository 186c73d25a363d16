"""Rotations of tangents: by an angle and by a map, as hits, kernels and files have them."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engine.core.errors import LoadError
from engine.material.bumps import NO_BUMPS, Bumps, bump_values, bumps_from
from engine.precompute.direct.pipeline import Placement
from engine.precompute.indirect._ray_kernels import object_tangent
from engine.scene.primary_hits import PrimaryHits
from engine.scene.raycaster import Intersections
from engine.scene.scene_loader import Scene, load_scene
from engine.scene.tangents import N_CODES, object_tangents, tangent_axes
from tests.scene_text import LAMBERT, camera, placed


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Images of angles: black, a half and white left to right; white; stripes of black and white, a texel each."""
    folder = tmp_path_factory.mktemp("brushed")
    Image.fromarray(np.tile(np.uint8([[0, 128, 255]]), (3, 1)).repeat(16, 0).repeat(16, 1)).save(folder / "three.png")
    Image.fromarray(np.full((4, 4), 255, np.uint8)).save(folder / "white.png")
    Image.fromarray(np.tile(np.uint8([[0, 255]]), (2, 256))).save(folder / "stripes.png")
    return folder


def scene_of(folder: Path, tangent: str = "", shape: str = "quad") -> Scene:
    text = camera((0, 0, 5), 20, (12, 12)) + placed("card", shape, more=f"{tangent}\n{LAMBERT}")
    (folder / "scene.toml").write_text(text)
    return load_scene(folder / "scene.toml")


def hits_of(scene: Scene) -> PrimaryHits:
    return Placement(scene).hits


def angles_of(hits: PrimaryHits, scene: Scene) -> np.ndarray:
    """Degrees from the tangents without rotation, counter-clockwise as the camera sees them."""
    own = object_tangents(scene, hits.objects, hits.normal.astype(np.float64))
    across = np.cross(hits.normal, own)
    return np.degrees(np.arctan2(np.einsum("pk,pk->p", hits.tangent, across), np.einsum("pk,pk->p", hits.tangent, own)))


@pytest.mark.parametrize("shape", ["quad", "sphere"])
@pytest.mark.parametrize("angle", [30.0, -75.0, 90.0])
def test_an_angle_rotates_about_the_normal(folder: Path, shape: str, angle: float) -> None:
    scene = scene_of(folder, f"tangent = {{ angle = {angle} }}", shape)
    hits = hits_of(scene)
    np.testing.assert_allclose(angles_of(hits, scene), angle, atol=1e-3)
    np.testing.assert_allclose(np.einsum("pk,pk->p", hits.tangent, hits.normal), 0.0, atol=1e-6)


def test_grey_is_an_angle(folder: Path) -> None:
    # Left, middle and right third: 0, 128/255 and 1 of 90 degrees, beside 10 that count everywhere.
    scene = scene_of(folder, 'tangent = { angle = 10, file = "three.png", range = 90 }')
    hits = hits_of(scene)
    x, found = hits.position[:, 0], angles_of(hits, scene)
    for low, high, grey in ((-0.4, -0.25, 0.0), (-0.1, 0.1, 128 / 255), (0.25, 0.4, 1.0)):
        inside = (x > low) & (x < high)
        assert inside.sum() > 5
        half_turns = (found[inside] - 10.0 - 90.0 * grey) / 180.0
        np.testing.assert_allclose(half_turns, np.rint(half_turns), atol=1e-4)


def test_directions_are_averaged_and_not_grey_values(folder: Path) -> None:
    # Black and white alternate below the size of a pixel: 0 and 180 degrees are one direction, 0 and 60 are 30.
    for degrees, expected in ((180.0, 0.0), (60.0, 30.0)):
        scene = scene_of(folder, f'tangent = {{ file = "stripes.png", range = {degrees} }}')
        found = np.radians(angles_of(hits_of(scene), scene) - expected)
        assert np.abs(np.sin(found)).max() < np.radians(5.0)


# A card whose texture stands on its side: u grows along +Y; on the right half v grows along -X, on the left along +X.
ON_ITS_SIDE = (
    "v -0.5 -0.5 0\nv 0 -0.5 0\nv 0.5 -0.5 0\nv -0.5 0.5 0\nv 0 0.5 0\nv 0.5 0.5 0\n"
    "vt 0 0\nvt 0 1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 1 0\nf 1/1 2/2 5/5 4/4\nf 2/2 3/3 6/6 5/5\n"
)


@pytest.mark.parametrize("from_behind", [False, True])
@pytest.mark.parametrize("angle", [0.0, 30.0])
def test_tangents_along_u_turn_towards_v(folder: Path, angle: float, from_behind: bool) -> None:
    (folder / "card.obj").write_text(ON_ITS_SIDE)
    text = camera((0, 0, -5 if from_behind else 5), 20, (12, 12))
    text += placed("card", "card.obj", more=f"tangent = {{ along_u = true, angle = {angle} }}\n{LAMBERT}")
    (folder / "scene.toml").write_text(text)
    scene = load_scene(folder / "scene.toml")
    hits = hits_of(scene)
    right = hits.position[:, 0] > 0.0
    # The surface has one direction at each place, whichever side is seen: streaks are without a head or a tail.
    towards_v = np.where(right, -1.0, 1.0)
    expected = np.stack([towards_v * np.sin(np.radians(angle)), np.full(len(right), np.cos(np.radians(angle)))], axis=1)
    along = np.abs(np.einsum("pk,pk->p", hits.tangent[:, :2], expected))
    np.testing.assert_allclose(along, 1.0, atol=1e-5)
    np.testing.assert_allclose(hits.tangent[:, 2], 0.0, atol=1e-6)


def test_red_and_green_are_directions(folder: Path) -> None:
    """A third of the image each: along u, along v, and halfway between them, in tangents that follow u."""
    pixels = np.uint8([[[255, 128, 0], [128, 255, 0], [218, 218, 0]]]).repeat(16, 0).repeat(16, 1)
    Image.fromarray(pixels).save(folder / "vectors.png")
    scene = scene_of(folder, 'tangent = { along_u = true, file = "vectors.png", vectors = true }')
    hits = hits_of(scene)
    x, found = hits.position[:, 0], angles_of(hits, scene)
    for low, high, degrees in ((-0.4, -0.25, 0.0), (-0.1, 0.1, 90.0), (0.25, 0.4, 45.0)):
        inside = (x > low) & (x < high)
        assert inside.sum() > 5
        half_turns = (found[inside] - degrees) / 180.0
        np.testing.assert_allclose(half_turns, np.rint(half_turns), atol=2e-3)


@pytest.mark.parametrize("along_u", [False, True])
def test_kernels_rotate_as_hits_do(folder: Path, along_u: bool) -> None:
    more = 'along_u = true, file = "vectors.png", vectors = true' if along_u else 'file = "three.png", range = 90'
    Image.fromarray(np.uint8([[[255, 128, 0], [218, 218, 0]]]).repeat(16, 0).repeat(16, 1)).save(folder / "vectors.png")
    scene = scene_of(folder, f"tangent = {{ angle = 10, {more} }}", "sphere")
    hits, random = hits_of(scene), np.random.default_rng(1)
    triangle = random.integers(0, len(scene.triangles), 200).astype(np.int32)
    u, v = random.dirichlet((1.0, 1.0, 1.0), 200).T[:2].astype(np.float32)
    found = Intersections(triangle, u, v, np.zeros(200, np.float32))
    normals = random.normal(size=(200, 3))
    if along_u:  # angles to the direction of u depend on the normal: of the surface itself
        corners = scene.normals[scene.triangles[triangle]].astype(float)
        normals = np.einsum("nk,nki->ni", np.stack([1.0 - u - v, u, v], axis=1), corners)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    exact = scene.tangent_rotations.tangents(np.zeros(200, int), normals, found)
    axes, codes = tangent_axes(scene), scene.tangent_rotations.codes(found)
    in_kernel = [object_tangent(axes, 0, code, *n.astype(np.float32)) for code, n in zip(codes, normals, strict=True)]
    # Codes are half a step off at most, and their opposites mean the same.
    cosine = np.abs(np.einsum("pk,pk->p", exact, np.array(in_kernel)))
    assert cosine.min() > np.cos(0.5 * np.pi / N_CODES) - 1e-5 and len(np.unique(codes)) > 2
    assert len(hits.pixel)


def test_without_rotation_nothing_changes_to_the_last_bit(folder: Path) -> None:
    plain = hits_of(scene_of(folder, "", "sphere"))
    for tangent in ("tangent = { angle = 0 }", 'tangent = { file = "three.png", range = 0 }'):
        scene = scene_of(folder, tangent, "sphere")
        assert scene.tangent_rotations.digest == ""
        np.testing.assert_array_equal(hits_of(scene).tangent, plain.tangent)


def test_rotations_are_written_as_they_are_read() -> None:
    for bumps in (NO_BUMPS, Bumps(tangent_angle=-12.5), Bumps(tangent_map="a.png", tangent_range=360.0),
                  Bumps(bump_map="b.png", bump_wrap=("clamp", "mirror"), tangent_angle=3.0)):  # fmt: skip
        assert bumps_from(bump_values(bumps)) == bumps
    assert Bumps(normal_map="n.png", tangent_map="t.png").files == (("normal_map", "n.png"), ("tangent_map", "t.png"))


@pytest.mark.parametrize(("tangent", "said"), [
    ('tangent = { file = "gone.png" }', "gone.png"),
    ('tangent = { file = "../out.png" }', "scene's folder"),
    ('tangent = { file = "scene.toml" }', "a PNG, JPEG, WebP, KTX 2 or OpenEXR image"),
    ("tangent = { angle = 361 }", "a number from -360 to 360"),
    ('tangent = { angle = "across" }', "a number from -360 to 360"),
    ("tangent = { turn = 1 }", "a table of angle, file, range"),
    ("tangent = 30", "a table of angle, file, range"),
])  # fmt: skip
def test_what_is_wrong_is_one_line(folder: Path, tangent: str, said: str) -> None:
    with pytest.raises(LoadError) as caught:
        scene_of(folder, tangent)
    assert said in str(caught.value) and "\n" not in str(caught.value)


def test_a_map_that_cannot_be_read_does_not_count(folder: Path) -> None:
    scene = scene_of(folder).with_bumps({"card": Bumps(tangent_map="gone.png", tangent_angle=20.0)})
    assert "gone.png" in str(scene.surface_flaws["card"])
    np.testing.assert_allclose(angles_of(hits_of(scene), scene), 20.0, atol=1e-3)
    with pytest.raises(LoadError, match=r"gone\.png"):
        scene.check_surfaces()
