"""Surfaces by their recipe: grids, profiles carried round a loop, tubes along a path.

All the built-in scenes are made of these. A profile is a polyline with rounded corners in the half plane (o, y), o
outward; a loop is what it is carried round: for each station a centre and an outward direction in the plane (x, z), so
that `centre + o * direction` is the loop's curve at offset o. A circle has one centre, a rounded rectangle four.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from .mesh import Faces, Floats, Mesh, cleaned, merged


def grid_faces(rows: int, columns: int, wrap: bool = False) -> Faces:
    """Two triangles for each cell of a (rows, columns) grid of vertices; `wrap` joins the last column to the first."""
    cells = columns if wrap else columns - 1
    row, column = np.divmod(np.arange((rows - 1) * cells), cells)
    a, b = row * columns + column, row * columns + (column + 1) % columns
    return np.concatenate([np.column_stack([a, a + columns, b]), np.column_stack([b, a + columns, b + columns])])


def parametric(surface: Callable[[Floats, Floats], Floats], u: Floats, v: Floats, wrap: bool = False) -> Mesh:
    """The surface (u, v) -> (..., 3) over the grid of u and v, normals from central differences, du x dv outward."""
    uu, vv = (a.ravel() for a in np.meshgrid(u, v, indexing="ij"))
    step = 1e-5 * max(np.ptp(u), np.ptp(v))
    du = surface(uu + step, vv) - surface(uu - step, vv)
    dv = surface(uu, vv + step) - surface(uu, vv - step)
    return cleaned(Mesh(surface(uu, vv), _unit(np.cross(du, dv)), grid_faces(len(u), len(v), wrap)))


@dataclass(frozen=True)
class Profile:
    """Points (N, 2) as (o, y) from the bottom outward and up, and their unit normals (N, 2)."""

    points: Floats
    normals: Floats


def rounded_profile(corners: Sequence[tuple[float, float, float]], arc_points: int = 7) -> Profile:
    """A polyline through corners (o, y, fillet radius); a radius of 0 is a crease. The ends' radii count for nothing.

    Raises ValueError where two neighbouring fillets do not fit on the side between them.
    """
    path = np.array([corner[:2] for corner in corners], dtype=float)
    tangents = _unit(np.diff(path, axis=0))
    _refuse_overlap(path, tangents, np.array([corner[2] for corner in corners]))
    points, angles = [path[:1]], [np.arctan2(tangents[:1, 1], tangents[:1, 0])]
    for i in range(1, len(path) - 1):
        start, turn = angles[-1][-1], _turn(tangents[i - 1], tangents[i])
        angle = start + turn * np.linspace(0, 1, arc_points if corners[i][2] > 0 else 2)
        radius = corners[i][2]
        reach = radius * np.tan(abs(turn) / 2)
        side = np.sign(turn) * radius  # the centre lies left of the path where it turns left
        centre = path[i] - reach * tangents[i - 1] + side * np.array([-np.sin(start), np.cos(start)])
        points.append(centre - side * np.column_stack([-np.sin(angle), np.cos(angle)]))
        angles.append(angle)
    points.append(path[-1:])
    angles.append(angles[-1][-1:])
    angle = np.concatenate(angles)
    return Profile(np.concatenate(points), np.column_stack([np.sin(angle), -np.cos(angle)]))


def _refuse_overlap(path: Floats, tangents: Floats, radii: Floats) -> None:
    turns = [0.0, *(_turn(a, b) for a, b in zip(tangents[:-1], tangents[1:], strict=True)), 0.0]
    reach = radii * np.tan(np.abs(turns) / 2)
    short = reach[:-1] + reach[1:] - np.linalg.norm(np.diff(path, axis=0), axis=1) > 1e-9
    if short.any():
        raise ValueError(f"the fillets at both ends of side {int(np.flatnonzero(short)[0])} are longer than the side")


def _turn(before: Floats, after: Floats) -> float:
    return float(np.arctan2(before[0] * after[1] - before[1] * after[0], before @ after))


def arc_profile(radius: float, centre: tuple[float, float], start: float, stop: float, n_points: int) -> Profile:
    """An arc of a circle in the (o, y) plane, angles in radians from +o toward +y."""
    angle = np.linspace(start, stop, n_points)
    normals = np.column_stack([np.cos(angle), np.sin(angle)])
    normals[np.abs(normals) < 1e-12] = 0
    return Profile(np.asarray(centre) + radius * normals, normals)


@dataclass(frozen=True)
class Loop:
    """Stations of a closed curve: centres (K, 2) and unit outward directions (K, 2) in the plane (x, z)."""

    centres: Floats
    directions: Floats


def circle(n_stations: int) -> Loop:
    angle = 2 * np.pi * np.arange(n_stations) / n_stations
    return Loop(np.zeros((n_stations, 2)), np.column_stack([np.cos(angle), np.sin(angle)]))


def rounded_rectangle(half_x: float, half_z: float, corner_stations: int) -> Loop:
    """The rectangle's corners are the centres: its half sides are (half_x + o, half_z + o) at offset o."""
    quarter = np.linspace(0, np.pi / 2, corner_stations)
    angle = np.concatenate([quarter + k * np.pi / 2 for k in range(4)])
    signs = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]).repeat(corner_stations, axis=0)
    return Loop(signs * np.array([half_x, half_z]), np.column_stack([np.cos(angle), np.sin(angle)]))


