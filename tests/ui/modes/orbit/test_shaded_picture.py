"""Orbit's moving pictures in shaders against those that the worker computes; what they take, and give back."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import moderngl
import numpy as np
import pytest
from PIL import Image

from app.project.project import open_project
from engine.light.environment import Environment
from engine.material import MODELS, make_layer
from engine.material.layer import Layer
from engine.material.strokes import Stroke, Strokes
from engine.precompute.direct.pipeline import LightLink, SkyState
from engine.realtime.core.gpu_parts import N_HEAD, LightPart
from engine.realtime.triple_product import view_radiance
from engine.realtime.triple_product.gpu_export import PointExporter
from engine.realtime.triple_product.orbit_engine import MOST_SLICE_BYTES, Orbit
from engine.scene.camera_moves import orbit_camera
from engine.scene.description import CameraDescription
from tests.engine.bump_images import write_bump_images
from tests.scene_text import LEANING_LAMP, camera, facing_up, placed, scaled
from ui.gl import gpu_memory
from ui.gl.context import MOVING_VARIABLE, GraphicsError, shader_bytes
from ui.gl.gpu_memory import read_texture
from ui.modes.orbit.gl.shaded_picture import ShadedPicture

pytestmark = pytest.mark.gl

SIZE = 64, 48
TINT = 'texture = "tint.png", texture_scale = [2, 3], texture_rotation = 20, texture_wrap = ["mirror", "repeat"]'
LEAN = 'repeats = [2, -1], offset = [0.2, 0.4], wrap = "mirror"'
MATT = f'{{ model = "lambert", albedo = [0.6, 0.5, 0.4], {TINT} }}'
GLOSS = '{ model = "rough_conductor", alpha = 0.3, weight = "share.png", weight_invert = true }'
BRUSHED = '{ model = "ward_anisotropic" }, { model = "lambert", albedo = [0.1, 0.2, 0.4] }'


def scene_text() -> str:
    """A floor with images and bumps, a block with a normal map and a rotated grain, a lamp, and a spot whose cone ends
    about the camera."""
    return (
        camera((0.6, 1.5, 2.9), 42, SIZE, (0, 0.4, 0), "bounces = 3\n")
        + placed("floor", "quad", facing_up(3),
                 f'bump_map = {{ file = "bumps.png", height = 0.04, repeats = [3, 3] }}\nlayer = [{MATT}, {GLOSS}]\n')
        + placed("block", "cube", "0.7,0,0.2,0.1, 0,0.7,0,0.35, -0.2,0,0.7,0.2, 0,0,0,1",
                 f'normal_map = {{ file = "lean.png", scale = 0.3, {LEAN} }}\ntangent = {{ angle = 50 }}\n'
                 f'layer = [{BRUSHED}]\n')
        + LEANING_LAMP
        + placed("spot", "quad", scaled(0.3, (0.9, 0.9, 0.3)),
                 "emission = [0.2, 0.4, 2]\ncone = { inner = 5, outer = 40 }\n")
    )  # fmt: skip


@lru_cache(maxsize=1)
def environment() -> Environment:
    """Blue above, with a sun."""
    image = np.full((32, 64, 3), 0.2, np.float32)
    image[:10] += [0.2, 0.3, 0.6]
    image[7:9, 20:22] = 200.0
    return Environment(image, "test")


def sky(rotation: float) -> SkyState:
    """It, turned."""
    return SkyState(environment(), rotation)


class Studio:
    """An Orbit that has done its work, and who is told of it."""

    def __init__(self, folder: Path, most_slice_bytes: int = MOST_SLICE_BYTES) -> None:
        write_bump_images(folder)
        chance = np.random.default_rng(1)
        for name, values in (("tint.png", chance.random((8, 8, 3))), ("share.png", chance.random((4, 4)))):
            Image.fromarray(np.uint8(255 * values)).resize((64, 64), Image.Resampling.BICUBIC).save(folder / name)
        (folder / "scene.toml").write_text(scene_text())
        project = open_project(str(folder / "scene.toml"))
        self.layers: dict[int, tuple[Layer, ...]] = {}
        for i, layer in project.indexed_layers:
            self.layers[i] = (*self.layers.get(i, ()), layer)
        self.camera: CameraDescription = project.scene.description.camera
        self.orbit = Orbit(project.scene, n_points=300, most_slice_bytes=most_slice_bytes)

    def work(self, light: SkyState, layers: dict[int, tuple[Layer, ...]]) -> None:
        self.orbit.set_light(light)
        self.orbit.set_layers(layers)
        for _ in self.orbit.work():
            pass


@pytest.fixture(scope="module")
def studio(tmp_path_factory: pytest.TempPathFactory) -> Studio:
    made = Studio(tmp_path_factory.mktemp("shaded"))
    made.work(sky(20.0), made.layers)
    return made


@pytest.fixture
def shaded(context: moderngl.Context) -> Iterator[ShadedPicture]:
    """One ray a pixel, as the worker's; it must give back every byte that it took."""
    made = ShadedPicture(context, n_samples=0)
    yield made
    made.release()
    assert made.memory_bytes == 0


