"""Deform's figures: how right lobes are, how long they take, frames a second, and how right a bent mesh is.

The mesh is a relief on a ball, of as many vertices as [Sloan05, fig. 1] has: brows, sockets and furrows that shade
themselves. A bent one is judged against rays in its new pose, beside transfer that does not turn with the mesh.
"""

from __future__ import annotations

import json
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.measure.figures import Figure, NotMeasured, not_measured
from app.measure.launches import run_program
from app.system.lazy_import import qualified
from engine.core.generators import run_to_end
from engine.light.environment import Environment
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.zonal_harmonics.bending_points import BendingPoints, bending_points
from engine.realtime.zonal_harmonics.deform_engine import N_LOBES, ORDER, Deform, band_light_of, finish_deform
from engine.realtime.zonal_harmonics.fit_errors import MESH, fit_errors, random_vectors, shadowed_mesh
from engine.realtime.zonal_harmonics.pose import Deformation, deform
from engine.realtime.zonal_harmonics.shading import Lobes, lobes, shade
from engine.realtime.zonal_harmonics.transfer import N_RAYS, TransferPoints, rotate_transfer, simulate_shadows
from engine.realtime.zonal_harmonics.zonal import fit
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene, load_scene
from engine.scene.surface_points import surface_points

Float64Array = NDArray[np.float64]

NAMES = (
    "zh_error_random_6", "zh_error_mesh_3", "zh_fit_s", "deform_fps", "deform_fps_gpu", "deform_error_bent",
    "deform_error_undeformed",
)  # fmt: skip
# Sockets, a nose and a mouth: where (x, y) on the ball, how far out, how wide.
_FEATURES = ((0.35, 0.2, -0.22, 0.2), (-0.35, 0.2, -0.22, 0.2), (0.0, 0.0, 0.3, 0.16), (0.0, -0.4, -0.15, 0.25))
BEND = Deformation("bend", 60.0)
ON_GRAPHICS_CARD, GRAPHICS_CARD_SECONDS = "ui.measure_deform", 300.0
NORM = "rms of the error over rms of the signal, as [Sloan05] has it"


@dataclass(frozen=True)
class DeformEffort:
    """Columns and rows of the mesh's vertices, rays a point, random vectors, points of the mesh that lobes are fitted
    to, frames, and their (width, height)."""

    columns: int = 185
    rows: int = 95
    n_rays: int = N_RAYS
    n_random: int = 400
    n_mesh: int = 1100
    n_frames: int = 40
    resolution: tuple[int, int] = (512, 384)


def deform_figures(effort: DeformEffort | None, report: Callable[[str], None]) -> list[Figure]:
    """All of them; None: left out."""
    if effort is None:
        return [not_measured(name, "left out of a quick run") for name in NAMES]
    report("Deform: lobes, frames, a bent mesh")
    scene = relief(effort.columns, effort.rows)
    points = bending_points(scene, RayCaster(scene.vertices, scene.triangles), 0)
    run_to_end(fit(np.ones((2, ORDER * ORDER)), N_LOBES))  # compiled before anything is timed
    begun, cpu = time.perf_counter(), time.process_time()
    mesh = points.mesh(0, (0,))
    vectors = run_to_end(simulate_shadows(mesh, points.caster((0,)), ORDER, effort.n_rays))
    zonal = run_to_end(fit(vectors, N_LOBES))
    seconds, cpu = time.perf_counter() - begun, time.process_time() - cpu
    ours, undeformed = _bent_errors(scene, points, vectors, zonal_lobes=lobes(zonal), n_rays=effort.n_rays)
    how = f"relief of {len(points)} vertices, {effort.n_rays} rays a point, order {ORDER}"
    of_random = run_to_end(fit_errors(random_vectors(effort.n_random), [6]))[6]
    of_mesh = run_to_end(fit_errors(run_to_end(shadowed_mesh(effort.n_mesh, effort.n_rays)), [3]))[3]
    bent = f"{how}, bent by {BEND.amount:g} degrees: radiance at its vertices against rays in that pose"
    return [
        Figure("zh_error_random_6", (of_random,), f"6 lobes to random vectors of order {ORDER}; {NORM}"),
        Figure(
            "zh_error_mesh_3", (of_mesh,), f"3 lobes, points of the built-in {' '.join(MESH)} with its shadows; {NORM}"
        ),
        Figure("zh_fit_s", (seconds,), f"rays and {N_LOBES} lobes, {how}", {"processor_s": cpu}),
        Figure("deform_fps", tuple(_frames(scene, effort)), f"{how}, {N_LOBES} lobes, matt, another pose each frame"),
        _on_graphics_card(effort),
        Figure("deform_error_bent", (ours,), bent),
        Figure("deform_error_undeformed", (undeformed,), f"{bent}; transfer as at rest, not turned"),
    ]


