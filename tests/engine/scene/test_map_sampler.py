"""Texture coordinates of meshes, images at pixels, and which images a scene may name."""

import os
import tomllib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engine.core.errors import LoadError
from engine.material import MODELS
from engine.material.layer import Layer
from engine.material.layer_maps import Images, LayerMaps, MapMeans
from engine.precompute.direct.pipeline import Placement
from engine.scene.description import load_description, parse_description
from engine.scene.map_sampler import MapFactors, MapSampler, look_up_images
from engine.scene.mesh import place_copies
from engine.scene.primitives import PRIMITIVES
from engine.scene.scene_loader import Scene, load_scene
from engine.scene.surface_uvs import uvs_at
from tests.engine.scene.conftest import read_mesh
from tests.scene_text import camera, material, placed

HEAD = camera((0, 0, 3), 20, (24, 24))
CARD = HEAD + placed("card", "quad", more=material('model = "lambert", MAPS'))
FACE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 2 0\nvt 2 1\nvt 0 1 0\nf 1/1 2/2 3/3 4/4\n"
PLY = (
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    "property float {0}\nproperty float {1}\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0 0 0\n1 0 0 2 0\n0 1 0 0 3\n3 0 1 2\n"
)


def write(path: Path, pixels: np.ndarray) -> Path:
    Image.fromarray(np.asarray(pixels, np.uint8)).save(path)
    return path


def scene_of(folder: Path, text: str) -> Scene:
    (folder / "scene.toml").write_text(text)
    return load_scene(folder / "scene.toml")


def at(mesh_uvs: np.ndarray, mesh_triangles: np.ndarray, vertices: np.ndarray) -> dict[tuple[float, ...], set]:
    """All texture coordinates at each position."""
    found: dict[tuple[float, ...], set] = {}
    for uvs, corners in zip(mesh_uvs, mesh_triangles, strict=True):
        for uv, corner in zip(uvs, corners, strict=True):
            found.setdefault(tuple(np.round(vertices[corner], 6).tolist()), set()).add(tuple(uv.tolist()))
    return found


def test_a_texture_stands_upright_on_the_fronts_of_primitives() -> None:
    quad = PRIMITIVES["quad"]()
    corners = at(quad.uvs, quad.triangles, quad.vertices)
    assert corners[-0.5, -0.5, 0.0] == {(0.0, 0.0)} and corners[0.5, 0.5, 0.0] == {(1.0, 1.0)}
    for mesh in (make() for make in PRIMITIVES.values()):
        assert mesh.uvs.shape == (len(mesh.triangles), 3, 2) and mesh.uvs.min() >= 0.0 and mesh.uvs.max() <= 1.0
        # Seen from the front u grows to the right and v upwards: triangles keep their winding.
        one, two = mesh.uvs[:, 1] - mesh.uvs[:, 0], mesh.uvs[:, 2] - mesh.uvs[:, 0]
        assert (one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0] > 0.0).all()


def test_the_sphere_is_a_map_without_a_torn_cell() -> None:
    sphere = PRIMITIVES["sphere"]()
    assert np.ptp(sphere.uvs[:, :, 0], axis=1).max() <= 1.5 / 128  # no cell spans the seam
    p = sphere.vertices[sphere.triangles].mean(axis=1)
    phi = np.arctan2(p[:, 0], p[:, 2]) / (2 * np.pi) % 1.0
    assert np.abs(sphere.uvs[:, :, 0].mean(axis=1) - phi).max() < 1e-2
    assert np.abs(sphere.uvs[:, :, 1].mean(axis=1) - 0.5 - np.arcsin(2 * p[:, 1] / 1.0001) / np.pi).max() < 1e-2


