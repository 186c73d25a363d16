"""A scene written for Mitsuba 3: what stands in the folder, the tables against the layers they are of, and, where
`INSITU_PEER_PYTHON` names an interpreter that has it, Mitsuba's picture against ours."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

from app.document.commands.layers import SetParameter
from app.document.view_state import SetView
from app.editor.editor import Editor
from app.export.materials import LEAST_COSINE, grid, highlight_width, tabulated
from app.export.mitsuba import export_scene
from app.project.project import open_project
from app.stills.stills import render_picture
from app.worker.cache import ArrayCache
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from benchmarks.peer import VARIABLE
from engine.core.errors import InsituError
from engine.curve.operators import Operator
from engine.light.radiance_files import read_radiance_image
from engine.material import MODELS, make_layer
from engine.material.layer import evaluate_layers
from engine.precompute.direct.pipeline import Placement
from engine.scene.loaders.ply import read_ply
from tests.app.files.test_brdf_files import insitu
from tests.naive.tensor_files import Gloss, acquired, tensor_bytes
from tests.pictures import write_exr
from tests.scene_text import camera, environment, material, placed, scaled
from tests.ui.small_scene import coloured_sky, write_small_scene

BUMP = Operator("amplify", "y", 0.1, 0.2, 0.4, 0.6, 0.8)
LAMBERT = make_layer(MODELS["lambert"], {"albedo": (0.2, 0.3, 0.1)}, "base")
EDITED = make_layer(MODELS["rough_conductor"], {"alpha": 0.2}, "coat").with_operators("theta_h", [BUMP])
BRUSHED = make_layer(MODELS["ward_anisotropic"], {"alpha_u": 0.3, "alpha_v": 0.15}, "brushed")


def export(folder: Path, *values: tuple[str, object]) -> tuple[ElementTree.Element, list[str]]:
    """The small scene, written into `folder`/out."""
    project = open_project(str(write_small_scene(folder)), (48, 32), values)
    notes = export_scene(project, folder / "out", 2, lambda share, text: None)
    return ElementTree.parse(folder / "out" / "scene.xml").getroot(), notes


@pytest.fixture
def small_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    """For what is asked of a table besides its accuracy."""
    monkeypatch.setattr("app.export.materials.ROUND_SHAPE", (1, 8, 9, 8))
    monkeypatch.setattr("app.export.materials.TURNED_SHAPE", (6, 8, 9, 8))


def test_the_folder_holds_all_of_the_scene(tmp_path: Path) -> None:
    root, notes = export(tmp_path, ("ball.coat.scale", 0.4), ("light.intensity", 2.0))
    assert not notes
    ground, ball, lamp = root.findall("shape")
    diffuse = ground.find("bsdf/bsdf[@type='diffuse']/rgb")
    assert diffuse is not None and diffuse.get("value") == "0.6 0.5 0.4"
    blend = ball.find("bsdf/bsdf[@type='blendbsdf']")
    assert blend is not None  # base 0.4 at most, coat 0.4: the two of Mitsuba
    share = float(blend.find("float").get("value"))  # type: ignore[union-attr,arg-type]
    albedo = [float(v) for v in blend.find("bsdf[@type='diffuse']/rgb").get("value").split()]  # type: ignore[union-attr]
    assert np.multiply(albedo, 1.0 - share) == pytest.approx((0.1, 0.2, 0.4))
    assert lamp.find("emitter/rgb").get("value") == "18 14 10"  # type: ignore[union-attr]
    assert root.find("integrator/integer").get("value") == "3"  # type: ignore[union-attr]
    file = tmp_path / "out" / "meshes" / "01_ball.ply"
    mesh, scene = read_ply(file).parts[0].mesh, open_project(str(tmp_path / "small.toml"), (1, 1)).scene
    first, last = scene.triangle_ranges[1]
    corners = scene.vertices[scene.triangles[first:last]] + scene.origin
    np.testing.assert_allclose(mesh.vertices[mesh.triangles], corners, atol=1e-6)
    sky = read_radiance_image(tmp_path / "out" / "sky.exr")
    np.testing.assert_allclose(sky, 2.0 * read_radiance_image(tmp_path / "sky.exr"), rtol=1e-6)


def test_what_mitsuba_has_not_becomes_a_table(tmp_path: Path) -> None:
    root, _ = export(tmp_path, ("ball.material", "Velvet, red"))
    bsdf = root.findall("shape")[1].find("bsdf")
    assert bsdf is not None and bsdf.get("type") == "insitu"
    with np.load(tmp_path / "out" / bsdf.find("string").get("value")) as data:  # type: ignore[union-attr,arg-type]
        assert data["table"].shape[-1] == 3 and np.isfinite(data["table"]).all() and data["table"].min() >= 0.0


def write_measured_scene(folder: Path, **acquisition: object) -> Path:
    """A ball of a measured gloss under the small scene's sky."""
    (folder / "gloss.bsdf").write_bytes(tensor_bytes(acquired(Gloss(0.3, 0.3), **acquisition)))  # type: ignore[arg-type]
    write_exr(folder / "sky.exr", coloured_sky(128))
    layers = material(*(f'model = "{name}", file = "gloss.bsdf"' for name in ("measured_diffuse", "measured")))
    scene = (
        camera((0, 0.4, 2), resolution=(32, 32)) + environment(file="sky.exr") + placed("ball", "sphere", more=layers)
    )
    (folder / "ball.toml").write_text(scene)
    return folder / "ball.toml"


