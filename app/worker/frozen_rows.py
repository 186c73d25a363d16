"""What a frozen curve reflects of the light between surfaces, band by band, at pixels: the rows of `engine.inverse`.

A frozen layer's radiance is sum_n d^n sum_j c_j F_jn at its gather points (`engine.precompute.indirect.frozen_light`),
d the equivalent albedo of the object. It is linear in the curve where d stays as it was frozen.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.document.scene_state import LayerState
from app.modes.placement.placement_messages import FreezeIndirect, IndirectFrozen
from app.worker.found_light import FoundLight
from engine.precompute.indirect.albedo import equivalent_albedo


@dataclass(frozen=True, eq=False)
class FrozenRows:
    """The light that was frozen last: of `found`, for the edits of `desired`; bands (3, J, D, p), in units of `unit`,
    by the keys of the edited layers."""

    found: FoundLight
    desired: FreezeIndirect
    bands: Mapping[str, NDArray[np.float32]]
    unit: float

    def of(self, layer: LayerState, name: str, rows: NDArray[np.integer]) -> NDArray[np.floating] | None:
        """The radiance (J, n, 3), without f_q and f_o, for a 1 in each band of a layer's curve, at rows (n,) of the
        picture's points; None where this curve was not frozen in these bands."""
        place, bands = layer.factors.index(name), self.bands.get(layer.key)
        if bands is None or self.desired.curves[layer.key] != place or bands.shape[1] != layer.bands[place]:
            return None
        return self.found.light.curve_rows(bands, self._albedo(layer.object), rows) * self.unit

    def _albedo(self, name: str) -> NDArray[np.float64]:
        """d (3,) of an object as it was frozen."""
        own = [each for each in self.desired.scene.visible if each.object == name]
        return np.asarray(sum(equivalent_albedo(each.layer, each.bands) * each.mean_factor for each in own))


def frozen_rows(found: FoundLight, desired: FreezeIndirect, frozen: IndirectFrozen) -> FrozenRows:
    """What a freezing has of the edited curves."""
    bands = {frozen.keys[i]: array for i, array in frozen.light.bands.items()}
    return FrozenRows(found, desired, bands, frozen.unit)


def freezes_alike(one: FreezeIndirect, two: FreezeIndirect) -> bool:
    """Whether both desire the same of a light."""
    desired = ((each.scene.visible, each.key, each.factor, each.second_bands, each.edited) for each in (one, two))
    return next(desired) == next(desired)
