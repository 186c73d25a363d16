"""Orbit's figures: how right its pictures are by coefficients kept, and how fast the scene made for it is.

Right is judged at random pixels inside of objects, in direct light, against brute force in 81,920 directions.
"""

from __future__ import annotations

import csv
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from app.measure.settings_orbit import finish_orbit, inner_rows
from app.project.project import Project, open_project
from app.stills.stills import layers_by_object
from benchmarks.figures import Figure, NotMeasured, not_measured
from benchmarks.haar_truncation import Truncated, truncation_errors, write_truncation
from benchmarks.launches import measure_orbit
from benchmarks.references import reference_folder
from engine.core.generators import run_to_end
from engine.light.environment import Environment
from engine.material.layer import Layer
from engine.precompute.direct.pipeline import Placement, SkyState
from engine.realtime.core.shading_points import place_points
from engine.realtime.triple_product.orbit_engine import N_POINTS, Orbit
from engine.reference.integrator import integrate_direct
from engine.render.picture_difference import errors
from engine.scene.camera_moves import orbit_camera
from engine.scene.raycaster import RayCaster

JUDGED, SCENE = ("teatray", "bunny"), "rings"
N_NAMED = 320
DEGREES_A_FRAME = 3.0  # as a hand goes round in some ten seconds
TABLE = "orbit.csv"
SPEEDS = (
    "orbit_fps_moving", "orbit_rest_s", "orbit_edit_s", "orbit_turn_stall_ms", "orbit_placing_s", "orbit_precompute_s",
)  # fmt: skip
NAMES = (
    *(f"orbit_error_{name}_{N_NAMED}" for name in JUDGED),
    *(f"orbit_rest_error_{name}" for name in JUDGED),
    *SPEEDS,
    "orbit_fps_gpu",
)


@dataclass(frozen=True)
class OrbitEffort:
    """Pixels that are judged and in how many directions, 20·4^level; coefficients; the speeds' picture and frames; and
    points besides the meshes' own vertices, where the speed and where the error is measured; the picture that a
    graphics card draws, and for how long it may."""

    n_pixels: int = 300
    level: int = 6
    coefficients: tuple[int, ...] = (20, 80, 320, 1280)
    resolution: tuple[int, int] = (512, 384)
    n_frames: int = 30
    n_points: int = 256 * 256
    n_judged_points: int = N_POINTS
    gpu_resolution: tuple[int, int] = (1024, 768)
    timeout_s: float = 600.0


