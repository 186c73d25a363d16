"""The layers of a picture: their accumulators, gains, view curves and footprints, and which objects need shading.

A layer keeps the footprint of its picture until its next picture, so that the stages of a coarse-to-fine picture may
arrive layer by layer and the picture on screen is always consistent within a layer.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from ui.gl.context import GraphicsError
from ui.gl.gpu_memory import TextureMemory
from ui.modes.placement.gl.composite import VIEW_CURVE_SIZE, Compositor, FootprintTextures, Indirect, MapTexture
from ui.modes.placement.gl.transport import Accumulator

_SIDE_BY_SIDE = 1024  # samples that are added at a time


@dataclass(eq=False)
class DrawnLayer:
    """One layer as it is drawn; `mean` (3,) is its mean radiance before f_q and f_o, of direct light. map_numbers: the
    texture's strength, and whether the weight is inverted."""

    i_object: int
    accumulator: Accumulator
    footprint: FootprintTextures | None
    indirect: Indirect | None = None
    gain: tuple[float, float, float] = (1.0, 1.0, 1.0)
    view_curve: moderngl.Texture | None = None
    visible: bool = True
    maps: MapTexture | None = None
    map_numbers: tuple[float, bool] = (1.0, False)
    mean: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True, eq=False)
class ComparedAppearance:
    """Another appearance of a layer: f_q, the factors of f_o by frame (2,256,3), visibility, and a radiance (p,3) at
    every pixel of its object.

    `radiance` None: as in its accumulator. maps: samples of its images (p,4) or None, with their two numbers.
    """

    gain: tuple[float, float, float]
    view_curves: NDArray[np.floating]
    visible: bool
    radiance: NDArray[np.floating] | None = None
    maps: tuple[NDArray[np.float16] | None, float, bool] = (None, 1.0, False)


