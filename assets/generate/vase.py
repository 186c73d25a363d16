"""Vase: anemones in a glazed vase and two lemons on a wooden table in the corner of two walls, by a window.

The window on the left lights the side wall on the right, whose colour then reaches what the window does not light.
"""

from collections.abc import Callable

import numpy as np

from .furniture import block, boards
from .mesh import Floats, Mesh, axis_rotation, cleaned, merged, moved, transformed
from .surfaces import Profile, arc_profile, bezier, carried, circle, grid_faces, quads, tube

MOUTH = 0.206  # height at which the stems lean on the lip
TURN = np.pi * (3 - np.sqrt(5))  # the golden angle

# Each flower: azimuth of its lean in degrees (0 right, 90 toward the eye), reach, height of its head, size.
FLOWERS = (
    (62, 0.062, 0.372, 1.06), (128, 0.098, 0.336, 1.0), (8, 0.112, 0.330, 0.96), (188, 0.136, 0.392, 0.92),
    (318, 0.090, 0.425, 0.88), (238, 0.052, 0.446, 0.98), (92, 0.112, 0.272, 0.9),
)  # fmt: skip
LEAVES = ((150, 0.20, 0.9), (28, 0.19, 0.8), (205, 0.17, 1.0), (340, 0.20, 0.7), (75, 0.15, 0.5), (265, 0.18, 1.1))


def meshes() -> dict[str, Mesh]:
    stems = [_stem(np.radians(azimuth), reach, height) for azimuth, reach, height, _ in FLOWERS]
    heads = [_head_frame(stem) for stem in stems]
    sizes = [flower[3] for flower in FLOWERS]
    return {
        "vase": vase(),
        "petals": merged([_petals(*head, size, i) for i, (head, size) in enumerate(zip(heads, sizes, strict=True))]),
        "hearts": merged([_heart(*head, size) for head, size in zip(heads, sizes, strict=True)]),
        "greens": merged([*(tube(stem, np.full(len(stem), 0.0021), 10, 3) for stem in stems), *_leaves()]),
        "lemons": merged([_lemon((0.128, 0.075), 0.55), _lemon((0.172, -0.002), 2.2)]),
        "table": table(),
        "wall": block((-1.2, -0.6, -0.36), (0.36, 1.5, -0.30)),
        "side": block((0.29, -0.6, -0.36), (0.35, 1.5, 0.9)),
        "window": window(),
    }


def vase() -> Mesh:
    """A bellied vase with a narrow neck and a flared lip, 3 mm thick."""
    t = np.linspace(0, 1, 15)
    curves = [
        [(0.036, 0.0015), (0.056, 0.018), (0.071, 0.050), (0.071, 0.092)],
        [(0.071, 0.092), (0.071, 0.140), (0.026, 0.150), (0.026, 0.182)],
        [(0.026, 0.182), (0.026, 0.199), (0.029, 0.206), (0.037, 0.212)],
    ]
    outside = np.concatenate([bezier(np.array(curve), t[1 if i else 0 :]) for i, curve in enumerate(curves)])
    normals = _right_of(np.gradient(outside, axis=0))
    start = np.arctan2(normals[-1, 1], normals[-1, 0])
    turn = start + np.linspace(0, np.pi, 8)[1:-1]
    lip_normals = np.column_stack([np.cos(turn), np.sin(turn)])
    lip = outside[-1] - 0.0015 * normals[-1] + 0.0015 * lip_normals
    inner = slice(None, 15, -1)
    inside = (outside - 0.003 * normals)[inner]
    foot = np.array([(0.0, 0.0), (0.0352, 0.0)])
    return carried(
        Profile(
            np.concatenate([foot, outside, lip, inside]),
            np.concatenate([[(0.0, -1.0), (0.0, -1.0)], normals, lip_normals, -normals[inner]]),
        ),
        circle(72),
    )


def _right_of(tangents: Floats) -> Floats:
    """Unit normals (N, 2) to the right of the way."""
    unit = tangents / np.linalg.norm(tangents, axis=1, keepdims=True)
    return np.column_stack([unit[:, 1], -unit[:, 0]])


def _stem(azimuth: float, reach: float, height: float) -> Floats:
    """The path (25, 3) of a stem from inside of the vase over its lip outward."""
    way = bezier(
        np.array([(-0.012, 0.125), (0.012, MOUTH), (0.35 * reach + 0.012, 0.75 * height + 0.06), (reach, height)]),
        np.linspace(0, 1, 25),
    )
    return np.column_stack([way[:, 0] * np.cos(azimuth), way[:, 1], way[:, 0] * np.sin(azimuth)])


def _head_frame(stem: Floats) -> tuple[Floats, Floats]:
    """Where a flower sits and the rotation of its own Y: along its stem's end, nodding outward and toward the eye."""
    along = stem[-1] - stem[-3]
    axis = along / np.linalg.norm(along) + (0.0, -0.15, 0.75) + 1.5 * stem[-1] * (1, 0, 1)
    axis /= np.linalg.norm(axis)
    across = np.cross((0.0, 1.0, 0.0), axis)
    angle = np.arctan2(np.linalg.norm(across), axis[1])
    return stem[-1], axis_rotation(across, float(angle))


def _petals(at: Floats, turned: Floats, size: float, index: int) -> Mesh:
    """Two whorls of five broad petals, the inner one steeper."""
    rng = np.random.default_rng(20 + index)
    petals = []
    for whorl, (rise, length) in enumerate(((0.30, 0.041), (0.62, 0.036))):
        for k in range(5):
            azimuth = 2 * np.pi * (k + 0.5 * whorl) / 5 + rng.uniform(-0.1, 0.1) + TURN * index
            petal = _petal(length * size * rng.uniform(0.93, 1.07), rise + rng.uniform(-0.1, 0.1), rng.uniform(0, 6))
            petals.append(transformed(petal, axis_rotation((0, 1, 0), azimuth), (0.0, 0.0006 * whorl, 0.0)))
    return transformed(merged(petals), turned, at)


