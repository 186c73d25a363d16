"""Images in a mesh's second set of texture coordinates, in pictures of every mode, in means, and in paths.

The second set is the first one, scaled and moved: an image in it must look as one in the first set with these repeats
and this offset."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from app.project.project import Project, open_project
from app.stills.stills import render_project
from engine.material.layer_maps import ChannelImage, ChannelWeight, Images, LayerMaps, TextureTransform
from engine.scene.map_sampler import look_up_images, mean_factor
from engine.scene.mesh import Mesh, join_meshes
from engine.scene.scene_loader import Scene, load_scene
from engine.scene.surface_uvs import uvs_at
from engine.texture.texture_store import TextureStore
from tests.engine.scene.conftest import pack_glb
from tests.few_points import use_few_points
from tests.scene_text import camera, environment, placed

SHARES = np.float32([[0, 0], [1, 0], [1, 1], [0, 1]])
REPEATS, OFFSET = (2.0, 3.0), (0.25, 0.5)
HEAD = camera((0, 0, 3), 18, (24, 24), head="bounces = 2\n") + environment()
# A material's textures say which sets of its meshes are read; these ones are not there.
USES_BOTH = {
    "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}, "normalTexture": {"index": 1, "texCoord": 1},
}  # fmt: skip
IN_SECOND, IN_FIRST = "uv_set = 1", "repeats = [2, 3], offset = [0.25, 0.5]"


def card_glb(
    material: dict | None = None, sets: tuple[str, ...] = ("TEXCOORD_0", "TEXCOORD_1"), **tree: object
) -> bytes:
    """A card of a metre with two sets of coordinates, the second SHARES · REPEATS + OFFSET with v upwards."""
    places = np.concatenate([SHARES - 0.5, np.zeros((4, 1))], axis=1).astype("<f4")
    second = SHARES * np.float32(REPEATS) + np.float32(OFFSET)
    uvs = [np.column_stack([each[:, 0], 1.0 - each[:, 1]]).astype("<f4") for each in (SHARES, second)]
    arrays = [places, np.tile(np.float32([0, 0, 1]), (4, 1)), *uvs, np.array([0, 1, 2, 0, 2, 3], "<u2")]
    starts = np.cumsum([0, *(each.nbytes for each in arrays)])
    kinds = ["VEC3", "VEC3", "VEC2", "VEC2", "SCALAR"]
    attributes = {"POSITION": 0, "NORMAL": 1} | {name: 2 + k for k, name in enumerate(sets)}
    primitive = {"attributes": attributes, "indices": 4, **({"material": 0} if material else {})}
    whole = {
        "asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [primitive]}], "materials": [material] if material else [],
        "accessors": [
            {"bufferView": k, "count": len(each), "type": kind, "componentType": 5123 if each.dtype == "<u2" else 5126}
            for k, (each, kind) in enumerate(zip(arrays, kinds, strict=True))
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": int(start), "byteLength": each.nbytes}
            for start, each in zip(starts, arrays, strict=False)
        ],
        "buffers": [{"byteLength": int(starts[-1])}],
    }  # fmt: skip
    return pack_glb(whole | tree, b"".join(each.tobytes() for each in arrays))


def write_images(folder: Path) -> None:
    """A smooth colour, a smooth grey, relief and a hole, of 32 texels' side."""
    x, y = (np.mgrid[:32, :32] + 0.5)[::-1] / 32.0
    wave = 0.5 + 0.4 * np.sin(2 * np.pi * x) * np.cos(2 * np.pi * y)
    colour = np.stack([wave, 1.0 - wave, 0.5 + 0.4 * np.sin(2 * np.pi * y)], axis=2)
    relief = np.stack([0.5 + 0.3 * np.sin(2 * np.pi * x), 0.5 + 0.2 * np.sin(2 * np.pi * y), np.ones_like(x)], axis=2)
    hole = np.where((x - 0.5) ** 2 + (y - 0.5) ** 2 < 0.05, 0.0, 1.0)
    for name, pixels in (("colour", colour), ("grey", wave), ("relief", relief), ("hole", hole)):
        Image.fromarray(np.round(255 * pixels).astype(np.uint8)).save(folder / f"{name}.png")