def orbit_figures(effort: OrbitEffort | None, output: Path, report: Callable[[str], None]) -> list[Figure]:
    """All of them, and the errors by coefficients and by way to draw as a table in `output`; None: left out."""
    if effort is None:
        return [not_measured(name, "left out of a quick run") for name in NAMES]
    folder, figures, rows = reference_folder(), [], list[tuple[str, int, str, float, float]]()
    truncated: list[Truncated] = []
    for name in JUDGED:
        named, rest = f"orbit_error_{name}_{N_NAMED}", f"orbit_rest_error_{name}"
        if folder is None:
            figures += [not_measured(each, "there is no folder of references") for each in (named, rest)]
            continue
        report(f"Orbit against brute force: {name}")
        project = open_project(str(folder / f"{name}.toml"))
        truncated += _truncation(name, project, effort)
        found = errors_by_coefficients(project, effort)
        rows += [(name, *row) for row in found]
        at_rest = {str(n): rmse for n, quality, rmse, _ in found if quality == "rest"}
        still = min(rmse for _, quality, rmse, _ in found if quality == "still")
        how = f"{effort.n_pixels} random pixels against {20 * 4**effort.level} directions, direct light, at rest"
        figures.append(Figure(named, (at_rest[str(N_NAMED)],), how, at_rest))
        figures.append(Figure(rest, (still,), f"{how}, as stills are drawn, by as many coefficients as are best"))
    with open(output / TABLE, "w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([("scene", "coefficients", "drawn", "relRMSE", "means"), *rows])
    if truncated:
        write_truncation(output, truncated)
    report(f"Orbit's speed: {SCENE}")
    return [*figures, *speed_figures(open_project(SCENE, effort.resolution), effort), gpu_figure(effort)]


def gpu_figure(effort: OrbitEffort) -> Figure:
    """Frames a second that shaders draw while the camera moves, by 320 coefficients; by fewer among its parts."""
    width, height = map(str, effort.gpu_resolution)
    options = ["--resolution", width, height, "--points", str(effort.n_points), "--frames", str(effort.n_frames)]
    try:
        with tempfile.TemporaryDirectory(prefix="insitu-orbit-") as folder:
            found = measure_orbit(SCENE, options, Path(folder), effort.timeout_s)
    except NotMeasured as error:
        return not_measured("orbit_fps_gpu", str(error))
    rates = found.pop("fps")
    how = f"{SCENE}, {effort.n_points} points between its vertices, {width}x{height}, {N_NAMED} coefficients"
    medians = {f"fps_{n}": float(np.median(each)) for n, each in rates.items()}
    return Figure("orbit_fps_gpu", tuple(rates[str(N_NAMED)]), how, medians | found)


def _truncation(name: str, project: Project, effort: OrbitEffort) -> list[Truncated]:
    placement = Placement(project.scene)
    rows = inner_rows(placement.hits, effort.n_pixels)
    return truncation_errors(
        name, placement.hits, rows, placement.caster, layers_by_object(project), project.sky, effort.level
    )


def errors_by_coefficients(project: Project, effort: OrbitEffort) -> list[tuple[int, str, float, float]]:
    """(coefficients, "moving", "rest" or "still", relRMSE, difference of means) of pictures of one scene."""
    placement, layers = Placement(project.scene), layers_by_object(project)
    rows = inner_rows(placement.hits, effort.n_pixels)
    sky: Environment | None = project.sky.environment
    truth = integrate_direct(
        placement.hits, rows, placement.caster, lambda i: layers.get(i, ()), sky, project.sky.rotation,
        placement.patches(1024), effort.level,
    )  # fmt: skip
    found, arrays = [], None
    for n in effort.coefficients:
        orbit = Orbit(project.scene, placement.caster, effort.n_judged_points, n)
        if arrays is not None:
            orbit.restore(arrays)
        camera = project.scene.description.camera
        finish_orbit(orbit, project.sky, layers)
        orbit.draw(camera, project.scene.resolution)
        finish_orbit(orbit, project.sky, layers)  # backs that this has seen
        arrays = arrays or orbit.stored_visibility()
        for quality in ("moving", "rest", "still"):
            picture = orbit.draw(camera, project.scene.resolution, quality, n)  # type: ignore[arg-type]
            off = errors(picture.reshape(-1, 3)[placement.hits.pixel[rows]], truth)
            found.append((n, quality, off.rmse, off.mean))
    return found


def speed_figures(project: Project, effort: OrbitEffort) -> list[Figure]:
    """Of one scene: making ready, frames while the camera moves, a picture at rest, an edit until it is whole."""
    layers, camera, sky = layers_by_object(project), project.scene.description.camera, project.sky
    orbit = Orbit(project.scene, n_points=200)
    finish_orbit(orbit, sky, layers, n_bounces=2)
    for quality in ("moving", "rest"):  # compiled before anything is timed
        orbit.draw(camera, (32, 24), quality)  # type: ignore[arg-type]
    cpu = time.process_time()
    run_to_end(place_points(project.scene, RayCaster(project.scene.vertices, project.scene.triangles), effort.n_points))
    placed = time.process_time() - cpu
    begun = time.perf_counter()
    orbit = Orbit(project.scene, n_points=effort.n_points)
    finish_orbit(orbit, sky, layers, n_bounces=project.scene.description.bounces or 1)
    made = time.perf_counter() - begun
    frames = []
    for k in range(effort.n_frames):
        moved = orbit_camera(camera, np.radians(DEGREES_A_FRAME) * k, 0.0)
        begun = time.perf_counter()
        orbit.draw(camera.model_copy(update={"position": moved.position}), effort.resolution, "moving")
        frames.append(time.perf_counter() - begun)
    begun = time.perf_counter()
    orbit.draw(camera, effort.resolution)
    rest = time.perf_counter() - begun
    for _step in orbit.work():  # backs that these pictures have seen are no part of an edit
        pass
    first, whole = _edit_seconds(orbit, project, layers, effort.resolution)
    stall = _turn_stall(orbit, sky, effort.n_frames)
    size = f"{effort.resolution[0]}x{effort.resolution[1]}"
    how = f"{SCENE}, {len(project.scene.vertices)} vertices and {effort.n_points} points between them"
    parts = {"mb": orbit.n_bytes / 1e6, "stored_mb": sum(a.nbytes for a in orbit.stored_visibility().values()) / 1e6}
    return [
        Figure("orbit_fps_moving", tuple(1.0 / each for each in frames), f"{how}, {size}, {DEGREES_A_FRAME:g}° each"),
        Figure("orbit_rest_s", (rest,), f"{how}, {size}"),
        Figure("orbit_edit_s", (whole,), f"{how}: a roughness, until all is whole", {"first_s": first}),
        Figure("orbit_turn_stall_ms", stall, f"{how}: for which a frame waits while the sky turns"),
        Figure("orbit_placing_s", (placed,), f"{how}: processor seconds until the points stand"),
        Figure("orbit_precompute_s", (made,), how, parts),
    ]


def _turn_stall(orbit: Orbit, sky: SkyState, n_turns: int) -> tuple[float, ...]:
    """For how many milliseconds at most a frame waits while a sky turns, for it comes between two pieces of work."""
    longest = []
    for k in range(n_turns):
        begun, pieces = time.perf_counter(), []
        orbit.set_light(replace(sky, rotation=sky.rotation + DEGREES_A_FRAME * (k + 1)))
        for _, _step in zip(range(8), orbit.work(), strict=False):
            pieces.append(time.perf_counter() - begun)
            begun = time.perf_counter()
        longest.append(1e3 * max(pieces))
    return tuple(longest)


def _edit_seconds(
    orbit: Orbit, project: Project, layers: Mapping[int, tuple[Layer, ...]], resolution: tuple[int, int]
) -> tuple[float, float]:
    """Until the first picture that shows an edit, and until its reflection is whole."""
    camera = project.scene.description.camera
    i, k = next((i, k) for i, own in layers.items() for k, layer in enumerate(own) if "alpha" in layer.values)
    own = list(layers[i])
    own[k] = own[k].with_parameter("alpha", 0.3)
    begun, first = time.perf_counter(), 0.0
    orbit.set_layers({**layers, i: tuple(own)})
    for step in orbit.work():
        if not first and step.text == "reflection":
            orbit.draw(camera, resolution, "moving")
            first = time.perf_counter() - begun
    orbit.draw(camera, resolution, "moving")
    return first, time.perf_counter() - begun
