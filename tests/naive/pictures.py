"""Slow, obvious twins of the picture passes: one pixel at a time, float64, formulas as the sources state them."""

import math

import numpy as np


def encode_srgb(value: float) -> float:
    """IEC 61966-2-1."""
    return 12.92 * value if value <= 0.0031308 else 1.055 * value ** (1 / 2.4) - 0.055


def filmic(value: float) -> float:
    """Narkowicz 2016."""
    x = max(value, 0.0)
    return min(max((x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14), 0.0), 1.0)


def background(environment: np.ndarray, direction: np.ndarray, rotation_degrees: float) -> np.ndarray:
    """Bilinear lookup of a lat-long map turned counter-clockwise about +Y (docs/conventions.md, "Light")."""
    height, width = environment.shape[:2]
    a = math.radians(-rotation_degrees)
    turn = np.array([[math.cos(a), 0, math.sin(a)], [0, 1, 0], [-math.sin(a), 0, math.cos(a)]])
    x, y, z = turn @ direction
    column = (math.atan2(x, -z) / (2 * math.pi) + 0.5) * width - 0.5
    row = min(max(math.acos(y) / math.pi * height - 0.5, 0.0), height - 1.0)
    left, top = math.floor(column), math.floor(row)
    s, t = column - left, row - top
    total = np.zeros(3)
    for j, weight_j in ((top, 1 - t), (min(top + 1, height - 1), t)):
        for i, weight_i in ((left % width, 1 - s), ((left + 1) % width, s)):
            total += weight_i * weight_j * environment[j, i]
    return total


def view_curve(curve: np.ndarray, theta: float) -> np.ndarray:
    """A curve of N values at angles 0 to pi/2, linear between."""
    position = theta / (math.pi / 2) * (len(curve) - 1)
    i = min(int(position), len(curve) - 2)
    return curve[i] + (position - i) * (curve[i + 1] - curve[i])