@pytest.mark.usefixtures("small_tables")
@pytest.mark.parametrize(
    ("edit", "acquisition", "is_handed_back"),
    [
        ((), {}, True),
        ((("ball.1.scale", 0.5),), {}, False),
        ((), {"wavelengths": np.array([450.0, 550.0, 650.0])}, False),
        ((), {"n_phi": 5, "turn": np.pi}, False),
    ],
)
def test_a_measurement_is_handed_back(tmp_path: Path, edit: tuple, acquisition: dict, is_handed_back: bool) -> None:
    file = write_measured_scene(tmp_path, n_theta=4, n=8, n_facets=12, **acquisition)
    export_scene(open_project(str(file), (8, 8), edit), tmp_path / "out", 1, lambda share, text: None)
    bsdf = ElementTree.parse(tmp_path / "out" / "scene.xml").getroot().find("shape/bsdf")
    assert bsdf is not None
    if is_handed_back:
        inner = bsdf.find("bsdf[@type='measured']/string")
        assert inner is not None and inner.get("value") == "materials/00_ball.bsdf"
        assert (tmp_path / "out/materials/00_ball.bsdf").read_bytes() == (tmp_path / "gloss.bsdf").read_bytes()
    else:
        assert bsdf.get("type") == "insitu"


@pytest.mark.usefixtures("small_tables")
def test_a_coat_on_a_measurement_is_written(tmp_path: Path) -> None:
    file = write_measured_scene(tmp_path, n_theta=4, n=8, n_facets=12)
    file.write_text(file.read_text().replace("layer = [", 'layer = [{ model = "clearcoat", name = "coat" }, '))
    export_scene(open_project(str(file), (8, 8)), tmp_path / "out", 1, lambda share, text: None)
    bsdf = ElementTree.parse(tmp_path / "out" / "scene.xml").getroot().find("shape/bsdf")
    assert bsdf is not None and bsdf.get("type") == "insitu"


