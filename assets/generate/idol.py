"""Idol: a carved stone head of 17,500 vertices, whose relief shades itself; after [Sloan05, fig. 3 and 6]."""

import numpy as np

from .mesh import Floats, Mesh, cleaned, moved
from .surfaces import carried, circle, grid_faces, rounded_profile

ROWS, AROUND = 101, 177
HEIGHT = 0.25  # half of it, metres


def meshes() -> dict[str, Mesh]:
    return {
        "head": moved(head(), (0.0, HEIGHT + 0.03, 0.0)),
        "foot": carried(rounded_profile(_FOOT, arc_points=4), circle(64)),
    }


# (radius, height, fillet) from the floor outward and up.
_FOOT = [(0.0, 0.0, 0), (0.17, 0.0, 0.002), (0.17, 0.022, 0.008), (0.15, 0.045, 0.008), (0.0, 0.05, 0)]


def head() -> Mesh:
    """Rows from the chin up, turning from the front, +Z, to the left; a rounded block, carved."""
    rise, turn = np.linspace(-np.pi / 2, np.pi / 2, ROWS), 2 * np.pi * np.arange(AROUND) / AROUND
    rise, turn = (each.ravel() for each in np.meshgrid(rise, turn, indexing="ij"))
    inner, step = np.clip(rise, -np.pi / 2 + 2e-3, np.pi / 2 - 2e-3), 1e-4
    up = _surface(inner + step, turn) - _surface(inner - step, turn)
    left = _surface(inner, turn + step) - _surface(inner, turn - step)
    normals = np.cross(up, left)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    pole = np.abs(rise) > np.pi / 2 - 1e-9
    normals[pole] = np.sign(rise[pole])[:, None] * (0.0, 1.0, 0.0)
    return cleaned(Mesh(_surface(rise, turn), normals, grid_faces(ROWS, AROUND, wrap=True)))


def _surface(rise: Floats, turn: Floats) -> Floats:
    height = np.sign(np.sin(rise)) * np.abs(np.sin(rise)) ** 0.75
    slim = np.abs(np.cos(rise)) ** 0.55
    block = (np.abs(np.sin(turn) / 0.150) ** 3 + np.abs(np.cos(turn) / 0.145) ** 3) ** (-1 / 3)
    taper = 1.0 + 0.10 * height - 0.10 * _near(height, -0.72, 0.16)
    angle = np.mod(turn + np.pi, 2 * np.pi) - np.pi
    out = slim * (block * taper + _carved(np.abs(angle), angle, height) * np.minimum(1.0, 3.0 * slim**2))
    return np.stack([-out * np.sin(turn), HEIGHT * height, out * np.cos(turn)], axis=-1)


def _carved(side: Floats, angle: Floats, height: Floats) -> Floats:
    """How far the stone stands out, metres, by the angle from the front and the height from -1 to 1."""
    face = _window(side, 1.05, 0.12)
    brow = 0.014 * _near(height, 0.34 - 0.10 * (side - 0.45) ** 2, 0.055) * face
    socket = -0.020 * _spot(side, height, 0.42, 0.19, 0.24, 0.10)
    eye = 0.020 * _spot(side, height, 0.42, 0.19, 0.13, 0.055)
    bridge = _window(np.abs(height - 0.12), 0.22, 0.05)
    nose = (0.014 + 0.030 * np.clip((0.34 - height) / 0.44, 0.0, 1.0)) * np.exp(-((side / 0.15) ** 2)) * bridge
    nostrils = 0.016 * _spot(side, height, 0.17, -0.07, 0.085, 0.05)
    lips = 0.016 * (_near(height, -0.28, 0.045) + _near(height, -0.40, 0.05)) * _window(side, 0.50, 0.09)
    mouth = -0.016 * _near(height, -0.34, 0.022) * _window(side, 0.46, 0.06)
    cheeks = 0.012 * _spot(side, height, 0.70, -0.12, 0.22, 0.16)
    chin = 0.014 * _spot(side, height, 0.0, -0.60, 0.34, 0.10)
    away = np.hypot((side - 1.45) * 0.7, height - 0.02)
    spool = 0.022 * np.exp(-((away / 0.20) ** 6)) - 0.022 * np.exp(-((away / 0.10) ** 6))
    crown = _window(-height, -0.50, 0.03)
    feathers = 0.010 * crown * (0.5 + 0.5 * np.cos(14.0 * angle)) + 0.012 * _near(height, 0.50, 0.035)
    behind = (
        0.008 * np.cos(7.0 * angle + 16.0 * height) * _window(-side, -2.0, 0.12) * _window(np.abs(height), 0.42, 0.06)
    )
    collar = 0.006 * np.cos(42.0 * height) * _window(height, -0.74, 0.03)
    return (
        brow + socket + eye + nose + nostrils + lips + mouth + cheeks + chin + spool + feathers + behind + collar
    )  # fmt: skip


def _near(value: Floats, place: Floats | float, width: float) -> Floats:
    return np.asarray(np.exp(-(((value - place) / width) ** 2)))


def _spot(x: Floats, y: Floats, at_x: float, at_y: float, wide: float, high: float) -> Floats:
    return _near(x, at_x, wide) * _near(y, at_y, high)


def _window(value: Floats, limit: float, soft: float) -> Floats:
    """1 below the limit, 0 above, over a soft edge."""
    return np.asarray(0.5 - 0.5 * np.tanh((value - limit) / soft))