def carried(profile: Profile, loop: Loop, caps: bool = True) -> Mesh:
    """The profile carried round the loop, its two ends closed by flat caps (a closed profile wants none)."""
    o, y = profile.points[:, :1, None], profile.points[:, 1]
    plane = loop.centres + o * loop.directions  # (N, K, 2)
    lateral = profile.normals[:, :1, None] * loop.directions
    n_rows, n_stations = plane.shape[:2]

    def stacked(xz: Floats, height: Floats) -> Floats:
        heights = np.broadcast_to(height[:, None], (n_rows, n_stations))
        return np.stack([xz[..., 0], heights, xz[..., 1]], axis=-1).reshape(-1, 3)

    wall = Mesh(stacked(plane, y), stacked(lateral, profile.normals[:, 1]), grid_faces(n_rows, n_stations, wrap=True))
    open_rows = [row for row in (0, -1) if caps and np.ptp(plane[row], axis=0).max() > 1e-9]
    lids = [_cap(plane[row], y[row], np.sign(profile.normals[row, 1])) for row in open_rows]
    return cleaned(merged([wall, *lids]))


def _cap(xz: Floats, y: float, up: float) -> Mesh:
    """The flat inside of one station row, as a fan about its middle."""
    rim = np.column_stack([xz[:, 0], np.full(len(xz), y), xz[:, 1]])
    index = np.arange(len(xz))
    faces = np.column_stack([index, np.roll(index, -1), np.full(len(xz), len(xz))])
    positions = np.vstack([rim, rim.mean(axis=0)])
    return Mesh(positions, np.tile([0.0, up, 0.0], (len(positions), 1)), faces)


def tube(path: Floats, radii: Floats, n_sides: int, cap_rings: int = 5) -> Mesh:
    """A tube of radius (N,) along the path (N, 3), its ends closed by half ellipsoids; frames do not twist."""
    tangents = _unit(np.gradient(path, axis=0))
    lean = -np.arctan(np.gradient(radii) / np.linalg.norm(np.gradient(path, axis=0), axis=1))
    cap = np.linspace(np.pi / 2, 0, cap_rings, endpoint=False)
    across = _untwisted(tangents)
    rows = [
        (path[0] - radii[0] * np.sin(cap)[:, None] * tangents[0], radii[0] * np.cos(cap), -cap, tangents[0], across[0]),
        (path, radii, lean, tangents, across),
        (path[-1] + radii[-1] * np.sin(cap[::-1])[:, None] * tangents[-1], radii[-1] * np.cos(cap[::-1]), cap[::-1],
         tangents[-1], across[-1]),
    ]  # fmt: skip
    centre = np.concatenate([row[0] for row in rows])
    radius, angle = (np.concatenate([row[k] for row in rows]) for k in (1, 2))
    forward, side = (np.concatenate([np.broadcast_to(row[k], row[0].shape) for row in rows]) for k in (3, 4))
    other = np.cross(forward, side)
    phi = 2 * np.pi * np.arange(n_sides) / n_sides
    radial = np.cos(phi)[:, None] * side[:, None] + np.sin(phi)[:, None] * other[:, None]  # (rows, sides, 3)
    normals = np.cos(angle)[:, None, None] * radial + np.sin(angle)[:, None, None] * forward[:, None]
    positions = centre[:, None] + radius[:, None, None] * radial
    return cleaned(Mesh(positions.reshape(-1, 3), normals.reshape(-1, 3), grid_faces(len(centre), n_sides, wrap=True)))


def _untwisted(tangents: Floats) -> Floats:
    """Unit vectors across the tangents (N, 3), each the one before turned no more than its tangent turned."""
    across = np.zeros_like(tangents)
    helper = np.eye(3)[np.argmin(np.abs(tangents[0]))]
    across[0] = _unit(np.cross(tangents[0], helper)[None])[0]
    for i in range(1, len(tangents)):
        projected = across[i - 1] - (across[i - 1] @ tangents[i]) * tangents[i]
        across[i] = projected / np.linalg.norm(projected)
    return across


def bezier(control: Floats, t: Floats) -> Floats:
    """The cubic Bezier curve of 4 control points (4, D) at t (N,) in [0, 1]: (N, D)."""
    s = 1 - t
    return np.column_stack([s**3, 3 * s**2 * t, 3 * s * t**2, t**3]) @ control


def quads(corners: Floats) -> Mesh:
    """Flat quadrilaterals (Q, 4, 3), counter-clockwise seen from their front, each with vertices of its own."""
    normals = _unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    start = 4 * np.arange(len(corners))[:, None]
    faces = np.concatenate([start + [0, 1, 2], start + [0, 2, 3]])
    return Mesh(corners.reshape(-1, 3), normals.repeat(4, axis=0), faces)


def panel(middle: Sequence[float], across: Sequence[float] | Floats, up: Sequence[float] | Floats) -> Mesh:
    """A flat rectangle about its middle with two half edges; its front faces along across x up."""
    m, a, u = (np.asarray(each, dtype=float) for each in (middle, across, up))
    return quads(np.array([[m - a - u, m + a - u, m + a + u, m - a + u]]))


def _unit(vectors: Floats) -> Floats:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
