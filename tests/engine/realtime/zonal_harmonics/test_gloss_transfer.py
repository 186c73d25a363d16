"""Which layers are drawn by rows, what edits leave of them, and what pictures by rows show and by lobes do not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from engine.core.generators import run_to_end
from engine.light.environment import Environment
from engine.material import MODELS
from engine.material.layer import Layer, make_layer
from engine.precompute.direct.pipeline import Placement, SkyState
from engine.realtime.stills import PathReference
from engine.realtime.zonal_harmonics.deform_engine import Deform, finish_deform
from engine.realtime.zonal_harmonics.gloss_pilot import relative_error
from engine.realtime.zonal_harmonics.gloss_transfer import LayerGloss
from engine.realtime.zonal_harmonics.object_transfer import ObjectTransfer, Reflectance
from engine.realtime.zonal_harmonics.zonal import Zonal
from engine.scene.scene_loader import load_scene
from engine.scene.surface_kinds import NO_SURFACE, DeformSurface, Membrane, Subsurface, Wrinkles
from tests.scene_text import camera, environment, facing_up, placed

SIZE = (48, 36)
MATT = make_layer(MODELS["lambert"], {"albedo": (0.6, 0.5, 0.4)})
BLACK = make_layer(MODELS["lambert"], {"albedo": (0.0, 0.0, 0.0)})


def shiny(**parameters: object) -> Layer:
    return make_layer(MODELS["rough_conductor"], {"alpha": 0.5, **parameters})


def half_sky(name: str = "half") -> Environment:
    """Bright where x > 0: longitudes from -x around by -y."""
    image = np.full((32, 64, 3), 0.05, np.float32)
    image[:, 16:48] = 1.0
    return Environment(image, name)


class Store:
    """Fitted transfer in memory."""

    def __init__(self) -> None:
        self.stored: list[tuple[tuple[object, ...], Zonal]] = []

    def get(self, made_of: tuple[object, ...], n_places: int) -> Zonal | None:
        for known, zonal in self.stored:
            if len(known) == len(made_of) and all(map(np.array_equal, known, made_of)):
                return zonal
        return None

    def put(self, made_of: tuple[object, ...], zonal: Zonal) -> None:
        self.stored.append((made_of, zonal))


def made(folder: Path, store: Store | None = None) -> Deform:
    """A floor with a wall along y on it, which hides from the floor's half at x < 0 what is at x > 0."""
    path = folder / "wall.toml"
    wall = placed("wall", "quad", "0,0,1,0, 0,1,0,0, -1,0,0,0, 0,0,0,1")
    path.write_text(
        camera((-1.0, 0.3, 3.0), 40, SIZE) + environment() + placed("floor", "quad", facing_up(1, (0, -1, 0))) + wall
    )
    deform = Deform(load_scene(path), n_points=200, n_rays=200, store=store)
    deform.set_light(SkyState(half_sky()))
    deform.set_bounces(1)
    return deform


def finished(deform: Deform, layer: Layer, n_rows: int | None) -> LayerGloss | None:
    """How the floor's gloss is drawn in the end."""
    deform.set_layers({0: (MATT, layer), 1: (MATT,)})
    deform.set_effort(200, 4, n_rows)
    return finish_deform(deform).gloss.get((0, layer))


def test_an_override_is_carried_out_and_rows_are_in_the_memory(tmp_path: Path) -> None:
    deform = made(tmp_path)
    lobe = finished(deform, shiny(), 0)
    assert (
        lobe is not None and lobe.rows is None and (lobe.choice.value, lobe.choice.reason) == ("one lobe", "as is set")
    )
    before = deform.n_bytes
    by_rows = finished(deform, shiny(), 6)
    assert by_rows is not None and by_rows.rows is not None and by_rows.choice.value == "6 rows"
    n_points = (deform._points.owners == 0).sum()  # type: ignore[union-attr]
    # each row 31 numbers of 4 bytes; the weights of 32 x 32 views in three channels
    assert deform.n_bytes - before == by_rows.n_bytes == 4 * 6 * (31 * n_points + 32 * 32 * 3)
    assert deform.is_done and deform.lost_shares.keys() == {0}