def _petal(length: float, rise: float, phase: float) -> Mesh:
    """A petal along +X from the origin, cupped, its edge a little waved."""

    def surface(u: Floats, v: Floats) -> Floats:
        half = length * (0.09 + 0.43 * np.sin(np.pi * 0.86 * np.clip(u, 0, 1) ** 1.1))
        lift = length * (np.sin(rise) * u + 0.16 * u * u * (1 - u)) + 0.15 * length * u * v * v
        wave = 0.035 * length * u * u * np.sin(4.5 * v + phase)
        x = length * (np.cos(rise) * u - 0.10 * v * v * u)
        return np.stack([x, lift + wave, half * v], axis=-1)

    return _sheet(surface, 10, 7)


def _sheet(surface: Callable[[Floats, Floats], Floats], rows: int, columns: int) -> Mesh:
    """The surface over u in [0, 1], v in [-1, 1], normals upward for a sheet along +X."""
    uu, vv = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, rows), np.linspace(-1, 1, columns), indexing="ij"))
    step = 1e-3
    inner = np.clip(uu, 2 * step, 1 - 2 * step)
    normals = np.cross(
        surface(inner, vv + step) - surface(inner, vv - step), surface(inner + step, vv) - surface(inner - step, vv)
    )
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return cleaned(Mesh(surface(uu, vv), normals, grid_faces(rows, columns)))


def _heart(at: Floats, turned: Floats, size: float) -> Mesh:
    """The dark button of an anemone in a wreath of stamens."""
    button = carried(arc_profile(0.0062 * size, (0, 0), -np.pi / 2, np.pi / 2, 9), circle(16))
    stamens = []
    for k in range(16):
        out = (0.0088 + 0.0022 * (k % 2)) * size
        head = carried(arc_profile(0.0011 * size, (0, 0), -np.pi / 2, np.pi / 2, 4), circle(5))
        angle = 2 * np.pi * k / 16
        stamens.append(moved(head, (out * np.cos(angle), 0.0075 * size + 0.001 * (k % 2), out * np.sin(angle))))
    return transformed(merged([moved(button, (0.0, 0.0040 * size, 0.0)), *stamens]), turned, at)


def _leaves() -> list[Mesh]:
    return [_leaf(np.radians(azimuth), length, droop) for azimuth, length, droop in LEAVES]


def _leaf(azimuth: float, length: float, droop: float) -> Mesh:
    """A lance of a leaf out of the vase's mouth, folded along its middle, bending down to its tip."""
    fine = np.linspace(-0.01, 1.01, 205)
    tilt = 1.32 - 0.25 * np.clip(fine, 0, 1) - droop * np.clip(fine, 0, 1) ** 2
    x, y = (np.cumsum(side) * (fine[1] - fine[0]) * length for side in (np.cos(tilt), np.sin(tilt)))

    def surface(u: Floats, v: Floats) -> Floats:
        half = length * (0.012 + 0.105 * np.sin(np.pi * np.clip(u, 0, 1) ** 1.3) ** 1.3) * (1 - 0.75 * u**8)
        lift = 0.45 * half * np.sqrt(v * v + 0.02)
        bend = np.interp(u, fine, tilt)
        return np.stack(
            [np.interp(u, fine, x) - lift * np.sin(bend), np.interp(u, fine, y) + lift * np.cos(bend), half * v],
            axis=-1,
        )

    leaf = moved(_sheet(surface, 21, 9), (0.008, MOUTH - 0.035, 0.0))
    return transformed(leaf, axis_rotation((0, 1, 0), -azimuth))


def _lemon(at: tuple[float, float], azimuth: float) -> Mesh:
    """A lemon lying on the table: a spindle with a nipple at one end."""
    s = np.linspace(0, 1, 33)
    along = -0.036 * np.cos(np.pi * s) + 0.007 * s**8
    radius = 0.0275 * np.sin(np.pi * s) ** 0.86 * (1 - 0.10 * s) + 0.0035 * np.sin(np.pi * s**9)
    points = np.column_stack([radius, along])
    points[[0, -1], 0] = 0
    normals = _right_of(np.gradient(points, s, axis=0))
    normals[0], normals[-1] = (0, -1), (0, 1)
    lemon = carried(Profile(points, normals), circle(36))
    lying = transformed(lemon, axis_rotation((0, 1, 0), azimuth) @ axis_rotation((0, 0, 1), -np.pi / 2))
    return moved(lying, (at[0], -lying.positions[:, 1].min(), at[1]))


def table() -> Mesh:
    """A top of boards that run from wall to front, along the side wall."""
    widths = (0.135, 0.118, 0.142, 0.126, 0.133, 0.121, 0.139, 0.128)
    edges = 0.285 - np.cumsum([0.0, *widths])
    spans = [(float(b) + 0.0006, float(a) - 0.0006) for a, b in zip(edges[:-1], edges[1:], strict=True)]
    return boards(spans, (-0.295, 0.36), (-0.028, 0.0), 0.0018)


def window() -> Mesh:
    """Six panes that shine to the right: 0.72 m deep, 0.96 m high, 1.1 m to the left of the vase."""
    panes = []
    for z in (0.02, 0.39):
        for y in (0.12, 0.45, 0.78):
            panes.append([(-1.1, y, z), (-1.1, y + 0.30, z), (-1.1, y + 0.30, z + 0.34), (-1.1, y, z + 0.34)])
    return quads(np.array(panes))
