"""Places the shading points of Orbit: as many, and with as much light each, as fit into memory."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace

import numpy as np

from engine.core.errors import InsituError
from engine.core.generators import run_to_end
from engine.realtime.core.shading_points import ShadingPoints, place_points, with_rotated_tangents
from engine.realtime.triple_product.visibility import N_UPPER, find_enclosed
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene

_LEAST_COEFFICIENTS = 20
_BYTES_A_COEFFICIENT = 8


class PointPlacement:
    """Points for one scene, see `Orbit` for the numbers."""

    def __init__(
        self, scene: Scene, caster: RayCaster, n_points: int, n_coefficients: int, n_patches: int, most_bytes: int
    ) -> None:
        self._scene, self._caster, self._n_points = scene, caster, n_points
        self._n_coefficients, self._n_patches, self._most_bytes = n_coefficients, n_patches, most_bytes

    def check_vertices(self) -> None:
        """Raise InsituError where the vertices alone are too many: do not search for minutes only to find more."""
        self._check_memory(self._n_least())

    def steps(self) -> Generator[None, None, tuple[ShadingPoints, int]]:
        """The points, and how many coefficients of light each has. Raises InsituError where they are too many."""
        points = yield from self._points(self._n_points)
        n = self._within_memory(len(points))
        if n < self._n_coefficients and self._n_points:
            points = run_to_end(self._points(0))
            n = self._within_memory(len(points))
        self._check_memory(len(points))
        return points, n

    def _points(self, n_points: int) -> Generator[None, None, ShadingPoints]:
        points = yield from place_points(self._scene, self._caster, n_points)
        if self._scene.tangent_rotations.digest:
            points = with_rotated_tangents(points, self._scene)
        found = yield from find_enclosed(self._scene, self._caster, points)
        return replace(points, buried=found)

    def _within_memory(self, n_points: int) -> int:
        """How many coefficients a point fit into memory, at most the desired number."""
        rest = self._most_bytes - n_points * (N_UPPER // 2 + self._n_patches // 8 + 160)
        return min(self._n_coefficients, rest // (n_points or 1) // _BYTES_A_COEFFICIENT)

    def _n_least(self) -> int:
        """Least number of points: distinct positions of vertices on reflecting objects."""
        scene = self._scene
        used = np.zeros(len(scene.vertices), bool)
        used[scene.triangles[scene.reflecting[scene.object_of_triangle]]] = True
        bits = (scene.vertices[used] + np.float32(0.0)).view(np.int32).astype(np.int64)  # −0 as 0
        return len(np.unique(bits @ np.array([1, 0x9E3779B1, 0x85EBCA6B0001])))  # a hash: the sums wrap around

    def _check_memory(self, n_points: int) -> None:
        """Raise InsituError if so many points do not fit into memory."""
        if self._within_memory(n_points) < _LEAST_COEFFICIENTS:
            raise InsituError(
                f"{self._scene.file}: {n_points} vertices, of which Orbit would store more than "
                f"{self._most_bytes / 2**20:.0f} MiB; expected fewer, or a simpler mesh"
            )
