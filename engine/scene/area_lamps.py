"""Lights of some size, as files have them, as objects: lamps with the shape, place and radiance of the file; and a
dome as the environment of a scene that has none of its own."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from engine.material.layer_maps import LayerMaps
from engine.scene.description import ConeDescription, EnvironmentDescription, ObjectDescription, check_transform
from engine.scene.loaders.model import ImportedDome, ImportedLamp


def area_lamps_of(
    lamps: Sequence[ImportedLamp], matrix: npt.NDArray[np.float64], image_name: Callable[[str], str]
) -> tuple[list[ObjectDescription], list[str]]:
    """The lamps as objects under the matrix (4, 4) of their model, and the names of those whose transform has no
    inverse; those without radiance are omitted. image_name: the name of an image in the scene by that in its file."""
    found: list[ObjectDescription] = []
    left_out: list[str] = []
    for lamp in lamps:
        transform = tuple((matrix @ lamp.matrix).ravel().tolist())
        if check_transform(transform) is not None:
            left_out.append(lamp.name)
        elif any(lamp.radiance):
            cone = None
            if lamp.cone is not None:
                inner, outer = map(math.degrees, lamp.cone)
                cone = ConeDescription(inner=inner, outer=outer)
            found.append(
                ObjectDescription(
                    name=lamp.name, primitive=lamp.shape, emission=lamp.radiance, cone=cone, transform=transform,
                    emission_texture=LayerMaps(image_name(lamp.texture)),
                )
            )  # fmt: skip
    return found, left_out


def environment_of(dome: ImportedDome, file: str) -> EnvironmentDescription:
    """The environment of a dome of a file of this name; its image is scaled by the mean of its radiance."""
    if not dome.file:
        return EnvironmentDescription(radiance=dome.radiance)
    name = dome.file if dome.image is None else f"{file}{dome.file}"
    return EnvironmentDescription(file=name, rotation=dome.rotation, scale=float(np.mean(dome.radiance)))
