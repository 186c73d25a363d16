"""Paints lights onto an environment, and tilts it: the map that all modes and path tracing see.

The map is made as fine as the smallest edit requires first, by interpolation. Shapes are then painted in order, each
texel with its mean over solid angle, so that light is neither lost at rims nor at the poles, and the columns at ±π
meet. Painted lights are tilted by their directions, not by resampling, so they are as sharp as untilted ones.
"""

from __future__ import annotations

import math
import os
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from engine.core.errors import LoadError
from engine.core.safe_files import read_regular_file
from engine.core.threads import even_parts, on_threads
from engine.light.daylight import horizontal_irradiance, sky_radiance, sun_irradiance
from engine.light.environment import Environment, interpolated_image
from engine.light.map_changes import tilted_image
from engine.light.painted_lights import PaintedLight, tilt_matrix
from engine.light.suns import Sun, add_sun_disc

Float64Array = NDArray[np.float64]
Image = NDArray[np.float32]

COARSE_ROWS, FINE_ROWS, MOST_ROWS = 512, 1024, 4096
# Below this size in degrees a light is painted on the finer map, where it covers 34 texels.
_SMALL = 6.0
_SKY_ROWS = 16
_IMAGE_ENDINGS = (".exr", ".hdr", ".pic")
MAX_IMAGE_BYTES = 1 << 30


@lru_cache(maxsize=8)  # the same object again, whose integrals are known; single lights are painted as well
def painted_environment(environment: Environment, lights: tuple[PaintedLight, ...], tilt: float = 0.0) -> Environment:
    """The environment tilted by degrees, with these lights on it, in order. Raises LoadError for an image that cannot
    be read."""
    tilt %= 360.0
    if not lights and not tilt or not lights and environment.radiance.shape[:2] == (1, 1):
        return environment
    pictures = [picture_of(light) for light in lights]
    image = _fine_image(environment, _rows_for(lights, pictures), tilt).copy()
    for light, picture in zip(lights, pictures, strict=True):
        if light.kind == "sky":
            _paint_sky(image, light, tilt)
        else:
            _paint_shape(image, light, picture, tilt)
    np.minimum(image, np.float32(1e30), out=image)
    image.flags.writeable = False
    return Environment(image, environment.source, environment.notes)


def _rows_for(lights: tuple[PaintedLight, ...], pictures: list[Image]) -> int:
    """The rows that the smallest of lights requires."""
    wanted = FINE_ROWS if any(each.least_size < _SMALL for each in lights) else COARSE_ROWS
    panoramas = [len(each) for light, each in zip(lights, pictures, strict=True) if light.kind == "image"
                 and light.surrounds]  # fmt: skip
    return max(wanted, min(max(panoramas, default=0), MOST_ROWS))


@lru_cache(maxsize=2)  # while what is painted on it changes
def _fine_image(environment: Environment, wanted: int, tilt: float) -> Image:
    """The environment's image with at least so many rows, tilted."""
    given = environment.radiance
    if given.shape[:2] == (1, 1):
        image = np.tile(given, (wanted, 2 * wanted, 1))
    else:
        image = interpolated_image(environment, math.ceil(wanted / len(given)))
        image = tilted_image(image, tilt) if tilt else image
    return _frozen(image)


def _paint_shape(image: Image, light: PaintedLight, picture: Image, tilt: float) -> None:
    from engine.light import _painting_kernels as kernels

    half = [math.radians(each) / 2.0 for each in (light.width, light.height)]
    if light.kind == "gradient":
        kind, size, reach = kernels.GRADIENT, np.array([2.0 * half[0], 0.0]), math.pi
    elif light.kind == "disc":
        kind, size, reach = kernels.DISC, np.array([half[0], 0.0]), half[0]
    elif light.surrounds:
        kind, size, reach = kernels.PANORAMA, np.ones(2), math.pi
    else:
        size = np.array([math.tan(each) for each in half])
        kind, reach = kernels.CARD, math.atan(float(np.hypot(*size)))
    frame = np.ascontiguousarray(light.frame @ tilt_matrix(tilt).T)
    colour = np.array(light.gain if light.kind == "gradient" else light.colour, np.float64)
    on_threads(
        lambda start, stop: kernels.paint_rows(
            start,
            stop,
            image,
            kind,
            frame,
            size,
            reach,
            float(light.softness),
            picture,
            colour,
            float(light.opacity),
            light.covers,
        ),
        *even_parts(len(image)),
    )


def _paint_sky(image: Image, light: PaintedLight, tilt: float) -> None:
    sky = _sky_image(light.azimuth, light.elevation, light.turbidity, light.ground, light.sun, light.diameter,
                     len(image), image.shape[1], tilt)  # fmt: skip
    if light.covers:
        image *= np.float32(1.0 - light.opacity)
    image += sky * (light.opacity * np.array(light.colour)).astype(np.float32)


