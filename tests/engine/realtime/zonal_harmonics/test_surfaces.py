"""What a scene's file says of surfaces for Deform: closed forms on a sheet, and what of it is refused."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engine.core.errors import LoadError
from engine.light.environment import Environment
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.zonal_harmonics.deform_engine import Deform, finish_deform
from engine.realtime.zonal_harmonics.patches import PATTERNS
from engine.realtime.zonal_harmonics.pose import Deformation
from engine.realtime.zonal_harmonics.surface_details import heights, wrinkle_lobes
from engine.realtime.zonal_harmonics.transfer import Medium
from engine.render.display import error_to_radiance
from engine.scene.description import SceneDescription
from engine.scene.scene_loader import Scene, load_scene
from engine.scene.surface_kinds import NO_SURFACE
from tests.scene_text import camera, environment, placed, scaled

SIZE = (24, 18)
WHITE = make_layer(MODELS["lambert"], {"albedo": (1.0, 1.0, 1.0)})


def scene_of(folder: Path, says: str, shape: str = "quad") -> Scene:
    """A square in the plane z = 0, seen from +z."""
    path = folder / "sheet.toml"
    text = camera((0, 0, 2.0), 30, SIZE) + environment() + placed("sheet", shape)
    path.write_text(f"{text}\n[object.deform]\n{says}\n")
    return load_scene(path)


def lit(scene: Scene, sky: np.ndarray) -> Deform:
    deform = Deform(scene, n_points=0, n_rays=64)
    deform.set_light(SkyState(Environment(sky.astype(np.float32), "sky")))
    deform.set_layers({0: (WHITE,)})
    return finish_deform(deform)


def even(front: float, back: float) -> np.ndarray:
    """A sky of one radiance over z > 0 and another below: the centre column looks along -z."""
    sky = np.full((64, 128, 3), front)
    sky[:, 32:96] = back
    return sky


def middle(deform: Deform) -> float:
    picture = deform.draw(deform.scene.description.camera, SIZE)
    return float(picture[9, 12, 0])


@pytest.mark.parametrize("alpha", [0.0, 0.4, 1.0])
def test_a_membrane_shows_the_light_before_it_and_a_share_of_that_behind(tmp_path: Path, alpha: float) -> None:
    scene = scene_of(tmp_path, f"membrane = {{ translucency = {alpha} }}")
    # Under even light a white sheet has radiance 1, and alpha more from behind.
    assert middle(lit(scene, even(1.0, 1.0))) == pytest.approx(1.0 + alpha, abs=5e-3)
    # Of a half sphere n bands hold what the cosine has of them: the even ones are 0 beyond DC in the step.
    before, behind = middle(lit(scene, even(1.0, 0.0))), middle(lit(scene, even(0.0, 1.0)))
    assert before + behind == pytest.approx(1.0 + alpha, abs=1e-2)
    assert before - behind == pytest.approx(1.0 - alpha, abs=0.03)


def test_a_membrane_of_a_thickness_reflects_and_transmits_as_a_slab(tmp_path: Path) -> None:
    thin = "membrane = { thickness = 2e-4, scattering = 5000, absorption = 100 }"
    deform = lit(scene_of(tmp_path, thin), even(1.0, 0.0))
    front = middle(deform)
    deform.set_light(SkyState(Environment(even(0.0, 1.0).astype(np.float32), "sky")))
    reflected, transmitted = Medium(5000.0, 100.0).slab_shares(2e-4)
    assert front == pytest.approx(reflected, abs=0.03) and middle(deform) == pytest.approx(transmitted, abs=0.03)
    assert 0.2 < reflected < 0.8 and 0.2 < transmitted < 0.8


def test_a_membrane_goes_with_the_sheet_that_bends(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, "membrane = { translucency = 0.5 }")
    deform = lit(scene, even(1.0, 0.0))
    poses = (("sheet", (Deformation("twist", 180.0),)),)
    bent = deform.draw(scene.description.camera, SIZE, poses)
    assert np.isfinite(bent).all() and bent.max() <= 1.6


def test_a_dark_patch_of_no_height_is_the_flat_surface(tmp_path: Path) -> None:
    sky = np.random.default_rng(1).uniform(0.0, 2.0, (16, 32, 3))
    flat = scene_of(tmp_path, "patch = { kind = 'bumps', height = 1e-6 }")
    plain = load_scene(tmp_path / "sheet.toml")
    plain = Scene(**{**vars(plain), "description": without_surface(plain)})
    drawn, expected = (lit(scene, sky).draw(flat.description.camera, SIZE) for scene in (flat, plain))
    assert drawn == pytest.approx(expected, rel=0.02, abs=0.02)


def test_what_a_file_says_comes_through_to_the_window(tmp_path: Path) -> None:
    description = scene_of(tmp_path, "patch = { kind = 'weave', repeats = [3, 2] }").description
    assert SceneDescription.model_validate_json(description.model_dump_json(by_alias=True)) == description


def without_surface(scene: Scene) -> object:
    bare = tuple(each.model_copy(update={"deform": NO_SURFACE}) for each in scene.description.objects)
    return scene.description.model_copy(update={"objects": bare})


@pytest.fixture(autouse=True)
def small_patches(monkeypatch: pytest.MonkeyPatch) -> None:
    for kind, made in list(PATTERNS.items()):
        monkeypatch.setitem(PATTERNS, kind, partial(made, 16))


WRINKLES = pytest.param("wrinkles = { repeats = 6, across = 'v' }", marks=pytest.mark.sweep)


@pytest.mark.parametrize("says", ["patch = { kind = 'weave', repeats = [3, 2], height = 3 }", WRINKLES])
def test_detail_is_darker_than_the_flat_surface_and_shows(tmp_path: Path, says: str, monkeypatch) -> None:
    monkeypatch.setattr("engine.realtime.zonal_harmonics.wrinkle._ROUNDS", 1)
    scene = scene_of(tmp_path, says)
    picture = lit(scene, np.ones((8, 16, 3))).draw(scene.description.camera, SIZE, (), "rest")[7:11, 8:16]
    assert 0.3 < picture.mean() < 0.99 and picture.std() > 0.01  # what grooves hide of an even sky


def test_how_far_lobes_of_detail_are_off_is_shown_where_it_lies(tmp_path: Path) -> None:
    deform = lit(scene_of(tmp_path, "patch = { kind = 'weave', repeats = [3, 2], height = 3 }"), np.ones((8, 16, 3)))
    errors = deform._found.details[0]._patch.errors
    assert 0.0 < errors.mean() < 0.1
    picture = deform.draw_errors(deform.scene.description.camera, SIZE)[7:11, 8:16]
    assert picture.max() <= error_to_radiance(errors.max()) * 1.001 and picture.std() > 0.1 * picture.mean() > 0.0


@pytest.mark.parametrize(("size", "texels"), [((300, 150), (75, 150)), ((8, 4), (4, 8)), ((1, 1), (2, 2))])
def test_an_image_of_heights_has_no_more_texels_than_a_pattern(tmp_path: Path, size, texels) -> None:
    Image.fromarray(np.random.default_rng(1).integers(0, 256, size[::-1]).astype(np.uint8)).save(tmp_path / "dents.png")
    scene = scene_of(tmp_path, "patch = { file = 'dents.png', height = 2 }")
    found = heights(scene, scene.description.objects[0].deform.patch)
    assert max(found.shape) <= 128
    assert (
        found.min() >= 0.0 and (found.shape == texels or size[0] > 128) and found.max() == (0.2 if size[0] > 1 else 0.0)
    )


@pytest.mark.parametrize(("thickness", "least", "most"), [(0.0, 0.0, 1e-3), (0.02, 0.1, 1.0), (0.5, 1e-3, 0.1)])
def test_light_comes_through_a_patch_that_is_a_thin_slab(
    tmp_path: Path, thickness: float, least: float, most: float
) -> None:
    """Lit from behind alone; radiance as far below 0 as the bands' error is drawn as 0."""
    slab = f"patch = {{ kind = 'waffle', height = 0.1, thickness = {thickness} }}"
    deform = lit(scene_of(tmp_path, slab), even(0.0, 1.0))
    assert least <= middle(deform) <= most


