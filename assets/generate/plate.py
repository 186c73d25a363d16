"""Plate: a painted and gilded plate and a glazed bowl on an oak table: what textures and weight maps are for.

The painting multiplies the ceramic's colour, as cobalt under a glaze does; the gilding is a weight map, by which gold
takes the place of glaze and ceramic. Both are drawn from above, in the polar coordinates of a plate; its mesh is laid
out so. The table is a primitive with its own texture coordinates, the oak repeats on it without a seam.
"""

import numpy as np
from numpy.typing import NDArray

from engine.core.colour import encode_srgb

from .mesh import Floats, Mesh, moved, with_coordinates
from .surfaces import carried, circle, rounded_profile

HALF = 0.137  # of the square that the painting covers, metres; the plate's rim is at 0.134
SIDE, FINER = 512, 2  # texels of the painting, samples across each
OAK = 512
PETALS = 18
COBALT = np.array([3.6, 2.3, 0.62])  # what a full stroke takes of red, green and blue, as optical depth


def meshes() -> dict[str, Mesh]:
    plate = carried(rounded_profile(_PLATE, arc_points=6), circle(128))
    from_above = 0.5 + np.column_stack([plate.positions[:, 0], -plate.positions[:, 2]]) / (2.0 * HALF)
    bowl = carried(rounded_profile(_BOWL, arc_points=8), circle(96))
    return {"plate": with_coordinates(plate, from_above), "bowl": moved(bowl, (0.135, 0.0, -0.185))}


def images() -> dict[str, NDArray[np.uint8]]:
    """By file name, (H, W, 3) sRGB or (H, W) shares."""
    return {"painting.png": painting(), "gilding.png": gilding(), "oak.jpg": oak()}


# (radius, height, fillet) from the middle below outward, over the rim, and back to the middle above.
_PLATE = [
    (0.0, 0.0040, 0), (0.0760, 0.0040, 0.0015), (0.0800, 0.0, 0.0012), (0.0850, 0.0, 0.0012), (0.0900, 0.0050, 0.004),
    (0.1330, 0.0185, 0.0010), (0.1345, 0.0208, 0.0010), (0.1322, 0.0220, 0.0010), (0.0920, 0.0098, 0.010),
    (0.0760, 0.0072, 0.012), (0.0, 0.0072, 0),
]  # fmt: skip
_BOWL = [
    (0.0, 0.0030, 0), (0.0290, 0.0030, 0.001), (0.0310, 0.0, 0.0008), (0.0350, 0.0, 0.0008), (0.0380, 0.0050, 0.003),
    (0.0640, 0.0240, 0.022), (0.0720, 0.0660, 0.0012), (0.0698, 0.0668, 0.0010), (0.0610, 0.0270, 0.020),
    (0.0360, 0.0085, 0.010), (0.0, 0.0070, 0),
]  # fmt: skip


def painting() -> NDArray[np.uint8]:
    """Cobalt on white: a wreath of leaves on the rim, a rosette in the middle, lines between."""
    radius, angle = _polar()
    depth = np.zeros_like(radius)
    for r, width, strength in ((0.700, 0.004, 1.0), (0.716, 0.0022, 0.7), (0.925, 0.003, 0.9), (0.47, 0.0025, 0.6)):
        depth = np.maximum(depth, strength * _within(np.abs(radius - r) - width))
    leaf = _leaf(radius, angle, PETALS, 0.0, (0.735, 0.905), 0.068)
    depth = np.maximum(depth, np.maximum(0.62 * _within(leaf) * (0.45 + 1.9 * np.clip(-leaf, 0.0, 0.05) / 0.05),
                                         1.15 * _within(np.abs(leaf) - 0.0035)))  # fmt: skip
    for r, size in ((0.885, 0.013), (0.845, 0.009), (0.812, 0.006)):
        depth = np.maximum(depth, 1.05 * _within(_dots(radius, angle, PETALS, 0.5, r) - size))
    inner = _leaf(radius, angle, 10, 0.5, (0.045, 0.255), 0.052)
    depth = np.maximum(depth, np.maximum(0.8 * _within(inner), 1.2 * _within(np.abs(inner) - 0.004)))
    outer = _leaf(radius, angle, 10, 0.0, (0.130, 0.400), 0.050)
    depth = np.maximum(depth, np.maximum(0.30 * _within(outer), 0.9 * _within(np.abs(outer) - 0.003)))
    depth = np.maximum(depth, 1.1 * _within(_dots(radius, angle, 20, 0.25, 0.435) - 0.008))
    depth = np.maximum(depth, 1.2 * _within(radius - 0.028))
    depth *= 1.0 + 0.17 * _finer(_noise(SIDE, 6.0, 11))  # a brush lays unevenly
    light = np.exp(-np.clip(depth, 0.0, 2.0)[..., None] * COBALT)
    return _codes(encode_srgb(_shrunk(light)))