@lru_cache(maxsize=2)  # while other lights are dragged
def _sky_image(
    azimuth: float, elevation: float, turbidity: float, ground: tuple[float, float, float], sun: float, diameter: float,
    height: int, width: int, tilt: float,
) -> Image:  # fmt: skip
    """(H, W, 3): the sky with its sun, and the ground that both light."""
    theta = math.pi * (np.arange(height) + 0.5) / height
    phi = 2.0 * math.pi * ((np.arange(width) + 0.5) / width - 0.5)
    towards_sun = PaintedLight("", azimuth=azimuth, elevation=elevation).frame[2]
    inverse, below = tilt_matrix(tilt).T, np.array(ground) / math.pi * horizontal_irradiance(turbidity, elevation, sun)
    image = np.empty((height, width, 3), np.float32)
    across = np.stack([np.sin(phi), np.zeros(width), -np.cos(phi)], axis=1)

    def fill(start: int) -> None:
        rows = slice(start, start + _SKY_ROWS)
        directions = np.sin(theta[rows])[:, None, None] * across
        directions[..., 1] = np.cos(theta[rows])[:, None]
        directions = directions @ inverse.T
        up = directions[..., 1] > 0.0
        image[rows] = below
        image[rows][up] = sky_radiance(directions[up], towards_sun, turbidity)

    on_threads(fill, range(0, height, _SKY_ROWS))
    irradiance = np.array(sun_irradiance(turbidity, elevation)) * sun
    if irradiance.any():
        x, y, z = (tilt_matrix(tilt) @ towards_sun).tolist()
        red, green, blue = irradiance.tolist()
        add_sun_disc(image, Sun((x, y, z), (red, green, blue), diameter))
    image.flags.writeable = False
    return image


# -------------------------------------------------------------------------------------------------------------- images


def picture_of(light: PaintedLight) -> Image:
    """(H, W, 4): the colours of a light and the share of each pixel that is opaque; of an image that has been read
    about as fine as it is painted."""
    if light.kind == "gradient":
        return _frozen(np.array([[(*light.radiance, 1.0), (*light.far, 1.0)]], np.float32))
    if light.kind != "image":
        return _frozen(np.ones((1, 1, 4), np.float32))
    picture = load_picture(light.file)
    return picture if light.surrounds else _reduced(light.file, _stamp(light.file), max(light.width, light.height))


def load_picture(file: str) -> Image:
    """(H, W, 4): an image with its alpha, linear, of OpenEXR, Radiance HDR, PNG, JPEG or WebP; read again only when the
    file has changed. Raises LoadError."""
    return _load(file, _stamp(file))


def _stamp(file: str) -> tuple[int, int]:
    try:
        status = os.stat(file)
    except OSError as error:
        raise LoadError(file, "file", error.strerror or str(error), "an image that exists") from None
    return status.st_mtime_ns, status.st_size


@lru_cache(maxsize=4)
def _load(file: str, stamp: tuple[int, int]) -> Image:
    from engine.light.environment import repair_radiance
    from engine.light.radiance_files import read_radiance_image
    from engine.texture.texture_files import has_alpha, read_opacity, read_texture

    if Path(file).suffix.lower() in _IMAGE_ENDINGS:
        colours = read_radiance_image(Path(file))
        repair_radiance(colours, [])
        alpha = np.ones((*colours.shape[:2], 1), np.float32)
    else:
        data = read_regular_file(Path(file), MAX_IMAGE_BYTES)
        colours = read_texture(data, file)
        alpha = read_opacity(data, file) if has_alpha(data, file) else np.ones((*colours.shape[:2], 1), np.float32)
    return _frozen(np.concatenate([colours, alpha], axis=2))


@lru_cache(maxsize=4)
def _reduced(file: str, stamp: tuple[int, int], degrees: float) -> Image:
    """A card's image by means of blocks, two to four pixels for a texel of the finer map."""
    picture = _load(file, stamp)
    texels = max(degrees / 180.0 * FINE_ROWS, 1.0)
    k = max(int(max(picture.shape[:2]) / (2.0 * texels)), 1)
    if k == 1:
        return picture
    height, width = -(-picture.shape[0] // k), -(-picture.shape[1] // k)
    rows, columns = (np.arange(0, n, k) for n in picture.shape[:2])
    # Colours weigh as much as they are opaque.
    weighted = np.concatenate([picture[..., :3] * picture[..., 3:], picture[..., 3:]], axis=2)
    sums = np.add.reduceat(np.add.reduceat(weighted, rows, axis=0), columns, axis=1)
    counts = np.diff(np.append(rows, picture.shape[0]))[:, None] * np.diff(np.append(columns, picture.shape[1]))
    found = np.empty((height, width, 4), np.float32)
    found[..., :3] = sums[..., :3] / np.maximum(sums[..., 3:], np.float32(1e-12))
    found[..., 3] = sums[..., 3] / counts
    return _frozen(found)


def _frozen(image: Image) -> Image:
    image.flags.writeable = False
    return image