@pytest.mark.usefixtures("small_tables")
def test_images_multiply_tables_in_their_mapping(tmp_path: Path) -> None:
    tint = np.zeros((4, 4, 3), np.uint8)
    tint[:2] = 255, 128, 0
    Image.fromarray(tint).save(tmp_path / "tint.png")
    Image.fromarray(np.full((2, 2), 51, np.uint8)).save(tmp_path / "share.png")
    values = (
        ("ground.0.texture", "tint.png"), ("ground.0.texture_space", "linear"), ("ground.0.texture_scale", (2.0, 3.0)),
        ("ground.0.texture_rotation", 90.0), ("ground.0.texture_wrap", ("mirror", "clamp")),
        ("ground.0.texture_strength", 0.5), ("ground.0.weight", "share.png"), ("ground.0.weight_invert", True),
    )  # fmt: skip
    root, notes = export(tmp_path, *values)
    assert not notes
    with np.load(tmp_path / "out" / root.findall("shape")[0].find("bsdf/string").get("value")) as data:  # type: ignore[union-attr,arg-type]
        albedo = np.array([0.6, 0.5, 0.4]) / np.pi  # the same for all directions
        np.testing.assert_allclose(data["table"][0, 0, 0, 0, 0], albedo, rtol=1e-3, atol=1e-6)
        half = np.array([1.0, 0.5 + 0.5 * 128 / 255, 0.5])
        np.testing.assert_allclose(data["image_0_0"][[0, 3], 0], [half, [0.5] * 3], atol=1e-6)
        # Rotated counter-clockwise by 90 degrees after the repeats: (u, v) becomes (-3 v, 2 u).
        np.testing.assert_allclose(data["matrix_0_0"], [[0, -3, 0], [2, 0, 0]], atol=1e-12)
        assert data["wrap_0_0"].tolist() == [1, 2]
        np.testing.assert_allclose(data["image_0_1"], 0.8, atol=1e-6)
        assert not data["vertex_colours_0"]


@pytest.mark.usefixtures("small_tables")
def test_nodes_of_a_map_are_tables_with_their_weights(tmp_path: Path) -> None:
    random = np.random.default_rng(6)
    Image.fromarray(random.integers(0, 256, (8, 8)).astype(np.uint8)).save(tmp_path / "rough.png")
    root, notes = export(tmp_path, ("ball.coat.alpha_map", {"map": "rough.png", "range": [0.2, 0.4]}))
    assert not notes
    with np.load(tmp_path / "out" / root.findall("shape")[1].find("bsdf/string").get("value")) as data:  # type: ignore[union-attr,arg-type]
        weights = [data[f"image_{k}_0"] for k in range(len(data["table"])) if f"image_{k}_0" in data]
        assert len(weights) == len(data["table"]) - 1  # the base has no image
        np.testing.assert_allclose(sum(weights), 1.0, atol=1e-5)


