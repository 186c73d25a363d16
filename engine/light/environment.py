"""Distant light: a latitude-longitude image of radiance, loaded, rotated, averaged and integrated.

The centre column is in the direction -Z, +Y is up, azimuth increases to the right towards +X. The direction of image
position (u, v) in [0, 1] is, with theta = pi v and phi = 2 pi (u - 1/2),

    d = (sin theta sin phi, cos theta, -sin theta cos phi)

`rotation`, in degrees, rotates the environment counter-clockwise about +Y seen from above. Radiance is linear Rec. 709.

Integrals treat a texel as a patch of constant radiance with its exact solid angle, so light is never lost, not even
that of one texel at the zenith. `evaluate` interpolates between texel centres, which looks right but, if integrated,
would give a texel of the first or last row 8 % too much.

The exact integral over a triangle of the geodesic sphere (`triangle_integrals`): on the cylinder (phi, h = cos theta)
areas are solid angles, a texel is a rectangle and a great circle is the curve

    h(psi) = k cos psi / sqrt(1 - k^2 sin^2 psi),    integral of h d psi = asin(k sin psi),

where psi is the azimuth from the circle's highest point, and k the height of that point. By Green's theorem the light
in a triangle is the signed sum over its edges of the light between the edge and the zenith,

    integral over the edge of A(phi, h(phi)) d phi,    A(phi, h) = integral of L(phi, h') d h' from h to 1,

and A is linear in h within a texel, so each edge is walked from texel to texel with the closed form above. Every edge
is walked once and counts for its two triangles with opposite signs: rounding can move light between them, but never
lose it. Binning samples of texels into triangles was rejected after a trial: it conserves light too, but in no less
time it left a constant sky uneven by 3 % RMS at level 7, even after balancing the samples' weights.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from engine.core.colour import encode_srgb
from engine.core.errors import LoadError
from engine.core.threads import even_parts, on_threads
from engine.light.probe_mappings import MAPPINGS, Mapping, blacken_unused, check_mapping, to_latlong
from engine.light.radiance_files import read_radiance_image
from engine.light.resampling import area_average

if TYPE_CHECKING:
    from engine.light.suns import Sun

# Rec. 709 luminance weights
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])

LARGEST_HALF = 65504.0
_MOST_INTEGRATED_ROWS = 2048
_REPAIRED_ROWS = 256
_REFINED_ROWS, _MOST_REFINEMENT = 1024, 4


@dataclass(frozen=True, eq=False)
class Environment:
    """A lat-long image of radiance around the scene.

    radiance: (H, W, 3) float32, finite and not negative, read-only; copied unless it is that already. source: its
    origin, for messages. notes: one line for each repair while loading. base, suns: where the image has suns
    (`engine.light.suns.with_suns`), the environment without them, and these; another image has none of its own.
    """

    radiance: NDArray[np.float32]
    source: str
    notes: tuple[str, ...] = ()
    base: Environment | None = None
    suns: tuple[Sun, ...] = ()

    def __post_init__(self) -> None:
        given = np.asarray(self.radiance)
        is_own = given.dtype == np.float32 and given.flags.c_contiguous and not given.flags.writeable
        image = given if is_own else np.array(given, dtype=np.float32, order="C")
        if image.ndim != 3 or image.shape[2] != 3 or 0 in image.shape:
            raise ValueError(f"radiance has shape {np.shape(self.radiance)}, expected (H, W, 3)")
        if not (image.min() >= 0.0 and image.max() < np.inf):  # false for NaN too
            raise ValueError("radiance holds values that are negative or not finite")
        image.flags.writeable = False
        object.__setattr__(self, "radiance", image)

    @cached_property
    def light_above(self) -> NDArray[np.float64]:
        """(H + 1, W, 3): the integral of L d(cos theta) down each column, from the zenith to every row's edge."""
        steps = texel_solid_angles(len(self.radiance), 1) / (2.0 * math.pi)
        summed = np.zeros((self.radiance.shape[0] + 1, *self.radiance.shape[1:]))
        np.cumsum(self.radiance * steps[:, None, None], axis=0, out=summed[1:])
        return summed

    @cached_property
    def digest(self) -> str:
        """Identifies the radiance. Equal images have equal digests, those with suns where map and suns are equal."""
        if self.base is not None:  # while a sun is dragged, only the map's is long
            return hashlib.blake2b(f"{self.base.digest} {self.suns!r}".encode(), digest_size=16).hexdigest()
        found = hashlib.blake2b(repr(self.radiance.shape).encode(), digest_size=16)
        found.update(self.radiance.data)
        return found.hexdigest()

    def scale_by(self, scale: float) -> Environment:
        """The same image, so many times as bright."""
        return Environment(self.radiance * np.float32(scale), self.source, self.notes)

    def evaluate(self, directions: ArrayLike, rotation: float = 0.0) -> NDArray[np.float32]:
        """Radiance arriving from world `directions` (N, 3), which need not be unit; (N, 3) float32.

        Bilinear between texel centres, wrapping at the seam, constant beyond the first and last row's centres. Raises
        ValueError for other shapes and for values that are not finite.
        """
        d = np.asarray(directions, dtype=np.float64)
        if d.ndim != 2 or d.shape[1] != 3:
            raise ValueError(f"directions have shape {d.shape}, expected (N, 3)")
        if not np.isfinite(d).all():
            raise ValueError("directions hold values that are not finite")
        height, width, _ = self.radiance.shape
        theta = np.arctan2(np.hypot(d[:, 0], d[:, 2]), d[:, 1])
        phi = np.arctan2(d[:, 0], -d[:, 2]) + math.radians(rotation % 360.0)
        column = (phi / (2.0 * math.pi) + 0.5) * width - 0.5
        row = np.clip(theta / math.pi * height - 0.5, 0.0, height - 1.0)
        return _bilinear(self.radiance, row, column)


