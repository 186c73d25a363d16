"""Pictures in files: what `insitu render` does, from a project to an EXR or a PNG that is complete or does not
exist."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.document.document import Document, reflecting_layers
from app.project.project import Project
from app.stills.shadow_catcher import catcher_part, caught_objects, caught_shadows, over_sky, without_others
from app.system.atomic import make_folder_of, require_place, save_file
from app.system.memory import orbit_bytes, orbit_slice_bytes
from app.worker.cache import ArrayCache
from app.worker.deform_worker import StoredLobes
from engine.core.clamping import BRIGHTEST, clamp_radiance
from engine.core.colour import AnyView
from engine.core.errors import InsituError
from engine.core.generators import StillProgress, map_steps, run_to_end
from engine.material.layer import Layer, object_of
from engine.planner import Plan, plan_scene
from engine.precompute.direct.pipeline import Placement, Quality, SkyState
from engine.precompute.indirect.sampling_settings import STILL, BounceSeries
from engine.realtime.core.picture_parts import parts_of
from engine.realtime.stills import render_deform, render_orbit
from engine.realtime.triple_product.orbit_engine import Orbit
from engine.realtime.zonal_harmonics.deform_engine import Deform
from engine.realtime.zonal_harmonics.transfer import N_RAYS as DEFORM_RAYS
from engine.reference.path_tracer import N_SAMPLES, trace_paths
from engine.render.bounce_plan import planned_bounces
from engine.render.crop import Crop, cropped
from engine.render.display import PictureLayer, exr_bytes, png_bytes
from engine.render.error_estimate import estimate_drawn_errors, estimate_error
from engine.render.light_pilot import with_light_budget
from engine.render.picture_error import ErrorEstimate
from engine.render.still import (
    REFERENCE_LEVEL,
    StillLayer,
    compose,
    find_indirect,
    first_bounce_layers,
    noise_in,
    reference_radiance,
    reflect_layers,
    reflected_light,
    still_layers,
    still_quality,
    with_maps,
)
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene
from engine.settings import MODE_LINES, RenderSettings

# Deform's transfer of a still has more rays than that of the editor.
STILL_SETTINGS = RenderSettings(n_rays=DEFORM_RAYS)
REFERENCE_PATCHES = 1024
_WHOLE = 0.7  # of the progress: the picture with all objects, before that of shadow catchers alone
ENDINGS = (".exr", ".png")

Report = Callable[[StillProgress], None]
Mode = Literal["placement", "orbit", "deform"]


def check_output(path: Path, endings: tuple[str, ...] = ENDINGS) -> Path:
    """Check that a picture can be written to the path, and return it; done before the work rather than after it."""
    if path.suffix.lower() not in endings:
        raise InsituError(f"{path}: the name of a picture ends in {' or '.join(endings)}")
    if os.path.isdir(path):
        raise InsituError(f"{path}: is a folder, expected the name of a picture")
    make_folder_of(path)
    require_place(path)
    return path


class Shown(NamedTuple):
    """What is written of a picture: its exposure in stops and gamma, on screen and in PNG files; the crop, None: the
    whole."""

    exposure: float = 0.0
    gamma: float = 1.0
    crop: Crop | None = None


AS_IT_IS = Shown()


@dataclass(frozen=True, eq=False)
class Still:
    """Linear radiance (H, W, 3), with alpha (H, W, 4) over a transparent background, and its estimated error, None
    where that was not requested. warning: about light that is left out, else ""; layers: besides the picture itself,
    where they were requested; catchers (H, W, 4): their part of a picture that is not finished, see
    `app.stills.shadow_catcher`, None where there are none; quality: of direct light that was projected, else None."""

    picture: NDArray[np.float32]
    error: ErrorEstimate | None = None
    warning: str = ""
    layers: tuple[PictureLayer, ...] = ()
    catchers: NDArray[np.float32] | None = None
    quality: Quality | None = None


def render_picture(
    project: Project, report: Report, *, reference: bool = False, series: BounceSeries | None = None,
    n_samples: int | None = None, **settings: Any,
) -> NDArray[np.float32]:  # fmt: skip
    """The picture of a still."""
    still = render_project(project, report, reference=reference, series=series, n_samples=n_samples, **settings)
    return still.picture


def render_project(
    project: Project, report: Report, *, reference: bool = False, series: BounceSeries | None = None,
    n_samples: int | None = None, estimates_error: bool = False, mode: Mode = "placement",
    caster: RayCaster | None = None, **settings: Any,
) -> Still:  # fmt: skip
    """A still of a project, with the editor's transport, by the mode's engine or by brute force.

    series: None for as many bounces as the scene says, or requires; the document may set the bands of the first bounce;
    by brute force bands do not matter. n_samples: paths per pixel, by brute force; without them direct light alone is
    integrated over all directions, without noise. estimates_error: whether its error is estimated; not by brute force,
    which knows its noise, and of shadow catchers as they are themselves. caster: the ray caster of the scene's
    triangles, where there is one already; crop: the part of the picture that is wanted, the rest may be black;
    settings: those that differ from `STILL_SETTINGS`, the numbers of lights and patches at most
    (`engine.render.light_pilot`).
    """
    how: dict[str, Any] = dict(reference=reference, series=series, n_samples=n_samples, mode=mode, **settings)
    alone = without_others(project)
    if alone is None:
        still = draw_still(project, report, estimates_error=estimates_error, caster=caster, **how)
        return replace(still, picture=finished_picture(project.document, still.picture))
    whole = _within(report, 0.0, _WHOLE)
    still = draw_still(project, whole, estimates_error=estimates_error, caster=caster, **how)
    rest = draw_still(alone, _within(report, _WHOLE, 1.0), quality=still.quality, **how)
    picture = with_caught_shadows(project, still.picture, still.catchers, rest.catchers)
    return replace(still, picture=finished_picture(project.document, picture))


def with_caught_shadows(
    project: Project, whole: NDArray[np.float32], part: NDArray[np.float32] | None, alone: NDArray[np.float32] | None
) -> NDArray[np.float32]:
    """A picture of a project with the shadows on its catchers, over the environment (H, W, 3), or (H, W, 4) where this
    is hidden. whole: the picture (H, W, 4), without the intensity of the light; part, alone: that of catchers in it,
    and in the picture of the project of `without_others`."""
    picture = whole if part is None or alone is None else caught_shadows(whole, part, alone)
    hides = project.document.background.hides_environment
    return picture if hides else over_sky(picture, project.sky, project.scene.description.camera)


def _within(report: Report, begin: float, end: float) -> Report:
    """Reports the progress of a part of the work, from one fraction of the whole to another."""
    return lambda step: report(replace(step, fraction=begin + (end - begin) * step.fraction))


def draw_still(project: Project, report: Report, **how: Any) -> Still:
    """A still before the intensity of the light, its background and catchers; how: see `render_project`."""
    return run_to_end(still_steps(project, **how), report)


def still_steps(
    project: Project, *, reference: bool = False, series: BounceSeries | None = None, n_samples: int | None = None,
    mode: Mode = "placement", estimates_error: bool = False, caster: RayCaster | None = None,
    quality: Quality | None = None, crop: Crop | None = None, **settings: Any,
) -> Generator[StillProgress, None, Still]:  # fmt: skip
    """The same in steps. quality: how finely its direct light is projected, None: as finely as it needs. Shadow
    catchers alone need the lights of the whole picture: other ones would leave shadows of nothing. crop: where light is
    needed alone; Orbit and Deform draw all."""
    chosen = still_settings(project, mode, settings)
    parts = still_parts(project, chosen, series, caster, crop if mode == "placement" else None)
    placement, layers, series, warning = parts.placement, parts.layers, parts.series, parts.warning
    if reference:
        picture, catchers = yield from _reference(placement, project, series.n_bounces, n_samples)
        return Still(picture, warning=warning, catchers=catchers)
    if mode != "placement":
        how = placement, layers, series, chosen, estimates_error, warning
        return (yield from _real_time_still(project, mode, *how))
    sky, error = project.sky, None
    layers = parts.direct_layers
    indirect, noise = yield from parts.indirect(placement, sky, estimates_error)
    if quality is None:
        quality = yield from parts.quality(placement, sky)
    radiance = yield from reflect_layers(placement, layers, sky, quality, indirect)
    if estimates_error:
        error = yield from estimate_error(
            placement, layers, sky, quality, series.n_bounces, radiance, indirect, noise=noise
        )  # fmt: skip
    picture = compose(placement, radiance, sky, project.document.hides_environment)
    return Still(picture, error, warning, (), catcher_part(project, placement.hits, radiance), quality)


def with_intensity(document: Document, light: NDArray[np.floating]) -> NDArray[np.float32]:
    """Light (H, W, 3) times the intensity of the document's light, clamped to what a picture holds."""
    return clamp_radiance(light * np.float64(document.light.intensity), BRIGHTEST)