def test_obj_and_ply_bring_theirs(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text(FACE)
    mesh = read_mesh(tmp_path / "a.obj")
    assert at(mesh.uvs, mesh.triangles, mesh.vertices)[1.0, 0.0, 0.0] == {(2.0, 0.0)}
    (tmp_path / "b.obj").write_text(FACE.replace("f 1/1 2/2 3/3 4/4", "f 1/1 2/2 3/3 4"))
    assert read_mesh(tmp_path / "b.obj").uvs is None  # one corner has none
    (tmp_path / "c.obj").write_text(FACE.replace("4/4", "4/9"))
    with pytest.raises(LoadError, match="vt index"):
        read_mesh(tmp_path / "c.obj")
    for names in (("s", "t"), ("u", "v"), ("texture_u", "texture_v")):
        (tmp_path / "a.ply").write_text(PLY.format(*names))
        np.testing.assert_array_equal(read_mesh(tmp_path / "a.ply").uvs, [[[0, 0], [2, 0], [0, 3]]])
    (tmp_path / "a.ply").write_text(PLY.format("s", "t").replace("1 0 0 2 0", "1 0 0 1e30 0"))
    np.testing.assert_array_equal(read_mesh(tmp_path / "a.ply").uvs, [[[0, 0], [0, 0], [0, 3]]])  # beyond range: 0


def test_a_mirrored_mesh_keeps_its_texture() -> None:
    quad = PRIMITIVES["quad"]()
    mirrored = place_copies(quad, np.diag([-1.0, 1.0, 1.0, 1.0])[None])
    corners = at(mirrored.uvs, mirrored.triangles, mirrored.vertices)
    assert corners[0.5, -0.5, 0.0] == {(0.0, 0.0)} and corners[-0.5, 0.5, 0.0] == {(1.0, 1.0)}


def test_each_pixel_sees_its_place_of_the_image(tmp_path: Path) -> None:
    # The card spans 22.7 pixels of 24: a ramp from black on the left to white on the right, read at pixel centres.
    ramp = np.tile(np.arange(256), (4, 1))
    write(tmp_path / "ramp.png", ramp)
    scene = scene_of(tmp_path, CARD.replace("MAPS", 'weight = "ramp.png"'))
    placement = Placement(scene)
    hits = placement.hits
    seen = MapSampler(scene, placement.caster, hits).sample(0, Images(weight="ramp.png"))
    x = hits.position[:, 0] + 0.5
    inside = (x > 0.1) & (x < 0.9)
    np.testing.assert_allclose(seen.weight[inside], (256 * x[inside] - 0.5) / 255, atol=2e-3)
    assert seen.means.weight == pytest.approx(0.5, abs=1e-3) and (seen.texture == 1.0).all()
    # Repeated four times, texture alone: the same ramp four times as steep; the weight map is not repeated.
    images = Images(texture="ramp.png", texture_space="linear", texture_scale=(4.0, 1.0), weight="ramp.png")
    seen = MapSampler(scene, placement.caster, hits).sample(0, images)
    inside = np.abs((4 * x) % 1.0 - 0.5) < 0.25
    np.testing.assert_allclose(seen.texture[inside, 1], (256 * ((4 * x[inside]) % 1.0) - 0.5) / 255, atol=5e-3)
    # ∫ frac(4x) x dx = Σ_k ∫ ... = 1/4 + 1/48 for k = 0 … 3 repeats.
    assert seen.means.both[0] == pytest.approx(0.25 + 1 / 48, abs=2e-3)


@pytest.mark.parametrize("repeats", [1.0, 3.0, 10.0])
def test_a_pixel_has_the_mean_of_its_area(repeats: float, tmp_path: Path) -> None:
    # Tiles of 8 texels, 64 to a side, at 2.8 texels a pixel and more, against 32 x 32 look-ups in each pixel.
    generator = np.random.default_rng(4)
    write(tmp_path / "tiles.png", generator.integers(40, 256, (8, 8, 3)).repeat(8, axis=0).repeat(8, axis=1))
    scene = scene_of(tmp_path, CARD.replace("MAPS", 'texture = "tiles.png", texture_space = "linear"'))
    placement = Placement(scene)
    sampler = MapSampler(scene, placement.caster, placement.hits)
    images = Images(texture="tiles.png", texture_space="linear", texture_scale=(repeats, repeats))
    seen, image = sampler.sample(0, images).texture, scene.textures.texture(images)
    assert image is not None
    uv, across, down = sampler.footprints(0)
    steps = (np.arange(32) + 0.5) / 32 - 0.5
    looked_up = [image.at(uv + x * across + y * down, repeats=(repeats, repeats)) for x in steps for y in steps]
    expected = np.mean(looked_up, axis=0)
    error = np.sqrt(((seen - expected) ** 2).mean()) / expected.mean()
    assert error < 0.007  # of one filter over a whole pixel: 1.0, 1.1 and 6.5 %


def test_an_image_far_finer_than_the_pixels_is_its_mean(tmp_path: Path) -> None:
    pixels = np.random.default_rng(2).integers(0, 2, (512, 512, 3)) * 255
    write(tmp_path / "noise.png", pixels)
    scene = scene_of(tmp_path, CARD.replace("MAPS", 'texture = "noise.png", texture_scale = 8'))
    placement = Placement(scene)
    maps = scene.description.objects[0].layers[0].maps
    seen = MapSampler(scene, placement.caster, placement.hits).sample(0, maps.images)
    assert seen.texture.std() < 0.02 and np.abs(seen.texture - 0.5).max() < 0.06
    np.testing.assert_allclose(seen.means.texture, pixels.mean(axis=(0, 1)) / 255, atol=5e-3)


def test_layers_of_an_object_share_what_they_have_in_common(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path / "ramp.png", np.tile(np.arange(256), (4, 1)))
    scene = scene_of(tmp_path, CARD.replace("MAPS", 'weight = "ramp.png"'))
    placement = Placement(scene)
    sampler = MapSampler(scene, placement.caster, placement.hits)
    first = sampler.sample(0, Images(weight="ramp.png"))
    monkeypatch.setattr(MapSampler, "_trace_footprints", None)  # not traced again
    again = sampler.sample(0, Images("ramp.png", "linear", (2.0, 1.0), "ramp.png"))
    assert np.shares_memory(first.weight, again.weight)
    twice = sampler.sample(0, Images("ramp.png", "linear", (1.0, 1.0)))
    np.testing.assert_array_equal(twice.texture[:, 0], first.weight)
    assert np.abs(again.texture - twice.texture).max() > 0.3  # repeats are another sampling


def test_a_file_that_was_written_since_is_read_again(tmp_path: Path) -> None:
    write(tmp_path / "grey.png", np.full((4, 4), 51))
    scene = scene_of(tmp_path, CARD.replace("MAPS", 'weight = "grey.png"'))
    images = Images(weight="grey.png")
    first = scene.textures.weight(images)
    assert first is not None and first is scene.textures.weight(images)
    write(tmp_path / "grey.png", np.full((5, 5), 102))
    again = scene.textures.weight(images)
    assert again is not None and again.mean[0] == pytest.approx(0.4)
    (tmp_path / "grey.png").unlink()
    with pytest.raises(LoadError, match="No such file"):
        scene.textures.weight(images)


def test_looking_up_along_a_ray_meets_the_same_place(tmp_path: Path) -> None:
    write(tmp_path / "ramp.png", np.tile(np.arange(256), (4, 1)))
    scene = scene_of(tmp_path, CARD.replace("MAPS", 'weight = "ramp.png"'))
    found = Placement(scene).caster.intersect(np.float32([[-0.25, 0.1, 1.0]]), np.float32([[0.0, 0.0, -1.0]]))
    uv = uvs_at(scene, found.triangle, found.u, found.v)
    np.testing.assert_allclose(uv, [[0.25, 0.6]], atol=1e-6)
    _, weight = look_up_images(Images(weight="ramp.png"), scene.textures, uv)
    assert weight[0] == pytest.approx(63.5 / 255, abs=1e-4)


def test_the_mean_of_a_factor_follows_from_three_means() -> None:
    rng = np.random.default_rng(4)
    texture, weight = rng.random((1000, 3)), rng.random(1000)
    both = tuple((texture * weight[:, None]).mean(axis=0).tolist())
    means = MapMeans(tuple(texture.mean(axis=0).tolist()), float(weight.mean()), both)
    for maps in (LayerMaps("a", weight="b"), LayerMaps("a", texture_strength=0.3, weight="b", weight_invert=True)):
        np.testing.assert_allclose(means.factor(maps), maps.factor(texture, weight).mean(axis=0), rtol=1e-12)
    alone = LayerMaps("a", weight_invert=True)  # without a map there is nothing to invert
    np.testing.assert_array_equal(alone.factor(texture, np.ones(1000)), texture)


def test_what_a_scene_says_of_maps_survives_json(tmp_path: Path) -> None:
    said = 'texture = "a.png", texture_space = "linear", texture_scale = [2, 3.5], weight = "b.exr", '
    said += "weight_invert = true"
    (tmp_path / "scene.toml").write_text(CARD.replace("MAPS", said))
    described = load_description(tmp_path / "scene.toml")
    assert described.objects[0].layers[0].maps == LayerMaps("a.png", "linear", (2.0, 3.5), 1.0, "b.exr", True)
    assert type(described).model_validate_json(described.model_dump_json(by_alias=True)) == described


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ("texture = 3", "texture = 3, expected the name of an image"),
        ('texture_space = "gamma"', 'expected "srgb" or "linear"'),
        ("texture_scale = [1, 2, 3]", "expected a number or two"),
        ("texture_scale = 0", "none 0"),
        ("texture_strength = 2", "expected a number from 0 to 1"),
        ('weight_invert = "yes"', "expected true or false"),
    ],
)
def test_values_that_maps_do_not_take(tmp_path: Path, said: str, words: str) -> None:
    with pytest.raises(LoadError) as caught:
        parse_description(tomllib.loads(CARD.replace("MAPS", said)), "scene.toml")
    assert words in str(caught.value) and "object 0 'card': layer 0: " in str(caught.value)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("nothing.png", "No such file"),
        ("../secret.png", "outside the scene folder"),
        ("/etc/passwd", "a relative path"),
        ("https://example.org/a.png", "a relative path"),
        ("folder.png", "a folder"),
        ("pipe.png", "a named pipe"),
        ("link.png", "outside the scene folder"),
        ("text.png", "a PNG, JPEG, WebP, KTX 2 or OpenEXR image"),
    ],
)
def test_images_that_a_scene_may_not_name(tmp_path: Path, name: str, words: str) -> None:
    folder = tmp_path / "scene"
    folder.mkdir()
    write(tmp_path / "secret.png", np.zeros((2, 2, 3)))
    (folder / "folder.png").mkdir()
    os.mkfifo(folder / "pipe.png")
    (folder / "link.png").symlink_to(tmp_path / "secret.png")
    (folder / "text.png").write_text("no image")
    with pytest.raises(LoadError, match=words):
        scene_of(folder, CARD.replace("MAPS", f'texture = "{name}"'))