def constant_environment(radiance: ArrayLike) -> Environment:
    """The same radiance from everywhere: a number or (3,). Raises ValueError if it is negative or not finite."""
    return _constant(*np.broadcast_to(np.asarray(radiance, dtype=np.float32), (3,)).tolist())


@lru_cache(maxsize=8)  # so that a sky set again is the same one, whose integrals are known
def _constant(*radiance: float) -> Environment:
    return Environment(np.array([[radiance]], np.float32), "constant")


@lru_cache(maxsize=2)  # the same object again, whose integrals are known
def tinted(environment: Environment, colour: tuple[float, float, float]) -> Environment:
    """The environment times a colour, linear Rec. 709; itself for white."""
    if colour == (1.0, 1.0, 1.0):
        return environment
    return Environment(environment.radiance * np.array(colour, np.float32), environment.source, environment.notes)


def load_environment(path: str | Path, mapping: Mapping = "latlong") -> Environment:
    """Loads an OpenEXR or Radiance HDR file; what is no lat-long map is resampled to one (`probe_mappings`).

    Negative values and NaN are set to 0, infinite ones to the brightest value, and counted in `notes`. Texels that a
    mapping does not use, such as those outside the disc of an angular map, are never read. A column of six squares is a
    cube map whatever `mapping` says. Raises LoadError, naming the file and the problem, for anything that is not a
    complete image.
    """
    file = Path(path)
    if mapping not in MAPPINGS:
        raise LoadError(file, "mapping", mapping, " or ".join(MAPPINGS))
    notes: list[str] = []
    image = read_radiance_image(file, notes)
    height, width = image.shape[:2]
    if mapping == "latlong" and height == 6 * width:
        mapping = "cube"
        notes.append("a column of six squares, read as the faces of a cube")
    check_mapping(file, mapping, width, height)
    blacken_unused(image, mapping)
    repair_radiance(image, notes)
    if mapping != "latlong":
        image = to_latlong(image, mapping)
    image.flags.writeable = False
    return Environment(image, str(file), tuple(notes))


def texel_solid_angles(height: int, width: int) -> NDArray[np.float64]:
    """(H,) solid angle of one texel in each row: (cos theta_top - cos theta_bottom) 2 pi / W, by a stable product."""
    middle = math.pi * (np.arange(height) + 0.5) / height
    return 2.0 * np.sin(middle) * math.sin(0.5 * math.pi / height) * (2.0 * math.pi / width)


@lru_cache(maxsize=4)
def downsample(environment: Environment, height: int) -> Environment:
    """The environment averaged over solid angle to `height` rows, with the same proportions; unchanged if it is no
    larger."""
    if height < 1:
        raise ValueError(f"height = {height}, expected at least 1")
    rows, columns, _ = environment.radiance.shape
    if height >= rows:
        return environment
    image = area_average(environment.radiance, height, max(1, round(columns * height / rows)))
    return Environment(image, environment.source, environment.notes)