def finished_picture(document: Document, picture: NDArray[np.floating]) -> NDArray[np.float32]:
    """A picture with the intensity of the document's light, over its background.

    picture (H, W, 3), or with alpha (H, W, 4) where the background hides the environment. Returns (H, W, 3), and where
    the background is transparent (H, W, 4): light that alpha is multiplied into.
    """
    light = with_intensity(document, picture[..., :3])
    if picture.shape[2] == 3:
        return light
    return document.background.behind(np.concatenate([light, picture[..., 3:]], axis=2))


@dataclass(frozen=True, eq=False)
class StillParts:
    """What a still is computed from. layers: with their images, and the plan's bands; warning: about light that is left
    out, else ""."""

    placement: Placement
    plan: Plan
    layers: tuple[StillLayer, ...]
    series: BounceSeries
    warning: str

    @cached_property
    def limited(self) -> tuple[StillLayer, ...]:
        """The layers as the first number of the series limits them."""
        return first_bounce_layers(self.layers, self.series)

    @property
    def direct_layers(self) -> tuple[StillLayer, ...]:
        """The layers that reflect direct light."""
        return self.layers if self.series.whole_direct else self.limited

    def indirect(
        self, placement: Placement, sky: SkyState, finds_noise: bool
    ) -> Generator[StillProgress, None, tuple[NDArray[np.float32] | None, float | None]]:
        """Indirect light (P, 3) of a placement's emitters and a sky, None where the series has one bounce; and its
        noise, RMS radiance, None where it is not asked for."""
        series = self.series
        if series.n_bounces == 1:
            return None, None
        n_rays = self.plan.settings.n_hemisphere_rays
        fineness, as_needed = STILL.with_rays(n_rays), not n_rays
        found = yield from find_indirect(placement, self.limited, sky, series, fineness, as_needed)
        reflecting = reflected_light(found, self.limited, series.second, placement.hits, third=series.third)
        light, noise = (yield from map_steps(reflecting, _reflecting)), None
        if finds_noise:
            noise = yield from map_steps(noise_in(found, self.limited, series.second, series.third), _reflecting)
        return light, noise

    def quality(self, placement: Placement, sky: SkyState) -> Generator[StillProgress, None, Quality]:
        """How finely the direct light of a placement's emitters and a sky is computed."""
        budget = with_light_budget(placement, self.direct_layers, sky, self.plan)
        return still_quality((yield from map_steps(budget, lambda step: StillProgress(0.0, "choosing lights"))))


