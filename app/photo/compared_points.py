"""The pixels at which a photograph is compared with a scene: which they are, and the light that reaches them."""

from __future__ import annotations

from collections.abc import Collection, Generator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.project.picture_points import SeenPoints, plan_points, view_points, view_points_coarsely
from app.project.project import Project
from engine.core.errors import InsituError
from engine.core.generators import StillProgress
from engine.inverse.photo import Photo
from engine.inverse.photo_fit import PhotoPixels
from engine.inverse.photo_view import inner_pixels, rows_of_pixels
from engine.planner import Plan
from engine.precompute.direct.pipeline import Placement

# How many pixels are compared: of the object, and of the rest.
MOST_PIXELS, MOST_BESIDE, LEAST_PIXELS = 2048, 1024, 16
# And how many while a light is searched for.
_FEW = 384


@dataclass(frozen=True, eq=False)
class ComparedPoints:
    """placement: of the whole picture; seen: the photograph in its size; rows: the points that are compared; beside:
    pixels (m,) that show the environment, by row-major index."""

    placement: Placement
    seen: Photo
    plan: Plan
    rows: NDArray[np.int32]
    beside: NDArray[np.integer]

    def fewer(self, most: int = _FEW) -> ComparedPoints:
        """At most so many of them, evenly chosen."""
        return replace(self, rows=self.rows[:: max(-(-len(self.rows) // most), 1)])

    def pixels(self, project: Project) -> PhotoPixels:
        """The photograph at the points, and where it shows the environment of a project."""
        hits, sky = self.placement.hits, project.sky
        radiance, error = (
            np.asarray(each, np.float64).reshape(-1, 3) for each in (self.seen.radiance, self.seen.error)
        )
        at = hits.pixel[self.rows]
        if sky.environment is None:
            return PhotoPixels(radiance[at], error[at])
        directions = hits.ray_directions.reshape(-1, 3)[self.beside]
        known = sky.environment.evaluate(directions, sky.rotation) * sky.scale
        return PhotoPixels(radiance[at], error[at], radiance[self.beside], np.asarray(known, np.float64))

    def view(self, project: Project, wanted_bounces: int | None) -> Generator[StillProgress, None, SeenPoints]:
        """The light of a project at the points, as finely as a finished picture has it, and the layers of its scene."""
        return view_points(project, self.placement, self.plan, self.rows, wanted_bounces)

    def coarse_view(self, project: Project, n_bounces: int = 1) -> Generator[StillProgress, None, SeenPoints]:
        """The same by few lights, to search for a light."""
        return view_points_coarsely(project, self.placement, self.plan, self.rows, n_bounces)


def compared_points(
    project: Project, name: str, seen: Photo, file: str, unknown: Collection[str] = ()
) -> ComparedPoints:
    """The points at which an object is compared. file: of the photograph, for a message; unknown: other objects whose
    materials are not known either. Raises InsituError where too few pixels see it."""
    plan = plan_points(project)
    placement = Placement(project.scene, None, plan.n_edge_rays)
    hits, generator = placement.hits, np.random.default_rng(1)
    objects, i_object = inner_pixels(hits, seen.usable).ravel(), project.scene.object_index(name)

    def some(pixels: NDArray[np.integer], most: int) -> NDArray[np.integer]:
        return pixels if len(pixels) <= most else np.sort(generator.choice(pixels, most, replace=False))

    own = rows_of_pixels(hits, some(np.flatnonzero(objects == i_object), MOST_PIXELS))
    if len(own) < LEAST_PIXELS:
        raise InsituError(
            f"{file}: {len(own)} usable pixels of {name}, expected {LEAST_PIXELS} or more that are neither clipped nor "
            "at its edge"
        )
    known = [i for i, each in enumerate(project.object_names) if each != name and each not in unknown]
    others = rows_of_pixels(hits, some(np.flatnonzero(np.isin(objects, known)), MOST_BESIDE))
    beside = some(np.flatnonzero((objects == -1) & (hits.open_image.ravel() == 1.0)), MOST_BESIDE)
    return ComparedPoints(placement, seen, plan, np.union1d(own, others).astype(np.int32), beside)