def test_opacity_is_a_mask(tmp_path: Path) -> None:
    alpha = np.full((4, 4, 4), 255, np.uint8)
    alpha[:2, :, 3] = 0
    Image.fromarray(alpha).save(tmp_path / "leaf.png")
    for mode, expected in (("mask", {0.0, 1.0}), ("blend", {0.0, 0.5})):
        values = (("ground.opacity_mode", mode), ("ground.opacity_map", "leaf.png"), ("ground.opacity_factor", 0.5),
                  ("ground.opacity_cutoff", 0.4))  # fmt: skip
        root, notes = export(tmp_path, *values)
        assert not notes
        mask = root.findall("shape")[0].find("bsdf[@type='mask']")
        assert mask is not None and mask.find("bsdf[@type='twosided']/bsdf[@type='diffuse']") is not None
        name = mask.find("texture/string[@name='filename']").get("value")  # type: ignore[union-attr]
        opacity = read_radiance_image(tmp_path / "out" / str(name))
        corners = {round(float(opacity[row, 0, 0]), 3) for row in (len(opacity) // 4, 3 * len(opacity) // 4)}
        assert corners == expected
    root, _ = export(tmp_path, ("ground.opacity_mode", "blend"), ("ground.opacity_factor", 0.3))
    assert root.findall("shape")[0].find("bsdf/float[@name='opacity']").get("value") == "0.3"  # type: ignore[union-attr]


def test_the_worker_writes_what_the_window_asks_for(tmp_path: Path) -> None:
    client = InProcessClient(RequestDispatcher(ArrayCache(tmp_path / "cache")))
    editor = Editor(client, str(write_small_scene(tmp_path)), resolution=(6, 4))
    editor.do(SetView.of(n_lights=20))
    _tick_until(editor, lambda: editor.scene_is_open)
    editor.do(SetParameter("ground.clay", "albedo", 0.25))
    editor.exchange.export_scene(tmp_path / "out")
    _tick_until(editor, lambda: editor.status.message.startswith("written"))
    root = ElementTree.parse(tmp_path / "out" / "scene.xml").getroot()
    assert root.find("shape/bsdf/bsdf/rgb").get("value") == "0.25 0.25 0.25"  # type: ignore[union-attr]
    assert (tmp_path / "out" / "render.py").is_file()
    editor.close()


def _tick_until(editor: Editor, done: Callable[[], bool]) -> None:
    for now in range(100_000):
        if done():
            return
        editor.tick(0.01 * now)
    raise AssertionError(editor.status)


def test_a_folder_that_cannot_be_written_is_reported_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("in the way")
    with pytest.raises(InsituError, match="out: not written"):
        export(tmp_path)


def test_the_command_tells_before_the_scene_is_read_where_it_cannot_write(capsys, monkeypatch) -> None:
    monkeypatch.setattr("app.cli.exchange.open_project", lambda *_: pytest.fail("the scene was read"))
    assert insitu("export", "plate", "-o", "/proc/self/out") == 1
    assert capsys.readouterr().err.startswith("insitu: /proc/self/out: not written, ")


@pytest.mark.parametrize(("layers", "bound"), [((LAMBERT, EDITED), 0.01), ((BRUSHED,), 0.06)])
def test_a_table_is_its_layers_between_its_places(layers: tuple, bound: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.export.materials.ROUND_SHAPE", (1, 80, 90, 32))  # smaller than in use
    monkeypatch.setattr("app.export.materials.TURNED_SHAPE", (24, 24, 48, 24))
    table = tabulated(layers)
    alpha = highlight_width(table)
    generator = np.random.default_rng(5)
    wi, wo = (_above_horizon(generator, 4000) for _ in range(2))
    found, wanted = _looked_up(table, wi, wo) * wi[:, 2:], evaluate_layers(layers, wi, wo)
    assert np.sqrt(np.mean((found - wanted) ** 2)) <= bound * np.sqrt(np.mean(wanted**2))
    assert 0.05 < alpha < 1.0


def test_the_places_of_a_table_are_half_and_difference_angles() -> None:
    wi, wo = grid((8, 5, 4, 6), 3)
    half = (wi + wo) / np.maximum(np.linalg.norm(wi + wo, axis=-1, keepdims=True), 1e-12)
    theta_h = np.arccos(np.clip(half[:, 1, :, 2], -1.0, 1.0))
    assert theta_h[:, 0] == pytest.approx(np.linspace(0.0, 1.0, 5) ** 2 * np.pi / 2, abs=1e-6)
    np.testing.assert_allclose(np.arctan2(half[2, 1, :, 1], half[2, 1, :, 0]), 2 * np.pi * 3 / 8, atol=1e-6)
    np.testing.assert_allclose((wi * wo).sum(-1)[:, 1], np.cos(np.pi / 3), atol=1e-6)


def _above_horizon(generator: np.random.Generator, n: int) -> np.ndarray:
    directions = generator.normal(size=(n, 3))
    directions[:, 2] = np.abs(directions[:, 2])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions[:, 2] = np.maximum(directions[:, 2], 20 * LEAST_COSINE)
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


def _looked_up(table: np.ndarray, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
    """The table between its places, by the formulas of `render.py` in numpy."""
    half = (wi + wo) / np.linalg.norm(wi + wo, axis=1, keepdims=True)
    flat = np.hypot(half[:, 0], half[:, 1])
    x, y = half[:, 0] / flat, half[:, 1] / flat
    along = (wi[:, 0] * x + wi[:, 1] * y) * half[:, 2] - wi[:, 2] * flat
    angles = (
        np.arctan2(y, x) / (2 * np.pi),
        np.sqrt(np.arctan2(flat, half[:, 2]) * 2 / np.pi),
        np.arccos(np.clip((wi * half).sum(1), -1, 1)) * 2 / np.pi,
        np.arctan2(wi[:, 1] * x - wi[:, 0] * y, along) / (2 * np.pi),
    )
    value = np.zeros((len(wi), 3))
    places = []
    for share, n, closes in zip(angles, table.shape, (True, False, False, True), strict=False):
        position = (share % 1.0) * n if closes else share * (n - 1)
        low = np.minimum(position.astype(int), n - 1 if closes else n - 2)
        places.append((low, (low + 1) % n if closes else low + 1, position - low))
    for corner in np.ndindex(2, 2, 2, 2):
        index = tuple(place[upper] for place, upper in zip(places, corner, strict=True))
        weight = np.prod([p[2] if upper else 1 - p[2] for p, upper in zip(places, corner, strict=True)], axis=0)
        value += weight[:, None] * table[index]
    return value


@pytest.mark.slow
@pytest.mark.skipif(VARIABLE not in os.environ, reason=f"{VARIABLE} names no interpreter that has Mitsuba 3")
def test_mitsuba_renders_what_we_render(tmp_path: Path) -> None:
    values = (("ball.material", "Velvet, red"), ("ball.pile.scale", (0.9, 0.5, 0.2)))
    file = write_small_scene(tmp_path)
    write_exr(tmp_path / "sky.exr", coloured_sky(128))  # Mitsuba looks up between texels, which may not matter here
    project = open_project(str(file), (96, 64), values)
    export_scene(project, tmp_path / "out", 1, lambda share, text: None)
    program = [os.environ[VARIABLE], str(tmp_path / "out" / "render.py"), "--samples", "512"]
    subprocess.run(program, check=True, capture_output=True)
    theirs = read_radiance_image(tmp_path / "out" / "render.exr").astype(np.float64)
    ours = render_picture(project, lambda step: None).astype(np.float64)
    hits = Placement(project.scene).hits
    seen = np.full(96 * 64, -1)
    for index, (first, last) in enumerate(hits.object_ranges):
        seen[hits.pixel[first:last]] = index
    blocks = [image.reshape(16, 4, 24, 4, -1).swapaxes(1, 2).reshape(384, 16, -1) for image in (ours, theirs)]
    there = seen.reshape(16, 4, 24, 4).swapaxes(1, 2).reshape(384, 16)
    for index in (0, 1):  # the ground, and the ball in velvet: a pixel is a point for us, an area for Mitsuba
        whole = (there == index).all(axis=1)
        found, wanted = (each[whole].mean(axis=1) for each in blocks)
        assert whole.sum() > 10
        assert found.mean() == pytest.approx(wanted.mean(), rel=0.01)
        assert np.sqrt(np.mean((found - wanted) ** 2)) < 0.03 * wanted.mean()


@pytest.mark.slow
@pytest.mark.skipif(VARIABLE not in os.environ, reason=f"{VARIABLE} names no interpreter that has Mitsuba 3")
@pytest.mark.parametrize("acquisition", [{"n_theta": 12}, {"n_theta": 12, "n_phi": 13, "turn": np.pi}])
def test_mitsuba_renders_a_measurement_as_we_do(tmp_path: Path, acquisition: dict) -> None:
    # The file itself where it is isotropic; else a table.
    file = write_measured_scene(tmp_path, **acquisition)
    project = open_project(str(file), (32, 32))
    export_scene(project, tmp_path / "out", 1, lambda share, text: None)
    program = [os.environ[VARIABLE], str(tmp_path / "out" / "render.py"), "--samples", "1024"]
    subprocess.run(program, check=True, capture_output=True)
    theirs = read_radiance_image(tmp_path / "out" / "render.exr").astype(np.float64)
    ours = render_picture(project, lambda step: None).astype(np.float64)
    inside = np.hypot(*(np.mgrid[:32, :32] - 15.5)) < 8.0
    found, wanted = ours[inside], theirs[inside]
    assert found.mean() == pytest.approx(wanted.mean(), rel=0.01)
    assert np.sqrt(np.mean((found - wanted) ** 2)) < 0.03 * wanted.mean()


@pytest.mark.slow
@pytest.mark.skipif(VARIABLE not in os.environ, reason=f"{VARIABLE} names no interpreter that has Mitsuba 3")
def test_mitsuba_renders_images_nodes_colours_and_holes_as_we_do(tmp_path: Path) -> None:
    """Side by side: a ball with a rotated texture and a map of alpha, a card of vertex colours, a leaf with holes."""
    random = np.random.default_rng(3)
    blobs = np.kron(random.integers(0, 256, (6, 6)), np.ones((8, 8)))
    leaf = np.full((48, 48, 4), 255, np.uint8)
    leaf[..., 3] = np.kron((random.random((8, 8)) > 0.4) * 255, np.ones((6, 6)))
    tint = random.integers(0, 256, (8, 8, 3)).astype(np.uint8).repeat(6, axis=0).repeat(6, axis=1)
    for name, pixels in (("rough", blobs.astype(np.uint8)), ("tint", tint), ("leaf", leaf)):
        Image.fromarray(pixels).save(tmp_path / f"{name}.png")
    colours = "255 0 0", "0 255 0", "0 0 255", "255 255 255"
    corners = [f"{x} {y} 0 {c}" for (x, y), c in zip(((-1, -1), (1, -1), (1, 1), (-1, 1)), colours, strict=True)]
    head = ["ply", "format ascii 1.0", "element vertex 4", *(f"property float {axis}" for axis in "xyz")]
    head += [*(f"property uchar {name}" for name in ("red", "green", "blue")), "element face 2"]
    head += ["property list uchar int vertex_indices", "end_header"]
    (tmp_path / "card.ply").write_text("\n".join([*head, *corners, "3 0 1 2", "3 0 2 3", ""]))
    write_exr(tmp_path / "sky.exr", coloured_sky(128))
    ball = material(
        'model = "lambert", albedo = [0.5, 0.3, 0.2], texture = "tint.png", texture_scale = [2, 3], '
        "texture_rotation = 30",
        'model = "rough_conductor", alpha = 0.3, scale = 0.5, '
        'parameter_maps = { alpha = { map = "rough.png", range = [0.15, 0.6] } }',
    )  # fmt: skip
    holes = 'opacity = { mode = "mask", file = "leaf.png", repeats = [1, 2] }\n'
    (tmp_path / "row.toml").write_text(
        camera((0, 0, 6), 30, (120, 40)) + environment(file="sky.exr")
        + placed("ball", "sphere", scaled(0.9, (-1.9, 0, 0)), ball)
        + placed("card", "card.ply", scaled(0.8), material('model = "lambert", albedo = 0.8, vertex_colours = true'))
        + placed("leaf", "quad", scaled(1.6, (1.9, 0, 0)), material('model = "lambert", albedo = 0.5') + holes)
    )  # fmt: skip
    project = open_project(str(tmp_path / "row.toml"))
    assert export_scene(project, tmp_path / "out", 1, lambda share, text: None) == []
    program = [os.environ[VARIABLE], str(tmp_path / "out" / "render.py"), "--samples", "256"]
    subprocess.run(program, check=True, capture_output=True)
    theirs = read_radiance_image(tmp_path / "out" / "render.exr").astype(np.float64)
    ours = render_picture(project, lambda step: None).astype(np.float64)
    for first in (0, 40, 80):  # means within 0.1 %, relRMSE 0.5 to 0.8 %, when this was written
        found, wanted = ours[:, first : first + 40], theirs[:, first : first + 40]
        assert found.mean() == pytest.approx(wanted.mean(), rel=0.005)
        assert np.sqrt(np.mean((found - wanted) ** 2)) < 0.02 * wanted.mean()


def test_a_far_scene_is_written_about_its_own_centre(tmp_path):
    """Mitsuba has single precision, in which neighbouring numbers at 4,600 km are 0.5 m apart."""
    near, far = tmp_path / "near", tmp_path / "far"
    for folder, x in ((near, 0.0), (far, 4.6e6)):
        scene = tmp_path / f"{folder.name}.toml"
        scene.write_text(
            camera((x, 1, 4), target=(x, 0, 0)) + environment(1.0) + placed("ball", "sphere", scaled(1, (x, 0, 0)))
        )
        notes = export_scene(open_project(str(scene)), folder, 1, lambda *_: None)
        assert [note for note in notes if "moved by" in note] == (
            ["the scene stands far from the origin, where single precision is coarse: moved by -4600000, 0, 0 m"]
            if x else []
        )  # fmt: skip
    assert (near / "scene.xml").read_bytes() == (far / "scene.xml").read_bytes()
    here, there = (read_ply(path).parts[0].mesh for f in (near, far) for path in (f / "meshes").iterdir())
    assert (here.triangles == there.triangles).all()
    assert np.abs(here.vertices - there.vertices).max() < 1e-6
