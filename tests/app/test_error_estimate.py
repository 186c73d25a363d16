"""What stills say of their own error, against path-traced pictures and settings that are known to be poor."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import zoom

from app.__main__ import Desktop
from app.cli.program import run
from app.project.project import Project, open_project
from app.stills.stills import Still, layers_by_object, plan_still, render_picture, render_project
from engine.core.generators import run_to_end
from engine.light.radiance_files import read_radiance_image
from engine.precompute.direct.pipeline import Placement
from engine.precompute.indirect import refinement
from engine.precompute.indirect.indirect_light import IndirectLight
from engine.precompute.indirect.sampling_settings import STILL, BounceSeries, SamplingSettings
from engine.realtime.triple_product.orbit_engine import Orbit
from engine.realtime.zonal_harmonics.deform_engine import Deform, finish_deform
from engine.reference.path_tracer import trace_halves
from engine.render import error_estimate, picture_error
from engine.render.error_estimate import estimate_drawn_errors, estimate_point_errors, interior_points
from engine.render.picture_difference import errors
from engine.render.picture_error import ErrorEstimate
from engine.render.still import (
    Picture,
    find_indirect,
    noise_in,
    reflect_layers,
    reflected_light,
    still_layers,
    still_quality,
    with_maps,
)
from tests.scene_text import LAMBERT, ground, placed, scaled

JUDGES = Path(__file__).resolve().parents[1] / "golden" / "rooms"
ROOMS = ("cornell", "room", "stairwell", "ajar", "storeroom", "teatray")
Captured = pytest.CaptureFixture[str]


def judged(scene: str, n_bounces: int, size: tuple[int, int] = (48, 36), **effort: int) -> tuple[Still, ErrorEstimate]:
    still = render_project(
        open_project(scene, size).with_settings(n_edge_rays=0), lambda step: None, series=BounceSeries(n_bounces),
        estimates_error=True, **effort,
    )  # fmt: skip
    assert still.error is not None
    return still, still.error


# Relative RMS noise of the judges by bounces, as `benchmarks.room_references` told it; that of the others is far below.
NOISE = {("room", 1): 0.0118, ("stairwell", 1): 0.005, ("teatray", 1): 0.0153}
NOISE |= {("cornell", 4): 0.0086, ("room", 4): 0.0225, ("teatray", 4): 0.0236}
NOISE |= {("ajar", 4): 0.0375}  # by three times as many paths
# A lamp, a sky, and light between walls in the suite; all rooms, and all their light, in the sweep.
ONCE = {("cornell", 4), ("stairwell", 1), ("teatray", 1)}
# Teatray's sky takes many lights; of few the error is larger, and as well known.
EFFORT = {("teatray", 1): {"n_lights": 250}}
SWEPT = [
    pytest.param(room, n, marks=pytest.mark.sweep)
    for room in ROOMS for n in (1, 4) if (room, n) not in ONCE
]  # fmt: skip


@pytest.mark.parametrize(("room", "n_bounces"), [*sorted(ONCE), *SWEPT])
def test_the_estimate_is_within_a_factor_of_two(room: str, n_bounces: int, monkeypatch: pytest.MonkeyPatch) -> None:
    if (room, n_bounces) in ONCE:
        monkeypatch.setattr(error_estimate, "PATHS_A_PIXEL", 16)
        monkeypatch.setattr(error_estimate, "N_TRUTH_SAMPLES", 2)
    still, estimate = judged(room, n_bounces, **EFFORT.get((room, n_bounces), {}))
    seen = Placement(open_project(room, (48, 36)).scene).hits.pixel
    ours, truth = still.picture, read_radiance_image(JUDGES / f"{room}_{n_bounces}.exr")
    found = errors(*(picture.reshape(-1, 3)[seen] for picture in (ours, truth))).rmse
    error = math.sqrt(found**2 - NOISE.get((room, n_bounces), 0.0) ** 2)
    assert 0.5 * error < estimate.overall < 2.0 * error


def test_too_few_patches_are_reported(tmp_path: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch) -> None:
    # So few are 4.5 % off in this room, which is not reported yet.
    monkeypatch.setattr(picture_error, "POOR", 0.03)
    out = tmp_path / "poor.exr"
    arguments = ["render", "stairwell", "-o", str(out), "--resolution", "24", "18", "--bounces", "1"]
    assert run([*arguments, "--patches", "20"], Desktop()) == 0
    line, *notes = capsys.readouterr().out.splitlines()
    assert "s, error about " in line
    assert "note: most of the error is in direct light: more lights, patches or bands help" in notes
    assert run(arguments, Desktop()) == 0
    assert "most of the error" not in capsys.readouterr().out


def test_too_few_lights_are_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(error_estimate, "N_TRUTH_SAMPLES", 2)
    _, few = judged("teatray", 1, (16, 12), n_lights=20)
    _, usual = judged("teatray", 1, (16, 12), n_lights=200)
    assert few.is_large and few.overall > 4.0 * usual.overall


@pytest.fixture
def few_patches(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where direct light is not what is asked about, four times as many patches of lamps as the picture has."""
    monkeypatch.setattr(error_estimate, "FINER_PATCHES", 4)


