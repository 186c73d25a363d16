"""Colours of vertices and faces, from the numbers of a file to linear factors of a material.

Files do not say what their numbers mean; what most programs write decides. Integers, and numbers named red, green and
blue, are sRGB: MeshLab, CloudCompare, Blender and scanners write what is seen on a screen. Numbers named r, g and b are
linear: Mitsuba writes those.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from engine.core.colour import decode_srgb
from engine.material.opacity import OPAQUE, Opacity
from engine.scene.mesh import Mesh


def linear_colours(shares: npt.NDArray[np.floating], is_srgb: bool = True) -> npt.NDArray[np.float32]:
    """Linear red, green, blue and alpha (N, 4) of colours (N, 3 or 4), shares of white; alpha is 1 where there is none.
    Values outside of [0, 1] are clamped, and those that are no numbers become 1."""
    colours = np.ones((len(shares), 4))
    colours[:, : shares.shape[1]] = np.clip(np.nan_to_num(shares, nan=1.0), 0.0, 1.0)
    if is_srgb:
        colours[:, :3] = decode_srgb(colours[:, :3])
    return colours.astype(np.float32)


def vertex_opacity(mesh: Mesh) -> Opacity:
    """The opacity of a part by the alpha of its colours; opaque where these would hide all of it."""
    if mesh.colours is None or mesh.colours[..., 3].min() == 1.0 or mesh.colours[..., 3].max() == 0.0:
        return OPAQUE
    return Opacity("blend", opacity_vertices=True)
