"""A colourful hall: stained glass along its sides, a rose window at its end, warm lamps, a mirroring marble floor.

A box room seen from a point in it: each direction meets a wall at a place in metres, so that all is in perspective.
The floor is a mirror too: one reflection is followed.
"""

import numpy as np

from .mesh import Floats
from .panorama import hashed, noise, panorama, smooth_step

LOW = np.array([-5.2, -1.5, -15.0])  # the room's corners seen from the eye, metres; the eye stands left of its middle
HIGH = np.array([9.2, 8.5, 11.0])
MIDDLE = 2.0  # x of the middle
RUNNER = 1.25  # half the width of the red runner along it
BAY = 3.2  # from window to window
LAMPS = np.array([[x, 2.6, z] for z in (-11.5, -5.1, 1.3, 7.7) for x in (MIDDLE - 4.2, MIDDLE + 4.2)])
LAMP_RADIUS = 0.24
LAMP_RADIANCE = np.array([78.0, 43.0, 15.0])
GLASS = np.array(
    [
        [0.03, 0.10, 0.95],
        [0.95, 0.05, 0.04],
        [0.98, 0.62, 0.05],
        [0.04, 0.55, 0.18],
        [0.45, 0.07, 0.75],
        [0.08, 0.55, 0.9],
    ]
)


def picture() -> Floats:
    return panorama(radiance)


def radiance(d: Floats) -> Floats:
    """Radiance (N, 3) along directions (N, 3) from the eye."""
    return _traced(np.zeros_like(d), d, mirror=True)


def _traced(origin: Floats, d: Floats, mirror: bool) -> Floats:
    """What is met first, a lamp or a wall; the floor adds a share of what it mirrors."""
    safe = np.where(np.abs(d) < 1e-9, 1e-9, d)
    exits = np.maximum((LOW - origin) / safe, (HIGH - origin) / safe)
    axis = exits.argmin(axis=1)
    distance = exits.min(axis=1)
    at = origin + distance[:, None] * d
    result = np.zeros_like(d)
    for face, painter in ((0, _side), (1, _level), (2, _end)):
        chosen = axis == face
        result[chosen] = painter(at[chosen])
    floor = (axis == 1) & (d[:, 1] < 0)
    if mirror and floor.any():
        cos_theta = -d[floor, 1]
        share = (0.06 + 0.94 * (1 - cos_theta) ** 5) * (np.abs(at[floor, 0] - MIDDLE) > RUNNER)
        bounced = _traced(at[floor] * (1, 0.9999, 1), d[floor] * (1, -1, 1), mirror=False)
        result[floor] += share[:, None] * bounced
    return _with_lamps(origin, d, distance, result)


def _with_lamps(origin: Floats, d: Floats, distance: Floats, behind: Floats) -> Floats:
    """Frosted globes in front of what is behind them, brightest in their middle."""
    result = behind
    for lamp in LAMPS:
        towards = lamp - origin
        along = np.einsum("ij,ij->i", towards, d)
        miss = np.sqrt(np.maximum(np.einsum("ij,ij->i", towards, towards) - along**2, 0))
        globe = smooth_step(LAMP_RADIUS, 0.9 * LAMP_RADIUS, miss) * ((along > 0) & (along < distance))
        glow = LAMP_RADIANCE * (0.55 + 0.45 * np.sqrt(np.maximum(1 - (miss / LAMP_RADIUS) ** 2, 0)))[:, None]
        result = result + globe[:, None] * (glow - result)
    return result


def _irradiance(at: Floats, normal: Floats) -> Floats:
    """On a wall (N, 3): the lamps as point lights, and a bluish remainder from the windows."""
    power = LAMP_RADIANCE * np.pi * LAMP_RADIUS**2
    total = np.broadcast_to(np.array([0.50, 0.46, 0.62]), at.shape).copy()
    for lamp in LAMPS:
        towards = lamp - at
        square = np.einsum("ij,ij->i", towards, towards)
        cosine = np.maximum(towards @ normal, 0) / np.sqrt(square)
        total += (cosine / square)[:, None] * power
    return total