def card_text(how: str, of_texture: str) -> str:
    """The card with every kind of image laid out as said."""
    matt = f'{{ model = "lambert", albedo = 0.8, texture = "colour.png", {of_texture} }}'
    maps = f'parameter_maps.alpha = {{ map = "grey.png", range = [0.2, 0.6], {how} }}'
    gloss = f'{{ model = "microfacet", alpha = 0.4, scale = 0.5, {maps} }}'
    images = f'normal_map = {{ file = "relief.png", {how} }}\nopacity = {{ mode = "mask", file = "hole.png", {how} }}\n'
    return placed("card", "card.glb", more=f"layer = [{matt}, {gloss}]\n{images}")


@pytest.fixture(scope="module")
def projects(tmp_path_factory: pytest.TempPathFactory) -> tuple[Project, Project]:
    """The card with its images in the second set, and as many times in the first."""
    folder = tmp_path_factory.mktemp("sets")
    (folder / "card.glb").write_bytes(card_glb(USES_BOTH))
    write_images(folder)
    texts = (
        card_text(IN_SECOND, "texture_uv_set = 1"),
        card_text(IN_FIRST, "texture_scale = [2, 3], texture_offset = [0.25, 0.5]"),
    )
    for name, text in zip(("second", "first"), texts, strict=True):
        (folder / f"{name}.toml").write_text(HEAD + text)
    second, first = (open_project(str(folder / f"{name}.toml")) for name in ("second", "first"))
    return second, first


@pytest.mark.parametrize("how", ["placement", "orbit", "deform", "paths"])
def test_an_image_in_the_second_set_is_that_image_repeated_in_the_first(
    projects: tuple[Project, Project], monkeypatch: pytest.MonkeyPatch, how: str
) -> None:
    use_few_points(monkeypatch)
    given = {"reference": True, "n_samples": 4} if how == "paths" else {"mode": how}
    second, first = (
        render_project(each, lambda *_: None, **given).picture.reshape(-1, 3)  # type: ignore[arg-type]
        for each in projects
    )
    # Only coordinates' rounding differs, and rays at the edges of holes.
    assert first.std() > 0.05
    assert np.median(np.abs(second - first)) < 1e-4 and np.quantile(np.abs(second - first), 0.97) < 0.02


def test_means_and_bounces_look_an_image_up_in_its_own_set(projects: tuple[Project, Project]) -> None:
    scenes = [each.scene for each in projects]
    maps = [each.scene.description.objects[0].layers[0].maps for each in projects]
    means = [mean_factor(scene, 0, each) for scene, each in zip(scenes, maps, strict=True)]
    np.testing.assert_allclose(*means, atol=2e-3)
    whole = mean_factor(scenes[0], 0, LayerMaps("colour.png"))
    assert np.abs(means[0] - whole).max() < 0.05  # the image is a period of waves


def test_images_of_a_node_in_two_sets_multiply(projects: tuple[Project, Project]) -> None:
    scene = projects[0].scene
    other = ChannelImage("grey.png", "grey", transform=TextureTransform(uv_set=1))
    weight = ChannelWeight(other, (0.0, 1.0), (0.25, 1.0), (0.25, 1.0))
    node = LayerMaps("colour.png", texture_strength=0.5).with_node_weight(weight)
    assert len(node.images.textures) == 2
    triangle, u, v = np.zeros(200, int), *(np.random.default_rng(1).random((2, 200)) * 0.5)
    uv = uvs_at(scene, triangle, u, v)
    np.testing.assert_allclose(uv[:, 2:], uv[:, :2] * REPEATS + OFFSET, atol=1e-5)
    texture, _ = look_up_images(node.images, scene.textures, uv)
    colour, _ = look_up_images(Images("colour.png"), scene.textures, uv)
    share = scene.textures.numbers(other).at(uv)
    # 1 + s (t - 1) of the texture, times the weight, 0.25 at black and 1 at white. Weights are on a grid four times
    # finer than the image, which rounds the bends at its texels' centres: by half an 8-bit step.
    np.testing.assert_allclose(texture, (0.5 + 0.5 * colour) * (0.25 + 0.75 * share), atol=2e-3)
    # A mesh without a second set takes the first.
    alone, _ = look_up_images(node.images, scene.textures, uv[:, :2])
    once = scene.textures.numbers(other).at(uv[:, :2])
    np.testing.assert_allclose(alone, (0.5 + 0.5 * colour) * (0.25 + 0.75 * once), atol=2e-3)


