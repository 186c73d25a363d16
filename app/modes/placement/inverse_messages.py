"""Placement's requests that go from a picture to curves, and their responses.

Shapes: n pixels of one object, J bands.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from app.messages.worker_messages import Request, Response
from app.modes.placement.placement_messages import ComputeTransport

if TYPE_CHECKING:
    from app.document.scene_state import LayerState
    from engine.inverse.curve_fit import CurveFit


@dataclass(frozen=True, eq=False)
class FitCurves(Request):
    """Find the change of curves that brings pixels of an object to a wanted radiance, by the transport that is there;
    answered by `CurvesFitted`.

    layers: those that share the curves, the selected one first; names: of the curves; points (n,): the numbers of the
    pixels' points among those of their object; seen and wanted (n, 3): radiance in the picture and as it is to be;
    touched: the numbers of all points that are not to stay as they are; smoothness, holding, in_grey: see
    `engine.inverse.curve_fit.fit_change`.
    """

    built_on = (ComputeTransport,)
    priority = 2
    answered_once = True
    is_stopped_by_user = False

    layers: tuple[LayerState, ...]
    names: tuple[str, ...]
    points: NDArray[np.integer]
    seen: NDArray[np.floating]
    wanted: NDArray[np.floating]
    touched: NDArray[np.integer]
    smoothness: float
    holding: float
    in_grey: bool = False


@dataclass(frozen=True, eq=False)
class CurvesFitted(Response):
    """What was found for each curve, by name, of the bands that the request's layers have; left (n, 3): the radiance
    that no change of these curves adds to the request's pixels."""

    fits: dict[str, CurveFit]
    left: NDArray[np.floating]
