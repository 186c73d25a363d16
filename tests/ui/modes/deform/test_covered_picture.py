"""What lies on bending objects by texture coordinates, in shaders against compiled code: images, weights, strokes, a
patch, wrinkles; on fronts and backs, and where coordinates are mirrored."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from functools import partial
from pathlib import Path

import moderngl
import numpy as np
import pytest
from PIL import Image

from engine.light.environment import Environment
from engine.material import MODELS
from engine.material.layer import Layer, make_layer
from engine.material.layer_maps import LayerMaps
from engine.material.strokes import Stroke, Strokes
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.zonal_harmonics import patches
from engine.realtime.zonal_harmonics.deform_engine import Deform, finish_deform
from engine.realtime.zonal_harmonics.pose import Deformation, Poses
from engine.realtime.zonal_harmonics.wrinkle import N_LOBES, SIDE
from engine.realtime.zonal_harmonics.zonal import Zonal
from engine.scene.camera_moves import orbit_camera
from engine.scene.scene_loader import Scene, load_scene
from engine.scene.surface_kinds import DeformSurface
from tests.ui.modes.deform.test_posed_picture import BALL_AND_LEAF, SIZE, shown
from ui.modes.deform.gl.posed_picture import PosedPicture

# Median difference from compiled code. Graphics cards interpolate images in steps of 1/256: 1.3e-4 on an NVIDIA card.
MEDIAN = 3e-4

pytestmark = pytest.mark.gl

MATT = make_layer(MODELS["lambert"], {"albedo": (0.6, 0.5, 0.4)})
GLOSS = make_layer(MODELS["rough_conductor"], {"alpha": 0.4})
PAINTED = Strokes((Stroke(0.5, 0.2, 0.9, 0.5, np.array([0.3, 0, 0.3, 0, 1, 0], "<f4").tobytes()),))
TINTED = LayerMaps(
    texture="tint.png", texture_scale=(2.0, -1.0), texture_strength=0.8, texture_offset=(0.3, 0.9),
    texture_rotation=25.0, texture_wrap=("mirror", "clamp"),
)  # fmt: skip
SHARED = LayerMaps(weight="share.png", weight_invert=True, strokes=PAINTED)
TINTED_GLOSS = GLOSS.replace(maps=TINTED)
PATCH = DeformSurface.model_validate({"patch": {"kind": "bumps", "repeats": [3, 2], "height": 2}})
BENT: Poses = (
    ("ball", (Deformation("bend", 60.0), Deformation("twist", 40.0))),
    ("leaf", (Deformation("bend", 90.0),)),
)


def layer(maps: LayerMaps) -> Layer:
    return MATT.replace(maps=maps)


def grooves(n: int, albedo: float, n_bounces: int) -> Generator[float, None, Zonal]:
    """Any lobes that are even over the nodes of the map."""
    chance = np.random.default_rng(3)
    low, axes, coefficients = (chance.normal(size=shape) for shape in ((4,), (N_LOBES, 3), (N_LOBES, n)))
    change = np.sin(np.linspace(0.0, 3.0, SIDE * SIDE) + 1.0)
    yield 1.0
    axes = axes + 0.5 * change[:, None, None]
    axes /= np.linalg.norm(axes, axis=2, keepdims=True)
    none = np.zeros(SIDE * SIDE)
    return Zonal(
        np.outer(change, 0.1 * low) + [0.9, 0, 0, 0], axes, np.multiply.outer(change, 0.1 * coefficients), none
    )


@pytest.fixture(scope="module")
def deform(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Deform]:
    """A ball and a leaf that is open over a floor; the leaf's coordinates are mirrored."""
    folder, chance = Path(tmp_path_factory.mktemp("covered")), np.random.default_rng(1)
    tint = chance.random((8, 8, 3)).round()  # in half floats as it is, clamped texels too
    for name, values in (("tint.png", tint), ("share.png", chance.random((4, 4)))):
        Image.fromarray(np.uint8(255 * values)).save(folder / name)
    (folder / "ball.toml").write_text(BALL_AND_LEAF)
    scene = load_scene(folder / "ball.toml")
    assert scene.uvs is not None
    uvs = np.where((scene.object_of_triangle == 1)[:, None, None], scene.uvs * np.float32([-1, 1]), scene.uvs)
    scene = Scene(**{**vars(scene), "uvs": uvs})
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setitem(patches.PATTERNS, "bumps", partial(patches.bumps, 12))
        monkeypatch.setattr("engine.realtime.zonal_harmonics.object_transfer.wrinkle_lobes", grooves)
        made = Deform(scene, n_points=300, n_rays=32)
        image = np.random.default_rng(2).uniform(0.2, 2.0, (16, 32, 3)).astype(np.float32)
        made.set_light(SkyState(Environment(image, "noise"), 30.0, 1.2))
        made.set_layers({0: (MATT, GLOSS), 1: (layer(TINTED), MATT), 2: (layer(TINTED), layer(SHARED), TINTED_GLOSS)})
        made.set_bending(["ball", "leaf"])
        made.set_effort(32, 1, 0)
        yield made