def _side(at: Floats) -> Floats:
    """A long wall: between pilasters one tall pointed window to a bay."""
    normal = np.array([1.0, 0.0, 0.0])
    inward = np.where(at[:, :1] < 0, 1.0, -1.0)
    light = _irradiance(at, normal) * (inward > 0) + _irradiance(at, -normal) * (inward < 0)
    bay = np.floor(at[:, 2] / BAY)
    z = at[:, 2] - (bay + 0.5) * BAY
    y = at[:, 1]
    stone = _stone(np.column_stack([at[:, 2], y]), np.array([0.52, 0.40, 0.29]))
    pilaster = smooth_step(1.22, 1.27, np.abs(z))
    stone = stone * (1 - 0.35 * pilaster * (0.5 + 0.5 * np.cos(60 * z)))[:, None]
    dado = smooth_step(0.42, 0.38, y)[:, None]
    stone = (
        stone * (1 - dado) + dado * np.array([0.20, 0.075, 0.05]) * (0.7 + 0.6 * noise(at[:, [2, 1]] * 3, 9))[:, None]
    )
    wall = stone * light / np.pi
    seed = bay + np.where(at[:, 0] < 0, 100, 200)
    glass, inside = _lancet(z, y, seed)
    strength = np.where(at[:, 0] < 0, 7.5, 3.2)[:, None]  # the sun stands on the left
    return wall * (1 - inside) + strength * glass * inside


def _lancet(z: Floats, y: Floats, seed: Floats) -> tuple[Floats, Floats]:
    """A pointed window 1.7 m wide: its glass (N, 3) and where it is, (N, 1)."""
    half, sill, spring = 0.85, 0.9, 5.2
    rise = np.maximum(y - spring, 0)
    arch = np.hypot(np.abs(z) + half, rise) - 2 * half  # a Gothic arch: two circles centred on the other jamb
    inside = smooth_step(0.0, -0.05, np.maximum(arch, sill - y))
    mullion = smooth_step(0.035, 0.05, np.abs(z)) * smooth_step(0.03, 0.045, (y - sill) % 1.1)
    cells = np.column_stack([z * 3.6 + seed * 7.0, y * 3.0])
    colour, lead = _mosaic(cells, seed)
    return colour * (mullion * lead)[:, None], inside[:, None]


def _mosaic(points: Floats, seed: Floats) -> tuple[Floats, Floats]:
    """Coloured pieces (N, 3) of a jittered grid's Voronoi cells, and 0 on the lead between them (N,)."""
    base = np.floor(points)
    nearest, second = np.full(len(points), 9.0), np.full(len(points), 9.0)
    piece = np.zeros(len(points))
    for dx in (-1, 0, 1):
        for dy in (-1, 0, 1):
            cell = base + (dx, dy)
            centre = cell + 0.15 + 0.7 * np.column_stack([hashed(cell, 1), hashed(cell, 2)])
            gap = np.linalg.norm(points - centre, axis=1)
            closer = gap < nearest
            second = np.where(closer, nearest, np.minimum(second, gap))
            piece = np.where(closer, hashed(np.column_stack([cell, seed]), 3), piece)
            nearest = np.minimum(nearest, gap)
    theme = hashed(np.floor(seed)[:, None], 4)
    index = np.floor((piece * 0.55 + theme) * len(GLASS)).astype(int) % len(GLASS)
    brightness = 0.45 + 0.9 * (piece * 37 % 1)
    return GLASS[index] * brightness[:, None], smooth_step(0.03, 0.08, second - nearest)


def _level(at: Floats) -> Floats:
    """The marble floor below, the coffered ceiling above."""
    down = np.array([0.0, -1.0, 0.0])
    above = at[:, 1] > 0
    result = np.empty_like(at)
    result[above] = _coffers(at[above]) * _irradiance(at[above], down) / np.pi
    result[~above] = _marble(at[~above]) * _irradiance(at[~above], -down) / np.pi
    return result