def gilding() -> NDArray[np.uint8]:
    """Where there is gold: the rim, and a thin line inside the wreath."""
    radius, angle = _polar()
    gold = np.maximum(_within(np.abs(radius - 0.972) - 0.022), _within(np.abs(radius - 0.668) - 0.0055))
    worn = 1.0 - 0.25 * np.clip(_noise(SIDE, 40.0, 5) - 0.9, 0.0, 1.0)
    return _codes(_shrunk(gold[..., None])[..., 0] * worn)


def oak() -> NDArray[np.uint8]:
    """Four boards with the grain along u; every pattern in it repeats."""
    v, u = np.mgrid[:OAK, :OAK] / OAK
    board = (4 * v).astype(int)
    tone = np.array([0.0, 0.9, -0.5, 0.35])[board]
    shift = np.array([0.0, 0.37, 0.71, 0.18])[board]
    wave = np.stack([_noise(OAK, 2.5, seed, stretch=6.0) for seed in (21, 22, 23, 24)])
    bend = np.take_along_axis(wave, board[None], axis=0)[0]
    rings = 0.5 + 0.5 * np.sin(2 * np.pi * (26 * v + 1.15 * bend + shift))
    fibres = _noise(OAK, 90.0, 31, stretch=24.0)
    pores = np.clip(_noise(OAK, 120.0, 32, stretch=14.0) - 1.1, 0.0, 1.0)
    depth = 0.78 + 0.16 * rings**3 + 0.055 * fibres + 0.30 * pores + 0.06 * tone + 0.04 * bend
    joint = np.minimum((4 * v) % 1.0, 1.0 - (4 * v) % 1.0)
    depth = depth + 1.1 * np.exp(-((joint / 0.010) ** 2))
    return _codes(encode_srgb(np.exp(-np.clip(depth, 0.0, 4.0)[..., None] * np.array([0.72, 1.12, 1.85]))))


def _polar() -> tuple[Floats, Floats]:
    """Radius, 1 at the edge of the painting, and angle (−π, π] of its samples, row 0 farthest from the eye."""
    n = SIDE * FINER
    y, x = (np.mgrid[:n, :n] + 0.5) / n * 2.0 - 1.0
    return np.hypot(x, y), np.arctan2(-y, x)


def _leaf(radius: Floats, angle: Floats, count: int, turn: float, span: tuple[float, float], width: float) -> Floats:
    """About the distance to the outline of pointed leaves along the radius, below 0 inside."""
    low, high = span
    along = np.clip((radius - low) / (high - low), 0.0, 1.0)
    across = np.abs(_from_middle(angle, count, turn)) * radius
    shape = width * np.sqrt(np.sin(np.pi * along**0.8))
    beyond = np.maximum(np.maximum(low - radius, radius - high), 0.0)
    return np.hypot(np.maximum(across - shape, 0.0), beyond) + np.minimum(across - shape, 0.0)


def _dots(radius: Floats, angle: Floats, count: int, turn: float, at: float) -> Floats:
    """Distance to points round a circle."""
    return np.hypot(radius - at, _from_middle(angle, count, turn) * radius)


def _from_middle(angle: Floats, count: int, turn: float) -> Floats:
    """Angle to the nearest of `count` directions, the first turned by a share of the step between them."""
    step = 2.0 * np.pi / count
    return (angle / step - turn + 0.5) % 1.0 * step - 0.5 * step


def _within(distance: Floats) -> Floats:
    """1 inside, 0 outside; the edge is smoothed over a sample."""
    return np.clip(0.5 - distance * SIDE * FINER / 2.0, 0.0, 1.0)


def _noise(n: int, frequency: float, seed: int, stretch: float = 1.0) -> Floats:
    """Even noise of unit variance (n, n) that repeats: waves of about so many periods, `stretch` times as long in u."""
    waves = np.fft.fftfreq(n, 1.0 / n)
    length = np.hypot(waves[:, None], stretch * waves[None, :])
    amplitude = length * np.exp(-((length / frequency) ** 2))
    phase = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, (n, n))
    noise = np.fft.ifft2(amplitude * np.exp(1j * phase)).real
    return np.asarray((noise - noise.mean()) / noise.std())


def _finer(texels: Floats) -> Floats:
    """As samples."""
    return texels.repeat(FINER, axis=0).repeat(FINER, axis=1)


def _shrunk(samples: Floats) -> Floats:
    """The mean of each texel's samples."""
    n, channels = SIDE, samples.shape[-1]
    return samples.reshape(n, FINER, n, FINER, channels).mean(axis=(1, 3))


def _codes(shares: Floats) -> NDArray[np.uint8]:
    return np.round(255.0 * np.clip(shares, 0.0, 1.0)).astype(np.uint8)
