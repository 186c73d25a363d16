"""Plant, after [BenArtzi07, fig. 8.9]: a potted plant of many curved leaves, whose shadows have little coherence."""

import numpy as np

from .mesh import Floats, Mesh, cleaned, merged
from .shapes import disc
from .surfaces import bezier, carried, circle, grid_faces, rounded_profile, tube

SOIL = 0.128  # height of the soil in the pot
GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))
N_STEMS = 11
LEAVES_A_STEM = 9


def meshes() -> dict[str, Mesh]:
    rng = np.random.default_rng(11)
    stems = [_stem(i, rng) for i in range(N_STEMS)]
    leaves = [leaf for stem in stems for leaf in _leaves_on(stem, rng)]
    wood = [tube(path, np.linspace(0.0032, 0.0014, len(path)), 10, 3) for path in stems]
    table = disc(0.85, 0.02)
    return {
        "pot": pot(),
        "soil": soil(),
        "stems": merged(wood),
        "leaves": merged(leaves),
        "table": Mesh(table.positions - (0, 0.02, 0), table.normals, table.faces),
    }


def pot() -> Mesh:
    """A tapered clay pot with a band at its lip, open above."""
    corners = [
        (0, 0.0, 0), (0.070, 0.0, 0.004), (0.092, 0.112, 0.002), (0.101, 0.114, 0.003), (0.105, 0.145, 0.004),
        (0.096, 0.145, 0.004), (0.090, 0.100, 0.003), (0, 0.100, 0),
    ]  # fmt: skip
    return carried(rounded_profile(corners), circle(80))


def soil() -> Mesh:
    """A bumpy round of earth, a little below the lip."""
    rng = np.random.default_rng(5)
    r, phi = np.linspace(0.0, 0.0945, 22), np.linspace(0, 2 * np.pi, 64, endpoint=False)
    waves = rng.uniform(-1, 1, (24, 2)) * 260
    phase = rng.uniform(0, 2 * np.pi, 24)

    def height(x: Floats, z: Floats) -> Floats:
        return SOIL + 0.0004 * np.sin(x[..., None] * waves[:, 0] + z[..., None] * waves[:, 1] + phase).sum(axis=-1)

    rr, pp = np.meshgrid(r, phi, indexing="ij")
    x, z = rr * np.cos(pp), rr * np.sin(pp)
    step = 1e-5
    slope_x = (height(x + step, z) - height(x - step, z)) / (2 * step)
    slope_z = (height(x, z + step) - height(x, z - step)) / (2 * step)
    normals = np.stack([-slope_x, np.ones_like(x), -slope_z], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    positions = np.stack([x, height(x, z), z], axis=-1)
    return cleaned(Mesh(positions.reshape(-1, 3), normals.reshape(-1, 3), grid_faces(len(r), len(phi), wrap=True)))


def _stem(index: int, rng: np.random.Generator) -> Floats:
    """The path (N, 3) of a stem that rises from the soil and bends outward."""
    azimuth = index * GOLDEN_ANGLE + rng.uniform(-0.2, 0.2)
    spread = np.sqrt((index + 0.5) / N_STEMS)
    root = 0.055 * spread
    reach = 0.03 + 0.17 * spread * rng.uniform(0.85, 1.1)
    height = (0.36 - 0.13 * spread) * rng.uniform(0.9, 1.1)
    outward = np.array(
        [
            (root, 0.0),
            (root + 0.15 * reach, 0.45 * height),
            (root + 0.45 * reach, 0.85 * height),
            (root + reach, height),
        ]
    )
    curve = bezier(outward, np.linspace(0, 1, 25))
    return np.column_stack([curve[:, 0] * np.cos(azimuth), SOIL - 0.004 + curve[:, 1], curve[:, 0] * np.sin(azimuth)])


def _leaves_on(stem: Floats, rng: np.random.Generator) -> list[Mesh]:
    """Leaves up the stem, each turned by the golden angle against the one before, smaller toward the tip."""
    leaves = []
    start = rng.uniform(0, 2 * np.pi)
    for i in range(LEAVES_A_STEM):
        share = 0.28 + 0.72 * i / (LEAVES_A_STEM - 1)
        at = stem[min(round(share * (len(stem) - 1)), len(stem) - 1)]
        length = (0.135 - 0.050 * share) * rng.uniform(0.85, 1.15)
        azimuth = start + i * GOLDEN_ANGLE
        leaves.append(_leaf(at, azimuth, length, rise=rng.uniform(0.35, 0.85), droop=rng.uniform(1.1, 1.9)))
    return leaves


def _leaf(at: Floats, azimuth: float, length: float, rise: float, droop: float) -> Mesh:
    """A leaf on a short stalk: it leaves `at` at `rise` radians above level and bends down by `droop` to its tip.

    The blade is folded along its midrib like a shallow V and waved at its edge.
    """
    along, across = np.linspace(0, 1, 17), np.linspace(-1, 1, 9)

    def surface(u: Floats, v: Floats) -> Floats:
        tilt = rise - droop * u**1.4 * 0.8
        fine = np.linspace(0, 1, 201)
        slope = rise - droop * fine**1.4 * 0.8
        x = np.interp(u, fine, _cumulative(np.cos(slope))) * length
        y = np.interp(u, fine, _cumulative(np.sin(slope))) * length
        blade = np.clip((u - 0.16) / 0.84, 0, 1)
        half = length * (0.008 + 0.27 * np.sin(np.pi * blade**0.75) ** 1.15)
        lift = half * (0.34 * np.sqrt(v * v + 0.02) + 0.10 * v * v * np.sin(9 * u))
        return np.stack([x - lift * np.sin(tilt), y + lift * np.cos(tilt), half * v], axis=-1)

    uu, vv = (a.ravel() for a in np.meshgrid(along, across, indexing="ij"))
    step = 1e-3
    inner_u = np.clip(uu, step, 1 - step)
    normals = np.cross(
        surface(uu, vv + step) - surface(uu, vv - step), surface(inner_u + step, vv) - surface(inner_u - step, vv)
    )
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    c, s = np.cos(azimuth), np.sin(azimuth)
    turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    return cleaned(Mesh(surface(uu, vv) @ turn.T + at, normals @ turn.T, grid_faces(len(along), len(across))))


def _cumulative(values: Floats) -> Floats:
    """The integral over [0, 1] up to each of the equidistant samples (trapezoids)."""
    return np.concatenate([[0.0], np.cumsum((values[1:] + values[:-1]) / 2)]) / (len(values) - 1)
