"""The transport that the worker holds of a layer: what it was made of, its responses, when it need not be made, and its
tiles while it is made.

A request for transport seldom changes all of it: a roughness changes one layer, and an object that becomes editable
needs bands under the same light. Transport that is as fine as a stage would make it is not made again; and a layer that
only gets bands keeps its picture until the last stage brings them.

An editor contracts the bands with its curves, so its worker holds them in memory. A process that only fills the cache
holds none: its memory does not grow with the transport, whose tiles stay in their file until they are joined there.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from app.document.light_state import LightState
from app.document.scene_state import LayerState
from app.messages.worker_messages import Response
from app.modes.placement.placement_messages import LayerPicture, LayerTransport
from app.worker.array_files import Tiles
from engine.core.stored_arrays import Arrays, Writable
from engine.precompute.direct.bandstore import (
    BandStore,
    BandTile,
    FixedPicture,
    arrays_in_pieces,
    arrays_of_file,
    curve_planes,
    join_pictures,
    join_tiles,
    picture_of_file,
    picture_of_tile,
    store_from_arrays,
)
from engine.precompute.direct.pipeline import COARSE, DRAG, FINAL, PREVIEW
from engine.precompute.direct.projection import TILE, LayerShape
from engine.settings import Precision, RenderSettings

# As fine as a preview, of a scene that is lit anew (`app.worker.relighting`): its pictures have no bands.
RELIT = replace(PREVIEW, name="relit")
# The stages by name, coarse to fine.
STAGES = {quality.name: quality for quality in (DRAG, COARSE, RELIT, PREVIEW, FINAL)}
_RANK = {name: rank for rank, name in enumerate(STAGES)}
Part = dict[str, np.ndarray]


@dataclass(frozen=True)
class LightingState:
    """The light that a layer's transport was requested for: equal ones light equally in the same stage.

    planned_settings: those of the last stage, where it needs less light than requested.
    """

    light: LightState
    settings: RenderSettings
    emission: tuple[tuple[str, tuple[float, float, float]], ...] = ()
    planned_settings: RenderSettings | None = field(default=None, compare=False)


@dataclass(frozen=True, eq=False)
class LayerData:
    """The newest transport of a layer: what it was requested with, its stage, what is stored, and its radiance's unit.

    edited: the layer whose curves it is contracted with, where those were edited since.
    """

    work: LayerState
    lit_by: LightingState
    stage: str
    store: BandStore | FixedPicture
    unit: float
    edited: LayerState | None = None

    @property
    def is_fixed(self) -> bool:
        return isinstance(self.store, FixedPicture)

    @property
    def radiance(self) -> np.ndarray:
        """The reflected radiance (p, 3) under its coefficients, without f_q and f_o."""
        return np.asarray(self.store.radiance(*both_curves(self._curves_of)) * np.float32(self.unit))

    @property
    def _curves_of(self) -> LayerState:
        return self.edited or self.work

    def is_picture_of(self, work: LayerState, lit_by: LightingState) -> bool:
        """Whether it yields the picture of this work in this light, in its own stage."""
        if (self.work.quotient, self.lit_by) != (work.quotient, lit_by):
            return False
        if self.is_fixed:
            return all(map(np.array_equal, self.work.coefficients, work.coefficients))
        return self.work.bands == work.bands

    def makes_needless(self, work: LayerState, stage: str, is_last: bool) -> bool:
        """Whether that stage of the work, whose picture this is, need not be made."""
        as_fine = _RANK[self.stage] >= _RANK[stage]
        return as_fine and (work.fixed or not (is_last and self.is_fixed))

    def taken_over_by(self, work: LayerState) -> LayerData:
        """The same for the work that requests its picture; without bands where that is fixed."""
        data = replace(self, work=work, edited=None)
        if work.fixed and not self.is_fixed:
            return replace(data, store=FixedPicture(self.store.radiance(*both_curves(work))))
        return data

    def fits_curves(self, layer: LayerState) -> bool:
        """Whether it can be contracted with the curves of this layer."""
        return not self.is_fixed and (self.work.factors, self.work.bands) == (layer.factors, layer.bands)

    def with_curves(self, layer: LayerState) -> LayerData:
        """The same transport under other curves."""
        return replace(self, edited=layer)

    def responses(self, factor: str | None, precision: Precision, picture: bool = True) -> Iterator[Response]:
        """The layer's picture, if that is requested, and its transport along a curve where one is named.

        Both come from one contraction.
        """
        work, store, coefficients = self.work, self.store, self._curves_of.coefficients
        if factor is None or isinstance(store, FixedPicture):
            yield LayerPicture(work.key, self.stage, self.radiance, coefficients)
            return
        curves = both_curves(self._curves_of)
        planes = curve_planes(store, work.factors.index(factor), curves, self.unit, precision)
        if picture:
            yield LayerPicture(work.key, self.stage, planes.radiance, coefficients)
        yield LayerTransport(work.key, factor, self.stage, planes.numbers, planes.norms, planes.scale)


def reflects_alike(one: LayerState, two: LayerState) -> bool:
    """Whether two layers of one object have the same curves and quotient."""
    if one.layer == two.layer:
        return True
    alike = one.quotient == two.quotient and len(one.coefficients) == len(two.coefficients)
    return alike and all(map(np.array_equal, one.coefficients, two.coefficients))


def both_curves(work: LayerState) -> tuple[np.ndarray, np.ndarray]:
    """The layer's coefficients, (J, 3) and (K, 3): one of 1 in place of the second curve where there is none."""
    first, *second = work.coefficients
    return np.asarray(first), np.asarray(second[0]) if second else np.ones((1, 3))


