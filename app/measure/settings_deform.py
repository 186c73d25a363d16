"""Deform's settings: order of the harmonics, lobes, rays a point [Sloan05].

Of a relief on a ball, bent, whatever the scene: radiance at vertices, white and diffuse, against rays in that pose into
the sky itself. So an error holds all there is: too few harmonics of light and transfer, too few lobes, and transfer
that turns with the surface where its shadows do not quite. The relief's brows, sockets and furrows shade themselves, as
those of [Sloan05, fig. 1].
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.measure.settings import Outcome, Setting
from app.measure.subject import MIB
from engine.core.generators import run_to_end
from engine.light.environment import Environment, triangle_integrals
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.zonal_harmonics.bending_points import bending_points
from engine.realtime.zonal_harmonics.object_transfer import N_LOBES, ORDER
from engine.realtime.zonal_harmonics.pose import Deformation, deform
from engine.realtime.zonal_harmonics.shading import band_light, lobes, shade
from engine.realtime.zonal_harmonics.transfer import (
    N_RAYS,
    TransferPoints,
    cosine_directions,
    ray_blocks,
    rotate_transfer,
    simulate_shadows,
)
from engine.realtime.zonal_harmonics.zonal import MAX_LOBES, fit
from engine.render.picture_difference import errors
from engine.scene.cutouts import scene_caster
from engine.scene.raycaster import RayCaster, surface_points
from engine.scene.scene_loader import Scene, load_scene
from engine.settings import DEFAULT_SETTINGS
from engine.sphere.harmonics import project

Float64Array = NDArray[np.float64]

# Sockets, a nose and a mouth: where (x, y) on the ball, how far out, how wide.
_FEATURES = ((0.35, 0.2, -0.22, 0.2), (-0.35, 0.2, -0.22, 0.2), (0.0, 0.0, 0.3, 0.16), (0.0, -0.4, -0.15, 0.25))
BEND = Deformation("bend", 60.0)


def relief(columns: int, rows: int) -> Scene:
    """A ball with a relief, of so many vertices around and from pole to pole."""
    polar, around = (np.arange(rows) + 0.5) / rows * np.pi, np.arange(columns) / columns * 2.0 * np.pi
    theta, phi = (each.ravel() for each in np.meshgrid(polar, around, indexing="ij"))
    unit = np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)], axis=1)
    height = 0.05 * np.sin(9.0 * phi) * np.sin(theta) ** 2 * np.sin(7.0 * theta)
    for x, y, depth, width in _FEATURES:
        place = np.array([x, y, np.sqrt(1.0 - x * x - y * y)])
        height += depth * np.exp(-(((unit - place) / width) ** 2).sum(axis=1))
    vertices = unit * (1.0 + height)[:, None] * (0.8, 1.2, 0.9)
    at = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = at[:-1], np.roll(at, -1, 1)[:-1], at[1:], np.roll(at, -1, 1)[1:]
    faces = [np.stack(each, axis=-1).reshape(-1, 3) for each in ((a, c, b), (b, c, d))]
    caps = [[at[0, 0], at[0, i], at[0, i + 1]] for i in range(1, columns - 1)]
    caps += [[at[-1, 0], at[-1, i + 1], at[-1, i]] for i in range(1, columns - 1)]
    return _scene(vertices, np.concatenate([*faces, np.array(caps)]))


def _scene(vertices: Float64Array, triangles: NDArray[np.integer]) -> Scene:
    with tempfile.TemporaryDirectory(prefix="insitu-relief-") as folder:
        lines = [f"v {x:.7g} {y:.7g} {z:.7g}" for x, y, z in vertices]
        lines += [f"f {a} {b} {c}" for a, b, c in triangles + 1]
        Path(folder, "relief.obj").write_text("\n".join(lines), encoding="utf-8")
        text = (
            "version = 1\n[camera]\nposition = [0, 0.6, 4]\ntarget = [0.2, 0, 0]\nfov_y = 42\nresolution = [512, 384]\n"
            '[environment]\nradiance = [1, 1, 1]\n[[object]]\nname = "relief"\nmesh = "relief.obj"\nsmooth = true\n'
        )
        Path(folder, "relief.toml").write_text(text, encoding="utf-8")
        return load_scene(Path(folder, "relief.toml"))


def varied_sky() -> SkyState:
    """A bright side, and another colour from below."""
    image = np.full((32, 64, 3), 0.15, np.float32)
    image[4:12, 40:52] = (6.0, 5.0, 4.0)
    image[20:, :] = (0.1, 0.2, 0.35)
    return SkyState(Environment(image, "a lamp over a blue floor"))


TRUTH_RAYS, LIGHT_LEVEL = 4000, 5


@dataclass(frozen=True)
class DeformValues:
    """Columns and rows of the relief's vertices, rays a vertex of the truth, and the values."""

    columns: int = 48
    rows: int = 32
    truth_rays: int = TRUTH_RAYS
    orders: tuple[int, ...] = (2, 3, 4, 5, 6, 8, 10)
    of_orders: tuple[int, ...] = (4, 6, 8)
    lobes: tuple[int, ...] = tuple(range(1, MAX_LOBES + 1))
    rays: tuple[int, ...] = (64, 256, 1000, 2500, N_RAYS)
    n_rays: int = 2500


