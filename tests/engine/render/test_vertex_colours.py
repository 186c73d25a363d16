"""Colours of vertices in pictures of every mode, in means, and in paths: closed forms."""

from pathlib import Path

import numpy as np
import pytest

from app.project.project import Project, open_project
from app.stills.stills import render_project
from engine.material.layer_maps import Images, LayerMaps
from engine.material.map_tables import maps_from
from engine.precompute.direct.pipeline import Placement
from engine.scene.map_sampler import MapSampler, mean_factor
from engine.scene.scene_loader import load_scene
from tests.engine.scene.conftest import pack_glb
from tests.few_points import use_few_points
from tests.scene_text import camera, environment, placed

WHITE = '{ model = "lambert", albedo = 1.0, vertex_colours = true }'
HEAD = camera((0, 0, 3), 18, (24, 24), head="bounces = 1\n") + environment()
# Red grows to the right, green upwards; blue and opacity are even.
SHARES = np.float32([[0, 0], [1, 0], [1, 1], [0, 1]])
COLOURS = np.stack([SHARES[:, 0], 0.2 + 0.6 * SHARES[:, 1], np.full(4, 0.5), np.ones(4)], axis=1).astype("<f4")


def card_glb(colours: np.ndarray = COLOURS, material: dict | None = None) -> bytes:
    """A card of a metre whose vertices have these colours (4, 3 or 4), floats or normalized integers."""
    places = np.concatenate([SHARES - 0.5, np.zeros((4, 1))], axis=1).astype("<f4")
    normals, indices = np.tile(np.float32([0, 0, 1]), (4, 1)), np.array([0, 1, 2, 0, 2, 3], "<u2")
    arrays = [places, normals, np.ascontiguousarray(colours), indices]
    starts = np.cumsum([0, *(each.nbytes + -each.nbytes % 4 for each in arrays)])
    components = {"f": 5126, "u1": 5121, "u2": 5123}
    kinds = ["VEC3", "VEC3", f"VEC{colours.shape[1]}", "SCALAR"]
    primitive = {"attributes": {"POSITION": 0, "NORMAL": 1, "COLOR_0": 2}, "indices": 3}
    tree = {
        "asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [primitive if material is None else primitive | {"material": 0}]}],
        "materials": [] if material is None else [material],
        "accessors": [
            {"bufferView": k, "count": len(each), "type": kind, "normalized": k == 2 and each.dtype.kind == "u",
             "componentType": components.get(each.dtype.kind) or components[each.dtype.str[1:]]}
            for k, (each, kind) in enumerate(zip(arrays, kinds, strict=True))
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": int(start), "byteLength": each.nbytes}
            for start, each in zip(starts, arrays, strict=False)
        ],
        "buffers": [{"byteLength": int(starts[-1])}],
    }  # fmt: skip
    return pack_glb(tree, b"".join(each.tobytes() + bytes(-each.nbytes % 4) for each in arrays))


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Project:
    folder = tmp_path_factory.mktemp("coloured")
    (folder / "card.glb").write_bytes(card_glb())
    (folder / "scene.toml").write_text(HEAD + placed("card", "card.glb", more=f"layer = [{WHITE}]\n"))
    return open_project(str(folder / "scene.toml"))


def expected(project: Project) -> tuple[np.ndarray, np.ndarray]:
    """Pixels (N,) within the card, and the colour of their centres (N, 3)."""
    hits = Placement(project.scene).hits
    inside = np.abs(hits.position[:, :2]).max(axis=1) < 0.45
    red, green = hits.position[inside, :2].T + 0.5
    return hits.pixel[inside], np.stack([red, 0.2 + 0.6 * green, np.full(len(red), 0.5)], axis=1)