def shape_of(work: LayerState) -> LayerShape:
    """The layer as the projection needs it."""
    bands = (work.bands[0], work.bands[1] if len(work.bands) > 1 else 1)
    return LayerShape(work.model, work.quotient_parameters, bands)


def tile_content(work: LayerState, tile: BandTile) -> Part:
    """The stored content of a tile: its bands, or of a fixed layer its picture."""
    if work.fixed:
        return {"picture": picture_of_tile(tile, shape_of(work).bands, both_curves(work))}
    return tile.arrays()


def picture_of_part(work: LayerState, part: Part) -> np.ndarray:
    """A tile's picture (p, 3) under the layer's coefficients, from its stored content."""
    return (
        part["picture"] if work.fixed else picture_of_tile(BandTile(0, **part), shape_of(work).bands, both_curves(work))
    )


def join_tile_contents(work: LayerState, parts: Mapping[int, Arrays]) -> BandStore | FixedPicture:
    """The stored content of all tiles, given by their first point, joined."""
    if work.fixed:
        return join_pictures({begin: np.asarray(part["picture"]) for begin, part in parts.items()})
    return join_tiles(shape_of(work).bands, (BandTile(begin, **part) for begin, part in parts.items()))


def part_of_file(work: LayerState, n_points: int, arrays: Arrays) -> Part:
    """The stored content of a tile, or of all of the layer, of so many points. Raises UnsoundArrays."""
    if work.fixed:
        return {"picture": picture_of_file(n_points, arrays)}
    return arrays_of_file(shape_of(work).bands, n_points, arrays)


def store_of(work: LayerState, n_points: int, arrays: Arrays) -> BandStore | FixedPicture:
    """All of a layer, read from a file. Raises UnsoundArrays."""
    part = part_of_file(work, n_points, arrays)
    return FixedPicture(part["picture"]) if work.fixed else store_from_arrays(shape_of(work).bands, part)


class LayerTiles:
    """The content of a layer's P points, in tiles of 256; after an interrupted run it has that run's tiles."""

    def __init__(self, work: LayerState, n_points: int, file: Tiles, held: bool) -> None:
        """held: whether all parts stay in memory; parts that the file does not take stay there in any case."""
        self._work, self._n_points, self._file, self._holds = work, n_points, file, held
        self._held: dict[int, Part] = {}
        self._pictures: dict[int, np.ndarray] = {}
        self._n_values: dict[int, int] = {}
        for i in sorted(file.complete_tiles):
            part = self._from_file(i)
            if part is not None:
                self._note(i, part, in_file=True)

    @property
    def complete(self) -> frozenset[int]:
        """The numbers of the tiles that need not be made."""
        return frozenset(self._n_values)

    def add(self, tile: BandTile) -> None:
        """Add another tile."""
        i, part = tile.begin // TILE, tile_content(self._work, tile)
        self._note(i, part, in_file=self._file.append_tile(i, part))

    def arrays(self) -> Writable:
        """All of the layer, in the form that is written to disk, when its tiles are complete."""
        if self._work.fixed:
            return join_pictures({i: np.asarray(self._part(i)["picture"]) for i in self._n_values}).arrays()
        n_values = [self._n_values[i] for i in sorted(self._n_values)]
        return arrays_in_pieces(shape_of(self._work).bands, self._n_points, n_values, self._part)

    def store(self) -> BandStore | FixedPicture:
        """All of the layer, to make pictures; parts that are not in memory are read."""
        return join_tile_contents(self._work, {i * TILE: self._part(i) for i in self._n_values})

    def picture(self) -> FixedPicture:
        """The layer's picture under its present curves; stored only of a layer whose parts are not in memory."""
        return join_pictures(self._pictures)

    def _note(self, i: int, part: Part, in_file: bool) -> None:
        self._n_values[i] = 0 if self._work.fixed else len(part["values"])
        if self._holds or not in_file:
            self._held[i] = part
        if not self._holds:
            self._pictures[i] = picture_of_part(self._work, part)

    def _part(self, i: int) -> Part:
        part = self._held.get(i) or self._from_file(i)
        if part is None:  # a disk that accepts data and does not return it
            raise OSError(f"tile {i} of {self._work.key} cannot be read again")
        return part

    def _from_file(self, i: int) -> Part | None:
        n_points = min(self._n_points - i * TILE, TILE)
        return self._file.tile(i, partial(part_of_file, self._work, n_points))
