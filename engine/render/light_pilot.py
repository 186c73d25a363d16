"""Finds how many lights and patches a picture needs, by trials on some of its points before it is computed.

The effect of fewer lights is measured on the points themselves, with the actual materials: plants under a clear sky
need a quarter of what a copper pot under small bright lamps needs. The pilot takes the least number whose picture
differs by at most `TOLERANCE` from that of the largest allowed number; because errors add up to at most their sum, the
picture's error grows by at most that. A highlight that can be edited may become sharper, so that an editor also tries
it at half the width and three times the brightness. Rejected: mirrors, which would need all lights under every sky with
a sun, though most highlights never become mirrors; and as many lights as each layer needs by itself, because diffuse
layers do not need fewer: their shadows need them.

Unlit points are no reason to take fewer: few patches and many alike miss light that comes through a gap, and black
pictures all agree. Patches are compared with four times the largest allowed number; if even these find no light of a
lamp that emits, or of a sky that is not black, the largest number stays.

Pictures of fewer than `PAYS_FROM` points take less time than the trials.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from engine.core.generators import map_steps
from engine.planner import MIN_LIGHTS_FOR_SPHERE, SLOW_ANGLES, Plan
from engine.precompute.direct.pipeline import Placement, SkyState, final_quality
from engine.precompute.direct.projection import VisibleLight, project_points
from engine.render.still import StillLayer, curves_of, layer_radiance, shape_of
from engine.scene.primary_hits import PrimaryHits
from engine.settings import RenderSettings

# Whole pictures differed by what the points predicted: 0.22 % for 0.2, 0.18 % for 0.1, 0.23 % for 0.2.
TOLERANCE, EDITED_TOLERANCE = 0.004, 0.01
N_POINTS = 768
PAYS_FROM = 50_000
FEWER = (8, 4, 2)
LEAST = {"lights": 500, "patches": 96}
BAND_FACTOR = 4  # fewer patches are compared with this many times the largest allowed number
NARROWER, BRIGHTER = 2, 3.0

# The error if no light was found.
NOT_FOUND = float("inf")

# Radiance (P, 3) with the layers as they are, and with sharper highlights where these can be edited.
Pictures = Sequence[NDArray[np.float64]]


@dataclass(frozen=True)
class LightBudget:
    """The required numbers of lights and patches; errors: by line of the plan, the relative RMS error of a picture with
    these numbers, or with half of them if none can be saved, with the layers as they are and with sharper highlights;
    only of lines that were tried."""

    lights: int
    patches: int
    errors: tuple[tuple[str, float, float], ...] = ()

    def limit_settings(self, most: RenderSettings, is_still: bool = False) -> RenderSettings:
        """Limit settings to these numbers; a still with few lights traces only their shadows."""
        keeps_sphere = most.keeps_sphere and (not is_still or self.lights >= MIN_LIGHTS_FOR_SPHERE)
        return replace(most, n_lights=self.lights, n_patches=self.patches, keeps_sphere=keeps_sphere)

    def reasons(self, most: RenderSettings) -> dict[str, str]:
        """The reasons, by line of the plan."""
        reasons: dict[str, str] = {}
        for line, plain, sharper in self.errors:
            ceiling, needed = (most.n_lights, self.lights) if line == "lights" else (most.n_patches, self.patches)
            fewer = f"{ceiling // FEWER[-1]:,}"
            if needed < ceiling:
                reasons[line] = f"within {100.0 * plain:.1f} % of what {ceiling:,} show"
            elif plain == NOT_FOUND:
                reasons[line] = "no sampled point is lit, though others may be"
            elif plain > TOLERANCE:
                reasons[line] = f"{fewer} would change the picture by {100.0 * plain:.1f} %"
            else:
                error = f"{100.0 * sharper:.1f} % error once its highlights are sharpened"
                reasons[line] = f"{fewer} are enough for the picture as it is, but have {error}"
        return reasons


def is_worthwhile(placement: Placement) -> bool:
    """Whether a picture has enough points for the trials to pay off."""
    return len(placement.hits.pixel) >= PAYS_FROM


def find_light_budget(
    placement: Placement, layers: Sequence[StillLayer], sky: SkyState, most: RenderSettings, is_still: bool = False,
    seed: int = 1,
) -> Generator[None, None, LightBudget]:  # fmt: skip
    """Find numbers of lights and patches, at most those of `most`, for the lines that the user has not overridden;
    yields now and then. Does not change the placement's own visibility."""
    need = LightBudget(most.n_lights, most.n_patches)
    there = {"lights": sky.environment is not None, "patches": bool(placement.scene.emitters.any())}
    lines = [line for line, is_there in there.items() if is_there and line not in most.overridden]
    if not (lines and layers and is_worthwhile(placement)):
        return need
    tried = _Trials(placement, layers, sky, is_still, seed)
    for line in lines:
        ceiling = getattr(need, line)
        numbers = [ceiling // fewer for fewer in FEWER if ceiling // fewer >= LEAST[line]]
        if not numbers:
            continue
        closest = (
            most if line == "lights" else replace(need.limit_settings(most, is_still), n_patches=BAND_FACTOR * ceiling)
        )
        truth = yield from tried.pictures(closest)
        if tried.sees_nothing_of(line):
            need = replace(need, errors=(*need.errors, (line, NOT_FOUND, NOT_FOUND)))
            continue
        for number in numbers:
            fewer = replace(need, **{line: number})
            errors = deviations((yield from tried.pictures(fewer.limit_settings(most, is_still))), truth)
            if errors[0] <= TOLERANCE and errors[1] <= EDITED_TOLERANCE:
                need = replace(fewer, errors=(*need.errors, (line, *errors)))
                break
        else:
            need = replace(need, errors=(*need.errors, (line, *errors)))
    return need


def with_light_budget(
    placement: Placement, layers: Sequence[StillLayer], sky: SkyState, plan: Plan
) -> Generator[None, None, Plan]:
    """Return a plan with the required light."""
    most = plan.light_settings
    need = yield from find_light_budget(placement, layers, sky, most, plan.is_still)
    return plan.with_light_budget(need.limit_settings(most, plan.is_still), need.reasons(most))


def deviations(trial: Pictures, truth: Pictures) -> tuple[float, float]:
    """Relative RMS difference of each of both pictures (P, 3) from another; 0 where that is black."""
    plain, sharper = (deviation(one, two) for one, two in zip(trial, truth, strict=True))
    return plain, sharper


def deviation(trial: NDArray[np.floating], truth: NDArray[np.floating]) -> float:
    """Relative RMS difference of a picture from another; 0 if that is black."""
    mean = float(truth.mean())
    return float(np.sqrt(np.mean((trial - truth) ** 2))) / mean if mean > 0.0 else 0.0


class _Trials:
    """Some points of a picture, and what they reflect with more or fewer lights."""

    def __init__(
        self, placement: Placement, layers: Sequence[StillLayer], sky: SkyState, is_still: bool, seed: int
    ) -> None:
        n_points = len(placement.hits.pixel)
        chosen = np.random.default_rng(seed).choice(n_points, min(N_POINTS, n_points), replace=False)
        self._rows = np.sort(chosen).astype(np.int32)
        self._placement, self._layers, self._sky, self._is_still = placement, layers, sky, is_still
        self._part = placement.at_rows(self._rows)
        self._lit_by = {"lights": False, "patches": False}
        if placement.sphere.done[self._rows].all():
            self._part.sphere.bits[:], self._part.sphere.done[:] = placement.sphere.bits[self._rows], True

    def sees_nothing_of(self, line: str) -> bool:
        """Whether a line's light, though it emits, reached none of the points in the last pictures."""
        return not self._lit_by[line]

    def pictures(self, settings: RenderSettings) -> Generator[None, None, Pictures]:
        """Radiance that the points reflect (P, 3): with the layers as they are, and with sharper highlights where these
        can be edited."""
        part = self._part if settings.keeps_sphere else self._placement.at_rows(self._rows)
        light = yield from map_steps(part.light(self._sky, final_quality(settings)), lambda fraction: None)
        self._lit_by = {"lights": _any_sky(light, self._sky), "patches": bool(light.emitters.bits.any())}
        found = np.zeros((2, len(self._rows), 3))
        for each in self._layers:
            rows = part.rows_of(each.i_object)
            if len(rows):
                found[:, rows] += _reflected(part.hits, rows, each, light, self._is_still)
                yield None
        return list(found)


def _any_sky(light: VisibleLight, sky: SkyState) -> bool:
    """Whether any point sees light of the sky, or the sky has none."""
    lights = light.lighting.sky
    emits = lights.colours.any(axis=1)
    if sky.environment is None or not emits.any():
        return True
    fine, sphere = (
        np.unpackbits(np.bitwise_or.reduce(each.bits, axis=0).view(np.uint8), bitorder="little")
        for each in (light.fine, light.sphere)
    )
    coarse = np.flatnonzero(emits & (lights.fine < 0))
    return bool(fine[lights.fine[emits & (lights.fine >= 0)]].any()) or any(
        sphere[lights.first[m] : lights.first[m] + lights.n_bits[m]].any() for m in coarse
    )


def _reflected(
    hits: PrimaryHits, rows: NDArray[np.int32], each: StillLayer, light: VisibleLight, is_still: bool
) -> NDArray[np.float64]:
    tile = project_points(hits, rows, light, shape_of(each), 0)
    curves, unit = curves_of(each), light.lighting.unit
    plain = layer_radiance(hits, rows, each, tile, unit, curves)
    if is_still or not each.editable or each.layer.model.factors[0].gamma in SLOW_ANGLES:
        return np.stack([plain, plain])
    return np.stack([plain, layer_radiance(hits, rows, each, tile, unit, (_sharper(curves[0]), *curves[1:]))])


def _sharper(curve: NDArray[np.float64]) -> NDArray[np.float64]:
    """A curve (J, 3) of half the width and three times the height."""
    sharp = np.zeros_like(curve)
    sharp[: -(-len(curve) // NARROWER)] = BRIGHTER * curve[::NARROWER]
    return sharp
