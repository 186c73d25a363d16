"""The light that goes between the objects of a scene at rest: its paths, traced once, and what it adds to pictures."""

from __future__ import annotations

from collections.abc import Generator, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from engine.realtime.zonal_harmonics.bending_points import BendingPoints
from engine.realtime.zonal_harmonics.lamp_gloss import LampLight
from engine.realtime.zonal_harmonics.lamp_light import light_of_lamps
from engine.realtime.zonal_harmonics.moving_lamps import MovingLamps
from engine.realtime.zonal_harmonics.neighbours import LightPaths, added_light, local_light, trace_light_paths
from engine.realtime.zonal_harmonics.object_transfer import ORDER
from engine.realtime.zonal_harmonics.picture_renderer import PictureRenderer, shade_own_light
from engine.realtime.zonal_harmonics.pose import Poses
from engine.realtime.zonal_harmonics.shading import BandLight, band_light
from engine.realtime.zonal_harmonics.shading_state import ShadingState
from engine.scene.scene_loader import Scene

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]


class LightBetweenObjects:
    """Light between objects, of which some are `alone`: their transfer contains only themselves; and that of lamps."""

    def __init__(self) -> None:
        self.lamps = MovingLamps()
        self._paths: tuple[tuple[object, ...], LightPaths] | None = None
        self._moved: tuple[str, ...] = ()
        self._lights: Mapping[int, BandLight] = {}
        self._distant: Mapping[int, Float64Array] = {}
        self._added: Float32Array | None = None

    def set_moved(self, moved: tuple[str, ...], lamps: Poses) -> bool:
        """Set the names of objects that stand elsewhere than at rest, which block no light there, and the placements
        of emitters; returns whether they are others than before."""
        if (moved, lamps) == (self._moved, self.lamps.placements):
            return False
        self._moved, self.lamps.placements = moved, lamps
        return True

    def away(self, scene: Scene) -> tuple[int, ...]:
        """The objects that block no light where they rest: those that stand elsewhere, and lamps."""
        is_light = scene.lights
        return tuple(i for i, name in enumerate(scene.object_names) if name in self._moved or is_light[i])

    def is_traced(self, scene: Scene, alone: tuple[int, ...], is_plain: bool) -> bool:
        """Whether it has been traced where light goes between objects, with these alone, and from lamps to them; of
        lamps alone, without shadows, nothing is."""
        return (
            is_plain
            or self._has_paths(scene, alone)
            and self.lamps.first_missing(scene, alone, self.away(scene)) is None
        )

    def _has_paths(self, scene: Scene, alone: tuple[int, ...]) -> bool:
        return self._paths is not None and self._paths[0] == (alone, self.away(scene))

    def take_over_points(self, nearest: NDArray[np.integer] | None) -> None:
        """Forget the paths of points that are made anew; nearest (P,): the former points nearest to the new ones, whose
        light they have until the paths are traced, None for none."""
        self._paths = None
        self.lamps.forget()
        if nearest is not None and self._added is not None:
            self._added = self._added[nearest]

    def trace(self, scene: Scene, points: BendingPoints, alone: tuple[int, ...]) -> Generator[float, None, None]:
        """Trace what is missing next: the light of a lamp, or where light goes between objects; yields the share
        done."""
        away = self.away(scene)
        if (lamp := self.lamps.first_missing(scene, alone, away)) is not None:
            yield from self.lamps.trace(scene, points, lamp, alone, away)
        else:
            paths = yield from trace_light_paths(scene, points, alone, away)
            self._paths = (alone, away), paths

    def added_to(
        self, state: ShadingState, scene: Scene, pictures: PictureRenderer, points: BendingPoints,
        alone: tuple[int, ...], albedos: Float64Array, is_plain: bool = False,
    ) -> ShadingState:  # fmt: skip
        """Add the lamps, and the light between objects, as it is at rest, where it has been traced; scene: at rest;
        albedos (P, 3): the share of light that each point sends on; is_plain: the lamps alone, without shadows."""
        away = self.away(scene)
        if is_plain:
            return self.lamps.added_to(replace(state, is_plain=True), scene, points, alone, away)
        if not self._has_paths(scene, alone):  # what there was
            kept = {i: each for i, each in self._lights.items() if i in alone}
            distant = {i: self._distant[i] for i in kept}
            state = replace(state, lights=kept, distant=distant, added=self._added)
            return self.lamps.added_to(state, scene, points, alone, away)
        assert self._paths is not None
        paths, frames = self._paths[1], points.rest_frames_of_drawn
        lit = self.lamps.added_to(state, scene, points, alone, away)
        # The points that are lit as the sky's transfer says, and by lamps, are first seen by the others.
        of_lamps = light_of_lamps(lit, points, frames, points.rest_places)[0].sum(axis=1)
        white = pictures.shade_at_rest(state) + of_lamps
        first = np.zeros(albedos.shape)
        first[paths.lit] = white[paths.lit] * albedos[paths.lit]
        skies = {i: state.sky_of(i) for i in paths.probes}
        around = local_light(paths, {i: sky.dull_powers for i, sky in skies.items()}, first, ORDER)
        is_open = {i: probe.is_open[skies[i].suns] for i, probe in paths.probes.items()}
        suns = {i: is_open[i][:, None, None] * sky.sun_harmonics for i, sky in skies.items()}
        self._distant = {i: dull + suns[i].sum(axis=0) for i, dull in around.items()}
        self._lights = {i: band_light(each) for i, each in self._distant.items()}
        opaque = [i for i in around if state.is_opaque(i)]
        state = replace(
            state,
            lights=self._lights,
            distant=self._distant,
            mirrored={i: band_light(around[i]) for i in opaque},
            sun_lights={i: tuple(map(LampLight, map(band_light, suns[i]), is_open[i].astype(float))) for i in opaque},
        )
        shade_own_light(state.lights, state.lobes, points, frames, white)
        for i in state.lights:
            white[points.points_of(i)] += of_lamps[points.points_of(i)]
        white = np.maximum(white, np.float32(0.0))
        self._added = added_light(paths, white * albedos).astype(np.float32)
        return self.lamps.added_to(replace(state, added=self._added), scene, points, alone, away)
