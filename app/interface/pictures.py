"""Pictures of all modes for the Python interface, cached between calls, and path-traced pictures to compare them
with."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from app.interface.placement import Picture, PlacementPictures
from app.project.project import Project
from app.stills.stills import (
    chosen_bounces,
    layers_by_object,
    plan_still,
    prepared_deform,
    prepared_orbit,
    render_project,
)
from engine.core.errors import InsituError
from engine.core.generators import run_to_end
from engine.precompute.direct.pipeline import Placement
from engine.precompute.indirect.clamping import BRIGHTEST, clamp_radiance
from engine.precompute.indirect.sampling_settings import BounceSeries
from engine.realtime.triple_product.orbit_engine import Orbit
from engine.realtime.zonal_harmonics.deform_engine import Deform
from engine.render.bounce_plan import planned_bounces
from engine.render.error_estimate import estimate_drawn_errors
from engine.render.picture_error import ErrorEstimate
from engine.render.still import still_layers, with_maps

Mode = Literal["placement", "orbit", "deform", "paths"]
MOST_BOUNCES = 16


class Pictures:
    """The pictures of one scene. What a mode needs is made with its first picture, and cached."""

    def __init__(self) -> None:
        self._placement = PlacementPictures()
        self._orbit: tuple[object, Orbit] | None = None
        self._deform: tuple[object, Deform] | None = None

    def picture(
        self, project: Project, mode: Mode, n_bounces: int | None, n_samples: int, draft: bool = False
    ) -> Picture:
        """Linear radiance (H, W, 3) float32; see `Scene.image`. Raises InsituError."""
        if mode not in get_args(Mode):
            raise InsituError(f"mode = {mode!r}, expected one of {', '.join(get_args(Mode))}")
        if n_bounces is not None and not 1 <= n_bounces <= MOST_BOUNCES:
            raise InsituError(f"bounces = {n_bounces}, expected 1 to {MOST_BOUNCES}")
        if mode == "placement":
            return self._placement.picture(project, n_bounces, draft)
        if mode == "paths":
            series = None if n_bounces is None else BounceSeries(n_bounces)
            still = render_project(project, lambda step: None, reference=True, series=series, n_samples=n_samples)
            return still.picture
        picture = self._in_orbit(project, n_bounces) if mode == "orbit" else self._in_deform(project, n_bounces)
        return clamp_radiance(picture * np.float64(project.document.light.intensity), BRIGHTEST)

    def error(self, project: Project, mode: Mode, n_bounces: int | None) -> ErrorEstimate:
        """The error of such a picture, estimated by path tracing. Raises InsituError where that is impossible."""
        if mode == "paths":
            raise InsituError("paths know no error of theirs: compare two pictures of other numbers of samples")
        if mode == "placement":
            return self._placement.error(project, n_bounces)
        alone = [state.name for state in project.document.objects if state.surface.kind]
        if mode == "deform" and alone:
            raise InsituError(f"no error estimate: path tracing does not support the surface of {', '.join(alone)}")
        intensity = project.document.light.intensity
        if not intensity:
            raise InsituError("light.intensity = 0, expected more: a black picture has no relative error")
        picture = self.picture(project, mode, n_bounces, 1) / np.float32(intensity)
        plan = plan_still(project)
        placement = Placement(project.scene, None, plan.n_edge_rays)
        wanted = n_bounces or chosen_bounces(project, plan)
        n_bounces = planned_bounces(placement, project.indexed_layers, wanted).n_bounces
        layers = with_maps(placement, still_layers(project.layers.items(), project.object_names, plan))
        (estimated,) = run_to_end(estimate_drawn_errors(placement, layers, project.sky, n_bounces, [picture]))
        return estimated.estimate

    def _in_orbit(self, project: Project, n_bounces: int | None) -> Picture:
        """Orbit's picture at rest, with exact directional lights; what the last one computed is reused."""
        document, scene = project.document, project.scene
        if self._orbit is None or self._orbit[0] != document.poses:
            self._orbit = document.poses, prepared_orbit(project)
        orbit = self._orbit[1]
        orbit.set_emission({name: tuple(scene.emission[i].tolist()) for i, name in enumerate(scene.object_names)})
        orbit.set_bumps({each.name: each.bumps for each in scene.description.objects})
        orbit.set_light(project.sky)
        orbit.set_layers(layers_by_object(project))
        orbit.set_bounces(n_bounces or project.chosen_bounces or 0)
        finish_work(orbit)
        picture = orbit.draw(scene.description.camera, scene.resolution, "still")
        if orbit.is_done:
            return picture
        finish_work(orbit)  # the camera sees the back faces of some objects for the first time
        return orbit.draw(scene.description.camera, scene.resolution, "still")

    def _in_deform(self, project: Project, n_bounces: int | None) -> Picture:
        """Deform's picture at rest; objects that deform cast coarse shadows on all others."""
        document, scene = project.document, project.scene
        posed = [name for name, _ in document.poses]
        if self._deform is None or self._deform[0] != document.new_bumps:
            resting = project.resting.with_bumps(dict(document.new_bumps))
            self._deform = document.new_bumps, prepared_deform(project, resting, posed)
        deform = self._deform[1]
        deform.set_emission({name: tuple(scene.emission[i].tolist()) for i, name in enumerate(scene.object_names)})
        deform.set_light(project.sky)
        deform.set_layers(layers_by_object(project))
        deform.set_surfaces(document.new_surfaces)
        deform.set_bending(posed)
        deform.set_bounces(n_bounces or project.chosen_bounces or 0)
        finish_work(deform)
        return deform.draw(scene.description.camera, scene.resolution, document.poses, "rest")


def finish_work(engine: Orbit | Deform) -> None:
    """Do all the work that is left."""
    for _ in engine.work():
        pass
