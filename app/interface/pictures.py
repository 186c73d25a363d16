"""Pictures of all modes for the Python interface, cached between calls, and path-traced pictures to compare them with.

What an edit leaves valid is reused from one picture to the next. A picture of Placement is made of parts, each with its
dependencies:

    primary hits, visibility of the sphere   geometry in its poses, bumps, camera, resolution
    light and its visibility                 the above, emission, environment, rotation
    transport of a layer                     the above, its model and quotient parameters, bands
    indirect light                           the above, the models of all layers, number of bounces
    radiance of a layer                      the above, its curves, scale and images

An edit of a curve changes only the last: increments over stored transport (`engine.render.layer_transport`). Each part
is stored with what it was made of; where that has changed, it is made anew.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from app.document.light_mix import mixed_light
from app.document.scene_state import moved_objects
from app.project.project import Project
from app.stills.shadow_catcher import catcher_part, caught_objects, without_others
from app.stills.stills import (
    chosen_bounces,
    deform_only_objects,
    estimate_picture_error,
    finished_picture,
    layers_by_object,
    prepared_deform,
    prepared_orbit,
    render_project,
    with_caught_shadows,
    with_intensity,
)
from engine.core.errors import InsituError
from engine.core.generators import run_to_end
from engine.material.layer import Layer, object_of
from engine.material.layer_maps import Images
from engine.planner import LayerPlan, Plan, plan_scene
from engine.precompute.direct.bandstore import join_tiles
from engine.precompute.direct.linking import light_groups
from engine.precompute.direct.pipeline import Placement, Quality, SkyState
from engine.precompute.direct.projection import LayerShape, VisibleLight, project_layer
from engine.precompute.indirect.gather_polynomial import GatherPolynomial
from engine.precompute.indirect.indirect_light import IndirectLight
from engine.precompute.indirect.sampling_settings import STILL, BounceSeries
from engine.realtime.core.picture_parts import parts_of
from engine.realtime.triple_product.orbit_engine import Orbit
from engine.realtime.zonal_harmonics.deform_engine import Deform
from engine.render._layer_kernels import add_points
from engine.render.bounce_plan import planned_bounces
from engine.render.error_estimate import estimate_error
from engine.render.layer_transport import LayerTransport
from engine.render.light_pilot import with_light_budget
from engine.render.picture_error import ErrorEstimate
from engine.render.still import (
    StillLayer,
    compose,
    curves_of,
    find_indirect,
    noise_in,
    reflected_light,
    shape_of,
    still_quality,
    view_factors,
)
from engine.scene.map_sampler import MapSampler, MapSamples

Picture = NDArray[np.float32]
Key = tuple[Any, ...]


@dataclass(frozen=True, eq=False)
class _View:
    """The view of the camera: hits and visibility."""

    key: Key
    placement: Placement


@dataclass(eq=False)
class _Light:
    """The light of a view; visible: for each group of objects (M,) that the same lights reach; background (H, W, 3):
    what pixels show that see no reflecting object, or with alpha (H, W, 4) without the environment."""

    key: Key
    sky: SkyState
    quality: Quality
    visible: tuple[tuple[NDArray[np.bool_], VisibleLight], ...]
    background: Picture | None = None

    def reaching(self, i_object: int) -> VisibleLight:
        """The light that reaches an object."""
        return next(light for objects, light in self.visible if objects[i_object])


@dataclass(eq=False)
class _KeptLayer:
    """Transport of one layer, and its last part of the picture (p, 3)."""

    shape: LayerShape
    transport: LayerTransport
    layer: Layer | None = None
    curves: tuple[NDArray[np.float64], ...] = ()
    factor: NDArray[np.floating] | None = None  # f_q f_o times texture and weight, (p, 3)
    radiance: NDArray[np.floating] | None = None


@dataclass(eq=False)
class _KeptIndirect:
    """Indirect light, the part of its reflection that no curve changes, and its last part of the picture (P, 3)."""

    key: Key
    light: IndirectLight
    polynomial: GatherPolynomial
    layers: Key = ()
    radiance: NDArray[np.float32] | None = None


class PlacementPictures:
    """Pictures of one scene; see the module. catchers (H, W, 4): the part of shadow catchers in the last one, None
    where there are none."""

    def __init__(self) -> None:
        self.catchers: NDArray[np.float32] | None = None
        self._view: _View | None = None
        self._light: _Light | None = None
        self._layers: dict[str, _KeptLayer] = {}
        self._planned: dict[str, tuple[Layer, LayerPlan]] = {}
        self._seen: dict[tuple[int, Images], MapSamples] = {}
        self._indirect: _KeptIndirect | None = None
        self._bounces: tuple[Key, int] | None = None

    def picture(self, project: Project, n_bounces: int | None = None, draft: bool = False) -> Picture:
        """Linear radiance (H, W, 3 or 4) before the intensity of the light. n_bounces: None for as many as the scene
        says or requires; draft: transport stays where only a quotient's parameters have changed."""
        radiance, _, _ = self._radiance(project, n_bounces, draft)
        view, light = self._made()
        assert light.background is not None
        hits, picture = view.placement.hits, light.background.copy()
        lit = np.ascontiguousarray(picture[..., :3])
        add_points(hits.pixel, hits.share, radiance, lit.reshape(-1, 3))
        picture[..., :3] = lit
        self.catchers = catcher_part(project, hits, radiance)
        return picture

    def error(self, project: Project, n_bounces: int | None = None) -> ErrorEstimate:
        """The error of that picture, estimated by tracing some of its points."""
        radiance, layers, n = self._radiance(project, n_bounces)
        view, light = self._made()
        indirect = noise = None
        if n > 1 and self._indirect is not None:
            indirect = self._indirect.radiance
            noise = run_to_end(noise_in(self._indirect.light, layers, None))
        of = view.placement, layers, light.sky, light.quality, n, radiance.astype(np.float64), indirect
        return run_to_end(estimate_error(*of, noise=noise))

    # -------------------------------------------------------------------------------------------------------- its parts

    def _made(self) -> tuple[_View, _Light]:
        assert self._view is not None and self._light is not None
        return self._view, self._light

    def _radiance(
        self, project: Project, n_bounces: int | None, draft: bool = False
    ) -> tuple[NDArray[np.float32], tuple[StillLayer, ...], int]:
        """The reflected radiance of the points (P, 3), the layers and the number of bounces."""
        plan = self._plan(project, draft)
        view = self._viewed(project, plan.n_edge_rays)
        layers = self._still_layers(project, plan, view.placement)
        self._lit(project, view, layers, plan)
        n_bounces = self._n_bounces(project, n_bounces or chosen_bounces(project, plan))
        radiance = np.zeros((len(view.placement.hits.pixel), 3), np.float32)
        if n_bounces > 1:
            radiance += self._reflected(project, layers, n_bounces, plan)
        for key, each in zip(project.layers, layers, strict=True):
            radiance[slice(*view.placement.hits.object_ranges[each.i_object])] += self._layer(key, each, draft)
        return radiance, layers, n_bounces

    def _plan(self, project: Project, draft: bool) -> Plan:
        """The plan for layers that are edited. A layer is planned when it is first seen, and anew where its transport
        would be made anew; under edits of its curves it keeps its bands, as in the editor."""
        changed = {
            key: layer for key, layer in project.layers.items()
            if key not in self._planned or not _same_quotient(self._planned[key][0], layer, draft)
        }  # fmt: skip
        plan = plan_scene(
            project.scene, changed, has_sky=project.sky.environment is not None, editable=changed.keys(),
            overrides=_lines_of(project, changed),
        )  # fmt: skip
        for own in plan.layers:
            self._planned[own.key] = changed[own.key], own
        return replace(plan, layers=tuple(self._planned[key][1] for key in project.layers))

    def _viewed(self, project: Project, n_edge_rays: int) -> _View:
        scene, document, before = project.scene, project.document, self._view
        geometry = document.composition, document.poses, document.new_bumps, document.new_opacities
        key = (geometry, scene.description.camera, scene.resolution, n_edge_rays, scene.emission.tobytes())
        if before is not None and before.key == key:
            return before
        same = () if before is None else tuple(a == b for a, b in zip(before.key, key, strict=True))
        caster = before.placement.caster if before is not None and same[0] else None
        placement = Placement(scene, caster, n_edge_rays)
        if before is not None and all(same[:-1]):
            placement.sphere = before.placement.sphere  # only lamps emit differently: shadows are the same
        else:
            self._seen.clear()
        self._view, self._light = _View(key, placement), None
        return self._view

    def _lit(self, project: Project, view: _View, layers: Sequence[StillLayer], plan: Plan) -> _Light:
        settings = plan.light_settings.of_direct_light
        hides_sky = project.document.hides_environment
        key = (view.key, replace(mixed_light(project.document), intensity=1.0), settings)
        if self._light is None or self._light.key != key:
            placement, sky = view.placement, project.sky
            quality = still_quality(run_to_end(with_light_budget(placement, layers, sky, plan)))
            visible = tuple(
                (group.objects, run_to_end(group.placement.light(group.sky, quality)))
                for group in light_groups(placement, sky)
            )
            self._light = _Light(key, sky, quality, visible)
            self._layers.clear()
            self._indirect = None
        if self._light.background is None or (self._light.background.shape[2] == 4) != hides_sky:
            nothing = np.zeros((len(view.placement.hits.pixel), 3))
            self._light.background = compose(view.placement, nothing, self._light.sky, hides_sky)
        return self._light

    def _still_layers(self, project: Project, plan: Plan, placement: Placement) -> tuple[StillLayer, ...]:
        """The layers with their bands, and their images as the camera sees them."""
        sampler, made = MapSampler(placement.scene, placement.caster, placement.hits), []
        for key, layer in project.layers.items():
            i_object = placement.scene.object_index(object_of(key))
            shape, most = plan.layer(key).shape, project.document.first_bands
            bands = shape if most is None else (min(shape[0], most), min(shape[1], most))
            seen = None
            if not layer.maps.is_plain:
                images = i_object, layer.maps.images
                seen = self._seen[images] = self._seen.get(images) or sampler.sample(*images)
            made.append(StillLayer(i_object, layer, bands, True, seen))
        return tuple(made)

    def _layer(self, key: str, each: StillLayer, draft: bool) -> NDArray[np.floating]:
        """A layer's part of the radiance of its object's points, (p, 3)."""
        view, light = self._made()
        hits, shape, kept = view.placement.hits, shape_of(each), self._layers.get(key)
        stays = kept is not None and (
            kept.shape == shape or draft and (kept.shape.model, kept.shape.bands) == (shape.model, shape.bands)
        )
        if kept is None or not stays:
            tiles = project_layer(hits, view.placement.rows_of(each.i_object), light.reaching(each.i_object), shape)
            kept = _KeptLayer(shape, LayerTransport(join_tiles(shape.bands, tiles)))
            self._layers[key] = kept
        if kept.radiance is not None and kept.layer == each.layer:
            return kept.radiance
        if kept.factor is None or kept.layer is None or _factor_key(kept.layer) != _factor_key(each.layer):
            rows = view.placement.rows_of(each.i_object)
            kept.factor = np.asarray(
                view_factors(hits, rows, each) * light.reaching(each.i_object).lighting.unit, np.float32
            )
        if kept.layer is None or _curves_key(kept.layer) != _curves_key(each.layer):
            kept.curves = curves_of(each)
        kept.layer, kept.radiance = each.layer, kept.transport.radiance(kept.curves) * kept.factor
        return kept.radiance

    def _n_bounces(self, project: Project, wanted: int | None) -> int:
        """The requested number; None: as many as the scene required when this view was first planned."""
        view, _ = self._made()
        if wanted is not None:
            return wanted
        if self._bounces is None or self._bounces[0] != view.key:
            planned = planned_bounces(view.placement, project.indexed_layers)
            self._bounces = view.key, planned.n_bounces
        return self._bounces[1]

    def _reflected(
        self, project: Project, layers: Sequence[StillLayer], n_bounces: int, plan: Plan
    ) -> NDArray[np.float32]:
        """The radiance that reaches the camera after two bounces and more, (P, 3)."""
        view, light = self._made()
        models = tuple((key, layer.model.name) for key, layer in project.layers.items())
        n_rays = plan.settings.n_hemisphere_rays
        key = (light.key, models, n_bounces, n_rays)
        kept = self._indirect
        if kept is None or kept.key != key:
            finding = find_indirect(
                view.placement, layers, light.sky, BounceSeries(n_bounces), STILL.with_rays(n_rays),
                not n_rays,
            )  # fmt: skip
            found = run_to_end(finding)
            self._indirect = kept = _KeptIndirect(key, found, GatherPolynomial(found))
        edited = tuple(project.layers.items()), tuple(each.bands for each in layers)
        if kept.radiance is None or kept.layers != edited:
            reflecting = reflected_light(kept.light, layers, None, view.placement.hits, kept.polynomial)
            kept.layers, kept.radiance = edited, run_to_end(reflecting)
        return kept.radiance


