"""Rings: a sculpture of two interlocked rings, a gilded and a glazed one, on a floor of inlaid stone, to be walked
around. Each ring is a lobed rope that turns about itself on its way: 25,000 vertices, all of them curved."""

import numpy as np
from numpy.typing import NDArray

from engine.core.colour import encode_srgb

from .mesh import Floats, Mesh, axis_rotation, moved, transformed
from .surfaces import carried, circle, panel, parametric, rounded_profile

AROUND, ACROSS = 280, 46
SIDE = 512  # texels of the floor's images
JOINT = 0.006  # half the width of a joint, of an image's side


def meshes() -> dict[str, Mesh]:
    upright = transformed(rope(0.20, 0.042, 5, 3), axis_rotation((1, 0, 0), np.pi / 2))
    leaning = transformed(rope(0.165, 0.036, 3, 5), axis_rotation((0.25, 1.0, 0.55), 0.9))
    return {
        "gilded": moved(upright, (-0.05, 0.31, 0.0)),
        "glazed": moved(transformed(leaning, axis_rotation((0, 0, 1), 0.62)), (0.15, 0.30, 0.0)),
        "plinth": moved(carried(rounded_profile(_PLINTH, arc_points=6), circle(96), caps=False), (0.03, 0.0, 0.0)),
        "lamp": panel((-0.75, 1.05, 0.55), (0.10, 0.0, 0.14), np.cross((0.52, -0.70, -0.38), (0.10, 0.0, 0.14)) * 0.9),
    }


# (radius, height, fillet) from the floor up and inward. It has no underside: that would lie in the floor's plane, and
# from below both would be seen in speckles.
_PLINTH = [(0.185, 0.0, 0), (0.185, 0.018, 0.006), (0.165, 0.026, 0.008), (0.155, 0.052, 0.008), (0.0, 0.058, 0)]


def rope(radius: float, thickness: float, lobes: int, turns: int) -> Mesh:
    """A ring about Y of that radius whose section has so many lobes, which pass turns / lobes of the way round."""

    def surface(u: Floats, v: Floats) -> Floats:
        twist = v + turns / lobes * u
        section = thickness * (1.0 + 0.16 * np.cos(lobes * twist)) * (1.0 + 0.12 * np.cos(2.0 * u))
        out = radius + section * np.cos(v)
        return np.stack([out * np.cos(u), section * np.sin(v), -out * np.sin(u)], axis=-1)

    u, v = np.linspace(0, 2 * np.pi, AROUND + 1), np.linspace(0, 2 * np.pi, ACROSS + 1)
    return parametric(surface, u, v)


def images() -> dict[str, NDArray[np.uint8]]:
    """By file name, (H, W, 3) sRGB or (H, W) shares."""
    inlay, joints, grain = _inlay()
    light, dark = np.array([0.62, 0.57, 0.49]), np.array([0.055, 0.085, 0.095])
    colour = (inlay[..., None] * dark + (1.0 - inlay[..., None]) * light) * (0.82 + 0.36 * grain[..., None])
    polished = np.clip(0.12 + 0.88 * inlay, 0.0, 1.0)
    relief = 1.0 - 0.55 * joints - 0.45 * (1.0 - inlay) * (1.0 - joints) * _dressing()
    return {
        "inlay.png": np.round(255.0 * encode_srgb(np.clip(colour, 0.0, 1.0))).astype(np.uint8),
        "polish.png": np.round(255.0 * polished).astype(np.uint8),
        "relief.png": np.round(255.0 * relief).astype(np.uint8),
    }


def _inlay() -> tuple[Floats, Floats, Floats]:
    """(H, W): the share of dark stone, rings of interlaced arcs that repeat without a seam, the joints around it, and
    the stones' grain."""
    y, x = (np.mgrid[0:SIDE, 0:SIDE] + 0.5) / SIDE
    distance = np.full((SIDE, SIDE), np.inf)
    for cx in (0.0, 0.5, 1.0):
        for cy in (0.0, 0.5, 1.0):
            distance = np.minimum(distance, np.abs(np.hypot(x - cx, y - cy) - 0.29) - 0.028)
    inlay = np.clip(0.5 - distance * SIDE / 2.0, 0.0, 1.0)
    joints = np.exp(-((distance / JOINT) ** 2))
    random, grain = np.random.default_rng(5), np.zeros((SIDE, SIDE))
    for k in range(1, 25):
        a, b = random.integers(-k, k + 1, 2)
        grain += np.sin(2.0 * np.pi * (a * x + b * y + random.random())) / (1.0 + np.hypot(a, b))
    return inlay, joints, (grain - grain.min()) / np.ptp(grain)


def _dressing() -> Floats:
    """(H, W): how deep a chisel went into the light stone, 0 to 1, without a seam."""
    y, x = (np.mgrid[0:SIDE, 0:SIDE] + 0.5) / SIDE
    random, depth = np.random.default_rng(6), np.zeros((SIDE, SIDE))
    for _ in range(80):
        a, b = random.integers(-36, 37, 2)
        depth += np.sin(2.0 * np.pi * (a * x + b * y + random.random()))
    return 1.0 / (1.0 + np.exp(-depth / 4.0))
