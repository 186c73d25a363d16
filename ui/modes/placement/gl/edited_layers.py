"""The layers that follow an edited curve: their transport on the GPU, pending uploads, and wanted coefficients.

Mostly that is one layer, the selected one. Layers that share the curve follow it as well, each with its own transport
and at its own samples, all in the same frame: those that a transport was begun `beside`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.settings import Precision
from ui.gl.context import GraphicsError
from ui.gl.gpu_memory import TextureMemory
from ui.modes.placement.gl.composite import FootprintTextures
from ui.modes.placement.gl.layers import LayerStack
from ui.modes.placement.gl.refiner import Refiner
from ui.modes.placement.gl.transport import TermSum, TransportUpload


@dataclass(eq=False)
class _PendingUpload:
    """A transport that is being uploaded, with the footprint of its samples and the layers that stay beside it.

    held: the layer's newest picture, radiance (p,3) at the samples of a footprint, under a curve that has been edited
    since. The picture before, which has the edits, stays instead; it is shown only if the upload is given up.
    """

    key: str
    curve: str
    stage: str
    upload: TransportUpload
    footprint: FootprintTextures | None
    beside: Collection[str]
    held: tuple[NDArray[np.floating], FootprintTextures | None] | None = None


@dataclass(eq=False)
class _ActiveTransport:
    """A transport in use, over the bands of a curve."""

    curve: str
    refiner: Refiner
    footprint: FootprintTextures | None


@dataclass(frozen=True)
class EditUpdate:
    """The result of an update: terms added, the most that still differ in a layer, whether nothing is left to do."""

    applied: int = 0
    remaining: int = 0
    exact: bool = True


class EditedLayers:
    """Transports by layer key, and the coefficients (J,3) of a curve that each layer should show."""

    def __init__(self, memory: TextureMemory, terms: TermSum) -> None:
        self._memory, self._terms = memory, terms
        self._wanted: dict[str, tuple[str, NDArray[np.float64]]] = {}
        self._arriving: list[_PendingUpload] = []
        self._active: dict[str, _ActiveTransport] = {}

    @property
    def keys(self) -> tuple[str, ...]:
        """The layers whose transport is in use."""
        return tuple(self._active)

    @property
    def precision(self) -> Precision | None:
        """The precision of the transports in use; None where none is."""
        return next((active.refiner.transport.precision for active in self._active.values()), None)

    @property
    def upload_fraction(self) -> float | None:
        """The uploaded fraction of the transport under way; None when there is none."""
        return self._arriving[0].upload.fraction if self._arriving else None

    @property
    def footprints(self) -> tuple[FootprintTextures | None, ...]:
        """The footprints of transports in use and under way, and of pictures that are held back."""
        at_work = (active.footprint for active in self._active.values())
        held = (arriving.held[1] for arriving in self._arriving if arriving.held is not None)
        return (*at_work, *(arriving.footprint for arriving in self._arriving), *held)

    def begin(
        self,
        layers: LayerStack,
        key: str,
        transport: NDArray[np.floating],
        norms: NDArray[np.floating],
        scale: NDArray[np.floating] | None,
        beside: Collection[str],
        curve: str,
        stage: str = "",
        radiance: NDArray[np.floating] | None = None,
    ) -> None:
        """Start to upload a transport over a curve. Other uploads, except for layers `beside` it, are dropped.

        radiance: a picture at its samples that is held back until then, see `_PendingUpload`.
        """
        held = None if radiance is None else (radiance, layers.footprint)
        for other in [each for each in self._arriving if each.key == key or each.key not in beside]:
            self._give_up(other)
            if other.key == key:
                held = held or other.held
            else:
                self._show_held(layers, other)
        upload = TransportUpload(self._memory, transport, norms, scale)
        arriving = _PendingUpload(key, curve, stage, upload, layers.footprint, beside, held)
        self._arriving.append(arriving)
        try:
            layers.check_sample_count(key, layers[key].i_object, upload.target.n_samples)
        except GraphicsError:
            self._give_up(arriving)
            self._show_held(layers, arriving)
            raise

    def upload(self, layers: LayerStack, time_budget_s: float) -> bool:
        """Continue pending uploads for about this long; True when none is left."""
        if not self._arriving:
            return True
        arriving = self._arriving[0]
        try:
            if not arriving.upload.advance(time_budget_s):
                return False
            self._activate(arriving)
            if arriving.held is not None and arriving.key not in self._wanted:  # no curve to sum it by
                layers.set_radiance(arriving.key, *arriving.held)
        except GraphicsError:
            self._give_up(arriving)
            self._show_held(layers, arriving)
            raise
        self._arriving.remove(arriving)
        return not self._arriving

    def curve(self, key: str) -> str | None:
        """The curve of a layer's transport in use."""
        return self._active[key].curve if key in self._active else None

    def want(self, key: str, coefficients: NDArray[np.floating], curve: str) -> None:
        """Set the curve that a layer should show; stored for its transport where that is not there."""
        values = np.array(coefficients, dtype=np.float64)
        if values.ndim != 2 or values.shape[1] != 3 or not np.isfinite(values).all():
            raise GraphicsError(f"layer {key}: coefficients of shape {values.shape}, expected (J, 3), all finite")
        active = self._active.get(key)
        if active is not None and active.curve == curve and active.refiner.fits(values):
            active.refiner.want(values)
        self._wanted[key] = curve, values

    def start_from(
        self, key: str, coefficients: NDArray[np.floating] | None, same_samples: bool, stage: str = ""
    ) -> None:
        """Note that a layer's picture was replaced by one of a stage made with these coefficients, None where unknown.

        A pending transport of another stage would bring back the picture before.
        """
        for arriving in [each for each in self._arriving if each.key == key]:
            arriving.held = None
            if arriving.stage != stage:
                self._give_up(arriving)
        if key in self._active:
            if same_samples:
                self._active[key].refiner.start_from(coefficients)
            else:
                self._stop(key)

    def update(self, layers: LayerStack, max_coefficients: int | None, budget_s: float | None) -> EditUpdate:
        """Move each layer towards its wanted curve: at most so many terms each, all of them within `budget_s`."""
        works = list(self._at_work())
        share = None if budget_s is None or not works else budget_s / len(works)
        applied = 0
        for key, active in works:
            layer, refiner = layers[key], active.refiner
            done, accumulator = refiner.step(layer.accumulator, refiner.term_limit(max_coefficients, share))
            if done.swapped:
                layers.exchange(key, accumulator, active.footprint)
            if done.swapped or done.shown_changed:
                layers.dirty.add(layer.i_object)
                layer.mean = refiner.mean_radiance()
            applied += done.applied
        remaining = max((len(active.refiner.state.pending()) for _, active in works), default=0)
        return EditUpdate(applied, remaining, all(active.refiner.is_exact for _, active in works))

    def missing(self, layers: LayerStack, object_size: int) -> float:
        """sqrt(Σ_k |Δc_k|²‖T_k‖²) with f_q, of pixels, over all the layers; `object_size` is that of their object."""
        total = 0.0
        for key, active in self._at_work():
            pixels_per_sample = object_size / max(1, active.refiner.transport.n_samples)
            gain = max(map(abs, layers[key].gain))
            total += (active.refiner.state.remaining_effect() * gain) ** 2 * pixels_per_sample
        return float(total**0.5)

    def drop(self, key: str) -> None:
        """Drop a layer's transport, in use or pending."""
        self._stop(key)
        for arriving in [each for each in self._arriving if each.key == key]:
            self._give_up(arriving)

    def clear(self) -> None:
        """Drop everything."""
        for arriving in [*self._arriving]:
            self._give_up(arriving)
        for key in self.keys:
            self._stop(key)
        self._wanted.clear()

    def _at_work(self) -> Iterator[tuple[str, _ActiveTransport]]:
        """Those whose own curve is wanted."""
        curves = {key: curve for key, (curve, _) in self._wanted.items()}
        return ((key, active) for key, active in self._active.items() if curves.get(key) == active.curve)

    def _activate(self, arrived: _PendingUpload) -> None:
        refiner = Refiner(self._memory, self._terms, arrived.upload.target, arrived.upload.norms)
        curve, wanted = self._wanted.get(arrived.key, ("", None))
        if wanted is not None and curve == arrived.curve and refiner.fits(wanted):
            try:
                refiner.want(wanted)
            except GraphicsError:
                refiner.release_spare()
                raise
        else:
            self._wanted.pop(arrived.key, None)
        for key in [each for each in self._active if each == arrived.key or each not in arrived.beside]:
            self._stop(key)
        self._active[arrived.key] = _ActiveTransport(arrived.curve, refiner, arrived.footprint)

    def _give_up(self, arriving: _PendingUpload) -> None:
        arriving.upload.target.release()
        self._arriving.remove(arriving)

    def _show_held(self, layers: LayerStack, arriving: _PendingUpload) -> None:
        """Show the picture that was held back for a transport that does not come; one in use is of other samples."""
        if arriving.held is not None and arriving.key in layers:
            layers.set_radiance(arriving.key, *arriving.held)
            self._stop(arriving.key)

    def _stop(self, key: str) -> None:
        if key in self._active:
            self._active.pop(key).refiner.release()