class LayerStack:
    """The layers by key, the footprint of the pictures to come, and the objects to shade again (`dirty`)."""

    def __init__(self, memory: TextureMemory, compositor: Compositor) -> None:
        self.footprint: FootprintTextures | None = None
        self.indirect_footprint: FootprintTextures | None = None
        self.dirty: set[int] = set()
        self._memory, self._compositor = memory, compositor
        self._layers: dict[str, DrawnLayer] = {}
        self._footprints: list[tuple[NDArray[np.integer], FootprintTextures]] = []

    def __contains__(self, key: str) -> bool:
        return key in self._layers

    def __getitem__(self, key: str) -> DrawnLayer:
        if key not in self._layers:
            raise GraphicsError(f"no layer {key}, there are {', '.join(self._layers) or 'none'}")
        return self._layers[key]

    @property
    def keys(self) -> tuple[str, ...]:
        return tuple(self._layers)

    def of_object(self, i_object: int) -> list[DrawnLayer]:
        """The object's layers as they are shaded one by one."""
        return [layer for layer in self._layers.values() if layer.i_object == i_object]

    def put(self, key: str, i_object: int, n_samples: int) -> None:
        """Add a layer, black; an old one of that key loses only its picture."""
        n_objects = self._compositor.frame.n_objects
        if not 0 <= i_object < n_objects:
            raise GraphicsError(f"layer {key}: object {i_object}, expected 0 to {n_objects - 1}")
        self.check_sample_count(key, i_object, n_samples)
        layer = DrawnLayer(i_object, Accumulator(self._memory, n_samples), self.footprint)
        old = self._layers.get(key)
        if old is not None:
            layer.gain, layer.view_curve, layer.visible = old.gain, old.view_curve, old.visible
            layer.maps, layer.map_numbers = old.maps, old.map_numbers
            self.dirty.add(old.i_object)
            _release(old)
        self._layers[key] = layer
        self.dirty.add(i_object)

    def remove(self, key: str) -> None:
        """Remove a layer."""
        layer = self[key]
        _release(layer)
        self._memory.release(layer.view_curve)
        self._compositor.release_maps(layer.maps)
        del self._layers[key]
        self.dirty.add(layer.i_object)

    def set_radiance(self, key: str, radiance: NDArray[np.floating], footprint: FootprintTextures | None) -> bool:
        """Replace a layer's picture by radiance (p,3) at the samples of a footprint; returns whether these are those
        of the picture before."""
        layer = self[key]
        same_samples = layer.footprint is footprint and layer.accumulator.n_samples == len(radiance)
        if radiance.ndim != 2 or radiance.shape[1] != 3:
            raise GraphicsError(f"layer {key}: radiance of shape {radiance.shape}, expected (p, 3)")
        self.check_sample_count(key, layer.i_object, len(radiance))
        if len(radiance) != layer.accumulator.n_samples:
            replacement = Accumulator(self._memory, len(radiance))
            layer.accumulator.release()
            layer.accumulator = replacement
        layer.accumulator.write(radiance)
        layer.footprint = footprint
        layer.mean = _finite_mean(radiance)
        self.dirty.add(layer.i_object)
        return same_samples

    def set_indirect(self, key: str, radiance: NDArray[np.floating] | None) -> None:
        """Set a layer's indirect radiance (p,3) at the samples of the indirect footprint; None removes it."""
        layer = self[key]
        if radiance is None:
            if layer.indirect is not None:
                layer.indirect.accumulator.release()
                layer.indirect = None
                self.dirty.add(layer.i_object)
            return
        if self.indirect_footprint is None:
            raise GraphicsError(f"layer {key}: indirect light, but no footprint for it")
        needed = int(self.indirect_footprint.n_samples_needed[layer.i_object])
        if radiance.shape != (len(radiance), 3) or len(radiance) < needed:
            raise GraphicsError(f"layer {key}: indirect radiance {radiance.shape}, expected ({needed} or more, 3)")
        if layer.indirect is None or layer.indirect.accumulator.n_samples != len(radiance):
            accumulator = Accumulator(self._memory, len(radiance))
            if layer.indirect is not None:
                layer.indirect.accumulator.release()
            layer.indirect = Indirect(accumulator, self.indirect_footprint)
        layer.indirect.footprint = self.indirect_footprint
        layer.indirect.accumulator.write(radiance)
        self.dirty.add(layer.i_object)

    def exchange(self, key: str, accumulator: Accumulator, footprint: FootprintTextures | None) -> None:
        """Show another accumulator; the caller gets the old one."""
        layer = self[key]
        layer.accumulator, layer.footprint = accumulator, footprint
        self.dirty.add(layer.i_object)

    def set_gain(self, key: str, gain: Sequence[float]) -> None:
        layer = self[key]
        red, green, blue = (float(value) for value in gain)
        if layer.gain != (red, green, blue):
            layer.gain = (red, green, blue)
            self.dirty.add(layer.i_object)

    def set_visible(self, key: str, visible: bool) -> None:
        layer = self[key]
        if layer.visible != visible:
            layer.visible = visible
            self.dirty.add(layer.i_object)

    def set_view_curve(
        self, key: str, curve: NDArray[np.floating] | None, of_coat: NDArray[np.floating] | None = None
    ) -> None:
        """Set f_o (256,3), or its factor by the base's normal; of_coat (256,3): the factor by the coat's; None: 1."""
        layer = self[key]
        for each in (curve, of_coat):
            if each is not None and np.shape(each) != (VIEW_CURVE_SIZE, 3):
                found = f"view curve of shape {np.shape(each)}, expected ({VIEW_CURVE_SIZE}, 3)"
                raise GraphicsError(f"layer {key}: {found}")
        # Rows of 1 at the end are left out: they shade alike, in less time.
        rows = np.array([np.ones((VIEW_CURVE_SIZE, 3)) if each is None else each for each in (curve, of_coat)])
        n_rows = int(np.flatnonzero((rows != 1.0).any(axis=(1, 2))).max(initial=-1)) + 1
        texels = None if n_rows == 0 else rows[:n_rows].astype(np.float32)
        if texels is not None and layer.view_curve is not None and layer.view_curve.height == n_rows:
            layer.view_curve.write(texels, alignment=1)
        else:
            made = None if texels is None else self._memory.texture((VIEW_CURVE_SIZE, n_rows), 3, "f4", texels)
            self._memory.release(layer.view_curve)
            layer.view_curve = made
        self.dirty.add(layer.i_object)

    def set_maps(self, key: str, samples: NDArray[np.float16] | None) -> None:
        """Set a layer's images (p,4) at every pixel of its object, texture RGB and weight; None: it has none."""
        layer = self[key]
        made = None if samples is None else self._compositor.make_maps(layer.i_object, samples)
        self._compositor.release_maps(layer.maps)
        layer.maps = made
        self.dirty.add(layer.i_object)

    def set_map_numbers(self, key: str, strength: float, inverts: bool) -> None:
        """Set the strength of a layer's texture, and whether one minus the weight counts."""
        layer = self[key]
        if layer.map_numbers != (strength, inverts):
            layer.map_numbers = strength, inverts
            if layer.maps is not None:
                self.dirty.add(layer.i_object)

    @contextmanager
    def with_appearances(self, looks: Mapping[str, ComparedAppearance]) -> Iterator[None]:
        """Show the layers with other appearances for a while; then their own return unchanged, and their objects are to
        be shaded."""
        own = {key: self._layers[key] for key in looks if key in self._layers}
        try:
            for key, layer in own.items():
                self._layers[key] = replace(layer, view_curve=None, accumulator=layer.accumulator)
                self._apply_appearance(key, looks[key], layer)
            yield
        finally:
            for key, layer in own.items():
                worn = self._layers[key]
                if worn.accumulator is not layer.accumulator:
                    worn.accumulator.release()
                if worn is not layer:
                    self._memory.release(worn.view_curve)
                if worn.maps is not layer.maps:
                    self._compositor.release_maps(worn.maps)
                self._layers[key] = layer
                self.dirty.add(layer.i_object)

    def _apply_appearance(self, key: str, look: ComparedAppearance, own: DrawnLayer) -> None:
        worn = self._layers[key]
        worn.gain, worn.visible = look.gain, look.visible
        samples, strength, inverts = look.maps
        worn.map_numbers = strength, inverts
        if samples is None:
            worn.maps = None
        elif own.maps is None or own.maps.samples is not samples:
            worn.maps = self._compositor.make_maps(own.i_object, samples)
        self.set_view_curve(key, *look.view_curves)
        if look.radiance is not None:
            n_pixels = self._compositor.object_size(own.i_object)
            if np.shape(look.radiance) != (n_pixels, 3):
                raise GraphicsError(f"layer {key}: radiance {np.shape(look.radiance)}, expected ({n_pixels}, 3)")
            worn.accumulator, worn.footprint = Accumulator(self._memory, n_pixels), None
            worn.accumulator.write(look.radiance)

    def set_footprint(self, rows: NDArray[np.integer] | None, weights: NDArray[np.floating] | None) -> None:
        """Set the footprint of the pictures to come; None is one sample per pixel."""
        if rows is None or weights is None:
            self.footprint = None
            return
        self.footprint = self._made(rows, weights)

    def set_indirect_footprint(self, rows: NDArray[np.integer], weights: NDArray[np.floating]) -> None:
        """Set the footprint of the indirect light to come."""
        self.indirect_footprint = self._made(rows, weights)

    def _made(self, rows: NDArray[np.integer], weights: NDArray[np.floating]) -> FootprintTextures:
        """A footprint's textures; the present ones where it was set before and is still in use."""
        for made_of, footprint in self._footprints:
            if made_of is rows:
                return footprint
        made = self._compositor.make_footprint(rows, weights)
        self._footprints.append((rows, made))
        return made

    def release_unused_footprints(self, also_used: Iterable[FootprintTextures | None] = ()) -> None:
        """Free the footprints that neither a layer nor `also_used` needs."""
        used = [self.footprint, self.indirect_footprint, *also_used]
        for layer in self._layers.values():
            used += [layer.footprint, None if layer.indirect is None else layer.indirect.footprint]
        for made in [each for each in self._footprints if not any(each[1] is other for other in used)]:
            self._compositor.release_footprint(made[1])
            self._footprints = [each for each in self._footprints if each is not made]

    def check_sample_count(self, key: str, i_object: int, n_samples: int) -> None:
        """Raise GraphicsError unless the current footprint finds all its samples among so many."""
        n_pixels = self._compositor.object_size(i_object)
        if self.footprint is None and n_samples != n_pixels:
            raise GraphicsError(f"layer {key}: {n_samples} samples without a footprint, expected {n_pixels}")
        if self.footprint is not None and n_samples < self.footprint.n_samples_needed[i_object]:
            needed = self.footprint.n_samples_needed[i_object]
            raise GraphicsError(f"layer {key}: {n_samples} samples, the footprint needs {needed}")

    def mean_radiance(self) -> float:
        """Mean of the visible layers over the pixels that see a surface and over the channels, without f_o."""
        total = 0.0
        for layer in self._layers.values():
            if layer.visible:
                size = self._compositor.object_size(layer.i_object)
                total += size * float(np.mean(np.abs(layer.gain) * layer.mean))
        return total / max(1, self._compositor.frame.n_points)

    def release(self) -> None:
        for layer in self._layers.values():
            _release(layer)
            self._memory.release(layer.view_curve)
            self._compositor.release_maps(layer.maps)
        self._layers.clear()
        self.footprint = self.indirect_footprint = None
        self.release_unused_footprints()


def _release(layer: DrawnLayer) -> None:
    layer.accumulator.release()
    if layer.indirect is not None:
        layer.indirect.accumulator.release()


def _finite_mean(radiance: NDArray[np.floating]) -> NDArray[np.float64]:
    """Mean of |radiance| (3,) over the samples, with 0 for NaN and infinity.

    Rows are added side by side in single precision: numpy takes fifteen times as long for three numbers at a time.
    """
    if not len(radiance):
        return np.zeros(3)
    whole = len(radiance) - len(radiance) % _SIDE_BY_SIDE
    with np.errstate(over="ignore", invalid="ignore"):
        rows = np.abs(radiance[:whole], dtype=np.float32).reshape(-1, 3 * _SIDE_BY_SIDE).sum(axis=0).reshape(-1, 3)
        total = rows.sum(axis=0, dtype=np.float64) + np.abs(radiance[whole:]).sum(axis=0, dtype=np.float64)
    if np.isfinite(total).all():
        return np.asarray(total / len(radiance))
    finite = np.where(np.isfinite(radiance), np.abs(radiance), 0.0)
    return finite.mean(axis=0, dtype=np.float64)