def still_parts(
    project: Project, settings: RenderSettings, series: BounceSeries | None = None, caster: RayCaster | None = None,
    crop: Crop | None = None,
) -> StillParts:  # fmt: skip
    """The parts of a project's still; arguments: see `render_project`, crop: of points in it alone."""
    plan = plan_still(project, settings)
    placement = Placement(project.scene, caster, plan.n_edge_rays)
    wanted = series.n_bounces if series else chosen_bounces(project, plan)
    bounces = planned_bounces(placement, project.indexed_layers, wanted)
    if crop is not None:
        placement = placement.at_rows(crop.rows(placement.hits.pixel, placement.hits.resolution))
    series = series or BounceSeries(bounces.n_bounces)
    series = replace(series, first=series.first or project.document.first_bands)
    layers = with_maps(placement, still_layers(project.layers.items(), project.object_names, plan))
    return StillParts(placement, plan, layers, series, bounces.warning)


def _reflecting(step: object) -> StillProgress:
    return StillProgress(1.0, "light between surfaces")


def _real_time_still(
    project: Project, mode: Mode, placement: Placement, layers: Sequence[StillLayer],
    series: BounceSeries, settings: RenderSettings, estimates_error: bool, warning: str,
) -> Generator[StillProgress, None, Still]:  # fmt: skip
    """A still as Orbit or Deform shows it at rest; layers: those of its estimate."""
    transparent, apart = project.document.hides_environment, caught_objects(project)
    if mode == "orbit":
        drawing = render_orbit(
            placement, layers_by_object(project), project.sky, settings.n_patches, settings.n_points,
            settings.n_coefficients, series.n_bounces, orbit_bytes(), orbit_slice_bytes(), transparent, apart,
        )  # fmt: skip
    else:
        # A still has one pose: transfer of the meshes in it includes the shadows between objects.
        prepared = prepared_deform(project, project.scene, (), series, settings)
        drawing = render_deform(prepared, project.scene.resolution, transparent, apart)
    (picture, part), error = parts_of((yield from drawing)), None
    alone = deform_only_objects(project) if mode == "deform" else ()
    if estimates_error and alone:
        warning = warning or f"no error estimate: path tracing does not support the surface of {', '.join(alone)}"
    elif estimates_error:
        (estimated,) = yield from estimate_drawn_errors(
            placement, layers, project.sky, series.n_bounces, [picture[..., :3]]
        )
        error = estimated.estimate
    return Still(picture, error, warning, catchers=part)


