"""Orbit's settings: coefficients kept of light, at rest and while something moves; points.

Pictures are judged at random pixels inside of objects, in direct light, by brute force over 81,920 directions.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.measure.settings import Outcome, Setting
from app.measure.subject import MIB, Subject, oracle
from app.project.project import Project
from app.stills.stills import layers_by_object
from engine.core.errors import InsituError
from engine.core.stored_arrays import Arrays
from engine.material.layer import Layer
from engine.precompute.direct.pipeline import Placement, SkyState
from engine.realtime.triple_product.orbit_engine import N_COEFFICIENTS, N_POINTS, Orbit
from engine.realtime.triple_product.view_radiance import N_MOVING, Quality
from engine.scene.primary_hits import PrimaryHits


@dataclass(frozen=True)
class OrbitValues:
    """Judged pixels and the oracle's level; the values: coefficients kept, drawn while something moves, points besides
    the meshes' vertices; n_points: besides the meshes' vertices, where these are no matter."""

    n_pixels: int = 150
    level: int = 6
    kept: tuple[int, ...] = (20, 80, 160, 320, 640, 1280)
    moving: tuple[int, ...] = (20, 40, 64, 128, 320)
    points: tuple[int, ...] = (2500, 40_000)
    n_points: int = N_POINTS


QUICK = OrbitValues(16, 5, (320,), (20, 64), (), 100)


def orbit_settings(subject: Subject, project: Project, effort: OrbitValues) -> Iterator[Setting]:
    """Of a subject in the resolution that is drawn. Raises InsituError where no pixel is inside of an object."""
    pictures = _Pictures(subject, project, effort)
    yield pictures.setting(
        "coefficients at rest", effort.kept, lambda n: pictures.drawn("rest", n), N_COEFFICIENTS, "a picture"
    )
    yield pictures.setting("coefficients in motion", effort.moving, pictures.moving, N_MOVING, "a picture")
    yield pictures.setting("points", effort.points, pictures.placed, N_POINTS, "making ready")


class _Pictures:
    def __init__(self, subject: Subject, project: Project, effort: OrbitValues) -> None:
        self._project, self._effort, self._layers = project, effort, layers_by_object(project)
        self._placement = Placement(project.scene)
        self._rows = inner_rows(self._placement.hits, effort.n_pixels)
        self._pixels = self._placement.hits.pixel[self._rows]
        self._truth = oracle(subject, self._placement, self._rows, effort.level)
        self._ready: dict[int, Orbit] = {}
        self._seen: Arrays | None = None

    def setting(self, name: str, values: Any, make: Any, present: Any, cost: str) -> Setting:
        return Setting("orbit", name, values, make, self._truth, present, cost)

    def drawn(self, quality: Quality, n_kept: int, n_moving: int = N_MOVING) -> Any:
        orbit = self._orbit(n_kept)

        def compute() -> Outcome:
            picture = orbit.draw(
                self._project.scene.description.camera, self._project.scene.resolution, quality, n_moving
            )
            return Outcome(picture.reshape(-1, 3)[self._pixels], orbit.n_bytes / MIB)

        return compute

    def moving(self, n: int) -> Any:
        return self.drawn("moving", N_COEFFICIENTS, n)

    def placed(self, n_points: int) -> Any:
        """From an opened scene to a picture at rest."""

        def compute() -> Outcome:
            self._ready = {N_COEFFICIENTS: self._made(N_COEFFICIENTS, n_points)}
            shown: Outcome = self.drawn("rest", N_COEFFICIENTS)()
            return shown

        return compute

    def _orbit(self, n_kept: int) -> Orbit:
        if n_kept not in self._ready:
            self._ready = {n_kept: self._made(n_kept, self._effort.n_points, self._seen)}
            self._seen = self._seen or self._ready[n_kept].stored_visibility()
        return self._ready[n_kept]

    def _made(self, n_kept: int, n_points: int, seen: Arrays | None = None) -> Orbit:
        """Made ready, and what the camera sees from behind as well; seen: what is known of visibility."""
        orbit = Orbit(self._project.scene, self._placement.caster, n_points, n_kept)
        if seen is not None:
            orbit.restore(seen)
        finish_orbit(orbit, self._project.sky, self._layers)
        orbit.draw(self._project.scene.description.camera, self._project.scene.resolution)
        finish_orbit(orbit, self._project.sky, self._layers)
        return orbit


def finish_orbit(orbit: Orbit, sky: SkyState, layers: Mapping[int, tuple[Layer, ...]], n_bounces: int = 1) -> None:
    """Set light and layers, and work until all is ready."""
    orbit.set_light(sky)
    orbit.set_layers(layers)
    orbit.set_bounces(n_bounces)
    for _ in orbit.work():
        pass


def inner_rows(hits: PrimaryHits, n: int) -> NDArray[np.integer]:
    """Some of the points whose pixel's neighbours see the same object. Raises InsituError where there are none."""
    ids = hits.object_image
    same = np.ones(ids.shape, bool)
    for axis in (0, 1):
        for step in (1, -1):
            same &= np.roll(ids, step, axis) == ids
    inner = np.flatnonzero(same.ravel()[hits.pixel])
    if not len(inner):
        raise InsituError("no pixel lies inside of an object")
    return np.random.default_rng(1).choice(inner, min(n, len(inner)), replace=False)