@pytest.mark.parametrize("bounces", [1, 2])
def test_the_dark_has_no_error(tmp_path: Path, bounces: int) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(ground((16, 12), (0, 0, 0), bounces=bounces))
    still, estimate = judged(str(path), bounces, n_lights=100)
    assert not still.picture.any() and estimate.overall == 0.0 and not estimate.is_large


def test_it_is_the_same_again(few_patches: None) -> None:
    (first, one), (second, other) = (judged("storeroom", 1, (16, 12)) for _ in range(2))
    np.testing.assert_array_equal(first.picture, second.picture)
    assert one == other


def test_it_says_what_helps() -> None:
    assert ErrorEstimate(0.006, 0.017).text == "error about 1.8 % (direct 0.6 %, indirect 1.7 %)"
    assert ErrorEstimate(0.006, 0.017).advice == ""
    assert ErrorEstimate(0.02, 0.06).advice.startswith("most of the error is in light between surfaces")
    assert ErrorEstimate(0.06, 0.05).advice.startswith("most of the error is in direct light")


def drawn_by_orbit(project: Project) -> Picture:
    orbit = Orbit(project.scene, n_points=200, n_coefficients=40)
    orbit.set_light(project.sky)
    orbit.set_layers(layers_by_object(project))
    orbit.set_bounces(1)
    for _ in orbit.work():
        pass
    return orbit.draw(project.scene.description.camera, project.scene.resolution, "moving")


def drawn_by_deform(project: Project) -> Picture:
    deform = Deform(project.resting, n_points=200, n_rays=64)
    deform.set_light(project.sky)
    deform.set_layers(layers_by_object(project))
    deform.set_bounces(1)
    return finish_deform(deform).draw(project.scene.description.camera, project.scene.resolution)