def test_meshes_with_fewer_sets_repeat_their_first() -> None:
    places, faces = np.eye(3), np.array([[0, 1, 2]], np.int32)
    one, two = (np.arange(3 * n, dtype=np.float32).reshape(1, 3, n) for n in (2, 4))
    joined = join_meshes([Mesh(places, faces, uvs=one), Mesh(places, faces, uvs=two), Mesh(places, faces)])
    assert joined.uvs is not None
    assert joined.uvs[0, 1].tolist() == [2, 3, 2, 3] and joined.uvs[1, 1].tolist() == [4, 5, 6, 7]
    assert not joined.uvs[2].any()


def loaded(folder: Path, material: dict, **given: object) -> Scene:
    """The scene of the card with a material whose textures 0 and 1 are the colour and the relief."""
    write_images(folder)
    images = {"images": [{"uri": "colour.png"}, {"uri": "relief.png"}], "textures": [{"source": 0}, {"source": 1}]}
    (folder / "card.glb").write_bytes(card_glb(material, **images, **given))  # type: ignore[arg-type]
    return load_scene(folder / "card.glb")


def test_a_glb_file_brings_the_set_of_each_texture(tmp_path: Path) -> None:
    moved = {"KHR_texture_transform": {"texCoord": 1}}
    scene = loaded(tmp_path, {
        "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0},
        "normalTexture": {"index": 1, "texCoord": 0, "extensions": moved},
    })  # fmt: skip
    card = scene.description.objects[0]
    assert card.layers[0].maps.texture_uv_set == 0 and card.bumps.bump_uv_set == 1
    assert scene.uvs is not None and scene.uvs.shape[2] == 4
    np.testing.assert_allclose(scene.uvs[0, :, 2:], scene.uvs[0, :, :2] * REPEATS + OFFSET, atol=1e-6)
    assert not any("texCoord" in each.name or "TEXCOORD" in each.name for each in scene.unshown)
    # The colour's set is the first of the mesh, whatever its number.
    scene = loaded(tmp_path, {
        "pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 1}, "metallicFactor": 0},
        "normalTexture": {"index": 1},
    })  # fmt: skip
    card = scene.description.objects[0]
    assert card.layers[0].maps.texture_uv_set == 0 and card.bumps.bump_uv_set == 1
    assert scene.uvs is not None
    np.testing.assert_allclose(scene.uvs[0, :, :2], scene.uvs[0, :, 2:] * REPEATS + OFFSET, atol=1e-6)


def test_a_third_set_is_listed_and_one_that_is_not_there_noted(tmp_path: Path) -> None:
    material = {
        "pbrMetallicRoughness": {
            "baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 0, "texCoord": 1},
        },
        "normalTexture": {"index": 1, "texCoord": 2},
    }  # fmt: skip
    scene = loaded(tmp_path, material)
    assert not scene.description.objects[0].bumps.file
    assert [each.count for each in scene.unshown if each.name == "materials.normalTexture.texCoord"] == [1]
    scene = loaded(tmp_path, material, sets=("TEXCOORD_0",))
    assert any("TEXCOORD_1 = nothing" in note for note in scene.notes)
    assert scene.uvs is not None
    np.testing.assert_array_equal(scene.uvs[0, :, :2], scene.uvs[0, :, 2:])


def test_stores_are_asked_for_each_set(tmp_path: Path) -> None:
    write_images(tmp_path)
    store = TextureStore(tmp_path / "scene.toml")
    weight = ChannelWeight(ChannelImage("grey.png"), (0.0, 1.0), (0.0, 1.0), (0.0, 1.0))
    images = LayerMaps("colour.png", texture_uv_set=1).with_node_weight(weight).images
    store.load([images])
    numbers, colours = (store.texture(each) for each in images.textures)
    assert numbers is not None and colours is not None
    assert (numbers.transform.uv_set, colours.transform.uv_set) == (0, 1)
    assert images.for_bounces.textures == tuple(each.for_bounces for each in images.textures)