@pytest.fixture(autouse=True)
def _all_gloss_at_points(monkeypatch: pytest.MonkeyPatch) -> None:
    """Most tests are of these; sharp gloss has tests of its own."""
    monkeypatch.setattr("engine.realtime.triple_product.reflections.SHARP", 0.0)


def image(shaded: ShadedPicture, camera: CameraDescription, n: int = 64) -> np.ndarray:
    return np.asarray(read_texture(shaded.draw(camera, SIZE, n), np.float32)[..., :3])


def assert_same(studio: Studio, shaded: ShadedPicture, camera: CameraDescription, n: int = 64) -> None:
    expected, found = studio.orbit.draw(camera, SIZE, "moving", n), image(shaded, camera, n)
    off = np.abs(found - expected).max(axis=2) / expected.mean()
    assert off.mean() < 0.005
    on_floor = studio.orbit.lit.mesh.sample_view(camera, SIZE).samples.i_object.reshape(off.shape) == 0  # type: ignore[union-attr]
    # Images are looked up in one of their levels: where that changes, the two round in their own ways.
    assert np.quantile(off[on_floor], 0.9) < 0.02
    assert np.quantile(off[~on_floor], 0.995) < 0.01


def test_slices_over_larger_triangles_are_read_as_the_worker_does(tmp_path: Path, shaded: ShadedPicture) -> None:
    made = Studio(tmp_path, 12 << 20)  # a metal and a brushed layer take 37 MB
    made.work(sky(20.0), made.layers)
    assert made.orbit.notes and made.orbit.reflections.slice_bytes <= 12 << 20
    for part in PointExporter(1 << 26).parts(made.orbit):
        shaded.buffers.take(part)
    assert_same(made, shaded, made.camera)


def test_it_is_the_workers_picture_after_every_change(studio: Studio, shaded: ShadedPicture) -> None:
    telling, own = PointExporter(1 << 26), studio.camera

    def tell() -> int:
        told = list(telling.parts(studio.orbit))
        for part in told:
            shaded.buffers.take(part)
        return sum(len(part.which) for part in told if isinstance(part, LightPart))

    assert tell() == len(studio.orbit.lit.points)  # type: ignore[union-attr, arg-type]
    assert shaded.buffers.is_ready
    assert_same(studio, shaded, own)
    moved = own.model_copy(update={"position": orbit_camera(own, 0.9, 0.2).position})
    assert_same(studio, shaded, moved, 320)
    studio.work(sky(20.0), studio.layers)  # the backs that this has seen
    tell()
    floor, block = studio.layers[0], studio.layers[1]
    painted = Strokes((Stroke(0.5, 0.2, 0.9, 0.5, np.array([0, 0, 0.6, 0, 1, 0], "<f4").tobytes()),))
    edited = floor[1].replace(maps=replace(floor[1].maps, strokes=painted))
    blunt = block[0].with_parameter("alpha_u", 0.15)
    studio.work(sky(20.0), {0: (floor[0], edited), 1: (blunt, block[1])})
    before = image(shaded, own)
    assert tell() == 0  # materials alone: no light is told again
    assert np.abs(image(shaded, own) - before).max() > 0.05
    assert_same(studio, shaded, own)
    studio.work(sky(80.0), studio.layers)
    studio.orbit.set_emission({"lamp": (2.0, 3.0, 9.0)})
    studio.work(sky(80.0), studio.layers)
    tell()
    assert_same(studio, shaded, own)
    assert list(telling.parts(studio.orbit)) == []
    studio.orbit.set_emission({"lamp": (9.0, 7.0, 5.0)})
    studio.work(sky(20.0), studio.layers)


