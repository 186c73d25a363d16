"""Plans what the computation of a scene requires, before any work starts: pure model.

`plan_scene` gives every layer its number of bands, decides whether the sphere's visibility is required, and states the
reason for each choice. `engine.render.cost_pilot` measures the cost on a few hundred points. The user can override
every line.

The number of bands follows from the curve. A curve f is replaced by its piecewise linear fit f_J
(`engine.curve.bands`). The visible effect of the difference is how far light moves between angles, so it is measured on
the running integrals by solid angle [BenArtzi07, sect. 4.3 chooses J manually],

    d(J) = max over gamma of | int_0^gamma (f - f_J) sin | / int_0^(pi/2) f sin,

and J is the least power of two with d(J) <= 0.02. The picture is then within about 0.5 % of the limit of many bands.
(0.005 for a measured highlight, whose true appearance is known.) d falls with J^3, and faster once the bands are
narrower than the curve's features. The largest pointwise difference was rejected: it never falls below half a step at
an edge, however narrow the band. A curve gets at least `EDITABLE_BANDS`: the next edit is unknown, and bands also
determine how finely a light is split before its cosine and quotient are evaluated. A layer that is not to be edited is
computed with as many bands and stores none of them, only its picture (`engine.precompute.direct.bandstore`). A
still stores none either, and uses twice as many. This module imports little, because the window's process uses its
table.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from engine.core.errors import InsituError
from engine.curve.bands import band_nodes, band_values, band_weights
from engine.material import MODELS, kinds
from engine.material.layer import Layer
from engine.material.model import Model
from engine.settings import (
    AS_PLANNED,
    DEFAULT_SETTINGS,
    FIELD_OF_LINE,
    MAX_BANDS_OVERRIDDEN,
    MODE_LINES,
    N_LIGHTS,
    N_PATCHES,
    NEEDED_LINES,
    PICTURE_LINES,
    LineValue,
    RenderSettings,
    checked_bands,
    checked_line,
)

if TYPE_CHECKING:
    from engine.scene.description import SceneDescription
    from engine.scene.scene_loader import Scene

MOST_BANDS = 128
# Bands of an editable curve over each angle: many for highlights, few for slowly varying curves.
EDITABLE_BANDS = {
    kinds.THETA_R: 64,
    kinds.THETA_H: 64,
    kinds.GAMMA_ALPHA: 32,
    kinds.GAMMA_BETA: 32,
    kinds.GAMMA_RATIO: 32,
    kinds.SLOPE_U: 32,
    kinds.SLOPE_V: 32,
    kinds.PHI_H: 16,
    kinds.GAMMA_WIDTH: 64,
    kinds.STREAK: 64,
    kinds.PHI_D: 16,
    kinds.THETA_D: 16,
    kinds.THETA_I: 16,
}
SLOW_ANGLES = (kinds.THETA_I, kinds.THETA_O, kinds.THETA_D, kinds.PHI_D)
BANDWIDTH_TOLERANCE = 0.02
# For measured highlights, which should be within 1 % of the data while unedited. Nickel, whose lobe is half as high at
# 1.1°, has an error of 4 % with 64 bands (d = 0.008) and 0.9 % with 128; broader lobes get 64.
MEASURED_TOLERANCE = 0.005
# Up to about this many lights, tracing the lights of the cut costs less than the sphere's 5,120 directions.
MIN_LIGHTS_FOR_SPHERE = 1280
N_FINE = 512
ONCE_REASON = "light is reflected once"
RAYS_REASON = "as few as the noise of a pilot allows"
PRECISION_REASON = "each coefficient's plane has its own scale, so half floats hold it to 0.05 %"


@dataclass(frozen=True)
class LayerPlan:
    """One layer: bands (J,) or (J, K) of its one or two factors, and the reason for each number.

    editable: whether the bands are stored; of other layers only the picture is. is_node: whether it is one of the
    further nodes of a layer, whose bands are those of that layer's lines.
    """

    key: str
    model: str
    editable: bool
    factors: tuple[str, ...]
    bands: tuple[int, ...]
    reasons: tuple[str, ...]
    is_node: bool = False

    @property
    def shape(self) -> tuple[int, int]:
        """Bands (J, K); K = 1 if there is one factor."""
        return self.bands[0], self.bands[1] if len(self.bands) > 1 else 1


@dataclass(frozen=True)
class Cost:
    """The cost of the plan if nothing is stored yet, extrapolated from `n_sampled` points: within 30 %.

    seconds: processor time in all, of which for visibility and for indirect light; memory, disk, editing and gpu in MiB
    (2^20 bytes): main memory of the precomputing process; main memory that an editor then holds of transport, of
    indirect light, of what is frozen of it for the curve for which that is most, and of rows of a sky that may turn;
    and the GPU's for the largest layer when it is selected. looks_mib, looks_gpu_mib: what looks side by side take at
    most, besides. n_cores: the cores that share the seconds.
    """

    seconds: float
    visibility_seconds: float
    indirect_seconds: float
    memory_mib: float
    disk_mib: float
    editing_mib: float
    gpu_mib: float
    n_points: int
    n_sampled: int
    n_cores: int = 1
    looks_mib: float = 0.0
    looks_gpu_mib: float = 0.0


@dataclass(frozen=True)
class Plan:
    """What is computed for one scene. reasons: the reason for each line; is_still: the result is not edited afterwards.

    bounces: None until a pilot has determined it (`engine.render.bounce_plan`); n_rays: rays per sample set of indirect
    light, 0 for as many as required (`engine.precompute.indirect.ray_budget`); n_edge_rays: one of
    `engine.settings.EDGE_RAYS`; is_still: the result is not edited afterwards; nodes: the number of nodes of each
    parameter map, in words, "" where there is none.
    """

    layers: tuple[LayerPlan, ...]
    settings: RenderSettings
    reasons: Mapping[str, str]
    cost: Cost | None = None
    is_still: bool = False
    nodes: str = ""

    @property
    def n_edge_rays(self) -> int:
        """Rays through a pixel at an edge."""
        return self.settings.n_edge_rays or 0

    @property
    def light_settings(self) -> RenderSettings:
        """The settings that its light is computed with."""
        settings = self.settings
        n_lights, n_patches = settings.n_lights or N_LIGHTS, settings.n_patches or N_PATCHES
        return replace(settings, n_lights=n_lights, n_patches=n_patches).of_light

    def with_light_budget(self, budget: RenderSettings, reasons: Mapping[str, str]) -> Plan:
        """The plan with the numbers of lights and patches that a pilot found sufficient; the sphere remains as the user
        has set it."""
        settings, reasons = self.settings, {**self.reasons, **reasons}
        keeps_sphere = settings.keeps_sphere and (budget.keeps_sphere or "sphere" in settings.overridden)
        if keeps_sphere != settings.keeps_sphere:
            reasons["sphere"] = sphere_reason(True, keeps_sphere)
        n_lights, n_patches = settings.n_lights and budget.n_lights, settings.n_patches and budget.n_patches
        settings = replace(settings, n_lights=n_lights, n_patches=n_patches, keeps_sphere=keeps_sphere)
        return replace(self, settings=settings, reasons=reasons)

    def layer(self, key: str) -> LayerPlan:
        """The plan of one layer, which must exist."""
        return next(plan for plan in self.layers if plan.key == key)


def bands_for_sharpest(layer: Layer, planned: Mapping[str, int], sharpest: int) -> dict[str, int]:
    """J of each transport factor if the user chose J (a power of two) for the sharpest instead of the ``planned``
    number.

    Other curves of highlights are scaled with it; slowly varying curves retain their few bands.
    """
    most = max((planned[f.name] for f in layer.model.factors if f.gamma not in SLOW_ANGLES), default=1)
    counts = {}
    for place, factor in enumerate(layer.model.factors):
        usual = planned[factor.name]
        wanted = min(usual, sharpest) if factor.gamma in SLOW_ANGLES else sharpest * usual // most
        counts[factor.name] = max(1, min(wanted, MAX_BANDS_OVERRIDDEN[place]))
    return counts


def usual_bands(model: Model) -> dict[str, int]:
    """J of each of the transport factors of a model's layers where no curve requires more."""
    return {factor.name: EDITABLE_BANDS[factor.gamma] for factor in model.factors}