def _marble(at: Floats) -> Floats:
    """Chequered slabs of 1.4 m, cream and green-black, with veins, and a red runner along the middle."""
    xz = at[:, [0, 2]]
    dark = (np.floor(xz / 1.4).sum(axis=1) % 2)[:, None]
    warp = noise(xz * 0.9, 21) * 6
    vein = np.abs(np.sin(xz[:, 0] * 2.2 + xz[:, 1] * 1.3 + warp))[:, None] ** 0.35
    cream, green = np.array([0.70, 0.61, 0.47]), np.array([0.035, 0.075, 0.06])
    slab = cream * (0.72 + 0.28 * vein) * (1 - dark) + (green + 0.15 * (1 - vein)) * dark
    joint = smooth_step(0.012, 0.03, np.abs((xz + 0.7) % 1.4 - 0.7)).min(axis=1)[:, None]
    across = np.abs(at[:, :1] - MIDDLE)
    runner = smooth_step(RUNNER, RUNNER - 0.05, across)
    border = smooth_step(0.04, 0.02, np.abs(across - RUNNER + 0.17))
    cloth = np.array([0.42, 0.018, 0.02]) * (1 - border) + border * np.array([0.6, 0.38, 0.06])
    return slab * (0.4 + 0.6 * joint) * (1 - runner) + cloth * runner


def _coffers(at: Floats) -> Floats:
    """Blue panels with gilded frames."""
    cell = np.abs(at[:, [0, 2]] % 2.0 - 1.0).max(axis=1)[:, None]
    frame = smooth_step(0.70, 0.74, cell)
    gilt = smooth_step(0.05, 0.02, np.abs(cell - 0.66))
    panel = np.array([0.05, 0.10, 0.26]) * (1 - gilt) + gilt * np.array([0.75, 0.50, 0.14])
    return panel * (1 - frame) + frame * np.array([0.36, 0.22, 0.12])


def _end(at: Floats) -> Floats:
    """The short walls: a rose window ahead, an archway with a warm light behind."""
    ahead = at[:, 2] < 0
    normal = np.array([0.0, 0.0, 1.0])
    light = np.where(ahead[:, None], _irradiance(at, normal), _irradiance(at, -normal))
    wall = _stone(at[:, :2], np.array([0.50, 0.36, 0.30])) * light / np.pi
    rose, inside = _rose(at[:, 0] - MIDDLE, at[:, 1] - 4.3)
    inside = inside * ahead[:, None]
    arch = np.hypot(at[:, 0] - MIDDLE, np.maximum(at[:, 1] - 1.6, 0)) - 1.6
    door = (smooth_step(0.0, -0.08, arch) * ~ahead)[:, None]
    result = wall * (1 - inside) + 13.0 * rose * inside
    return (
        result * (1 - door) + door * np.array([2.6, 1.5, 0.6]) * (0.4 + 0.6 * smooth_step(-1.5, 2.5, at[:, 1]))[:, None]
    )


def _rose(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """A round window of 6 m: petals round an eye; its glass (N, 3) and where it is (N, 1)."""
    radius, angle = np.hypot(x, y), np.arctan2(y, x)
    ring = np.digitize(radius, (0.55, 1.5, 2.4))
    petals = np.array([1, 12, 24, 24])[ring]
    turn = angle / (2 * np.pi) * petals
    petal = np.floor(turn)
    across = np.abs(turn - petal - 0.5) * 2 * np.pi * np.maximum(radius, 0.3) / petals
    width = np.pi * np.maximum(radius, 0.3) / petals
    lead = np.where(ring == 0, 1.0, smooth_step(0.0, 0.05, width - across))
    for edge in (0.55, 1.5, 2.4):
        lead = lead * smooth_step(0.03, 0.07, np.abs(radius - edge))
    index = np.array([2, 0, 1, 0])[ring] + np.where(petal % 2 == 0, 0, np.array([0, 1, 1, 5])[ring])
    glass = GLASS[index % len(GLASS)] * (0.7 + 0.5 * hashed(np.column_stack([ring, petal]), 8))[:, None]
    return glass * lead[:, None], smooth_step(3.0, 2.94, radius)[:, None]


def _stone(points: Floats, colour: Floats) -> Floats:
    """Ashlar: courses of 0.5 m with joints, each block a little lighter or darker."""
    course = np.floor(points[:, 1] / 0.5)
    along = points[:, 0] + 0.5 * (course % 2)
    block = np.column_stack([np.floor(along), course])
    tone = 0.82 + 0.3 * hashed(block, 5) + 0.25 * (noise(points * 2.5, 6) - 0.5)
    joint = np.minimum(smooth_step(0.008, 0.02, along % 1.0), smooth_step(0.008, 0.02, points[:, 1] % 0.5))
    return colour * (tone * (0.65 + 0.35 * joint))[:, None]