@pytest.mark.parametrize("slices_alone", [False, True])
def test_sharp_gloss_is_the_workers_pixel_by_pixel(
    studio: Studio, shaded: ShadedPicture, monkeypatch: pytest.MonkeyPatch, slices_alone: bool
) -> None:
    monkeypatch.setattr("engine.realtime.triple_product.reflections.SHARP", 0.4)
    # The shaders ask formulas of all peaks, or of none: the worker's picture is then made with the same.
    monkeypatch.setitem(view_radiance._LITTLE, "moving", np.inf if slices_alone else -1.0)
    if slices_alone:  # as measured layers
        monkeypatch.setattr("ui.modes.orbit.gl.sharp_gloss._has_formula", lambda layers: False)
    floor, block = studio.layers[0], studio.layers[1]
    metal = make_layer(MODELS["rough_conductor"], {"alpha": 0.09})
    brushed = block[0].with_parameter("alpha_u", 0.06).with_parameter("alpha_v", 0.12)
    sharp = {0: (floor[0], floor[1].with_parameter("alpha", 0.1)), 1: (brushed, block[1], metal)}
    studio.work(sky(20.0), sharp)
    exporter = PointExporter(1 << 26)
    for part in exporter.parts(studio.orbit):
        shaded.buffers.take(part)
    assert [bool(term.sharp) for term in shaded.buffers.terms] == [False, True, False, True]
    assert_same(studio, shaded, studio.camera)
    with monkeypatch.context() as usual:  # where the worker asks formulas of those peaks that slices do not know well
        usual.setitem(view_radiance._LITTLE, "moving", view_radiance._LITTLE["rest"])
        expected = studio.orbit.draw(studio.camera, SIZE, "moving", 64)
    assert slices_alone or np.abs(image(shaded, studio.camera) - expected).mean() < 0.002
    highlight = image(shaded, studio.camera)
    edited = {0: sharp[0], 1: (brushed.with_parameter("alpha_u", 0.1), block[1], metal.with_parameter("alpha", 0.07))}
    studio.work(sky(20.0), edited)
    for part in exporter.parts(studio.orbit):
        shaded.buffers.take(part)
    moved = orbit_camera(studio.camera, 0.4, 0.1)
    moved = studio.camera.model_copy(update={"position": moved.position})
    assert_same(studio, shaded, moved, 24)
    assert np.abs(image(shaded, studio.camera) - highlight).max() > 0.05
    studio.work(sky(20.0), studio.layers)


