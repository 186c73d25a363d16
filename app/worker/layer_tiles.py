"""The parts of a layer's transport while it is made, tile by tile: on disk, and held where somebody asks for them.

An editor bends curves over the bands, so its worker holds them. Who only fills the cache holds none: memory does not
grow with the transport then, whose tiles lie in their file until the whole is put together from there.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from app.document.scene_state import LayerState
from app.worker.layer_data import Part, join_tile_contents, part_of_file, picture_of_part, shape_of, tile_content
from app.worker.tiles import Tiles
from engine.core.stored_arrays import Writable
from engine.precompute.direct.bandstore import BandStore, BandTile, arrays_in_pieces
from engine.precompute.direct.fixed_picture import FixedPicture, join_pictures
from engine.precompute.direct.projection import TILE


class LayerTiles:
    """What is kept of a layer's P points, in tiles of 256; of a run that was interrupted it has what that one kept."""

    def __init__(self, work: LayerState, n_points: int, file: Tiles, held: bool) -> None:
        """held: whether all parts stay in memory; what the file does not take does in any case."""
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
        """Keep another one."""
        i, part = tile.begin // TILE, tile_content(self._work, tile)
        self._note(i, part, in_file=self._file.append_tile(i, part))

    def arrays(self) -> Writable:
        """All of the layer, as it goes to the disk, when its tiles are complete."""
        if self._work.fixed:
            return join_pictures({i: np.asarray(self._part(i)["picture"]) for i in self._n_values}).arrays()
        n_values = [self._n_values[i] for i in sorted(self._n_values)]
        return arrays_in_pieces(shape_of(self._work).bands, self._n_points, n_values, self._part)

    def store(self) -> BandStore | FixedPicture:
        """All of the layer, to ask it for pictures; of parts that are not held it is read."""
        return join_tile_contents(self._work, {i * TILE: self._part(i) for i in self._n_values})

    def picture(self) -> FixedPicture:
        """The layer's picture under its curves as they are; kept only of a layer whose parts are not."""
        return join_pictures(self._pictures)

    def _note(self, i: int, part: Part, in_file: bool) -> None:
        self._n_values[i] = 0 if self._work.fixed else len(part["values"])
        if self._holds or not in_file:
            self._held[i] = part
        if not self._holds:
            self._pictures[i] = picture_of_part(self._work, part)

    def _part(self, i: int) -> Part:
        part = self._held.get(i) or self._from_file(i)
        if part is None:  # a disk that takes and does not give back
            raise OSError(f"tile {i} of {self._work.key} cannot be read again")
        return part

    def _from_file(self, i: int) -> Part | None:
        n_points = min(self._n_points - i * TILE, TILE)
        return self._file.tile(i, partial(part_of_file, self._work, n_points))
