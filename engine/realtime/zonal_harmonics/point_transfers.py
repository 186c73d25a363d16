"""What is known of the transfer of a scene's points: their lobes, and what each object's were computed for."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engine.realtime.zonal_harmonics.bending_points import BendingPoints
from engine.realtime.zonal_harmonics.object_transfer import N_LOBES, ORDER, ObjectTransfer
from engine.realtime.zonal_harmonics.shading import Lobes, unshadowed_points
from engine.realtime.zonal_harmonics.surface_details import Detail, detail
from engine.realtime.zonal_harmonics.zonal import Zonal
from engine.scene.scene_loader import Scene


class PointTransfers:
    """The transfer of all points, unshadowed at first, or that of the nearest points of others that were before.

    lobes: of all points, replaced and never changed; errors (P,): of these relative to the transfer that they were
    fitted to; details: of objects whose surfaces vary between points; known: what each object's was computed for.
    """

    def __init__(self, points: BendingPoints) -> None:
        self._points = points
        self.lobes: Lobes = unshadowed_points(len(points), N_LOBES, ORDER)
        self.errors: NDArray[np.float32] = np.zeros(len(points), np.float32)
        self.details: dict[int, Detail] = {}
        self.known: dict[int, ObjectTransfer] = {}

    def take_over(self, before: PointTransfers, near: NDArray[np.integer]) -> None:
        """Begin with the transfer of other points, `near` (P,) of which each is nearest to."""
        had = before.lobes
        self.lobes, self.errors = Lobes(had.low[near], had.axes[near], had.coefficients[near]), before.errors[near]
        self.details = before.details
        self.known = {i: each for i, each in before.known.items() if self._points.has_same_points(before._points, i)}

    def put(self, computed: ObjectTransfer, zonal: Zonal, scene: Scene) -> None:
        """Replace an object's transfer."""
        i, surface = computed.i_object, computed.surface
        self.known[i] = computed
        self.details.pop(i, None)
        if surface.is_mapped:
            self.details[i] = detail(scene, surface, zonal)
            return
        mine, n = self._points.points_of(i), zonal.axes.shape[1]
        self.errors[mine] = zonal.relative_errors
        lobes = Lobes(self.lobes.low.copy(), self.lobes.axes.copy(), self.lobes.coefficients.copy())
        lobes.low[mine], lobes.axes[mine, :n], lobes.coefficients[mine] = zonal.low, zonal.axes, 0.0
        lobes.coefficients[mine, :n] = zonal.coefficients
        self.lobes = lobes

    def has(self, wanted: ObjectTransfer) -> bool:
        """Whether an object's transfer is as it is wanted."""
        return self.known.get(wanted.i_object) == wanted

    def is_outdated(self, wanted: ObjectTransfer) -> bool:
        """Whether an object's transfer has other shadows than it is wanted with, or is of another surface."""
        known = self.known.get(wanted.i_object)
        return known is None or (known.casters, known.surface) != (wanted.casters, wanted.surface)

    def share_of(self, wanted: ObjectTransfer) -> float:
        """How much of what is wanted is there, 0 to 1: few rays are a tenth of the work."""
        return 0.0 if wanted.i_object not in self.known else 1.0 if self.has(wanted) else 0.1

    @property
    def n_bytes(self) -> int:
        """Bytes that the lobes take."""
        return self.lobes.low.nbytes + self.lobes.axes.nbytes + self.lobes.coefficients.nbytes
