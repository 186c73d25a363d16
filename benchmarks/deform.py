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

from app.measure.settings_deform import BEND, relief, varied_sky
from benchmarks.figures import Figure, NotMeasured, not_measured
from benchmarks.launches import run_program
from benchmarks.zonal_fit_errors import MESH, fit_errors, random_vectors, shadowed_mesh
from engine.core.generators import run_to_end
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.realtime.zonal_harmonics.bending_points import BendingPoints, bending_points
from engine.realtime.zonal_harmonics.deform_engine import Deform, band_light_of, finish_deform
from engine.realtime.zonal_harmonics.object_transfer import N_LOBES, ORDER
from engine.realtime.zonal_harmonics.pose import Deformation, deform
from engine.realtime.zonal_harmonics.shading import Lobes, lobes, shade
from engine.realtime.zonal_harmonics.transfer import N_RAYS, TransferPoints, rotate_transfer, simulate_shadows
from engine.realtime.zonal_harmonics.zonal import fit
from engine.scene.raycaster import RayCaster, surface_points
from engine.scene.scene_loader import Scene

Float64Array = NDArray[np.float64]

NAMES = (
    "zh_error_random_6", "zh_error_mesh_3", "zh_fit_s", "deform_fps", "deform_fps_gpu", "deform_error_bent",
    "deform_error_undeformed",
)  # fmt: skip
ON_GRAPHICS_CARD, GRAPHICS_CARD_SECONDS = "benchmarks.programs.deform", 300.0
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
    rates, frame_seconds = _frames(scene, effort)
    return [
        Figure("zh_error_random_6", (of_random,), f"6 lobes to random vectors of order {ORDER}; {NORM}"),
        Figure(
            "zh_error_mesh_3", (of_mesh,), f"3 lobes, points of the built-in {' '.join(MESH)} with its shadows; {NORM}"
        ),
        Figure("zh_fit_s", (seconds,), f"rays and {N_LOBES} lobes, {how}", {"processor_s": cpu}),
        Figure(
            "deform_fps",
            tuple(rates),
            f"{how}, {N_LOBES} lobes, diffuse, another pose each frame",
            {"processor_s": statistics.median(frame_seconds)},
        ),
        _on_graphics_card(effort),
        Figure("deform_error_bent", (ours,), bent),
        Figure("deform_error_undeformed", (undeformed,), f"{bent}; transfer as at rest, not turned"),
    ]


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
        command = [sys.executable, "-m", ON_GRAPHICS_CARD, str(output), "--frames", str(effort.n_frames)]
        try:
            run_program(command, Path(folder), GRAPHICS_CARD_SECONDS)
        except NotMeasured as reason:
            return not_measured(name, str(reason))
        found = json.loads(output.read_text())
    how = f"shaders on {found['renderer']}: diffuse, another pose each frame, which is computed and sent"
    return Figure(name, tuple(found["diffuse"]), how, {"glossy": statistics.median(found["glossy"])})


def _frames(scene: Scene, effort: DeformEffort) -> tuple[list[float], list[float]]:
    """Frames a second, each in another pose, and the processor seconds of each."""
    deform = _drawn(scene)
    camera, rates, seconds = scene.description.camera, [], []
    for i in range(effort.n_frames + 1):
        begun, cpu = time.perf_counter(), time.process_time()
        deform.draw(camera, effort.resolution, (("relief", (Deformation("bend", 1.0 + i),)),))
        rates.append(1.0 / (time.perf_counter() - begun))
        seconds.append(time.process_time() - cpu)
    return rates[1:], seconds[1:]  # the first compiles


def mesh_for_frames(effort: DeformEffort) -> Deform:
    """What frames are drawn of, ready; its relief bends."""
    return _drawn(relief(effort.columns, effort.rows))


def _drawn(scene: Scene) -> Deform:
    deform = Deform(scene, n_points=0, n_rays=16)  # by how many rays lobes came about, no frame knows
    deform.set_light(varied_sky())
    deform.set_layers({0: (make_layer(MODELS["lambert"], {"albedo": (0.6, 0.5, 0.4)}),)})
    deform.set_bending(["relief"])
    return finish_deform(deform)