def estimate_picture_error(
    project: Project, picture: NDArray[np.float32], n_bounces: int | None = None
) -> ErrorEstimate | None:
    """The error of a picture (H, W, 3 or more) of a project that was drawn in another way, by path tracing some of its
    points; None where it is black, because there is no light. n_bounces: None for as many as the scene says, or
    requires."""
    intensity = project.document.light.intensity
    if not intensity:
        return None
    plan = plan_still(project)
    placement = Placement(project.scene, None, plan.n_edge_rays)
    bounces = planned_bounces(placement, project.indexed_layers, n_bounces or chosen_bounces(project, plan))
    layers = with_maps(placement, still_layers(project.layers.items(), project.object_names, plan))
    drawn = picture[..., :3] / np.float32(intensity)
    (estimated,) = run_to_end(estimate_drawn_errors(placement, layers, project.sky, bounces.n_bounces, [drawn]))
    return estimated.estimate


def prepared_orbit(
    project: Project, series: BounceSeries | None = None, settings: RenderSettings | None = None
) -> Orbit:
    """Orbit's engine for pictures from any camera, with all its work still to be done. series: None for as many bounces
    as the session or the scene says, or Orbit takes; settings: None for those of a still."""
    settings = settings or still_settings(project, "orbit")
    orbit = Orbit(
        project.scene, None, settings.n_points, settings.n_coefficients, settings.n_patches, orbit_bytes(),
        most_slice_bytes=orbit_slice_bytes(),
    )  # fmt: skip
    orbit.set_light(project.sky)
    orbit.set_layers(layers_by_object(project))
    if n_bounces := series.n_bounces if series else project.chosen_bounces:
        orbit.set_bounces(n_bounces)
    return orbit


def deform_only_objects(project: Project) -> tuple[str, ...]:
    """Names of the objects whose surfaces only Deform draws, so that paths cannot estimate their error."""
    return tuple(state.name for state in project.document.objects if state.surface.kind)