def test_grooves_are_lighter_by_what_they_reflect_and_are_fitted_once(tmp_path: Path, monkeypatch) -> None:
    """An albedo of 7/8, the most that is told apart, and one bounce as light between surfaces is left out."""
    asked = []

    def spied(n: int, albedo: float, n_bounces: int):
        asked.append((albedo, n_bounces))
        return (yield from wrinkle_lobes(n, albedo, n_bounces))

    monkeypatch.setattr("engine.realtime.zonal_harmonics.wrinkle._ROUNDS", 1)
    monkeypatch.setattr("engine.realtime.zonal_harmonics.surface_details.SIDE", 5)
    monkeypatch.setattr("engine.realtime.zonal_harmonics.wrinkle.wrinkles.__defaults__", (6, 5, 0.0, 0))
    monkeypatch.setattr("engine.realtime.zonal_harmonics.object_transfer.wrinkle_lobes", spied)
    deform = lit(scene_of(tmp_path, "wrinkles = { repeats = 6, depth = 0.8 }"), np.ones((8, 16, 3)))
    assert asked == [(0.875, 2)]
    bright = deform.draw(deform.scene.description.camera, SIZE)[7:11, 8:16].mean()
    deform.set_bounces(1)
    dark = finish_deform(deform).draw(deform.scene.description.camera, SIZE)[7:11, 8:16].mean()
    assert asked[1:] == [(0.0, 0)] and 1.05 * dark < bright < 1.0


