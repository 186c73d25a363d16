"""How an image of light covers the sphere of directions; light probes and cube maps become lat-long maps.

The frame is that of lat-long maps: straight ahead is -Z, +X to the right, +Y up.

- "angular": a disc in a square, centre -Z, radius = angle from -Z / pi [Debevec98].
- "ball": a mirroring ball as a distant camera that looks along -Z sees it. The centre shows +Z, the rim -Z.
- "cube": the six faces of a cube, unfolded: a cross of 4 x 3 faces, where -Z is second of the four in a row; a cross of
  3 x 4, whose lowest face, +Z, stands on its head; or a column of six, +X, -X, +Y, -Y, +Z, -Z, as OpenEXR's [Kainz13].
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from engine.core.errors import LoadError
from engine.core.threads import even_parts, on_threads

Float32Array = NDArray[np.float32]
Mapping = Literal["latlong", "angular", "ball", "cube"]

MAPPINGS: tuple[Mapping, ...] = ("latlong", "angular", "ball", "cube")
# Of images that are w x h faces of a cube, rows and columns of +X, -X, +Y, -Y, +Z, -Z.
_CELLS = {
    (4, 3): ((1, 2), (1, 0), (0, 1), (2, 1), (1, 3), (1, 1)),
    (3, 4): ((1, 2), (1, 0), (0, 1), (2, 1), (3, 1), (1, 1)),
    (1, 6): ((0, 0), (1, 0), (2, 0), (3, 0), (4, 0), (5, 0)),
}
_N_SUB = 4


def likely_mapping(width: int, height: int) -> Mapping:
    """The mapping of an image by its size: the faces of a cube have one of their own, a square is an angular map."""
    return "cube" if _faces(width, height) else "angular" if width == height else "latlong"


def mapping_problem(mapping: Mapping, width: int, height: int) -> str | None:
    """What an image of this size should be for a mapping; None if it can be one."""
    if mapping in ("angular", "ball") and width != height:
        return f"a square {'angular map' if mapping == 'angular' else 'picture of a ball'}"
    if mapping == "cube" and not _faces(width, height):
        return "a cube map: a cross of 4 x 3 or 3 x 4 faces, or a column of 6"
    return None


def blacken_unused(image: Float32Array, mapping: Mapping) -> None:
    """Sets what a mapping does not use to 0, in place: the cells of a cross beside its faces, and what is outside the
    disc of a probe. It holds captions and arbitrary values, and must count neither as light nor as errors."""
    height, width = image.shape[:2]
    if mapping == "cube":
        across, down = _faces(width, height) or (1, 6)
        used = np.zeros((down, across), bool)
        used[tuple(np.transpose(_CELLS[across, down]))] = True
        size = height // down
        for row, column in np.argwhere(~used):
            image[row * size : (row + 1) * size, column * size : (column + 1) * size] = 0.0
    elif mapping != "latlong":
        place = (2.0 * np.arange(height) + 1.0) / height - 1.0
        image[place[:, None] ** 2 + place[None, :] ** 2 > 1.0] = 0.0


def to_latlong(image: Float32Array, mapping: Mapping) -> Float32Array:
    """Resamples a probe or cube map (H, W, 3) to a lat-long map of its own angular resolution, with 4 x 4 samples a
    texel: half as many rows as a disc has, twice as many as a face."""
    from engine.light import _probe_kernels  # imported late: what shows environments alone needs no compiler

    height, width = image.shape[:2]
    faces = _faces(width, height) if mapping == "cube" else None
    cells = np.array(_CELLS[faces] if faces else np.empty((0, 2)), np.int32)
    rows = 2 * height // faces[1] if faces else max(1, (height + 1) // 2)
    latlong = np.empty((rows, 2 * rows, 3), np.float32)
    on_threads(
        lambda a, b: _probe_kernels.resample_probe(
            image, mapping == "ball", cells, faces == (3, 4), _N_SUB, a, b, latlong
        ),
        *even_parts(rows),
    )
    return latlong


def check_mapping(file: Path, mapping: Mapping, width: int, height: int) -> None:
    """Raises LoadError for an image that cannot have the mapping."""
    if problem := mapping_problem(mapping, width, height):
        raise LoadError(file, "size", f"{width} x {height}", problem)


def _faces(width: int, height: int) -> tuple[int, int] | None:
    """How many faces of a cube an image is wide and high; None if it is none."""
    return next((size for size in _CELLS if width * size[1] == height * size[0] and width % size[0] == 0), None)