def relief(columns: int, rows: int) -> Scene:
    """A ball with a relief, of so many vertices around and from pole to pole."""
    polar, around = (np.arange(rows) + 0.5) / rows * np.pi, np.arange(columns) / columns * 2.0 * np.pi
    theta, phi = (each.ravel() for each in np.meshgrid(polar, around, indexing="ij"))
    unit = np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)], axis=1)
    height = 0.05 * np.sin(9.0 * phi) * np.sin(theta) ** 2 * np.sin(7.0 * theta)
    for x, y, depth, width in _FEATURES:
        place = np.array([x, y, np.sqrt(1.0 - x * x - y * y)])
        height += depth * np.exp(-(((unit - place) / width) ** 2).sum(axis=1))
    vertices = unit * (1.0 + height)[:, None] * (0.8, 1.2, 0.9)
    at = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = at[:-1], np.roll(at, -1, 1)[:-1], at[1:], np.roll(at, -1, 1)[1:]
    faces = [np.stack(each, axis=-1).reshape(-1, 3) for each in ((a, c, b), (b, c, d))]
    caps = [[at[0, 0], at[0, i], at[0, i + 1]] for i in range(1, columns - 1)]
    caps += [[at[-1, 0], at[-1, i + 1], at[-1, i]] for i in range(1, columns - 1)]
    return _scene(vertices, np.concatenate([*faces, np.array(caps)]))


def _scene(vertices: Float64Array, triangles: NDArray[np.integer]) -> Scene:
    with tempfile.TemporaryDirectory(prefix="insitu-relief-") as folder:
        lines = [f"v {x:.7g} {y:.7g} {z:.7g}" for x, y, z in vertices]
        lines += [f"f {a} {b} {c}" for a, b, c in triangles + 1]
        Path(folder, "relief.obj").write_text("\n".join(lines), encoding="utf-8")
        text = (
            "version = 1\n[camera]\nposition = [0, 0.6, 4]\ntarget = [0.2, 0, 0]\nfov_y = 42\nresolution = [512, 384]\n"
            '[environment]\nradiance = [1, 1, 1]\n[[object]]\nname = "relief"\nmesh = "relief.obj"\nsmooth = true\n'
        )
        Path(folder, "relief.toml").write_text(text, encoding="utf-8")
        return load_scene(Path(folder, "relief.toml"))


def varied_sky() -> SkyState:
    """A bright side, and another colour from below."""
    image = np.full((32, 64, 3), 0.15, np.float32)
    image[4:12, 40:52] = (6.0, 5.0, 4.0)
    image[20:, :] = (0.1, 0.2, 0.35)
    return SkyState(Environment(image, "a lamp over a blue floor"))


def _bent_errors(
    scene: Scene, points: BendingPoints, vectors: Float64Array, zonal_lobes: Lobes, n_rays: int
) -> tuple[float, float]:
    """relRMSE of lobes that turn, and of transfer that does not."""
    light = band_light_of(varied_sky())
    harmonics = np.asarray(light.harmonics, np.float64)
    rest = points.rest_geometry(0)
    pose = deform(rest, (BEND,))
    caster = RayCaster(pose.positions.astype(np.float32), points.surface.corners)
    above = surface_points(caster, pose.positions, pose.frames[:, 2])
    mesh = TransferPoints(above, pose.frames, points.surface.corners)
    seen = run_to_end(simulate_shadows(mesh, caster, ORDER, n_rays))
    truth = rotate_transfer(seen, pose.frames.transpose(0, 2, 1)) @ harmonics
    stays = rotate_transfer(vectors, rest.frames.transpose(0, 2, 1)) @ harmonics
    found = shade(zonal_lobes, pose.frames, light)
    return _relative(found, truth), _relative(stays, truth)


def _relative(found: NDArray[np.floating], truth: Float64Array) -> float:
    return float(np.sqrt(((found - truth) ** 2).mean()) / truth.mean())


def _on_graphics_card(effort: DeformEffort) -> Figure:
    """Frames a second there, where there is one."""
    name = "deform_fps_gpu"
    with tempfile.TemporaryDirectory(prefix="insitu-measure-") as folder:
        output = Path(folder, "frames.json")
        command = [sys.executable, "-m", qualified(ON_GRAPHICS_CARD), str(output), "--frames", str(effort.n_frames)]
        try:
            run_program(command, Path(folder), GRAPHICS_CARD_SECONDS)
        except NotMeasured as reason:
            return not_measured(name, str(reason))
        found = json.loads(output.read_text())
    how = f"shaders on {found['renderer']}: matt, another pose each frame, which is computed and sent"
    return Figure(name, tuple(found["matt"]), how, {"glossy": statistics.median(found["glossy"])})


def _frames(scene: Scene, effort: DeformEffort) -> list[float]:
    """Frames a second, each in another pose."""
    deform = _drawn(scene)
    camera, rates = scene.description.camera, []
    for i in range(effort.n_frames + 1):
        begun = time.perf_counter()
        deform.draw(camera, effort.resolution, (("relief", (Deformation("bend", 1.0 + i),)),))
        rates.append(1.0 / (time.perf_counter() - begun))
    return rates[1:]  # the first compiles


def mesh_for_frames(effort: DeformEffort) -> Deform:
    """What frames are drawn of, ready; its relief bends."""
    return _drawn(relief(effort.columns, effort.rows))


def _drawn(scene: Scene) -> Deform:
    deform = Deform(scene, n_points=0, n_rays=16)  # by how many rays lobes came about, no frame knows
    deform.set_light(varied_sky())
    deform.set_layers({0: (make_layer(MODELS["lambert"], {"albedo": (0.6, 0.5, 0.4)}),)})
    deform.set_bending(["relief"])
    return finish_deform(deform)
