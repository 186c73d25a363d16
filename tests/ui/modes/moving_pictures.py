"""Moving pictures of Orbit and Deform by their shaders, and the same by compiled code."""

from __future__ import annotations

import moderngl
import numpy as np
import numpy.typing as npt

from app.project.project import Project
from app.stills.stills import layers_by_object
from engine.realtime.triple_product.gpu_export import PointExporter
from engine.realtime.triple_product.orbit_engine import Orbit
from engine.realtime.zonal_harmonics.deform_engine import Deform, finish_deform
from ui.gl.gpu_memory import read_texture
from ui.modes.deform.gl.posed_picture import PosedPicture
from ui.modes.orbit.gl.shaded_picture import ShadedPicture

Pictures = tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]


def orbit_pictures(
    project: Project, context: moderngl.Context, size: tuple[int, int], n_points: int = 300, transparent: bool = False
) -> tuple[Orbit, Pictures]:
    """Orbit at work on a project with so many points, and its pictures (H, W, 3), or with alpha (H, W, 4): by the
    shader, and by the worker."""
    orbit = Orbit(project.scene, n_points=n_points)
    orbit.set_light(project.sky)
    orbit.set_layers(layers_by_object(project))
    for _ in orbit.work():
        pass
    shaded, eye = ShadedPicture(context, 0), project.scene.description.camera
    for part in PointExporter(1 << 26).parts(orbit):
        shaded.buffers.take(part)
    expected = orbit.draw(eye, size, "moving", 64, transparent)
    drawn = read_texture(shaded.draw(eye, size, 64, transparent), np.float32)
    shaded.release()
    return orbit, (np.asarray(drawn[..., : expected.shape[2]]), expected)


def deform_pictures(
    project: Project, context: moderngl.Context, size: tuple[int, int], n_points: int = 300, transparent: bool = False
) -> Pictures:
    """Deform's pictures (H, W, 3), or with alpha (H, W, 4), of a project with so many points: by the shader, and by the
    worker."""
    deform = Deform(project.scene, n_points=n_points, n_rays=32)
    deform.set_light(project.sky)
    deform.set_layers(layers_by_object(project))
    deform.set_effort(32, 1, 0)
    finish_deform(deform)
    eye, picture = project.scene.description.camera, PosedPicture(context, 0)
    export = deform.export_picture(eye, (), picture.part_numbers)
    expected = deform.draw(eye, size, (), transparent=transparent)
    drawn = read_texture(picture.draw(export, eye, size, transparent), np.float32)
    picture.release()
    return np.asarray(drawn[..., : expected.shape[2]]), expected