@pytest.mark.parametrize("how", ["placement", "orbit", "deform", "paths"])
def test_a_white_card_under_a_white_sky_has_its_vertices_colours(
    project: Project, monkeypatch: pytest.MonkeyPatch, how: str
) -> None:
    use_few_points(monkeypatch)
    given = {"reference": True, "n_samples": 16} if how == "paths" else {"mode": how}
    picture = render_project(project, lambda *_: None, **given).picture.reshape(-1, 3)  # type: ignore[arg-type]
    pixels, colours = expected(project)
    # Nothing is in the way, so that all light is reflected: radiance 1 times the colour. Deform's bands of light leave
    # less than a percent.
    found = picture[pixels]
    if how == "paths":  # whose noise is the same in all channels; blue is even
        found *= 0.5 / found[:, 2:]
    np.testing.assert_allclose(found, colours, rtol=0.012, atol=0.012)


def test_strength_fades_them_and_means_are_theirs(project: Project) -> None:
    scene = project.scene
    maps = maps_from({"vertex_colours": True, "texture_strength": 0.5})
    # The mean of colours that are linear over a square is that of its middle; half of it is white.
    np.testing.assert_allclose(mean_factor(scene, 0, LayerMaps(vertex_colours=True)), [0.5, 0.5, 0.5], atol=1e-3)
    np.testing.assert_allclose(mean_factor(scene, 0, maps), [0.75, 0.75, 0.75], atol=1e-3)
    placement = Placement(scene)
    seen = MapSampler(scene, placement.caster, placement.hits).sample(0, Images(vertex_colours=True))
    red = placement.hits.position[:, 0] + 0.5
    np.testing.assert_allclose(seen.texture[:, 0], red, atol=1e-5)
    assert maps.is_tinted and not maps.is_plain and not maps.is_of_files


@pytest.mark.parametrize("metallic", [0.0, 0.5, 1.0])
def test_a_glb_file_multiplies_its_base_colour(tmp_path: Path, metallic: float) -> None:
    material = {"pbrMetallicRoughness": {"metallicFactor": metallic, "roughnessFactor": 1.0}}
    (tmp_path / "card.glb").write_bytes(card_glb(material=material))
    scene = load_scene(tmp_path / "card.glb")
    layers = {layer.model + (layer.name or ""): layer.maps for layer in scene.description.objects[0].layers}
    # What has no base colour, the dielectric's reflection, has no vertex colours [glTF20, B].
    tinted = {name: maps.vertex_colours for name, maps in layers.items()}
    assert (
        tinted
        == {
            0.0: {"diffuse_basebase": True, "microfacetgloss": False},
            0.5: {"diffuse_basebase": True, "microfacetgloss": False, "microfacetmetal": True},
            1.0: {"microfacetgloss": False, "microfacetmetal": True},
        }[metallic]
    )
    assert scene.colours is not None and scene.colours.shape == (len(scene.triangles), 3, 4)
    floor = scene.colours[slice(*scene.triangle_ranges[1])]
    assert (floor == 1.0).all()  # of an object without any


@pytest.mark.parametrize(
    "colours",
    [COLOURS[:, :3], np.round(255 * COLOURS).astype("u1"), np.round(65535 * COLOURS).astype("<u2")],
)
def test_colours_of_three_numbers_and_of_integers_are_read(tmp_path: Path, colours: np.ndarray) -> None:
    (tmp_path / "card.glb").write_bytes(card_glb(colours))
    scene = load_scene(tmp_path / "card.glb")
    assert scene.colours is not None
    np.testing.assert_allclose(scene.colours[0], COLOURS[[0, 1, 2]], atol=0.003)
    # A mesh without a material is white under its colours, not grey.
    (layer,) = scene.description.objects[0].layers
    assert layer.maps.vertex_colours and layer.parameters["albedo"] == (1.0, 1.0, 1.0)


def test_numbers_that_are_no_shares_are_clamped_with_a_note(tmp_path: Path) -> None:
    colours = COLOURS.copy()
    colours[0, :3] = np.nan, -1.0, 7.0
    (tmp_path / "card.glb").write_bytes(card_glb(colours))
    scene = load_scene(tmp_path / "card.glb")
    assert scene.colours is not None
    assert scene.colours[0, 0].tolist() == [1.0, 0.0, 1.0, 1.0]
    assert any("COLOR_0" in note and "3 numbers" in note for note in scene.notes)
