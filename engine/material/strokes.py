"""Brush strokes on a layer's weight map, in the order in which they were painted.

A stroke is a sequence of dabs. Each is a ball about a point of the surface, with the surface's outward normal there, so
that it extends neither over a seam of the texture coordinates nor through to the other side, and meshes without texture
coordinates can be painted as well as others. Where a stroke covers a point by the share c, it moves the weight w there
to

    w + strength c (value - w),     c = 1 up to hardness r from a dab, falling smoothly to 0 at its radius r,

where c is the maximum over its dabs: a stroke does not accumulate on itself. Rejected: an image in texture space, in
which the six sides of a cube coincide, and whose texels become visible when the camera is close; strokes are evaluated
at the look-ups. Points are in world space and not in the object's: objects do not move, and a radius in metres is the
same in all directions.

Dabs are stored packed: documents with thousands of them are compared, hashed and sent in every frame of a drag. Single
precision is accurate only near an origin, so each stroke has its own; painting uses `Scene.origin`, which moves with
the scene's meshes, and `Strokes.about` converts strokes to it.
"""

from __future__ import annotations

import base64
import binascii
import dataclasses
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from engine.material.parameters import ParameterError

MAX_STROKES = 4096
MAX_DABS = 50_000
MAX_RADIUS = 1e6
MAX_PLACE = 1e9
MAX_ORIGIN = 1e12
# A harder edge than this share of the radius would show the pixels.
HARDEST = 0.95
_DAB = np.dtype("<f4")
_BYTES = 6 * _DAB.itemsize
_EXPECTED = "strokes with radius, value, strength, hardness and dabs"
_KEYS = {"radius", "value", "strength", "hardness", "origin", "dabs"}

Place = tuple[float, float, float]


@dataclass(frozen=True)
class Stroke:
    """One stroke. radius in metres; value, strength and hardness in [0, 1]; dabs: six float32 each, a world position
    minus `origin` and the unit normal there, on the side that the surface's winding faces."""

    radius: float
    value: float = 1.0
    strength: float = 1.0
    hardness: float = 0.5
    dabs: bytes = b""
    origin: Place = (0.0, 0.0, 0.0)

    @property
    def array(self) -> NDArray[np.float32]:
        """The dabs (N, 6)."""
        return np.frombuffer(self.dabs, _DAB).reshape(-1, 6)

    @property
    def n_dabs(self) -> int:
        return len(self.dabs) // _BYTES

    def about(self, origin: Place) -> Stroke:
        """The same stroke with its dabs relative to another origin."""
        if origin == self.origin:
            return self
        moved = self.array.astype(np.float64)
        moved[:, :3] += np.subtract(self.origin, origin)
        return dataclasses.replace(self, dabs=moved.astype(_DAB).tobytes(), origin=origin)

    def extended(self, dabs: bytes) -> Stroke:
        """The stroke, continued by dabs relative to its own origin."""
        return dataclasses.replace(self, dabs=self.dabs + dabs)

    def continues(self, other: Stroke) -> bool:
        """Whether it is the other one, continued or unchanged."""
        same = dataclasses.replace(other, dabs=b"") == dataclasses.replace(self, dabs=b"")
        return same and self.dabs.startswith(other.dabs)


@dataclass(frozen=True)
class Strokes:
    """All strokes of one map, oldest first."""

    strokes: tuple[Stroke, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.strokes)

    @property
    def n_dabs(self) -> int:
        return sum(stroke.n_dabs for stroke in self.strokes)

    def about(self, origin: NDArray[np.float64]) -> Strokes:
        """The same strokes, all dabs relative to one origin (3,)."""
        x, y, z = origin.tolist()
        if all(stroke.origin == (x, y, z) for stroke in self.strokes):
            return self
        return Strokes(tuple(stroke.about((x, y, z)) for stroke in self.strokes))

    def with_stroke(self, stroke: Stroke) -> Strokes:
        """Add one stroke on top."""
        return Strokes((*self.strokes, stroke))

    def with_dabs(self, more: Stroke) -> Strokes:
        """Continue the newest stroke by another's dabs."""
        newest = self.strokes[-1]
        return Strokes((*self.strokes[:-1], newest.extended(more.about(newest.origin).dabs)))

    def extends(self, other: Strokes) -> bool:
        """Whether they are the others, of which the newest was continued or followed by more."""
        n = len(other.strokes)
        if n == 0 or len(self.strokes) < n:
            return n == 0
        return self.strokes[: n - 1] == other.strokes[:-1] and self.strokes[n - 1].continues(other.strokes[-1])

    def extends_last_stroke(self, other: Strokes) -> bool:
        """Whether they are the others with the newest stroke continued: the same drag."""
        return bool(other) and len(self.strokes) == len(other.strokes) and self != other and self.extends(other)

    def __reduce__(self) -> tuple[Callable[..., Strokes], tuple[Any, ...]]:
        """Pickled as one array, which crosses between processes in shared memory."""
        brushes = tuple((*_brush(stroke).values(), stroke.origin, len(stroke.dabs)) for stroke in self.strokes)
        return _unpack, (brushes, np.frombuffer(b"".join(stroke.dabs for stroke in self.strokes), np.uint8))


