"""A product photographer's studio: soft-boxes round a table, in a grey room whose floor runs up into its back wall.

What makes metal look good is what it mirrors: broad lights with soft edges, long gradients, and dark between them. The
eye of the panorama stands where the object stands. Darkest to brightest is about 1 : 700.
"""

from dataclasses import dataclass

import numpy as np

from .mesh import Floats
from .panorama import panorama, smooth_step


@dataclass(frozen=True)
class SoftBox:
    """A rectangle at `centre` (metres from the object) that faces it, sides (width, height), turned by `roll` radians.

    `radiance` is that of its middle; it falls by `fade` toward its border, to nothing over the last
    `edge` of its half side.
    """

    centre: tuple[float, float, float]
    size: tuple[float, float]
    radiance: tuple[float, float, float]
    roll: float = 0.0
    fade: float = 0.4
    edge: float = 0.08

    def seen(self, d: Floats) -> Floats:
        """Radiance (N, 3) along directions (N, 3)."""
        centre = np.asarray(self.centre)
        facing = centre / np.linalg.norm(centre)
        right = np.cross(facing, (0.0, 1.0, 0.0))
        right /= np.linalg.norm(right)
        up = np.cross(right, facing)
        right, up = (
            np.cos(self.roll) * right + np.sin(self.roll) * up,
            -np.sin(self.roll) * right + np.cos(self.roll) * up,
        )
        along = d @ facing
        scale = np.linalg.norm(centre) / np.maximum(along, 1e-6)
        x, y = scale * (d @ right) / (self.size[0] / 2), scale * (d @ up) / (self.size[1] / 2)
        inside = smooth_step(1, 1 - self.edge, np.abs(x)) * smooth_step(1, 1 - self.edge, np.abs(y)) * (along > 0)
        glow = 1 - self.fade * np.clip(x * x + y * y, 0, 2) / 2
        return (inside * glow)[:, None] * np.asarray(self.radiance)


BOXES = (
    SoftBox(
        (-1.55, 1.6, -0.55), (1.05, 1.05), (27.0, 25.9, 24.2), roll=0.1, fade=0.5, edge=0.12
    ),  # key: high, left, behind
    SoftBox((1.5, 1.15, -1.6), (0.22, 1.9), (31.0, 32.5, 35.0), fade=0.3, edge=0.3),  # rim: a strip behind on the right
    SoftBox((-1.2, 0.75, -2.1), (0.16, 1.5), (14.0, 14.6, 16.0), fade=0.3, edge=0.3),  # its weaker twin on the left
    SoftBox((1.2, 1.0, 2.2), (1.9, 1.4), (2.3, 2.2, 2.05), fade=0.5, edge=0.25),  # fill: broad, weak, beside the eye
    SoftBox((0.15, 2.6, -0.9), (1.5, 0.7), (4.6, 4.6, 4.6), fade=0.6, edge=0.3),  # from above, for the edges of lids
)


def radiance(d: Floats) -> Floats:
    total = surroundings(d)
    for box in BOXES:
        total = total + box.seen(d)
    return total


def surroundings(d: Floats) -> Floats:
    """The room: a sweep of paper lit from the left, darker behind the eye, dark at the ceiling."""
    y = d[:, 1]
    pool = np.exp(-4.0 * ((d[:, 0] + 0.15) ** 2 + (y + 0.28) ** 2)) * (d[:, 2] < 0.5)
    paper = 0.13 + 0.05 * smooth_step(-1.0, 0.0, y) + 0.30 * pool * smooth_step(0.5, -0.6, d[:, 2])
    wall = paper * (1 - 0.75 * smooth_step(0.0, 0.7, y))
    return np.maximum(wall, 0.05)[:, None] * np.array([0.98, 1.0, 1.03])


def picture() -> Floats:
    return panorama(radiance)
