"""The figures of objects that are dragged in Orbit: from a movement to its picture, beside preparing all anew."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from app.measure.settings_orbit import finish_orbit
from app.project.project import open_project
from app.stills.stills import layers_by_object
from benchmarks.figures import Figure, not_measured
from engine.realtime.triple_product.moved_orbit import MovedOrbit
from engine.realtime.triple_product.orbit_engine import N_POINTS, Orbit
from engine.realtime.zonal_harmonics.posed_scene import movements_between, pose_scene
from engine.scene.transform import Transform

NAMES = ("orbit_move_ms", "orbit_move_ratio", "orbit_move_share")
FIRST_SECONDS = 0.06  # for which the worker sees and lights points before the first picture of a movement


@dataclass(frozen=True)
class OrbitMoveEffort:
    """What is moved in which scene; the picture, how many steps a hand makes, and points besides the meshes' own."""

    objects: Mapping[str, str] = field(default_factory=lambda: {"shapes": "cone", "teatray": "teapot"})
    resolution: tuple[int, int] = (512, 512)
    n_steps: int = 9
    n_points: int = N_POINTS


def orbit_move_figures(effort: OrbitMoveEffort | None, report: Callable[[str], None]) -> list[Figure]:
    """All of them; None: left out."""
    if effort is None:
        return [not_measured(name, "left out of a quick run") for name in NAMES]
    ms, ratios, shares = dict[str, float](), dict[str, float](), dict[str, float]()
    for scene, name in effort.objects.items():
        report(f"a dragged object in Orbit: {scene}")
        ms[scene], ratios[scene], shares[scene] = _measure(scene, name, effort)
    how = "{}x{}, {} steps: ".format(*effort.resolution, effort.n_steps)
    return [
        Figure("orbit_move_ms", tuple(ms.values()), f"{how}from a movement to its picture, the median", ms),
        Figure("orbit_move_ratio", tuple(ratios.values()), f"{how}processor time of that over preparing all", ratios),
        Figure("orbit_move_share", tuple(shares.values()), f"{how}points that the drag concerned", shares),
    ]


def _measure(source: str, name: str, effort: OrbitMoveEffort) -> tuple[float, float, float]:
    """Median milliseconds of a step, its processor time over that of all preparation, and the share of points."""
    project = open_project(source)
    scene, camera, cpu = project.scene, project.scene.description.camera, time.process_time()
    orbit = Orbit(scene, n_points=effort.n_points)
    finish_orbit(orbit, project.sky, layers_by_object(project), n_bounces=scene.description.bounces or 1)
    prepared = time.process_time() - cpu
    orbit.draw(camera, effort.resolution, "moving")
    moved, size = MovedOrbit(orbit), float(np.nanmax(np.ptp(scene.bounds[scene.object_index(name)], axis=0)))
    seconds, processor = list[float](), list[float]()
    for k in range(effort.n_steps + 1):  # the first compiles
        poses = ((name, (Transform((0.05 * size * k, 0.0, 0.0), (0.0, 5.0 * k, 0.0)),)),)
        begun, cpu = time.perf_counter(), time.process_time()
        moved.move(pose_scene(scene, poses), movements_between(scene, (), poses) or {})
        for _ in moved.work():
            if time.perf_counter() - begun > FIRST_SECONDS:
                break
        orbit.draw(camera, effort.resolution, "moving")
        seconds.append(time.perf_counter() - begun)
        processor.append(time.process_time() - cpu)
    ratio = float(np.median(processor[1:])) / prepared
    return 1e3 * float(np.median(seconds[1:])), ratio, float(moved.changed.mean())
