"""Lights placed by pixels of a picture that no window shows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from app.document.commands import EditCommand
from app.document.light_placing import LightAim, place_named
from app.project.project import Project
from engine.core.errors import InsituError
from engine.scene.cutouts import scene_caster
from engine.scene.light_paths import describe_light_path, describe_unplaced
from engine.scene.light_placement import PlacedLight, facing_of
from engine.scene.picture_frame import picture_frame
from engine.scene.primary_hits import trace_primary
from engine.scene.surface_spot import SurfaceSpot, spot_in

Pixel = tuple[int, int]
BoxOf = Callable[[str], NDArray[np.float64] | None]


def placing_in_picture(
    project: Project, light: str, highlight: Pixel | None, shadow: tuple[Pixel, Pixel] | None, resting_box: BoxOf
) -> tuple[EditCommand | None, str]:  # fmt: skip
    """The command that places a light by its highlight at a pixel, or by the shadow of what is at one pixel on another,
    and what keeps the light from doing so, "" for nothing. Raises InsituError."""
    if (highlight is None) == (shadow is None):
        raise InsituError("place_light: expected exactly one of highlight and shadow")
    scene, rays = project.scene, scene_caster(project.scene)
    frame = picture_frame(trace_primary(scene, rays), scene.camera_position)
    camera = scene.description.camera

    def spot_at(pixel: Pixel) -> SurfaceSpot:
        if (spot := spot_in(frame, camera, *pixel)) is None:
            raise InsituError(f"place_light: pixel {pixel[0]}, {pixel[1]} sees no surface")
        return spot

    def lamp_of(name: str) -> PlacedLight | None:
        box, resting = resting_box(name), project.resting
        facing = facing_of(resting.description.objects[resting.object_names.index(name)])
        return None if box is None else PlacedLight(box.mean(axis=0), facing, project.document.object(name).transform)

    start, end = (None, highlight) if shadow is None else shadow
    assert end is not None
    aim = LightAim(spot_at(end), camera)
    if start is not None:
        x, y, z = spot_at(start).place.tolist()
        aim = replace(aim, caster=(x, y, z), caster_object=scene.object_names[frame.object_at(*start)])
    command, path = place_named(project.document, light, lamp_of, aim)
    if path.towards is None:
        raise InsituError(f"place_light: {describe_unplaced(path)}")
    return command, describe_light_path(path, scene, rays)