@pytest.mark.parametrize("drawn", [drawn_by_orbit, drawn_by_deform])
def test_errors_of_other_modes_are_estimated_within_a_factor_of_two(
    drawn: Callable[[Project], Picture], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(error_estimate, "N_TRUTH_SAMPLES", 2)
    path = tmp_path / "scene.toml"
    path.write_text(ground((24, 18)) + placed("box", "cube", scaled(1, (0, 0.5, 0)), LAMBERT))
    project = open_project(str(path)).with_settings(n_edge_rays=0)
    placement = Placement(project.scene)
    picture = drawn(project)
    # Its own noise, 2.9 % of the mean at most, is little beside the errors.
    truth = render_picture(project, lambda _: None, reference=True, series=BounceSeries(1), n_samples=512)
    pixel = placement.hits.pixel[interior_points(placement.hits)]
    error = errors(*(each.reshape(-1, 3)[pixel] for each in (picture, truth))).rmse
    plan = plan_still(project)
    layers = with_maps(placement, still_layers(project.layers.items(), project.object_names, plan))
    smaller = zoom(picture, (0.5, 0.5, 1), order=1)
    dim = np.where((placement.hits.object_image == 1)[..., None], 0.5 * picture, picture)
    judging = estimate_drawn_errors(placement, layers, project.sky, 1, [picture, smaller, truth, dim])
    judged, coarse, exact, off = (each.estimate for each in run_to_end(judging))
    assert 0.5 * error < judged.overall < 2.0 * error
    assert 2.0 * exact.overall < judged.overall < coarse.overall
    assert (
        off.worst_object == "box" and off.short.startswith("error about ") and off.short.endswith(" %, mostly on box")
    )


def test_the_chance_of_paths_is_not_taken_for_an_error(few_patches: None) -> None:
    # Some 40 paths a point are far noisier than the picture, whose own noise the solver tells; 2.5 times too much was
    # told by them alone. What is a third too bright they still tell.
    project = open_project("cornell", (20, 15)).with_settings(n_edge_rays=0)
    placement, plan, series = Placement(project.scene), plan_still(project), BounceSeries(2)
    layers = with_maps(placement, still_layers(project.layers.items(), project.object_names, plan))
    found = run_to_end(find_indirect(placement, layers, project.sky, series, STILL, True))
    noise = run_to_end(noise_in(found, layers, series.second))
    indirect = run_to_end(reflected_light(found, layers, series.second, placement.hits))
    direct = run_to_end(reflect_layers(placement, layers, project.sky, still_quality(plan)))
    rows = np.arange(len(placement.hits.pixel))
    truth = run_to_end(trace_halves(placement, layers_by_object(project), project.sky, 2, 512, 1, rows))
    again = truth[:, :, 1] - truth[:, :, 0]

    def told(gain: float, known: float | None) -> tuple[float, float]:
        """The estimate of an indirect light so many times as bright, and its true error."""
        judging = estimate_point_errors(
            placement, layers, project.sky, still_quality(plan), 2, direct + gain * indirect, gain * indirect,
            n_paths=1 << 13, noise=known,
        )  # fmt: skip
        square = np.mean((gain * indirect - again[0]) * (gain * indirect - again[1]))
        return run_to_end(judging).estimate.indirect or 0.0, float(np.sqrt(square) / truth[:, :, 1].mean())

    estimate, error = told(1.0, noise)
    assert error / 1.5 < estimate < 1.5 * error
    assert told(1.0, None)[0] > 1.5 * error
    estimate, error = told(4.0 / 3.0, noise)
    assert error / 1.5 < estimate < 1.5 * error


@pytest.mark.sweep
@pytest.mark.parametrize("room", ["ajar", "room", "storeroom"])
def test_the_error_of_interpolated_indirect_light_is_estimated(room: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Against fans of its own at every pixel, with 4,096 rays each. The judge of `ajar` cannot tell: it seemed to be
    1.65 times as far off as it said, nearly all of it the noise of the judge's own paths."""
    project, series = open_project(room, (64, 48)).with_settings(n_edge_rays=0), BounceSeries(4)
    placement, plan = Placement(project.scene), plan_still(project)
    layers = with_maps(placement, still_layers(project.layers.items(), project.object_names, plan))
    direct = run_to_end(reflect_layers(placement, layers, project.sky, still_quality(plan)))

    def indirect(fineness: SamplingSettings, as_needed: bool) -> tuple[IndirectLight, np.ndarray]:
        found = run_to_end(find_indirect(placement, layers, project.sky, series, fineness, as_needed))
        return found, run_to_end(reflected_light(found, layers, series.second, placement.hits))

    found, shown = indirect(STILL, True)
    assert len(found.points.samples.points) < 0.9 * len(shown)
    noise = run_to_end(noise_in(found, layers, series.second))
    judging = estimate_point_errors(
        placement, layers, project.sky, still_quality(plan), 4, direct + shown, shown, noise=noise
    )
    told = run_to_end(judging).estimate.indirect
    for name, value in {"TOLERANCE": -1.0, "FLOOR": -1.0, "REACH": 0.0}.items():
        monkeypatch.setattr(refinement, name, value)
    finer, truth = indirect(STILL.with_rays(4096), False)
    assert len(finer.points.samples.points) == len(shown)
    error = np.sqrt(((shown - truth) ** 2).mean()) / (direct + truth).mean()
    assert told is not None and 0.7 * error < told < 1.5 * error


def test_the_whole_error_is_measured_and_not_added_up(few_patches: None) -> None:
    project = open_project("cornell", (16, 12)).with_settings(n_edge_rays=0)
    placement, plan = Placement(project.scene), plan_still(project)
    layers = with_maps(placement, still_layers(project.layers.items(), project.object_names, plan))
    quality = still_quality(plan)
    light = run_to_end(reflect_layers(placement, layers, project.sky, quality))

    def judged(shown: float, of_it_indirect: float) -> ErrorEstimate:
        judging = estimate_point_errors(
            placement, layers, project.sky, quality, 2, shown * light, of_it_indirect * light, 1 << 15
        )
        return run_to_end(judging).estimate

    lacks, swapped = judged(1.0, 0.0), judged(1.0, 0.1)
    # Direct light is exact, what is reflected again is missing: all the error is of that.
    assert lacks.overall == pytest.approx(lacks.indirect, rel=0.05) and lacks.indirect > 0.2
    # A tenth of the direct light is taken for the other: parts change, the whole does not.
    assert 0.05 < swapped.direct < 0.2 and swapped.indirect < 0.95 * lacks.indirect
    assert swapped.overall == pytest.approx(lacks.overall, rel=1e-6)
