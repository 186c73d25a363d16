"""The cameras of a glTF file, in the form of Insitu's own.

A glTF camera looks along −Z of its node, with Y up [glTF20, 3.10.2]. Its target here lies as far away as the middle of
what the scene shows, so that orbiting turns about that. An orthographic camera becomes a perspective one of 2° far
behind it, which shows the plane through the target in the same size; what lies before or behind differs by the share
of their distance. Distances of clipping planes have no meaning for rays.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from engine.core.errors import LoadError, printable_name
from engine.scene.description import Camera
from engine.scene.loaders.gltf_file import GltfFile
from engine.scene.loaders.gltf_forest import LONGEST_NAME
from engine.scene.loaders.gltf_json import JsonObject
from engine.scene.loaders.gltf_nodes import Float64Array, MeshNode
from engine.scene.loaders.model import ImportedCamera, triple

MOST_CAMERAS = 200
_FAR_FOV = 2.0
LEAST_FOV, MOST_FOV = 0.01, 179.0


def read_cameras(file: GltfFile, nodes: Sequence[MeshNode], middle: Float64Array) -> tuple[ImportedCamera, ...]:
    """The cameras of these nodes; one that cannot be read is listed as not shown. middle: of what is shown, (3,)."""
    described = file.root.children("cameras")
    found: list[ImportedCamera] = []
    for each in nodes:
        node = file.nodes[each.node]
        if not node.has("camera"):
            continue
        try:
            if len(found) >= MOST_CAMERAS:
                raise node.error("camera", f"camera {MOST_CAMERAS + 1}", f"at most {MOST_CAMERAS}")
            fields = described[node.integer("camera", 0, len(described) - 1)]
            name = node.text("name") or fields.text("name") or f"Camera {len(found) + 1}"
            camera, aspect = _camera(fields, each.matrix, middle)
            found.append(ImportedCamera(printable_name(name, LONGEST_NAME), camera, aspect))
        except (LoadError, ValueError) as error:
            reason = error.reason if isinstance(error, LoadError) else "its axes are no frame"
            node.not_shown("camera", f"a view that cannot be used: {reason}")
    return tuple(found)


def _camera(fields: JsonObject, matrix: Float64Array, middle: Float64Array) -> tuple[Camera, float | None]:
    """The camera under its node's transform, and the picture's width by its height if the file says it."""
    kind = fields.text("type")
    if kind == "perspective":
        lens = fields.child("perspective")
        angle = lens.number("yfov", 0.0)
        if not angle > 0.0:
            raise lens.error("yfov", lens.raw("yfov"), "an angle above 0")
        fov = lens.clamped(math.degrees(angle), "yfov", LEAST_FOV, MOST_FOV)
        aspect = lens.number("aspectRatio", 1.0) if lens.has("aspectRatio") else None
        camera = looking_along(matrix, middle, fov)
    elif kind == "orthographic":
        lens = fields.child("orthographic")
        width, height = abs(lens.number("xmag", 1.0)), abs(lens.number("ymag", 1.0))
        if not (width > 0.0 and height > 0.0):
            raise lens.error("xmag, ymag", [width, height], "sizes other than 0")
        fields.not_shown("orthographic", "shown in perspective, of 2 degrees from afar")
        camera, aspect = orthographic(matrix, middle, height), width / height
    else:
        raise fields.error("type", kind or "nothing", "perspective or orthographic")
    lens.mark_read("znear", "zfar")
    return camera, aspect if aspect is not None and 0.01 <= aspect <= 100.0 else None


def looking_along(matrix: Float64Array, middle: Float64Array, fov_y: float) -> Camera:
    """The camera that looks along −Z of a frame (4, 4), with Y up; its target lies as far away as middle (3,). Raises
    ValueError where its axes are no frame."""
    position, _, target, up = _frame(matrix, middle)
    return Camera(position=triple(position), target=triple(target), up=triple(up), fov_y=fov_y)


def orthographic(matrix: Float64Array, middle: Float64Array, half_height: float) -> Camera:
    """The same of a camera without perspective that shows this half height."""
    _, back, target, up = _frame(matrix, middle)
    position = target + half_height / math.tan(math.radians(_FAR_FOV / 2.0)) * back
    return Camera(position=triple(position), target=triple(target), up=triple(up), fov_y=_FAR_FOV)


def _frame(matrix: Float64Array, middle: Float64Array) -> tuple[Float64Array, ...]:
    """Position, the direction backwards, the target and the direction upwards, (3,) each."""
    position = matrix[:3, 3]
    back, up = (matrix[:3, axis] / max(float(np.linalg.norm(matrix[:3, axis])), 1e-300) for axis in (2, 1))
    distance = float((position - middle) @ back)
    distance = distance if distance > 1e-6 else max(float(np.linalg.norm(position - middle)), 1.0)
    return position, back, position - distance * back, up