def test_sharp_gloss_of_linked_objects_is_the_workers(
    studio: Studio, shaded: ShadedPicture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The block has a sky of its own, whose peaks are others, and the lamp does not light it."""
    monkeypatch.setattr("engine.realtime.triple_product.reflections.SHARP", 0.4)
    monkeypatch.setitem(view_radiance._LITTLE, "moving", -1.0)
    floor, block = studio.layers[0], studio.layers[1]
    metal = make_layer(MODELS["rough_conductor"], {"alpha": 0.09})
    sharp = {0: (floor[0], floor[1].with_parameter("alpha", 0.1)), 1: (metal, block[1])}
    lamp = studio.orbit.scene.object_index("lamp")
    link = LightLink(frozenset({1}), sky(140.0), frozenset({lamp}))
    studio.work(sky(20.0), sharp)
    plain = studio.orbit.draw(studio.camera, SIZE, "moving", 64)
    studio.work(replace(sky(20.0), links=(link,)), sharp)
    for part in PointExporter(1 << 26).parts(studio.orbit):
        shaded.buffers.take(part)
    assert_same(studio, shaded, studio.camera)
    assert np.abs(image(shaded, studio.camera) - plain).max() > 0.05
    studio.work(sky(20.0), studio.layers)


def test_coats_have_normals_of_their_own(
    studio: Studio, shaded: ShadedPicture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("engine.realtime.triple_product.reflections.SHARP", 0.4)
    monkeypatch.setitem(view_radiance._LITTLE, "moving", -1.0)
    floor, block = studio.layers[0], studio.layers[1]
    coat = make_layer(MODELS["clearcoat"], {"alpha": 0.09}, "coat").replace(frame="coat")
    studio.work(sky(20.0), {0: floor[:1], 1: (block[1], coat)})
    exporter, own = PointExporter(1 << 26), studio.orbit.scene.description.objects[1].bumps
    pictures = []
    for bumps in (own, replace(own, coat_normal_map="lean.png", coat_strength=0.5)):
        studio.orbit.set_bumps({"block": bumps})
        studio.work(sky(20.0), {0: floor[:1], 1: (block[1], coat)})
        for part in exporter.parts(studio.orbit):
            shaded.buffers.take(part)
        assert_same(studio, shaded, studio.camera)
        pictures.append(image(shaded, studio.camera))
    assert np.abs(pictures[1] - pictures[0]).max() > 0.05
    studio.orbit.set_bumps({"block": own})
    studio.work(sky(20.0), studio.layers)


def test_edges_are_smooth(studio: Studio, context: moderngl.Context) -> None:
    smooth, hard = ShadedPicture(context), ShadedPicture(context, n_samples=0)
    for part in PointExporter(1 << 26).parts(studio.orbit):
        smooth.buffers.take(part)
        hard.buffers.take(part)
    lamp = [image(each, studio.camera).reshape(-1, 3)[:, 0] for each in (smooth, hard)]
    partly = [int(((red > 3.0) & (red < 8.5)).sum()) for red in lamp]
    smooth.release()
    hard.release()
    assert partly[1] == 0 and partly[0] > 10  # shares of the lamp's 9 at its rim


def test_what_does_not_fit_is_reported_in_a_line(
    studio: Studio, shaded: ShadedPicture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(gpu_memory, "most_buffer_bytes", lambda context: 1000)
    with pytest.raises(GraphicsError, match="buffer of 1 MiB"):
        for part in PointExporter(1000).parts(studio.orbit):
            shaded.buffers.take(part)
    assert not shaded.buffers.is_ready


def test_as_much_light_is_sent_as_goes_into_a_buffer(studio: Studio, shaded: ShadedPicture) -> None:
    n_rows = len(studio.orbit.lit.incident.stored.number)  # type: ignore[union-attr]
    for part in PointExporter(4 * n_rows * (N_HEAD + 2 * 24)).parts(studio.orbit):
        shaded.buffers.take(part)
    assert shaded.buffers.mesh is not None and shaded.buffers.mesh.n_coefficients == 24
    assert_same(studio, shaded, studio.camera, 24)


def test_software_is_left_to_the_worker_unless_shaders_are_asked_for(
    context: moderngl.Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ui.gl.context.is_software", lambda context: True)
    monkeypatch.delenv(MOVING_VARIABLE, raising=False)
    assert shader_bytes(context) == 0
    monkeypatch.setenv(MOVING_VARIABLE, "shader")
    assert shader_bytes(context) > 0
    monkeypatch.setattr("ui.gl.context._SHADER_VERSION", 999)
    with pytest.raises(GraphicsError, match=r"OpenGL 4\.3"):
        shader_bytes(context)
    monkeypatch.setenv(MOVING_VARIABLE, "gpu")
    with pytest.raises(GraphicsError, match='expected "shader" or "worker"'):
        shader_bytes(context)


def test_a_graphics_card_draws_unless_the_worker_is_asked_for(
    context: moderngl.Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ui.gl.context.is_software", lambda context: False)
    monkeypatch.delenv(MOVING_VARIABLE, raising=False)
    assert shader_bytes(context) > 0
    monkeypatch.setenv(MOVING_VARIABLE, "worker")
    assert shader_bytes(context) == 0
    monkeypatch.delenv(MOVING_VARIABLE)
    monkeypatch.setattr("ui.gl.context._SHADER_VERSION", 999)  # as on a Mac
    assert shader_bytes(context) == 0
