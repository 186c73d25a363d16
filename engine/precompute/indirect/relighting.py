"""Indirect light while lights change, with fixed materials: by albedo, one source at a time.

Light adds up, so what surfaces reflect is a sum over the sources: the sky, each emitter that changes, and all other
emitters together. Each part is linear in its source [BenArtzi07, eq. 7.4]. An emitter that is dimmed or recoloured is
reflected once, as if it were white, and multiplied by its radiance from then on. A sky that turns is reflected anew at
each angle: the records' rays to it are traced, and the gather points' rays summed.

The triangles of the sky are those of the light at rest, and turn with it. Records sample them by the same few random
numbers at each angle. The noise of neighbouring angles is therefore alike, and at rest it cancels.

What glossy surfaces add is known of the light at rest (`GatherPolynomial`). A source keeps its share of it: emitters in
proportion to their radiance, which is exact for a single one, and the sky as far as it still resembles the sky at rest.
What they mirror of a sky that turns is known at each angle, where rows were made for it (`gloss_rows`); of that, the
share concerns only what the rows leave out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from engine.core.clamping import BRIGHTEST, clamp_radiance, unscaled
from engine.core.generators import map_steps
from engine.light.triangle_lights import TriangleLights, cut_lights, quick_integrals, turned
from engine.precompute.direct.linking import has_one_sky
from engine.precompute.direct.pipeline import SkyState, patches_of
from engine.precompute.direct.relight import is_same_sky, sky_likeness
from engine.precompute.indirect._cache_kernels import Lights
from engine.precompute.indirect.emission import (
    N_LIGHTS,
    N_PATCHES,
    ReachingLights,
    group_lights,
    in_units,
    shares_alone,
    sky_lights,
)
from engine.precompute.indirect.gloss_rows import GlossRows, gloss_rows
from engine.precompute.indirect.indirect_layers import IndirectLayer
from engine.precompute.indirect.indirect_light import IndirectLight
from engine.precompute.indirect.irradiance_cache import direct_irradiance
from engine.precompute.indirect.reflection import OutgoingRadiance
from engine.scene.scene_loader import Scene
from engine.sphere.geodesic import MAX_LEVEL

# Samples of a source by each record: as many as make about this many rays.
_RAYS = 1 << 19
_FEWEST, _MOST = 8, 64
# So many emitters are reflected one by one before it is known which will change.
_MOST_SEPARATE = 3
# What glossy surfaces add is worth rows where it is this share of the indirect light, RMS: in *room* it is 0.055 and
# they add as much noise as they take away, in the tea tray 4.
_LEAST_GLOSS = 0.2

Float32Array = NDArray[np.float32]
RGB = tuple[float, float, float]
Light = TypeVar("Light", bound=Hashable)  # whatever names a light
# What each layer reflects at its gather points, (p, 3).
Reflected = list[Float32Array]
# What each layer reflects of a light, (p, D, 3) by power.
Reflect = Callable[[OutgoingRadiance], Generator[None, None, list[Float32Array]]]


@dataclass(frozen=True, eq=False)
class SceneLight:
    """All light of a scene: its sky, and the radiance (M, 3) of its objects, 0 where they do not emit."""

    sky: SkyState
    emission: Float32Array


@dataclass(frozen=True, eq=False)
class RelitLayer:
    """Indirect radiance (p, 3) of a layer by albedo alone, without f_q and f_o: `now`, and `resting`, in the light at
    rest; gloss (p, 3): how much of what glossy surfaces add to `resting` they still add now; mirrored (p, 3): what they
    add besides, of a sky that has turned."""

    now: Float32Array
    resting: Float32Array
    gloss: Float32Array
    mirrored: Float32Array


@dataclass(frozen=True, eq=False)
class _ReflectedSky:
    """What each layer reflects of a sky by albedo alone, and what glossy surfaces add to that."""

    sky: SkyState
    by_albedo: Reflected
    added: Reflected


class SourceLighting:
    """Lights the records of indirect light by one source at a time. at_rest: the light that was found."""

    def __init__(self, found: IndirectLight, scene: Scene, sky: SkyState) -> None:
        """found: for its records and rays; scene: for its emitters; sky: at rest."""
        self.at_rest = found
        self._light, self._scene, self._resting = found.without_glossy_hits(), scene, sky
        self._n_samples = min(max(_RAYS // max(len(found.cache), 1), _FEWEST), _MOST)
        self._sky_lights, self._unit = self._lights_of(sky)

    @property
    def n_bytes(self) -> int:
        """Memory of the sky's lights."""
        return sum(array.nbytes for each in self._sky_lights for array in each.lights[:-1])

    def by_sky(self, sky: SkyState) -> Generator[None, None, IndirectLight]:
        """The light that the sky alone gives."""
        resting = self._resting
        if sky.environment is not resting.environment or sky.scale != resting.scale or sky.links or resting.links:
            return (yield from self._lit_by(*self._lights_of(sky)))
        degrees = sky.rotation - resting.rotation
        lights = tuple(each._replace(lights=turned_lights(each.lights, degrees)) for each in self._sky_lights)
        return (yield from self._lit_by(lights, self._unit))

    def with_gloss(self, lit: IndirectLight) -> IndirectLight:
        """The same light of the records, of which glossy surfaces reflect what comes to them from records."""
        return replace(lit, points=replace(self.at_rest.points, lights_gloss=False))

    def part_at_rest(self, lit: IndirectLight, alone: SceneLight, weight: RGB) -> IndirectLight:
        """What a light, of this weight in the mix at rest, makes of the light at rest: glossy surfaces and photons too.
        lit: the records by the light alone."""
        rest, gain = self.at_rest, np.array(weight, np.float64)
        lights, cut = rest.all_lights, self._cut_at_rest
        shares = shares_alone(lights, self._scene, cut, rest.unit, alone.sky, alone.emission, gain)
        return rest.part(shares, lit.light.direct * np.asarray(gain * (lit.unit / rest.unit), np.float32))

    @cached_property
    def _cut_at_rest(self) -> TriangleLights | None:
        """The lights of the sky at rest, in the unit of the light at rest."""
        sky = self._resting
        if sky.environment is None:
            return None
        return cut_lights(sky.environment, N_LIGHTS, sky.rotation).scale_by(sky.scale / self.at_rest.unit)

    def by_emitters(
        self, emission: NDArray[np.floating], sky: SkyState, scene: Scene | None = None
    ) -> Generator[None, None, IndirectLight]:
        """The light that objects of this radiance (M, 3) alone give, by the links of a sky. scene: where they are,
        None for where they were found."""
        scene = replace(scene or self._scene, emission=np.asarray(emission, np.float32))
        _, _, unit = in_units(None, patches_of(scene, N_PATCHES), 1.0)
        links = tuple(link._replace(sky=SkyState(None)) for link in sky.links)
        return (yield from self._lit_by(group_lights(scene, SkyState(None, links=links), unit), unit))

    def _lights_of(self, sky: SkyState) -> tuple[tuple[ReachingLights, ...], float]:
        """The lights of a sky, none where it is dark, and their unit."""
        if sky.environment is None:
            return (), 1.0
        integrals = quick_integrals(sky.environment, sky.rotation, MAX_LEVEL)
        lights = cut_lights(sky.environment, N_LIGHTS, sky.rotation, integrals=integrals)
        cut, _, unit = in_units(lights, None, sky.scale)
        if sky.links:
            return group_lights(replace(self._scene, emission=np.zeros_like(self._scene.emission)), sky, unit), unit
        return () if cut is None else (ReachingLights(sky_lights(cut)),), unit

    def _lit_by(self, lights: tuple[ReachingLights, ...], unit: float) -> Generator[None, None, IndirectLight]:
        there = tuple(each for each in lights if len(each.lights.cumulative))
        steps = direct_irradiance(self._light.cache, there, self._n_samples)
        direct = yield from map_steps(steps, lambda fraction: None)
        return replace(self._light, light=replace(self._light.light, direct=direct), unit=unit)