def band_counts(layer: Layer, most: int = MOST_BANDS) -> dict[str, int]:
    """J of each of the transport factors of a layer; ``most`` (a power of two) limits them."""
    usual = usual_bands(layer.model)
    return {name: bandwidth(layer, name, most=most, least=min(n, most)) for name, n in usual.items()}


def curve_deviation(layer: Layer, factor: str, n_bands: int) -> float:
    """d(J) of a layer's curve as the module's docstring defines it, over all channels; 0 where the curve is 0."""
    return _deviation(_fine_values(layer, factor), layer.coefficients(factor, n_bands))


def bandwidth(layer: Layer, factor: str, tolerance: float | None = None, most: int = MOST_BANDS, least: int = 1) -> int:
    """The least power of two J from `least` to `most`, both powers of two, with d(J) <= tolerance; None for the layer's
    own."""
    fine = _fine_values(layer, factor)
    tolerance = tolerance_of(layer, factor) if tolerance is None else tolerance
    n_bands = least
    while n_bands < most and _deviation(fine, layer.coefficients(factor, n_bands)) > tolerance:
        n_bands *= 2
    return n_bands


def tolerance_of(layer: Layer, factor: str) -> float:
    """The limit on d(J) for a layer's curve."""
    measured = layer.model.needs_file and layer.model.factor(factor).gamma in kinds.HALF_ANGLES
    return MEASURED_TOLERANCE if measured else BANDWIDTH_TOLERANCE