def _lines_of(project: Project, layers: dict[str, Layer]) -> dict[str, Any]:
    """The overrides of the plan, for these layers and for the whole picture."""
    others = tuple(f"{key}." for key in project.layers if key not in layers)
    return {line: value for line, value in project.overrides.items() if not line.startswith(others)}


def _same_quotient(one: Layer, other: Layer, draft: bool) -> bool:
    """Whether the same transport serves both."""
    same = draft or bool((one.quotient_parameters() == other.quotient_parameters()).all())
    return same and one.model is other.model


def _curves_key(layer: Layer) -> Key:
    """The key of all that the curves depend on."""
    return layer.model.name, layer.parameters, layer.edits


def _factor_key(layer: Layer) -> Key:
    """The key of all that f_q, f_o, texture and weight depend on."""
    view = layer.model.view_factor
    curve = () if view is None else (layer.operators(view.name), layer.parameters)
    return layer.model.name, tuple(layer.scale().tolist()), curve, layer.covers, layer.maps


Mode = Literal["placement", "orbit", "deform", "paths"]
MOST_BOUNCES = 16


class Pictures:
    """The pictures of one scene. What a mode needs is made with its first picture, and cached."""

    def __init__(self) -> None:
        self._placement = PlacementPictures()
        self._catchers: Pictures | None = None  # of shadow catchers alone
        self._orbit: tuple[object, Orbit] | None = None
        self._deform: tuple[object, Deform] | None = None

    def picture(
        self, project: Project, mode: Mode, n_bounces: int | None, n_samples: int, draft: bool = False
    ) -> Picture:
        """Linear radiance (H, W, 3 or 4) float32; see `Scene.image`. Raises InsituError."""
        if mode not in get_args(Mode):
            raise InsituError(f"mode = {mode!r}, expected one of {', '.join(get_args(Mode))}")
        if n_bounces is not None and not 1 <= n_bounces <= MOST_BOUNCES:
            raise InsituError(f"bounces = {n_bounces}, expected 1 to {MOST_BOUNCES}")
        if mode == "paths":
            series = None if n_bounces is None else BounceSeries(n_bounces)
            still = render_project(project, lambda step: None, reference=True, series=series, n_samples=n_samples)
            return still.picture
        (picture, part), alone = self._drawn(project, mode, n_bounces, draft), without_others(project)
        if alone is not None:
            self._catchers = self._catchers or Pictures()
            _, rest = self._catchers._drawn(alone, mode, n_bounces, draft)
            picture = with_caught_shadows(project, picture, part, rest)
        return finished_picture(project.document, picture)

    def _drawn(
        self, project: Project, mode: Mode, n_bounces: int | None, draft: bool = False
    ) -> tuple[Picture, Picture | None]:
        """A picture before the intensity of the light, its background and shadow catchers, and the part of these in it
        (H, W, 4), None where there are none."""
        if mode == "placement":
            return self._placement.picture(project, n_bounces, draft), self._placement.catchers
        draw = self._in_orbit if mode == "orbit" else self._in_deform
        return parts_of(draw(project, n_bounces))

    def error(self, project: Project, mode: Mode, n_bounces: int | None) -> ErrorEstimate:
        """The error of such a picture, estimated by path tracing. Raises InsituError where that is impossible."""
        if mode == "paths":
            raise InsituError("paths know no error of theirs: compare two pictures of other numbers of samples")
        if mode == "placement":
            return self._placement.error(project, n_bounces)
        alone = deform_only_objects(project)
        if mode == "deform" and alone:
            raise InsituError(f"no error estimate: path tracing does not support the surface of {', '.join(alone)}")
        if not project.document.light.intensity:
            raise InsituError("light.intensity = 0, expected more: a black picture has no relative error")
        picture, _ = self._drawn(project, mode, n_bounces)
        drawn = with_intensity(project.document, picture[..., :3])
        estimate = estimate_picture_error(project, drawn, n_bounces)
        assert estimate is not None
        return estimate

    def _in_orbit(self, project: Project, n_bounces: int | None) -> Picture:
        """Orbit's picture at rest, with exact directional lights; what the last one computed is reused."""
        document, scene = project.document, project.scene
        geometry = document.poses, document.new_opacities
        if self._orbit is None or self._orbit[0] != geometry:
            self._orbit = geometry, prepared_orbit(project)
        orbit = self._orbit[1]
        orbit.set_emission({name: tuple(scene.emission[i].tolist()) for i, name in enumerate(scene.object_names)})
        orbit.set_bumps({each.name: each.bumps for each in scene.description.objects})
        orbit.set_light(project.sky)
        orbit.set_layers(layers_by_object(project))
        orbit.set_bounces(n_bounces or project.chosen_bounces or 0)
        finish_work(orbit)
        camera, how = scene.description.camera, _parts_shown(project)
        picture = orbit.draw(camera, scene.resolution, "still", **how)
        if orbit.is_done:
            return picture
        finish_work(orbit)  # the camera sees the back faces of some objects for the first time
        return orbit.draw(camera, scene.resolution, "still", **how)

    def _in_deform(self, project: Project, n_bounces: int | None) -> Picture:
        """Deform's picture at rest; objects that deform cast coarse shadows on all others."""
        document, scene = project.document, project.scene
        posed = [name for name, _ in document.poses]
        surfaces = document.new_bumps, document.new_opacities
        if self._deform is None or self._deform[0] != surfaces:
            resting = project.resting.with_bumps(dict(document.new_bumps))
            self._deform = surfaces, prepared_deform(project, resting, posed)
        deform = self._deform[1]
        deform.set_emission({name: tuple(scene.emission[i].tolist()) for i, name in enumerate(scene.object_names)})
        deform.set_light(project.sky)
        deform.set_layers(layers_by_object(project))
        deform.set_surfaces(document.new_surfaces)
        deform.set_bending(posed)
        deform.set_moved(*moved_objects(document))
        deform.set_bounces(n_bounces or project.chosen_bounces or 0)
        finish_work(deform)
        return deform.draw(scene.description.camera, scene.resolution, document.poses, "rest", **_parts_shown(project))


def _parts_shown(project: Project) -> dict[str, Any]:
    """What Orbit and Deform draw of a project, apart from its objects."""
    return {"transparent": project.document.hides_environment, "apart": caught_objects(project)}


def finish_work(engine: Orbit | Deform) -> None:
    """Do all the work that is left."""
    for _ in engine.work():
        pass
