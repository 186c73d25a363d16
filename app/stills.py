"""Pictures in files: what `insitu render` does, from a project to an EXR or a PNG that is whole or not there."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.atomic import replacing, write_atomically
from app.project import Project
from engine.errors import InsituError
from engine.material.layer import Layer
from engine.plan import N_LIGHTS, Plan, plan_scene
from engine.render.image_files import png_bytes, write_exr
from engine.render.still import (
    REFERENCE_LEVEL,
    StillProgress,
    finish,
    render_reference,
    render_still,
    still_layers,
    still_quality,
)
from engine.transport.pipeline import Placement

REFERENCE_PATCHES = 1024
ENDINGS = (".exr", ".png")

Report = Callable[[StillProgress], None]


def check_output(path: Path, endings: tuple[str, ...] = ENDINGS) -> Path:
    """The path itself when a picture can be put there; found out before the work rather than after it."""
    if path.suffix.lower() not in endings:
        raise InsituError(f"{path}: the name of a picture ends in {' or '.join(endings)}")
    if path.is_dir():
        raise InsituError(f"{path}: is a folder, expected the name of a picture")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InsituError(f"{path.parent}: the folder cannot be made, {error.strerror or error}") from error
    return path


def render_picture(
    project: Project, report: Report, *, n_lights: int = N_LIGHTS, reference: bool = False
) -> NDArray[np.float32]:
    """Linear radiance (H, W, 3) of a project, with the editor's transport or by brute force."""
    sky = project.sky
    placement = Placement(project.scene)
    if reference:
        steps = render_reference(placement, _layers_by_object(project), sky, REFERENCE_PATCHES, REFERENCE_LEVEL)
    else:
        plan = plan_still(project, sky.environment is not None, n_lights)
        layers = still_layers(project.layers.items(), project.object_names, plan)
        steps = render_still(placement, layers, sky, still_quality(plan))
    return finish(steps, report) * np.float32(project.document.light.intensity)


def plan_still(project: Project, has_sky: bool, n_lights: int = N_LIGHTS) -> Plan:
    """The plan of a still."""
    layers = project.layers
    return plan_scene(project.scene, layers, has_sky=has_sky, still=True, n_lights=n_lights)


def write_picture(path: Path, radiance: NDArray[np.float32]) -> None:
    """Put a picture into an .exr (linear, 32 bits) or a .png (as the viewport shows it), whole or not at all."""
    try:
        if path.suffix.lower() == ".png":
            write_atomically(path, png_bytes(radiance))
            return
        with replacing(path) as file:
            write_exr(Path(file.name), radiance)
    except OSError as error:
        raise InsituError(f"{path}: not written, {error.strerror or error}; what was there is untouched") from error


def _layers_by_object(project: Project) -> Mapping[int, tuple[Layer, ...]]:
    names = project.object_names
    layers = project.layers
    return {
        index: tuple(layer for key, layer in layers.items() if key.rpartition(".")[0] == name)
        for index, name in enumerate(names)
    }
