"""The figures of a light that is dragged in Deform, from its movement to the picture: a lamp's, beside tracing its
light anew, and those of one that is painted on the environment."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from app.document.commands.painted import AddPainted, SetPainted
from app.document.light_mix import mixed_light
from app.project.distant_light import sky_of
from app.project.project import Project, open_project
from app.stills.stills import layers_by_object
from benchmarks.figures import Figure, not_measured
from engine.light.environment import load_environment
from engine.realtime.zonal_harmonics.deform_engine import Deform, finish_deform
from engine.realtime.zonal_harmonics.pose import Poses
from engine.scene.transform import Transform

NAMES = ("deform_lamp_ms", "deform_lamp_ratio", "deform_lamp_error", "deform_painted_ms")
PAINTED = "Key"
DEGREES = 15.0  # of azimuth, by which the hand moves a painted light in a step
SHARE = 0.1  # of the scene's width, that the hand moves in a step


@dataclass(frozen=True)
class DeformLampEffort:
    """Which lamp is moved in which scene, which scenes are under a painted light; the picture, how many steps a hand
    makes, rays a point, and points besides the meshes' own, None for as many as Deform has."""

    lamps: Mapping[str, str] = field(default_factory=lambda: {"cornell": "light", "rings": "lamp"})
    painted: tuple[str, ...] = ("teatray", "vase")
    resolution: tuple[int, int] = (512, 384)
    n_steps: int = 9
    n_rays: int = 200
    n_points: int | None = None


def deform_lamp_figures(effort: DeformLampEffort | None, report: Callable[[str], None]) -> list[Figure]:
    """All of them; None: left out."""
    if effort is None:
        return [not_measured(name, "left out of a quick run") for name in NAMES]
    ms, ratios, errors = dict[str, float](), dict[str, float](), dict[str, float]()
    for scene, name in effort.lamps.items():
        report(f"a dragged lamp in Deform: {scene}")
        ms[scene], ratios[scene], errors[scene] = _measure(scene, name, effort)
    painted = dict[str, float]()
    for scene in effort.painted:
        report(f"a dragged painted light in Deform: {scene}")
        painted[scene] = _measure_painted(scene, effort)
    how = "{}x{}, {} steps: ".format(*effort.resolution, effort.n_steps)
    traced = "processor time of that over tracing the lamp's light where it is and drawing it"
    return [
        Figure("deform_lamp_ms", tuple(ms.values()), f"{how}from a movement to its picture, the median", ms),
        Figure("deform_lamp_ratio", tuple(ratios.values()), f"{how}{traced}", ratios),
        Figure("deform_lamp_error", tuple(errors.values()), f"{how}relRMSE of that against the latter", errors),
        Figure(
            "deform_painted_ms", tuple(painted.values()), f"{how}from a movement of a soft box, the median", painted
        ),
    ]


def _measure(source: str, name: str, effort: DeformLampEffort) -> tuple[float, float, float]:
    """Median milliseconds of a step, its processor time over that by rays, and the mean relRMSE between both."""
    project = open_project(source)
    scene, camera = project.scene, project.scene.description.camera
    deform = _finished(project, effort)
    size = float(np.ptp(scene.vertices, axis=0).max())
    seconds, processor, by_rays, errors = list[float](), list[float](), list[float](), list[float]()
    for k in range(effort.n_steps + 1):  # the first compiles
        poses: Poses = ((name, (Transform((SHARE * size * np.sin(k), -0.02 * size, SHARE * size * np.cos(k))),)),)
        begun, cpu = time.perf_counter(), time.process_time()
        moving = deform.draw(camera, effort.resolution, poses)
        seconds.append(time.perf_counter() - begun)
        processor.append(time.process_time() - cpu)
        cpu = time.process_time()
        deform.set_moved((), poses)
        resting = finish_deform(deform).draw(camera, effort.resolution, poses)
        by_rays.append(time.process_time() - cpu)
        most = np.quantile(resting, 0.999)
        errors.append(float(np.sqrt(((np.minimum(moving, most) - np.minimum(resting, most)) ** 2).mean())))
        errors[-1] /= float(np.minimum(resting, most).mean())
    ratio = float(np.median(processor[1:]) / np.median(by_rays[1:]))
    return 1e3 * float(np.median(seconds[1:])), ratio, float(np.mean(errors[1:]))


def _measure_painted(source: str, effort: DeformLampEffort) -> float:
    """Median milliseconds from another place of a painted soft box to the picture: the map is painted, integrated and
    projected onto bands, and the scene is drawn under it."""
    project = open_project(source)
    deform, document = _finished(project, effort), AddPainted("box", PAINTED).apply(project.document)
    load, seconds = cache(load_environment), list[float]()
    for k in range(effort.n_steps + 1):  # the first compiles, and reads the map
        document = SetPainted.of(PAINTED, "azimuth", DEGREES * k).apply(document)
        begun = time.perf_counter()
        deform.set_light(sky_of(project.scene, mixed_light(document), load))
        deform.draw(project.scene.description.camera, effort.resolution)
        seconds.append(time.perf_counter() - begun)
    return 1e3 * float(np.median(seconds[1:]))


def _finished(project: Project, effort: DeformLampEffort) -> Deform:
    """All that pictures of a scene are drawn of in Deform, after the first of them."""
    deform = Deform(project.scene, effort.n_points, n_rays=effort.n_rays)
    deform.set_effort(effort.n_rays, 4, 0)
    deform.set_light(project.sky)
    deform.set_layers(layers_by_object(project))
    finish_deform(deform).draw(project.scene.description.camera, effort.resolution)
    return deform