def plan_scene(
    scene: Scene,
    layers: Mapping[str, Layer],
    *,
    has_sky: bool,
    editable: Collection[str] = (),
    still: bool = False,
    settings: RenderSettings = DEFAULT_SETTINGS,
    overrides: Mapping[str, LineValue] | None = None,
) -> Plan:
    """The plan for the layers by key ("object.index"). editable: keys of the layers that the user will edit; still:
    nothing is stored, so bands cost only time, and each curve gets twice the number of an editable one.

    overrides: values by line of the plan (`engine.settings`). Raises InsituError for a line that is not in the plan
    or an invalid value.
    """
    has_emitters = bool(scene.emitters.any())
    keeps_sphere = has_sky and (settings.n_lights >= MIN_LIGHTS_FOR_SPHERE or not still)
    plan = Plan(
        layers=tuple(_plan_layer(key, layer, key in editable, still) for key, layer in layers.items()),
        settings=replace(
            settings,
            n_lights=settings.n_lights if has_sky else 0,
            n_patches=settings.n_patches if has_emitters else 0,
            n_bounces=scene.description.bounces or AS_PLANNED,
            keeps_sphere=keeps_sphere,
            precision="half",
            n_hemisphere_rays=AS_PLANNED,
            n_edge_rays=planned_edge_rays(scene.description),
        ),
        reasons={
            "lights": "triangles cut from the sky where it is bright" if has_sky else "no sky",
            "patches": "of the emitters" if has_emitters else "no emitters",
            "sphere": sphere_reason(has_sky, keeps_sphere),
            "precision": PRECISION_REASON,
            "bounces": "as the scene says",
            "rays": ONCE_REASON if scene.description.bounces == 1 else RAYS_REASON,
            "edges": edge_reason(planned_edge_rays(scene.description)),
        },
        is_still=still,
    )
    for line, value in (overrides or {}).items():
        plan = _override(plan, line, value)
    return plan


def planned_edge_rays(description: SceneDescription) -> int:
    """Rays through pixels at edges: twice as many for a scene with glossy materials as for a diffuse one, since light
    on narrow rims differs between rays. Depends on the scene's file only: edits do not trace the view anew."""
    models = {layer.model for each in description.objects for layer in each.layers}
    return 8 if all(MODELS[name].is_diffuse for name in models if name in MODELS) else 16


def edge_reason(n_rays: int) -> str:
    """The reason for this number."""
    return "highlights may be narrower than a pixel" if n_rays > 8 else "where objects meet; nothing is glossy"


def plan_lines(plan: Plan) -> Iterator[tuple[str, str, str]]:
    """(line, value, reason) for all lines of the plan, as shown to the user, who may override them."""
    for layer in (each for each in plan.layers if not each.is_node):
        for factor, n_bands, reason in zip(layer.factors, layer.bands, layer.reasons, strict=True):
            yield f"{layer.key}.{factor}", f"{n_bands} bands" + ("" if layer.editable else ", not stored"), reason
    settings = plan.settings
    values = {
        "lights": settings.n_lights,
        "patches": settings.n_patches,
        "sphere": "5,120 directions" if settings.keeps_sphere else "not needed",
        "precision": settings.precision,
        "bounces": settings.n_bounces or "to be planned",
        "rays": _rays_text(settings),
        "edges": f"{plan.n_edge_rays} rays a pixel" if plan.n_edge_rays else "off",
    }
    if plan.nodes:
        values["nodes"] = plan.nodes
    for line, value in values.items():
        yield line, f"{value:,}" if isinstance(value, int) else value, plan.reasons[line]


def _rays_text(settings: RenderSettings) -> str:
    if settings.n_bounces == 1:
        return "none"
    return f"{settings.n_hemisphere_rays:,} per gather point" if settings.n_hemisphere_rays else "as needed"


def _plan_layer(key: str, layer: Layer, editable: bool, still: bool) -> LayerPlan:
    """The plan of one layer: at least `EDITABLE_BANDS` for each curve, more for a narrow one."""
    if still:
        return replace(_plan_still_layer(key, layer), is_node=layer.is_further_node)
    counts = band_counts(layer)
    reasons = []
    for factor in layer.model.factors:
        n_bands = counts[factor.name]
        if n_bands > bandwidth(layer, factor.name):
            reasons.append("room for edits" if editable else "as finely as if it were editable")
        else:
            deviation = curve_deviation(layer, factor.name, n_bands)
            enough = deviation <= tolerance_of(layer, factor.name)
            what = "the curve's own bandwidth" if enough else "the most there are"
            reasons.append(f"{what}, {100 * deviation:.2f} % error")
    factors, bands = tuple(counts), tuple(counts.values())
    return LayerPlan(key, layer.model.name, editable, factors, bands, tuple(reasons), layer.is_further_node)