def with_surfaces(deform: Deform, **surfaces: DeformSurface) -> Deform:
    deform.set_surfaces(tuple(surfaces.items()))
    return finish_deform(deform)


@pytest.fixture
def picture(context: moderngl.Context) -> Iterator[PosedPicture]:
    made = PosedPicture(context, 0)
    for _ in made.warm_up():
        pass
    yield made
    made.release()
    assert made.memory_bytes == 0


def wrinkled(across: str, depth: float | str = 0.4) -> DeformSurface:
    return DeformSurface.model_validate({"wrinkles": {"across": across, "repeats": 5, "depth": depth}})


@pytest.mark.parametrize(
    "surfaces",
    [
        {},
        {"ball": PATCH, "leaf": wrinkled("u")},
        {"leaf": PATCH, "ball": wrinkled("v")},
        {"ball": wrinkled("u", "share.png"), "floor": PATCH},
    ],
)
def test_it_is_the_picture_of_compiled_code(
    deform: Deform, picture: PosedPicture, surfaces: dict[str, DeformSurface]
) -> None:
    own = with_surfaces(deform, **surfaces).scene.description.camera
    eyes = [orbit_camera(own, np.radians(turn), 0.2) for turn in (0.0, 140.0)]
    expected = [deform.draw(eye, SIZE, BENT) for eye in eyes]
    for eye, each in zip(eyes, expected, strict=True):
        off = np.abs(shown(picture, deform, eye, BENT) - each).max(axis=2)
        assert (off > 0.01).mean() < 0.015  # pixels on edges of triangles and of texels may go to either side
        assert np.median(off) < MEDIAN
    bare = with_surfaces(deform)
    bare.set_layers({0: (MATT, GLOSS), 1: (MATT,), 2: (MATT, GLOSS)})
    for eye, each in zip(eyes, expected, strict=True):
        assert np.abs(bare.draw(eye, SIZE, BENT) - each).max(axis=2).mean() > 0.02  # what lies on them shows
    bare.set_layers({0: (MATT, GLOSS), 1: (layer(TINTED), MATT), 2: (layer(TINTED), layer(SHARED), TINTED_GLOSS)})


def test_images_are_sent_once_and_light_and_amounts_without_them(deform: Deform, picture: PosedPicture) -> None:
    eye = with_surfaces(deform, ball=PATCH).scene.description.camera
    shown(picture, deform, eye, BENT)
    told = deform.export_picture(eye, BENT[:1], picture.part_numbers)
    assert told.shape is None and told.appearance is None and told.cover is None and len(told.posed.axes)
    light = deform._light
    deform.set_light(SkyState(light.environment, 120.0, 0.3))
    told = deform.export_picture(eye, BENT, picture.part_numbers)
    assert told.appearance is not None and told.appearance.terms and told.cover is None
    deform.set_light(light)
    with_surfaces(deform, leaf=PATCH)
    told = deform.export_picture(eye, BENT, picture.part_numbers)
    assert told.cover is not None and list(told.cover.ranges) == [1, 2]
    before = deform.draw(eye, SIZE, BENT)
    assert np.median(np.abs(shown(picture, deform, eye, BENT) - before)) < MEDIAN
