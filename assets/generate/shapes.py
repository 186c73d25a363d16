"""Shapes, after [BenArtzi07, fig. 8.7]: torus, cone, sphere, cylinder and cube on a ground, metres the size of toys."""

import numpy as np

from .mesh import Mesh, axis_rotation, moved, transformed
from .surfaces import arc_profile, carried, circle, rounded_profile, rounded_rectangle


def meshes() -> dict[str, Mesh]:
    return {
        "torus": transformed(torus(0.115, 0.042), axis_rotation((1, 0, 0.25), np.radians(62)), (0.015, 0.1425, -0.13)),
        "cone": moved(cone(0.095, 0.24), (-0.25, 0.0, -0.03)),
        "sphere": moved(sphere(0.085), (0.05, 0.085, 0.14)),
        "cylinder": moved(cylinder(0.06, 0.19), (0.27, 0.0, -0.02)),
        "cube": transformed(cube(0.13), axis_rotation((0, 1, 0), np.radians(28)), (-0.145, 0.0, 0.155)),
        "ground": moved(disc(1.6, 0.02), (0.0, -0.02, 0.0)),
    }


def sphere(radius: float, rows: int = 49, columns: int = 96) -> Mesh:
    return carried(arc_profile(radius, (0, 0), -np.pi / 2, np.pi / 2, rows), circle(columns))


def torus(ring: float, radius: float) -> Mesh:
    return carried(arc_profile(radius, (ring, 0), -np.pi, np.pi, 41), circle(96), caps=False)


def cone(radius: float, height: float) -> Mesh:
    return carried(rounded_profile([(0, 0, 0), (radius, 0, 0.004), (0.006, height, 0.004), (0, height, 0)]), circle(96))


def cylinder(radius: float, height: float) -> Mesh:
    return carried(
        rounded_profile([(0, 0, 0), (radius, 0, 0.005), (radius, height, 0.005), (0, height, 0)]), circle(96)
    )


def cube(side: float, bevel: float = 0.006) -> Mesh:
    profile = rounded_profile([(0, 0, 0), (bevel, 0, bevel), (bevel, side, bevel), (0, side, 0)])
    return carried(profile, rounded_rectangle(side / 2 - bevel, side / 2 - bevel, 7))


def disc(radius: float, height: float) -> Mesh:
    return carried(
        rounded_profile([(0, 0, 0), (radius, 0, 0.004), (radius, height, 0.004), (0, height, 0)]), circle(128)
    )