def _plan_still_layer(key: str, layer: Layer) -> LayerPlan:
    """The plan of one layer of a still: twice the bands of an editable one."""
    counts, reasons = {}, []
    for place, (name, n_bands) in enumerate(band_counts(layer).items()):
        counts[name] = min(2 * n_bands, MOST_BANDS)
        reasons.append("twice as many as for editing")
        # Nothing is stored, so a highlight narrower than the bands for editing gets as many as it requires.
        if place == 0 and layer.model.factors[0].gamma not in SLOW_ANGLES and n_bands == MOST_BANDS:
            most = MAX_BANDS_OVERRIDDEN[0]
            counts[name] = min(2 * bandwidth(layer, name, most=most, least=MOST_BANDS), most)
            reasons[0] = "a highlight narrower than the bands for editing"
    return LayerPlan(key, layer.model.name, False, tuple(counts), tuple(counts.values()), tuple(reasons))


def sphere_reason(has_sky: bool, keeps_sphere: bool) -> str:
    """Why visibility in all directions is computed, or not."""
    if not has_sky:
        return "no sky, so only emitters cast shadows"
    if keeps_sphere:
        return "shadows are reused when the sky changes"
    return f"fewer than {MIN_LIGHTS_FOR_SPHERE:,} lights are traced one by one"


def _override(plan: Plan, line: str, value: LineValue) -> Plan:
    """The plan with one line set by the user. Raises InsituError for a line that does not exist."""
    if any(line in lines for lines in MODE_LINES.values()):
        return plan
    settings = replace(plan.settings, overridden=plan.settings.overridden | {line})
    if line in PICTURE_LINES:
        return _with_line(replace(plan, settings=settings), line, checked_line(line, value))
    for index, layer in enumerate(plan.layers):
        for place, factor in enumerate(layer.factors):
            if line == f"{layer.key}.{factor}":
                layers = (*plan.layers[:index], _with_bands(layer, place, line, value), *plan.layers[index + 1 :])
                return replace(plan, layers=layers, settings=settings)
    there = [name for name, _, _ in plan_lines(plan)]
    raise InsituError(f"the plan has no line {line!r} to override; lines are: {', '.join(there)}")


def _with_line(plan: Plan, line: str, value: LineValue) -> Plan:
    """The plan with a checked value for one of `PICTURE_LINES`; lights that the scene has not are none."""
    settings, reasons = plan.settings, {**plan.reasons, line: "overridden"}
    changes: dict[str, Any] = {FIELD_OF_LINE[line]: value}
    if line in NEEDED_LINES and not getattr(settings, FIELD_OF_LINE[line]):
        return replace(plan, reasons=reasons)
    if line == "sphere":
        changes["keeps_sphere"] = bool(value) and settings.n_lights > 0
    if line == "lights" and plan.is_still and "sphere" not in settings.overridden:
        # The sphere is computed where it then pays.
        changes["keeps_sphere"] = int(value) >= MIN_LIGHTS_FOR_SPHERE
        reasons["sphere"] = sphere_reason(True, changes["keeps_sphere"])
    return replace(plan, settings=replace(settings, **changes), reasons=reasons)


def _with_bands(layer: LayerPlan, place: int, line: str, value: LineValue) -> LayerPlan:
    bands = (*layer.bands[:place], checked_bands(line, value, len(layer.bands)), *layer.bands[place + 1 :])
    reasons = (*layer.reasons[:place], "overridden", *layer.reasons[place + 1 :])
    return replace(layer, bands=bands, reasons=reasons)


def _fine_values(layer: Layer, factor: str) -> np.ndarray:
    """Values of many narrow bands, by solid angle, (N, 3): a stand-in for the curve itself."""
    return band_values(layer.curve(factor), N_FINE, by_solid_angle=True)


def _deviation(fine: np.ndarray, values: np.ndarray) -> float:
    """d(J) of the values of J bands against those of many, see the module's docstring."""
    nodes = band_nodes(len(fine))
    coarse = np.stack([np.interp(nodes, band_nodes(len(values)), channel) for channel in values.T], axis=1)
    weights = band_weights(len(fine), by_solid_angle=True)[:, None]
    total = (fine * weights).sum(axis=0)
    lit = total > 0.0
    if not lit.any():
        return 0.0
    running = np.cumsum((fine - coarse) * weights, axis=0)
    # Limited relative to the largest total: a channel that is almost black does not decide.
    deviation = np.abs(running[:, lit]).max(axis=0) / np.maximum(total[lit], 1e-6 * total.max())
    worst = float(deviation.max())
    return worst if math.isfinite(worst) else 0.0