def test_light_goes_through_what_is_thin(tmp_path: Path) -> None:
    """Lit from behind alone, a slab of 1 cm lets light through that one of matt stone does not."""
    text = camera((0, 0, 2.0), 30, SIZE) + environment() + placed("sheet", "cube", scaled((1, 1, 0.01)))
    path = tmp_path / "slab.toml"
    path.write_text(text + "\n[object.deform]\nsubsurface = { scattering = 200, absorption = 1 }\n")
    scene = load_scene(path)
    deform = Deform(scene, n_points=3000, n_rays=64)
    deform.set_light(SkyState(Environment(even(0.0, 1.0).astype(np.float32), "sky")))
    deform.set_layers({0: (WHITE,)})
    assert middle(finish_deform(deform)) > 0.1


@pytest.mark.parametrize(
    ("says", "said"),
    [
        ("membrane = { translucency = 1.5 }", "translucency"),
        ("membrane = { translucency = 'map.png' }", "map.png"),
        ("membrane = { translucency = '../map.png' }", "map.png"),
        ("membrane = { thickness = -1 }", "thickness"),
        ("membrane = { thickness = 1e-3, ior = 0.5 }", "ior"),
        ("patch = { kind = 'knit' }", "kind"),
        ("patch = {}", "exactly one of kind and file"),
        ("patch = { kind = 'weave', repeats = [0, 1] }", "repeats"),
        ("subsurface = { absorption = 1 }", "scattering"),
        ("subsurface = { scattering = -1 }", "scattering"),
        ("patch = { kind = 'weave', thickness = -0.1 }", "thickness"),
        ("patch = { kind = 'weave', thickness = 0.1, scattering = 0 }", "scattering"),
        ("wrinkles = { depth = 2 }", "depth"),
        ("wrinkles = { depth = 'none.png' }", "none.png"),
        ("membrane = {}\nsubsurface = { scattering = 1 }", "at most one of membrane"),
        ("fur = {}", "fur"),
    ],
)
def test_what_makes_no_sense_is_one_line(tmp_path: Path, says: str, said: str) -> None:
    with pytest.raises(LoadError, match=said) as error:
        scene_of(tmp_path, says)
    assert "\n" not in str(error.value)