class IndirectRelighting:
    """What layers with fixed materials reflect of changing lights; each source is reflected once for as long as it
    stays."""

    def __init__(
        self, lighting: SourceLighting, resting: SceneLight, layers: Sequence[IndirectLayer], reflect: Reflect
    ) -> None:
        """reflect: what each of the layers reflects of a light."""
        self._lighting, self._resting, self._layers, self._reflect = lighting, resting, layers, reflect
        self._skies: list[_ReflectedSky] = []
        self._changing: dict[int, Reflected] = {}  # emitters by object, as if they were white
        self._others: Reflected | None = None
        self._alone: dict[Hashable, Reflected] = {}  # lights that are alone
        self._with_gloss: set[Hashable] = set()  # those of them that glossy surfaces mirror
        self._rows: GlossRows | None = None
        self._is_prepared = False

    @property
    def n_bytes(self) -> int:
        """Memory of what was reflected of each source, and of rows."""
        of_skies = [part for sky in self._skies for part in (sky.by_albedo, sky.added)]
        parts = [*of_skies, *self._changing.values(), *self._alone.values(), self._others or []]
        of_rows = 0 if self._rows is None else self._rows.n_bytes
        return self._lighting.n_bytes + of_rows + sum(layer.nbytes for part in parts for layer in part)

    def take_over(self, before: IndirectRelighting) -> None:
        """Use what lights alone were reflected of in an earlier light of the same layers, where its rays were these."""
        light, earlier = self._lighting.at_rest, before._lighting.at_rest
        if light.cache is earlier.cache and light.points.samples is earlier.points.samples:
            self._alone, self._with_gloss = before._alone, before._with_gloss

    def prepare(self) -> Generator[None, None, None]:
        """Reflects the sources of the light at rest, and makes rows of what glossy surfaces mirror of the sky, where
        that shows."""
        if self._is_prepared:
            return
        if (yield from self.reflect_sources()):
            sky, found = self._resting.sky, self._lighting.at_rest
            assert sky.environment is not None
            self._rows = yield from gloss_rows(found, self._layers, sky.environment, sky.scale)
            self._skies = []
            yield from self._by_sky(sky)
        self._is_prepared = True

    def reflect_sources(self) -> Generator[None, None, bool]:
        """Reflects the sources of the light at rest, emitters each on its own where there are few; returns whether what
        glossy surfaces mirror of the sky shows."""
        emitters = np.flatnonzero(self._resting.emission.any(axis=1)).tolist()
        yield from self._by_sky(self._resting.sky)
        yield from self._separate(emitters if len(emitters) <= _MOST_SEPARATE else [])
        return self._lighting.at_rest.points.glossy and (yield from self._shows_gloss())

    def _shows_gloss(self) -> Generator[None, None, bool]:
        """Whether what glossy surfaces add at rest is much of the indirect light, and the sky uneven, and the same for
        all objects: rows have no links of it."""
        sky = self._resting.sky
        if sky.environment is None or not has_one_sky(sky):
            return False
        if (sky.environment.radiance == sky.environment.radiance[0, 0]).all():
            return False
        whole = yield from self._reflected(self._lighting.at_rest)
        by_albedo = self._sums(self._skies[0].by_albedo, self._resting.emission)
        squares = total = n = 0.0
        for layer, one, other in zip(self._layers, whole, by_albedo, strict=True):
            squares += float(np.sum(((one - other) * layer.gain) ** 2, dtype=np.float64))
            total, n = total + float(np.sum(one * layer.gain, dtype=np.float64)), n + one.size
        return n > 0 and math.sqrt(squares / n) > _LEAST_GLOSS * total / n

    def forget_alone(self, but: Iterable[Hashable]) -> None:
        """Frees what lights alone were reflected of, except for these."""
        self._alone = {light: self._alone[light] for light in but if light in self._alone}
        self._with_gloss &= self._alone.keys()

    def reflect_alone(self, light: Hashable, alone: SceneLight, weight: RGB) -> Generator[None, None, None]:
        """Reflects a light that is alone in the scene, an emitter or in the sky, once. Where the light at rest has some
        of it, by this weight, so do its rays to glossy surfaces and its photons; else all surfaces reflect by
        albedo."""
        has_gloss = self._lighting.at_rest.points.glossy and all(weight)
        if light in self._alone and (light in self._with_gloss or not has_gloss):
            return
        lit = yield from (
            self._lighting.by_emitters(alone.emission, alone.sky)
            if alone.emission.any()
            else self._lighting.by_sky(alone.sky)
        )
        if has_gloss:
            lit = self._lighting.part_at_rest(lit, alone, weight)
        found = yield from self._reflected(lit)
        gain = np.array(weight if has_gloss else (1.0, 1.0, 1.0), np.float32)
        self._alone[light] = [np.asarray(each / gain, np.float32) for each in found]
        if has_gloss:  # only now, because an edit may have ended the steps before
            self._with_gloss.add(light)

    def mixed(self, now: Mapping[Light, RGB], then: Mapping[Light, RGB]) -> list[RelitLayer] | None:
        """Each layer in a mix of lights that were reflected alone, by their weights, `then` at rest; None where one was
        not. Of what glossy surfaces add at rest to those reflected by albedo, each light keeps its share."""
        shining = [light for light, weight in (*now.items(), *then.items()) if any(weight)]
        if not self._alone or not all(light in self._alone for light in shining):
            return None
        kept = {light: weight for light, weight in now.items() if any(then.get(light, ()))}
        sums = [self._weighted(weights) for weights in (now, then, kept)]
        gloss = _ratios(sums[2], sums[1])
        return [
            RelitLayer(lit, resting, share, np.zeros_like(lit))
            for lit, resting, share in zip(sums[0], sums[1], gloss, strict=True)
        ]

    def _weighted(self, weights: Mapping[Light, RGB]) -> Reflected:
        """What the layers reflect of lights, each times its weight."""
        terms = [(self._alone[light], np.array(weight, np.float32)) for light, weight in weights.items() if any(weight)]
        sums = []
        for i, like in enumerate(next(iter(self._alone.values()))):
            total = np.zeros_like(like)
            for reflected, weight in terms:
                total += reflected[i] * weight
            sums.append(clamp_radiance(total, BRIGHTEST))
        return sums

    def relit(self, light: SceneLight) -> Generator[None, None, list[RelitLayer]]:
        """Each layer under a light. A generator of steps."""
        then, emission = self._resting, light.emission
        sky_then = yield from self._by_sky(then.sky)
        sky_now = yield from self._by_sky(light.sky)
        yield from self._separate(np.flatnonzero((emission != then.emission).any(axis=1)).tolist())
        likeness = sky_likeness(light.sky, then.sky)
        kept_emission = np.where(then.emission > 0.0, emission, np.float32(0.0))
        now, resting = self._sums(sky_now.by_albedo, emission), self._sums(sky_then.by_albedo, then.emission)
        kept = self._sums([each * likeness for each in sky_then.by_albedo], kept_emission)
        gloss = _ratios(kept, resting)
        mirrored = [a - share * b for a, b, share in zip(sky_now.added, sky_then.added, gloss, strict=True)]
        return [RelitLayer(*each) for each in zip(now, resting, gloss, mirrored, strict=True)]

    def relit_moved(self, moved: Scene, lamps: NDArray[np.bool_]) -> Generator[None, None, list[RelitLayer]]:
        """Each layer where some lamps (M,) are elsewhere, in a scene that has them there. What glossy surfaces add at
        rest stays as far as there is as much light by albedo as then. A generator of steps."""
        then = self._resting
        by_sky = (yield from self._by_sky(then.sky)).by_albedo
        yield from self._separate(np.flatnonzero(lamps).tolist())
        emission = np.where(lamps[:, None], then.emission, np.float32(0.0))
        lit = yield from self._lighting.by_emitters(emission, then.sky, moved)
        found = yield from self._reflected(lit)
        staying, resting = self._sums(by_sky, then.emission - emission), self._sums(by_sky, then.emission)
        now = [clamp_radiance(a + b, BRIGHTEST) for a, b in zip(staying, found, strict=True)]
        gloss = [np.minimum(each, np.float32(1.0)) for each in _ratios(now, resting)]
        return [RelitLayer(*each, np.zeros_like(each[0])) for each in zip(now, resting, gloss, strict=True)]

    def _by_sky(self, sky: SkyState) -> Generator[None, None, _ReflectedSky]:
        """What the layers reflect of a sky; that at rest and the newest are stored."""
        for stored in self._skies:
            if is_same_sky(stored.sky, sky):
                return stored
        lit = yield from self._lighting.by_sky(sky)
        if self._rows is None:
            by_albedo = yield from self._reflected(lit)
            added = [np.zeros_like(each) for each in by_albedo]
        else:
            by_albedo, of_records = yield from self._reflected_both(lit)
            of_sky = self._rows.lit(sky)
            added = [a + b - c for a, b, c in zip(of_records, of_sky, by_albedo, strict=True)]
        found = _ReflectedSky(sky, by_albedo, added)
        self._skies = [*self._skies[:1], found]
        return found

    def _reflected(self, light: IndirectLight) -> Generator[None, None, Reflected]:
        found = yield from self._reflect(light.outgoing_radiance(self._layers))
        return [unscaled(each[:, 0], light.unit) for each in found]

    def _reflected_both(self, lit: IndirectLight) -> Generator[None, None, tuple[Reflected, Reflected]]:
        """What the layers reflect of a light of the records by albedo alone, and where glossy surfaces reflect what
        comes to them from records: in one pass over the rays."""
        with_gloss = self._lighting.with_gloss(lit).outgoing_radiance(self._layers)
        both = lit.outgoing_radiance(self._layers).beside(with_gloss)
        found = yield from self._reflect(both)
        by_albedo, of_records = ([unscaled(each[:, i], lit.unit) for each in found] for i in (0, 1))
        return by_albedo, of_records

    def _separate(self, changing: list[int]) -> Generator[None, None, None]:
        """Reflects emitters that begin to change on their own, and all others together."""
        added = [i for i in changing if i not in self._changing]
        for i in added:
            white = np.zeros_like(self._resting.emission)
            white[i] = 1.0
            lit = yield from self._lighting.by_emitters(white, self._resting.sky)
            self._changing[i] = yield from self._reflected(lit)
        if added or self._others is None:
            emission = self._resting.emission.copy()
            emission[list(self._changing)] = 0.0
            lit = yield from self._lighting.by_emitters(emission, self._resting.sky)
            self._others = yield from self._reflected(lit)

    def _sums(self, sky: Reflected, emission: Float32Array) -> Reflected:
        """What the layers reflect of a sky and of emitters with this radiance (M, 3)."""
        assert self._others is not None
        sums = []
        for i, others in enumerate(self._others):
            total = sky[i] + others
            for emitter, white in self._changing.items():
                total = total + white[i] * emission[emitter]
            sums.append(clamp_radiance(total, BRIGHTEST))
        return sums


def _ratios(parts: Reflected, wholes: Reflected) -> Reflected:
    """parts / wholes; where a whole is 0, the ratio of the sums over all layers."""
    part, whole = (sum(np.sum(each, axis=0, dtype=np.float64) for each in all_of) for all_of in (parts, wholes))
    overall = np.divide(part, whole, out=np.ones(3), where=np.asarray(whole) > 0.0).astype(np.float32)
    return [
        np.divide(one, all_, out=np.broadcast_to(overall, all_.shape).copy(), where=all_ > 0.0)
        for one, all_ in zip(parts, wholes, strict=True)
    ]


def turned_lights(lights: Lights, degrees: float) -> Lights:
    """The lights of a sky that is rotated by so many degrees more."""
    corners = turned(lights.corners.reshape(-1, 3), degrees).reshape(-1, 3, 3)
    return lights._replace(corners=np.ascontiguousarray(corners)) if degrees else lights
