"""Points of a surface as rays need them: position, normal, and position lifted off the surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from engine.scene.raycaster import RayCaster

Float32Array = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """P points. position (P, 3) in the scene's frame, metres; horizon (P, 3): the unit normal that defines the
    hemisphere above; offset_position (P, 3): lifted off the surface, for shadow rays."""

    position: Float32Array
    horizon: Float32Array
    offset_position: Float32Array


def surface_points(caster: RayCaster, position: npt.ArrayLike, normal: npt.ArrayLike) -> SurfacePoints:
    """Points (P, 3) of a surface with unit normals (P, 3): vertices of a mesh, or texels."""
    position, normal = (np.ascontiguousarray(each, np.float32) for each in (position, normal))
    lifted = caster.offset_origins(position.astype(np.float64), normal.astype(np.float64))
    return SurfacePoints(position, normal, np.ascontiguousarray(lifted, np.float32))