def pack_dabs(places: ArrayLike, normals: ArrayLike) -> bytes:
    """Dabs at points (N, 3) with normals (N, 3)."""
    rows = np.concatenate([np.reshape(places, (-1, 3)), np.reshape(normals, (-1, 3))], axis=1)
    return rows.astype(_DAB).tobytes()


def stroke_values(strokes: Strokes) -> list[dict[str, Any]]:
    """Strokes in the form of files: numbers, and the dabs in base 64."""
    found = []
    for stroke in strokes.strokes:
        origin = {"origin": list(stroke.origin)} if any(stroke.origin) else {}
        found.append(_brush(stroke) | origin | {"dabs": base64.b64encode(stroke.dabs).decode()})
    return found


def strokes_from(values: object) -> Strokes:
    """The strokes that a file describes. Raises ParameterError."""
    if isinstance(values, Strokes):
        return values
    if not isinstance(values, (list, tuple)) or len(values) > MAX_STROKES:
        raise ParameterError("strokes", type(values).__name__, f"a list of at most {MAX_STROKES} {_EXPECTED}")
    strokes = Strokes(tuple(_stroke(each) for each in values))
    if strokes.n_dabs > MAX_DABS:
        raise ParameterError("strokes", f"{strokes.n_dabs} dabs", f"at most {MAX_DABS}")
    return strokes


def make_stroke(radius: object, value: object, strength: object, hardness: object, dabs: bytes) -> Stroke:
    """A stroke of validated numbers. Raises ParameterError."""
    return Stroke(
        _number("radius", radius, 1e-12, MAX_RADIUS), _number("value", value, 0.0, 1.0),
        _number("strength", strength, 0.0, 1.0), _number("hardness", hardness, 0.0, 1.0), dabs,
    )  # fmt: skip


def _brush(stroke: Stroke) -> dict[str, float]:
    return {name: getattr(stroke, name) for name in ("radius", "value", "strength", "hardness")}


def _unpack(brushes: Iterable[tuple[float, float, float, float, Place, int]], dabs: NDArray[np.uint8]) -> Strokes:
    """The inverse of `Strokes.__reduce__`."""
    strokes, begin = [], 0
    for radius, value, strength, hardness, origin, n_bytes in brushes:
        own = dabs[begin : begin + n_bytes].tobytes()
        strokes.append(Stroke(radius, value, strength, hardness, own, origin))
        begin += n_bytes
    return Strokes(tuple(strokes))


def _stroke(values: object) -> Stroke:
    if isinstance(values, Stroke):
        return values
    if not isinstance(values, Mapping) or not set(values) <= _KEYS:
        raise ParameterError("strokes", type(values).__name__, _EXPECTED)
    radius, value, strength, hardness = (values.get(name, of_old) for name, of_old in _brush(Stroke(0.0)).items())
    stroke = make_stroke(radius, value, strength, hardness, _dabs(values.get("dabs")))
    return dataclasses.replace(stroke, origin=_place(values.get("origin", stroke.origin)))


def _place(value: object) -> Place:
    if not isinstance(value, (list, tuple)) or len(value) != 3:
        raise ParameterError("origin", type(value).__name__, "three numbers")
    x, y, z = (_number("origin", each, -MAX_ORIGIN, MAX_ORIGIN) for each in value)
    return x, y, z


def _dabs(text: object) -> bytes:
    """The packed dabs of a file, each finite and with a unit normal."""
    expected = f"base 64 of at most {MAX_DABS} times six finite numbers"
    if not isinstance(text, str) or len(text) > 2 * _BYTES * MAX_DABS:
        raise ParameterError("dabs", type(text).__name__, expected)
    try:
        data = base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError):
        raise ParameterError("dabs", text[:24], expected) from None
    if not data or len(data) % _BYTES:
        raise ParameterError("dabs", f"{len(data)} bytes", expected)
    rows = np.frombuffer(data, _DAB).reshape(-1, 6)
    if not np.isfinite(rows).all() or np.abs(rows[:, :3]).max() > MAX_PLACE or np.abs(rows[:, 3:]).max() > 1.01:
        raise ParameterError("dabs", "numbers out of range", expected)
    return data


def _number(name: str, value: object, low: float, high: float) -> float:
    if isinstance(value, (int, float)) and not isinstance(value, bool) and low <= value <= high:
        return float(value)
    raise ParameterError(name, value, f"a number from {low:g} to {high:g}")
