"""Picture events of Placement: the worker's arrays, on their way to the renderer.

The renderer applies them and then, each frame, steps from the coefficients it shows to the desired ones
(``Curves.coefficients``); the editor computes no pictures. Shapes: P pixels that see a reflecting object, p those of
one layer, J bands.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from app.messages.picture_events import PictureEvent
from app.modes.placement.curves import Coefficients, Float64Array

if TYPE_CHECKING:
    from app.modes.placement.placement_messages import LayerTransport


@dataclass(frozen=True, eq=False)
class Footprint:
    """Which samples stand for each pixel: rows, those of its own object from 0, and weights (P,4).

    Each result carries the footprint of its own samples, so that two can never be mixed up.
    """

    rows: NDArray[np.integer]
    weights: NDArray[np.floating]


@dataclass(frozen=True, eq=False)
class LayerRadiance(PictureEvent):
    """One layer's radiance (p,3) without f_q and f_o, made with these coefficients by factor; footprint None: every
    pixel has its own sample; drawn_as: see `drawn_as`; is_outdated: a curve has been edited since, and the
    `TransportReady` that follows brings what the edit adds."""

    key: str
    stage: str
    radiance: NDArray[np.floating]
    coefficients: Coefficients
    footprint: Footprint | None = None
    drawn_as: tuple[object, ...] = ()
    is_outdated: bool = False


@dataclass(frozen=True, eq=False)
class TransportReady(PictureEvent):
    """The selected curve's transport in one layer: ``coefficients_first`` (J,p,3) in the Daubechies-4 domain, times
    ``scale``. ``beside``: all layers that follow the curve; footprint: as of a `LayerRadiance`."""

    key: str
    factor: str
    stage: str
    coefficients_first: NDArray[np.floating]
    norms: NDArray[np.floating]
    scale: NDArray[np.floating]
    beside: tuple[str, ...] = ()
    footprint: Footprint | None = None

    @classmethod
    def of(cls, response: LayerTransport, beside: tuple[str, ...], footprint: Footprint | None) -> TransportReady:
        """The event for a response of the worker."""
        return cls(
            response.key,
            response.factor,
            response.stage,
            response.coefficients_first,
            response.norms,
            response.scale,
            beside,
            footprint,
        )


@dataclass(frozen=True, eq=False)
class IndirectRadiance(PictureEvent):
    """One layer's radiance (p,3) from light that was reflected before, without f_q and f_o, and the footprint of its
    samples; None: there is none; drawn_as: see `drawn_as`."""

    key: str
    radiance: NDArray[np.floating] | None = None
    footprint: Footprint | None = None
    drawn_as: tuple[object, ...] = ()


@dataclass(frozen=True, eq=False)
class LayerMapsChanged(PictureEvent):
    """One layer's images (p,4) as the camera sees them, texture RGB and weight; None: it has none. ``has_weight``:
    whether there is a weight map among them; ``thumbnails`` (h,w,3) as in ``placement_messages.MapsSampled``."""

    key: str
    samples: NDArray[np.float16] | None
    has_weight: bool = False
    thumbnails: Mapping[str, NDArray[np.uint8]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class LayerAppearance:
    """A layer in another document: f_q, the factors of f_o by frame (2,256,3), visibility, and its radiance (p,3), None
    where as on screen; ``maps``: the samples of its images, None for none, the texture's strength, and whether the
    weight is inverted."""

    gain: Float64Array
    view_curves: Float64Array
    visible: bool
    radiance: NDArray[np.floating] | None = None
    maps: tuple[NDArray[np.float16] | None, float, bool] = (None, 1.0, False)


@dataclass(frozen=True, eq=False)
class ComparisonRefined(PictureEvent):
    """Side A of the A/B picture can be drawn anew: as what is on screen, with these appearances of its layers."""

    appearances: Mapping[str, LayerAppearance]


@dataclass(frozen=True, eq=False)
class DocumentDrawn(PictureEvent):
    """All that the picture waited for is there: it is the document's again."""


def group_events(events: list[PictureEvent]) -> list[PictureEvent]:
    """Group events so that none is shown without the others."""
    return [*(replace(event, with_next=True) for event in events[:-1]), *events[-1:]]