# Corners of a card without texture coordinates: 4 wide and 2 high, it covers the lower half of its image.
BARE = "v -2 -1 0\nv 2 -1 0\nv 2 1 0\nv -2 1 0\nf 1 2 3 4\n"


def bare_card(folder: Path, scale: str = "[1, 1]") -> Scene:
    """Quarters of one image: below red and green, above blue and white."""
    (folder / "bare.obj").write_text(BARE)
    write(folder / "a.png", np.repeat(np.repeat([[[0, 0, 255], [255] * 3], [[255, 0, 0], [0, 255, 0]]], 32, 0), 32, 1))
    maps = f'texture = "a.png", texture_scale = {scale}'
    text = CARD.replace('primitive = "quad"', 'mesh = "bare.obj"').replace("MAPS", maps)
    return scene_of(folder, text.replace("fov_y = 20", "fov_y = 36"))


def test_a_mesh_without_coordinates_is_projected_on(tmp_path: Path) -> None:
    scene = bare_card(tmp_path)
    assert scene.notes == ("card: no texture coordinates, so images are projected from the sides of its box",)
    images = scene.description.objects[0].layers[0].maps.images
    placement = Placement(scene)
    seen = MapSampler(scene, placement.caster, placement.hits).sample(0, images)
    columns = placement.hits.pixel % 24
    left, right = columns < 10, columns > 13
    assert left.any() and np.allclose(seen.texture[left], (1, 0, 0), atol=0.02)
    assert right.any() and np.allclose(seen.texture[right], (0, 1, 0), atol=0.02)
    assert np.allclose(seen.means.texture, (0.5, 0.5, 0.0), atol=0.02)  # only the lower half is on it
    found = placement.caster.intersect(
        np.tile(scene.camera_position.astype(np.float32), (len(columns), 1)),
        placement.hits.ray_directions.reshape(-1, 3)[placement.hits.pixel],
    )  # what paths look up at their vertices is what the eye sees
    layer = Layer(MODELS["lambert"], "a", (), maps=scene.description.objects[0].layers[0].maps)
    factors = MapFactors(scene, {0: [layer]})
    looked_up = factors.at_path_vertices(found, np.zeros(len(columns), np.int32), np.arange(len(columns)))
    assert np.allclose(looked_up[left | right, 0], seen.texture[left | right], atol=0.02)


def test_repeats_count_on_the_box(tmp_path: Path) -> None:
    scene = bare_card(tmp_path, "[1, 2]")
    images = scene.description.objects[0].layers[0].maps.images
    placement = Placement(scene)
    means = MapSampler(scene, placement.caster, placement.hits).sample(0, images).means
    assert np.allclose(means.texture, (0.5, 0.5, 0.5), atol=0.02)  # all of it, once
