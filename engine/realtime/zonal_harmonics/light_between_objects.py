"""The light that goes between the objects of a scene at rest: its paths, traced once, and what it adds to pictures."""

from __future__ import annotations

from collections.abc import Generator, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from engine.precompute.direct.linking import emitter_reach
from engine.realtime.zonal_harmonics.bending_points import BendingPoints
from engine.realtime.zonal_harmonics.lamp_gloss import LampLight
from engine.realtime.zonal_harmonics.neighbours import (
    Lamp,
    LightPaths,
    added_light,
    light_of_lamps,
    local_light,
    trace_light_paths,
)
from engine.realtime.zonal_harmonics.object_transfer import ORDER
from engine.realtime.zonal_harmonics.picture_renderer import PictureRenderer, shade_own_light
from engine.realtime.zonal_harmonics.pose import Poses
from engine.realtime.zonal_harmonics.posed_scene import pose_scene
from engine.realtime.zonal_harmonics.shading import BandLight, band_light
from engine.realtime.zonal_harmonics.shading_state import ShadingState
from engine.scene.scene_loader import Scene

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]


class LightBetweenObjects:
    """Light between objects, of which some are `alone`: their transfer contains only themselves."""

    def __init__(self) -> None:
        self._paths: tuple[tuple[object, ...], LightPaths] | None = None
        self._moved: tuple[str, ...] = ()
        self._lamps: Poses = ()
        self._lit: tuple[Scene, Scene] | None = None
        self._lights: Mapping[int, BandLight] = {}
        self._added: Float32Array | None = None

    def set_moved(self, moved: tuple[str, ...], lamps: Poses) -> bool:
        """Set the names of objects that stand elsewhere than at rest, which block no light there, and the transforms
        of emitters; returns whether they are others than before."""
        if (moved, lamps) == (self._moved, self._lamps):
            return False
        self._moved, self._lamps, self._lit = moved, lamps, None
        return True

    def lit_scene(self, scene: Scene) -> Scene:
        """The scene at rest with its emitters where they shine; the same one as long as both are."""
        if self._lit is None or self._lit[0] is not scene:
            self._lit = scene, pose_scene(scene, self._lamps)
        return self._lit[1]

    def has_paths(self, alone: tuple[int, ...]) -> bool:
        """Whether it has been traced where light goes between objects, with these alone."""
        return self._paths is not None and self._paths[0] == self._made_of(alone)

    def _made_of(self, alone: tuple[int, ...]) -> tuple[object, ...]:
        return alone, self._moved, self._lamps

    def take_over_points(self, nearest: NDArray[np.integer] | None) -> None:
        """Forget the paths of points that are made anew; nearest (P,): the former points nearest to the new ones, whose
        light they have until the paths are traced, None for none."""
        self._paths = None
        if nearest is not None and self._added is not None:
            self._added = self._added[nearest]

    def trace(self, scene: Scene, points: BendingPoints, alone: tuple[int, ...]) -> Generator[float, None, None]:
        """Trace where light goes between objects, see `neighbours`; yields the share done."""
        made_of, away = self._made_of(alone), [i for i, name in enumerate(scene.object_names) if name in self._moved]
        paths = yield from trace_light_paths(self.lit_scene(scene), points, alone, ORDER, away)
        self._paths = made_of, paths

    def added_to(
        self, state: ShadingState, pictures: PictureRenderer, points: BendingPoints,
        alone: tuple[int, ...], opaque: tuple[int, ...], albedos: Float64Array,
    ) -> ShadingState:  # fmt: skip
        """Add the light between objects, as it is at rest, where it has been traced; opaque: those of the objects
        alone that lamps light by rays in pictures at rest; albedos (P, 3): the share of light that each point sends
        on."""
        if not self.has_paths(alone):  # what there was
            return replace(state, lights={i: each for i, each in self._lights.items() if i in alone}, added=self._added)
        assert self._paths is not None
        paths, emission = self._paths[1], state.scene.emission.astype(np.float64)
        reach = emitter_reach(state.light, len(emission))[list(paths.emitters)].T
        if state.light.links:
            paths = paths.linked(reach, points.owners)
        # The points that are lit as the sky's transfer says, and by lamps, are first seen by the others.
        white = pictures.shade_at_rest(state)
        white[paths.lit] += light_of_lamps(paths, emission)
        first = np.zeros(albedos.shape)
        first[paths.lit] = white[paths.lit] * albedos[paths.lit]
        skies = {i: state.sky_of(i) for i in paths.probes}
        around = local_light(paths, {i: sky.dull_powers for i, sky in skies.items()}, first, emission, ORDER)
        is_open = {i: probe.is_open[skies[i].suns] for i, probe in paths.probes.items()}
        suns = {i: is_open[i][:, None, None] * sky.sun_harmonics for i, sky in skies.items()}
        distant = {i: dull + suns[i].sum(axis=0) for i, (dull, _) in around.items()}
        lit = replace(
            state,
            lights={i: band_light(distant[i] + of_lamps.sum(axis=0)) for i, (_, of_lamps) in around.items()},
            unlit={i: band_light(distant[i]) for i in opaque if i in around},
            mirrored={i: band_light(around[i][0]) for i in opaque if i in around},
            lamp_lights={
                i: (
                    *map(LampLight, map(band_light, around[i][1]), paths.probes[i].shares.tolist()),
                    *map(LampLight, map(band_light, suns[i]), is_open[i].astype(float)),
                )
                for i in opaque
                if i in around
            },
        )
        shade_own_light(lit.lights, lit.lobes, points, points.rest_frames_of_drawn, white)
        white = np.maximum(white, np.float32(0.0))
        self._lights = lit.lights
        self._added = added_light(paths, white * albedos, emission).astype(np.float32)
        lamps = tuple(Lamp(*parts, emission[i]) for i, parts in paths.emitters.items())
        by_lamp = np.zeros((len(points), len(lamps), 3), np.float32)
        by_lamp[paths.lit] = paths.lamps * emission[list(paths.emitters)]
        shares = np.zeros((len(points), len(lamps)), np.float32)
        shares[paths.lit] = paths.shares
        return replace(lit, added=self._added, lamps=lamps, by_lamp=by_lamp, lamp_shares=shares, lamp_reach=reach)
