"""The cameras of a USD stage, in the form of Insitu's own: along −Z of their prim, with Y up [UsdGeomCamera].

The angle of view is that of the vertical aperture, 2 atan(aperture / (2 focal length)), both in the same unit.
"""

from __future__ import annotations

import math

from engine.core.errors import LoadError, printable_name
from engine.scene.loaders.gltf_cameras import LEAST_FOV, MOST_CAMERAS, MOST_FOV, looking_along, orthographic
from engine.scene.loaders.gltf_forest import LONGEST_NAME
from engine.scene.loaders.model import ImportedCamera
from engine.scene.loaders.usd_prims import Float64Array, UsdPrim

# What only a lens or a film shows, and distances of clipping, which have no meaning for rays.
_HARMLESS = ("clippingRange", "clippingPlanes", "focusDistance", "stereoRole")
_UNSHOWN = {
    "fStop": "all is in focus", "shutter:open": "nothing is blurred by motion",
    "shutter:close": "nothing is blurred by motion", "exposure": "the picture's exposure is that of the window",
    "horizontalApertureOffset": "the view is centred", "verticalApertureOffset": "the view is centred",
}  # fmt: skip


def read_cameras(placed: list[tuple[UsdPrim, Float64Array]], middle: Float64Array) -> tuple[ImportedCamera, ...]:
    """The cameras at their places (4, 4); one that cannot be read is listed as not shown. middle: of what is shown,
    (3,)."""
    found: list[ImportedCamera] = []
    for prim, matrix in placed:
        try:
            if len(found) >= MOST_CAMERAS:
                raise prim.error("camera", f"camera {MOST_CAMERAS + 1}", f"at most {MOST_CAMERAS}")
            found.append(_camera(prim, matrix, middle))
        except (LoadError, ValueError) as error:
            reason = error.reason if isinstance(error, LoadError) else "its axes are no frame"
            prim.not_shown("focalLength", f"a view that cannot be used: {reason}")
    return tuple(found)


def _camera(prim: UsdPrim, matrix: Float64Array, middle: Float64Array) -> ImportedCamera:
    width, height = prim.number("horizontalAperture", 20.955), prim.number("verticalAperture", 15.2908)
    focal = prim.number("focalLength", 50.0)
    if not (width > 0.0 and height > 0.0 and focal > 0.0):
        raise prim.error("horizontalAperture, verticalAperture, focalLength", [width, height, focal], "lengths above 0")
    prim.mark_read(*_HARMLESS)
    for key, effect in _UNSHOWN.items():
        if prim.has(key) and prim.number(key, 0.0) != 0.0:
            prim.not_shown(key, effect)
    aspect = width / height if 0.01 <= width / height <= 100.0 else None
    name = printable_name(prim.name, LONGEST_NAME)
    if prim.word("projection", "perspective") == "orthographic":
        prim.not_shown("projection", "shown in perspective, of 2 degrees from afar")
        # An aperture is in tenths of a unit.
        size = 0.05 * height * math.hypot(*matrix[:3, 1])
        return ImportedCamera(name, orthographic(matrix, middle, size), aspect)
    fov = prim.clamped(math.degrees(2.0 * math.atan(height / (2.0 * focal))), "focalLength", LEAST_FOV, MOST_FOV)
    return ImportedCamera(name, looking_along(matrix, middle, fov), aspect)
