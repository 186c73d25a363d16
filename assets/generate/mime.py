"""Mime: a clay head whose face an animation takes from rest to laughter and to a frown, by two morph targets."""

from pathlib import Path

import numpy as np

from .glb import Shape, save_morphing_glb
from .mesh import Floats, Mesh, cleaned
from .surfaces import carried, circle, grid_faces, rounded_profile

ROWS, AROUND = 49, 64
MIDDLE, RADII = (0.0, 0.245, 0.0), (0.145, 0.195, 0.155)  # metres
PERIOD = 4.0  # seconds
# (radius, height, fillet) from the floor outward and up.
_NECK = [
    (0.0, 0.0, 0), (0.13, 0.0, 0.003), (0.13, 0.02, 0.008), (0.075, 0.04, 0.02), (0.06, 0.10, 0.01), (0.0, 0.115, 0)
]  # fmt: skip
# Keys: when, how much of it is laughter, how much a frown.
_KEYS = ((0.0, 0.0, 0.0), (0.7, 1.0, 0.0), (1.5, 1.0, 0.0), (2.1, 0.0, 0.1), (2.7, 0.0, 1.0), (3.3, 0.0, 1.0))


def meshes() -> dict[str, Mesh]:
    return {"neck": carried(rounded_profile(_NECK, arc_points=3), circle(36))}


def save(path: Path) -> None:
    """The face, as a GLB file."""
    rest = face()
    shapes = [
        Shape(name, _placed(rest, *share)[0] - _placed(rest)[0])
        for name, share in (("laugh", (1.0, 0.0)), ("frown", (0.0, 1.0)))
    ]
    times, *weights = np.array([*_KEYS, (PERIOD, 0.0, 0.0)]).T
    mesh = Mesh(*_placed(rest), rest.faces)
    save_morphing_glb(path, mesh, (0.60, 0.46, 0.36), shapes, "moods", times, np.stack(weights, axis=1))


def face() -> Mesh:
    """Directions in the place of positions: rows from the chin up, closer about the mouth and at the front, +Z."""
    rise, turn = np.linspace(-np.pi / 2, np.pi / 2, ROWS), 2.0 * np.pi * np.arange(AROUND) / AROUND
    rise, turn = rise - 0.22 * np.sin(2.0 * (rise + 0.2)) - 0.22 * np.sin(0.4), turn - 0.65 * np.sin(turn)
    rise, turn = (each.ravel() for each in np.meshgrid(rise, turn, indexing="ij"))
    places = np.stack([-np.cos(rise) * np.sin(turn), np.sin(rise), np.cos(rise) * np.cos(turn)], axis=1)
    return cleaned(Mesh(places, places, grid_faces(ROWS, AROUND, wrap=True)))


def _placed(face: Mesh, laugh: float = 0.0, frown: float = 0.0) -> tuple[Floats, Floats]:
    """Positions and normals (V, 3) with so much of either expression."""
    out, step = face.positions, 1e-4
    across = np.cross(out, (0.3, 0.5, 0.8))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    slopes = [
        _surface(out + step * along, laugh, frown) - _surface(out - step * along, laugh, frown)
        for along in (across, np.cross(out, across))
    ]
    normals = np.cross(slopes[0], slopes[1])
    return _surface(out, laugh, frown) + MIDDLE, normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _surface(out: Floats, laugh: float, frown: float) -> Floats:
    out = out / np.linalg.norm(out, axis=1, keepdims=True)
    x, y = out[:, 0], out[:, 1]
    is_face = np.clip(2.0 * out[:, 2], 0.0, 1.0) ** 2
    height = is_face * _features(np.abs(x), y, laugh, frown)
    return out * (1.0 + height)[:, None] * RADII


def _features(side: Floats, y: Floats, laugh: float, frown: float) -> Floats:
    """How far the face stands out, by the distance from its middle and the height, both -1 to 1."""
    nose = 0.20 * _spot(side, y, 0.0, -0.10, 0.10, 0.09) + 0.10 * _spot(side, y, 0.0, 0.06, 0.065, 0.16)
    sockets = -0.12 * _spot(side, y, 0.34, 0.14, 0.15, 0.11)
    eyes = (0.10 - 0.03 * laugh) * _spot(side, y, 0.34, 0.13, 0.095, 0.075 - 0.02 * laugh)
    brow = 0.30 + 0.09 * laugh - 0.02 * frown + (0.25 * frown - 0.1 * laugh) * (side - 0.34)
    brows = (0.06 + 0.03 * frown) * _ridge(y - brow, 0.055) * _window(np.abs(side - 0.33), 0.21, 0.07)
    crease = -0.03 * frown * _spot(side, y, 0.0, 0.27, 0.05, 0.09)
    cheeks = (0.05 + 0.07 * laugh) * _spot(side, y, 0.44 + 0.03 * laugh, -0.20 + 0.05 * laugh, 0.16, 0.13)
    width = 0.26 + 0.09 * laugh - 0.03 * frown
    mouth = y + 0.46 + 0.04 * laugh - 0.03 * frown - (0.8 * laugh - 0.9 * frown) * side**2
    opening = 0.035 + 0.045 * laugh * _window(side, 0.16, 0.12)
    lips = 0.055 * (_ridge(mouth - opening - 0.045, 0.06) + _ridge(mouth + opening + 0.05, 0.07))
    lips = (lips - (0.07 + 0.05 * laugh) * _ridge(mouth, opening + 0.03)) * _window(side, width, 0.10)
    chin = 0.07 * _spot(side, y, 0.0, -0.74, 0.22, 0.10)
    return nose + sockets + eyes + brows + crease + cheeks + lips + chin


def _ridge(away: Floats, width: float | Floats) -> Floats:
    return np.asarray(np.exp(-((away / width) ** 2)))


def _spot(side: Floats, y: Floats, at: float, high: float, wide: float, tall: float) -> Floats:
    return _ridge(np.hypot((side - at) / wide, (y - high) / tall), 1.0)


def _window(away: Floats, width: float, soft: float) -> Floats:
    """1 up to a distance, 0 beyond."""
    return np.asarray(1.0 / (1.0 + np.exp((away - width) / (0.35 * soft))))