QUICK = DeformValues(20, 12, 400, (3, 6), (6,), (1, 4), (64, 256), 256)


def deform_settings(effort: DeformValues) -> Iterator[Setting]:
    """See above."""
    mesh = BentRelief(effort)
    frame = "shading all points once"
    yield mesh.setting("order, harmonics themselves", effort.orders, mesh.by_harmonics, ORDER, frame)
    for n in effort.of_orders:
        present = N_LOBES if n == ORDER else None
        yield mesh.setting(f"lobes, order {n}", effort.lobes, lambda k, n=n: mesh.by_lobes(n, k), present, frame)
    rays = sorted({each for each in effort.rays if each <= max(N_RAYS, effort.n_rays)})
    yield mesh.setting("rays a point", rays, mesh.by_rays, DEFAULT_SETTINGS.n_rays, "transfer and its lobes")


class BentRelief:
    """The relief, what light reaches its vertices, and what other values make of that."""

    def __init__(self, effort: DeformValues) -> None:
        scene = relief(effort.columns, effort.rows)
        self._points = bending_points(scene, scene_caster(scene), 0)
        self._effort, self._sky = effort, varied_sky()
        environment = self._sky.environment
        assert environment is not None
        pose = deform(self._points.rest_geometry(0), (BEND,))
        self._frames = pose.frames
        self._powers = triangle_integrals(environment, 0.0, LIGHT_LEVEL)
        caster = RayCaster(pose.positions.astype(np.float32), self._points.surface.corners)
        above = surface_points(caster, pose.positions, pose.frames[:, 2])
        mesh, n = TransferPoints(above, pose.frames, self._points.surface.corners), effort.truth_rays
        parts = []
        for start, stop, rays in ray_blocks(mesh, cosine_directions(n, 1)[0]):
            light = environment.evaluate(rays[1], 0.0) * ~caster.occluded(*rays)[:, None]
            parts.append(light.reshape(stop - start, n, 3).mean(axis=1))
        self._truth = np.concatenate(parts)
        self._vectors = lru_cache(maxsize=2)(self._traced)

    def setting(self, name: str, values: Any, make: Any, present: Any, cost: str) -> Setting:
        return Setting("deform", name, values, make, self._truth, present, cost)

    def _traced(self, n: int, n_rays: int) -> Float64Array:
        points = self._points
        return run_to_end(simulate_shadows(points.mesh(0, (0,)), points.caster((0,)), n, n_rays))

    def by_harmonics(self, n: int) -> Any:
        """All n² coefficients turned, as one would without lobes."""
        vectors, light = self._vectors(n, self._effort.n_rays), project(self._powers, n)
        back = self._frames.transpose(0, 2, 1)
        return lambda: Outcome(rotate_transfer(vectors, back) @ light, vectors.size * 4 / MIB)

    def by_lobes(self, n: int, n_lobes: int) -> Any:
        zonal = lobes(run_to_end(fit(self._vectors(n, self._effort.n_rays), n_lobes)))
        light = band_light(project(self._powers, n))
        kept = sum(each.nbytes for each in (zonal.low, zonal.axes, zonal.coefficients)) / MIB
        return lambda: Outcome(shade(zonal, self._frames, light), kept)

    def by_rays(self, n_rays: int) -> Any:
        return lambda: Outcome(self.shaded(n_rays, N_LOBES))

    def shaded(self, n_rays: int, n_lobes: int) -> Float64Array:
        """Light (p, 3) of the vertices by so many rays from each, and lobes for what they find."""
        zonal = run_to_end(fit(self._traced(ORDER, n_rays), n_lobes))
        return np.asarray(shade(lobes(zonal), self._frames, band_light(project(self._powers, ORDER))), np.float64)

    def error(self, shaded: Float64Array) -> float:
        """relRMSE of that light."""
        return errors(shaded, self._truth).rmse