def prepared_deform(
    project: Project, scene: Scene, posed: Sequence[str], series: BounceSeries | None = None,
    settings: RenderSettings | None = None,
) -> Deform:  # fmt: skip
    """Deform's engine for pictures of the project's scene, at rest or in a pose, with all its work still to be done;
    posed: names of the objects that are to deform further. settings: None for those of a still."""
    settings = settings or still_settings(project, "deform")
    deform = Deform(scene, store=StoredLobes(ArrayCache()))
    deform.set_effort(settings.n_rays, settings.n_lobes, settings.n_gloss_rows)
    deform.set_light(project.sky)
    deform.set_layers(layers_by_object(project))
    deform.set_surfaces(project.document.new_surfaces)
    deform.set_bending(posed)
    if n_bounces := series.n_bounces if series else project.chosen_bounces:
        deform.set_bounces(n_bounces)
    return deform


def _reference(
    placement: Placement, project: Project, n_bounces: int, n_samples: int | None
) -> Generator[StillProgress, None, tuple[NDArray[np.float32], NDArray[np.float32] | None]]:
    """A picture by brute force, and the part of shadow catchers in it, None where there are none."""
    # With the parameters of each hit where they vary, not their nodes; only paths look them up.
    layers, sky = layers_by_object(project, dict(reflecting_layers(project.document))), project.sky
    vary = any(layer.parameter_maps for own in layers.values() for layer in own)
    if n_bounces == 1 and n_samples is None and not vary:
        radiance = yield from reference_radiance(placement, layers, sky, REFERENCE_PATCHES, REFERENCE_LEVEL)
    else:
        radiance = (yield from trace_paths(placement, layers, sky, n_bounces, n_samples or N_SAMPLES)).radiance
    part = catcher_part(project, placement.hits, radiance)
    return compose(placement, radiance, sky, project.document.hides_environment), part


def still_settings(project: Project, mode: Mode, changes: Mapping[str, int] = MappingProxyType({})) -> RenderSettings:
    """The settings of a project's stills in a mode: `STILL_SETTINGS` with the project's overrides of that mode's own
    lines, and with changes, by name."""
    own = {line: value for line, value in project.overrides.items() if line in MODE_LINES.get(mode, ())}
    return replace(STILL_SETTINGS.with_lines(own), **changes)  # type: ignore[arg-type]


def plan_still(project: Project, settings: RenderSettings = STILL_SETTINGS) -> Plan:
    """The plan of a still, with so many lights and patches where they are not overridden."""
    has_sky = project.sky.environment is not None
    return plan_scene(
        project.scene, project.layers, has_sky=has_sky, still=True, settings=settings,
        overrides=project.overrides,
    )  # fmt: skip


def chosen_bounces(project: Project, plan: Plan) -> int | None:
    """The user's override, the session's number, or the scene's; None: to be planned."""
    return project.chosen_bounces or plan.settings.n_bounces or None


def write_picture(
    path: Path, radiance: NDArray[np.float32], view: AnyView = "filmic", comment: str = "",
    layers: Sequence[PictureLayer] = (), shown: Shown = AS_IT_IS,
) -> None:  # fmt: skip
    """Write a picture (H, W, 3), or with alpha (H, W, 4), to a file, whole or not at all; see `picture_bytes`."""
    save_file(path, picture_bytes(path, radiance, view, comment, layers, shown))


def picture_bytes(
    path: Path, radiance: NDArray[np.float32], view: AnyView = "filmic", comment: str = "",
    layers: Sequence[PictureLayer] = (), shown: Shown = AS_IT_IS,
) -> bytes:  # fmt: skip
    """The bytes of a picture's file: an .exr (linear, 32 bits, with a comment and layers) or a .png (as the viewport
    shows it, without)."""
    if path.suffix.lower() == ".png":
        return png_bytes(cropped(radiance, shown.crop), shown.exposure, view, shown.gamma)
    return exr_bytes(radiance, comment, layers, shown.crop)


def layers_by_object(project: Project, layers: Mapping[str, Layer] | None = None) -> Mapping[int, tuple[Layer, ...]]:
    """The layers of each object, by its index in the scene; layers: by key, None for those of pictures."""
    names = project.object_names
    layers = project.layers if layers is None else layers
    return {
        index: tuple(layer for key, layer in layers.items() if object_of(key) == name)
        for index, name in enumerate(names)
    }
