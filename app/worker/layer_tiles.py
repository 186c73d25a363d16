"""The parts of a layer's transport while it is made, tile by tile: on disk, and in memory for an editor.

An editor contracts the bands with its curves, so its worker holds them in memory. A process that only fills the cache
holds none: its memory does not grow with the transport, whose tiles stay in their file until they are joined there.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from app.document.scene_state import LayerState
from app.worker.layer_data import Part, join_tile_contents, part_of_file, picture_of_part, shape_of, tile_content
from app.worker.tiles import Tiles
from engine.core.stored_arrays import Writable
from engine.precompute.direct.bandstore import BandStore, BandTile, FixedPicture, arrays_in_pieces, join_pictures
from engine.precompute.direct.projection import TILE


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