@lru_cache(maxsize=2)
def upsample_interpolated(environment: Environment) -> Environment:
    """The environment as `evaluate` interpolates it, with up to four times as many texels per axis and the same total
    light.

    A sun of few texels is as wide as interpolation makes it, and so are its shadows' edges: with texels of constant
    radiance the error of a room with a sky of 256 rows was 4.4 % against the path tracer, with these 1.9 %. From 1,024
    rows on the environment is unchanged.
    """
    times = min(_MOST_REFINEMENT, _REFINED_ROWS // len(environment.radiance))
    if times < 2:
        return environment
    return Environment(interpolated_image(environment, times), environment.source, environment.notes)


def interpolated_image(environment: Environment, times: int) -> NDArray[np.float32]:
    """The image as `evaluate` interpolates it, so many times as fine, with the same total light."""
    height, width, _ = environment.radiance.shape
    row = np.clip((np.arange(times * height) + 0.5) / times - 0.5, 0.0, height - 1.0)
    column = (np.arange(times * width) + 0.5) / times - 0.5
    rows, columns = (axis.ravel() for axis in np.meshgrid(row, column, indexing="ij"))
    image = _bilinear(environment.radiance, rows, columns).reshape(times * height, times * width, 3)
    # Interpolation gives rows at the zenith and nadir more weight than their solid angle.
    before, after = (
        np.einsum("hwc,h->c", each, texel_solid_angles(*each.shape[:2]), dtype=np.float64)
        for each in (environment.radiance, image)
    )
    image *= np.divide(before, after, out=np.ones(3), where=after > 0.0).astype(np.float32)
    return image


@lru_cache(maxsize=4)  # the stages of a picture cut the same light, places of a sun the same map
def triangle_integrals(environment: Environment, rotation: float, level: int) -> NDArray[np.float64]:
    """The integral of L d omega over each geodesic triangle of `level` (0 to 7): (20 * 4^level, 3) float64.

    Exact for texels of constant radiance, whatever the size of the map (above 2,048 rows it is averaged first): a
    constant sky gives L times the true solid angles, and a single bright texel retains its L Omega. Level 5 is fast
    enough for every frame of a drag. `rotation` in degrees. Read-only.
    """
    smaller = downsample(environment, _MOST_INTEGRATED_ROWS)
    turn = math.radians(rotation % 360.0)
    integrals = _integrate_over_triangles(smaller.radiance, smaller.light_above, turn, level)
    integrals.flags.writeable = False
    return integrals


def _integrate_over_triangles(
    radiance: NDArray[np.float32], light_above: NDArray[np.float64], turn: float, level: int
) -> NDArray[np.float64]:
    """The integral of L d omega over each triangle of `level`: (20 * 4^level, 3), never negative.

    radiance (H, W, 3); light_above (H + 1, W, 3), `Environment.light_above`; turn: azimuth in the map minus azimuth in
    the world, radians.
    """
    # Imported here: this module also serves processes that only show environments and must start without the compiler.
    from engine.light import _kernels
    from engine.sphere.geodesic import geodesic

    sphere = geodesic(level)
    edge_integrals = np.empty((len(sphere.edges), 3))
    row_edges = _row_edges(len(radiance))
    edges, triangle_edges = sphere.edges, sphere.triangle_edges
    on_threads(
        lambda start, stop: _kernels.integrate_above_edges(
            start, stop, edges, sphere.vertices, turn, radiance, light_above, row_edges, edge_integrals
        ),
        *even_parts(len(edges)),
    )
    integrals = np.empty((sphere.n_triangles, 3))
    on_threads(
        lambda start, stop: _kernels.sum_around_triangles(
            start, stop, sphere.triangles, triangle_edges, edge_integrals, integrals
        ),
        *even_parts(sphere.n_triangles),
    )
    integrals *= -1.0  # counter-clockwise from outside, the upper edges run towards smaller azimuth
    _close_at_nadir(sphere.vertices, sphere.triangles, turn, light_above[-1], integrals)
    return np.maximum(integrals, 0.0)


def _row_edges(height: int) -> NDArray[np.float64]:
    """(H + 1, 2): cosine and cotangent of theta at the rows' edges; the cotangents at zenith and nadir are never
    used."""
    theta = math.pi * np.arange(height + 1) / height
    sine = np.maximum(np.sin(theta), 1e-300)
    return np.stack([np.cos(theta), np.clip(np.cos(theta) / sine, -1e300, 1e300)], axis=1)


def _close_at_nadir(
    vertices: NDArray[np.float64],
    triangles: NDArray[np.int32],
    turn: float,
    column_light: NDArray[np.float64],
    integrals: NDArray[np.float64],
) -> None:
    """Adds the missing part of triangles with a corner at the nadir, where the boundary runs along h = -1."""
    for triangle in np.flatnonzero((vertices[triangles][..., 1] < -1.0 + 1e-12).any(axis=1)):
        x, y, z = vertices[triangles[triangle]].T
        phi = np.arctan2(x, -z)[y > -1.0 + 1e-12]
        step = (phi[1] - phi[0] + math.pi) % (2.0 * math.pi) - math.pi
        integrals[triangle] += _light_between(min(phi[0], phi[0] + step) + turn, abs(step), column_light)


def _light_between(first: float, step: float, column_light: NDArray[np.float64]) -> NDArray[np.float64]:
    """The integral of the columns' total light (W, 3) over the azimuths first .. first + step."""
    width = len(column_light)
    begin = (first + math.pi) / (2.0 * math.pi) * width
    columns = np.arange(math.floor(begin), math.ceil(begin + step / (2.0 * math.pi) * width) + 1)
    edges = np.clip(columns, begin, begin + step / (2.0 * math.pi) * width)
    return np.diff(edges) @ column_light[columns[:-1] % width] * (2.0 * math.pi / width)


def tone_mapped_thumbnail(environment: Environment, width: int) -> NDArray[np.uint8]:
    """A thumbnail of the environment for a panel: (max(1, width // 2), width, 3) uint8, sRGB.

    Exposed so that the mean luminance, without the brightest twentieth, becomes 0.18; compressed by x (1 + x / 16) / (1
    + x) [Reinhard02]. A black environment remains black.
    """
    if width < 1:
        raise ValueError(f"width = {width}, expected at least 1")
    small = area_average(environment.radiance, max(1, width // 2), width).astype(np.float64)
    luminance = (small @ LUMINANCE).ravel()
    n_counted = max(1, int(0.95 * luminance.size))
    mean = np.partition(luminance, n_counted - 1)[:n_counted].mean()
    exposed = np.minimum(small * (0.18 / mean) if mean > 0.0 else small, 1e6).astype(np.float32)
    mapped = np.clip(exposed * (1.0 + exposed / 16.0) / (1.0 + exposed), 0.0, 1.0)
    return _srgb_of_words()[(65535.0 * mapped + 0.5).astype(np.uint16)]


@lru_cache(maxsize=1)
def _srgb_of_words() -> NDArray[np.uint8]:
    """sRGB of n / 65535 for each n: a table is ten times as fast as the power, and exact to a twentieth of a step."""
    return np.round(255.0 * encode_srgb(np.arange(65536) / 65535.0)).astype(np.uint8)


def _bilinear(image: NDArray[np.float32], row: NDArray, column: NDArray) -> NDArray[np.float32]:
    """Bilinear interpolation at rows and columns (N,) in units of texels; columns wrap around."""
    height, width, _ = image.shape
    top, left = np.floor(row).astype(np.int64), np.floor(column).astype(np.int64)
    down, right = (row - top)[:, None].astype(np.float32), (column - left)[:, None].astype(np.float32)
    bottom = np.minimum(top + 1, height - 1)
    left, after = left % width, (left + 1) % width
    upper = image[top, left] * (1 - right) + image[top, after] * right
    lower = image[bottom, left] * (1 - right) + image[bottom, after] * right
    return upper * (1 - down) + lower * down


def repair_radiance(image: NDArray[np.float32], notes: list[str]) -> None:
    """Replaces, in place, infinite values by the brightest pixel, at least the largest half float, and NaN and negative
    values by 0. By bands of rows, so that a large map needs no second copy of itself."""
    height, width = image.shape[:2]
    bands = [image[start : start + _REPAIRED_ROWS] for start in range(0, height, _REPAIRED_ROWS)]
    n_bad, n_negative, brightest, first = 0, 0, LARGEST_HALF, None
    for i, band in enumerate(bands):
        finite = np.isfinite(band)
        n_bad += int((~finite).any(axis=2).sum())
        n_negative += int((finite & (band < 0.0)).any(axis=2).sum())
        brightest = max(brightest, float(band.max(where=finite, initial=0.0)))
        if first is None and n_bad:
            row, column, channel = (int(k) for k in np.argwhere(~finite)[0])
            first = f"in row {i * _REPAIRED_ROWS + row}, column {column}, channel {'RGB'[channel]}"
    if n_bad:
        what = f"infinite ones set to {brightest:g}, others to 0"
        notes.append(f"{n_bad} pixels were not finite, the first {first}: {what}")
    if n_negative:
        notes.append(f"{n_negative} of {height * width} pixels had negative values, set to 0")
    if n_bad or n_negative:
        for band in bands:
            np.nan_to_num(band, copy=False, nan=0.0, posinf=brightest, neginf=0.0)
            np.maximum(band, 0.0, out=band)