def test_a_new_colour_keeps_rows_and_another_shape_of_the_highlight_does_not(tmp_path: Path) -> None:
    deform = made(tmp_path)
    first, half, sharper = (finished(deform, each, 9) for each in (shiny(), shiny(scale=0.5), shiny(alpha=0.4)))
    assert first and half and sharper and first.rows and half.rows and sharper.rows
    assert half.rows[0] is first.rows[0]
    assert np.abs(half.rows[1].views - 0.5 * first.rows[1].views).max() < 1e-4 * np.abs(first.rows[1].views).max()
    assert sharper.rows[0] is not first.rows[0]


def test_a_pilot_chooses_under_the_environment_however_it_is_rotated(tmp_path: Path) -> None:
    deform = made(tmp_path)
    chosen = finished(deform, shiny(), None)
    assert chosen is not None and chosen.choice.found
    deform.set_light(SkyState(deform._light.environment, 90.0, 2.0))
    assert deform.is_done and finished(deform, shiny(), None) is chosen
    deform.set_light(SkyState(half_sky("another")))
    assert not deform.is_done
    again = finished(deform, shiny(), None)
    assert again is not None and again is not chosen and again.rows == chosen.rows  # the same rows, not fitted again


def test_without_a_sky_the_lobe_stays(tmp_path: Path) -> None:
    deform = made(tmp_path)
    deform.set_light(SkyState(None))
    dark = finished(deform, shiny(), None)
    assert dark is not None and (dark.rows, dark.choice.reason) == (None, "no sky")


def test_rows_are_stored_and_found_again(tmp_path: Path) -> None:
    store = Store()
    first = finished(made(tmp_path, store), shiny(), 9)
    n_stored = len(store.stored)
    again = finished(made(tmp_path, store), shiny(), 9)
    assert first and again and first.rows and again.rows and len(store.stored) == n_stored
    np.testing.assert_array_equal(first.rows[0].coefficients, again.rows[0].coefficients)


@pytest.mark.parametrize(
    ("surface", "has_rows"),
    [
        (DeformSurface(subsurface=Subsurface(scattering=50.0)), True),
        (DeformSurface(membrane=Membrane(translucency=0.5)), False),
    ],
)
def test_membranes_keep_the_lobe(tmp_path: Path, surface: DeformSurface, has_rows: bool) -> None:
    deform = made(tmp_path)
    deform.set_surfaces((("floor", surface),))
    assert (finished(deform, shiny(), 6) is not None) == has_rows
    assert np.isfinite(deform.draw(deform.scene.description.camera, SIZE)).all()


def test_detail_keeps_the_lobe() -> None:
    wrinkled = ObjectTransfer(0, (0,), DeformSurface(wrinkles=Wrinkles()), Reflectance(), 0, 200, 4)
    assert not wrinkled.can_have_gloss_rows and replace(wrinkled, surface=NO_SURFACE).can_have_gloss_rows


@pytest.mark.parametrize("seed", range(2))
def test_gloss_beside_a_wall_is_nearer_to_paths_by_rows_than_by_a_lobe(tmp_path: Path, seed: int) -> None:
    """From random places left of the wall, where the floor mirrors what the wall hides of the bright half of the sky;
    the wall is black. The lobe is dimmed as a diffuse floor is."""
    deform, random = made(tmp_path), np.random.default_rng(seed)
    x, y, z = random.uniform((-3.0, -0.4, -0.5), (-2.0, 0.4, 0.5))
    eye = deform.scene.description.camera.model_copy(
        update={"position": (x, y, z), "target": (-0.25, -1.0, 0.0), "fov_y": 11.0}
    )
    paths, layers, sky = (
        PathReference(deform.scene.from_camera(eye, SIZE), ()),
        {0: (shiny(),), 1: (BLACK,)},
        half_sky(),
    )
    for _ in range(16):
        run_to_end(paths.trace(layers, SkyState(sky), 1))
    assert paths.picture is not None
    deform.set_layers(layers)
    is_floor = Placement(paths._placement.scene).hits.object_image.reshape(SIZE[::-1]) == 0
    errors = {}
    for n_rows in (0, 16):
        deform.set_effort(1000, 4, n_rows)
        picture = finish_deform(deform).draw(eye, SIZE, (), "rest")
        errors[n_rows] = relative_error(picture[is_floor], paths.picture[is_floor].astype(np.float64))
    assert errors[16] < 0.9 * errors[0], errors
