"""A scene's lamps while they move: where a pose has them, and what rays have found of those that rest.

A lamp that moves needs nothing precomputed. Objects that bend have its light by their lobes
(`engine.realtime.zonal_harmonics.lamp_light`); of those at rest, each point sends a few rays to it, whose share that
arrives multiplies the light of all its parts. Their transfer was rejected for that: it knows what hides light from
afar, as the wall behind a lamp does. Once the lamp rests, a ray goes to each part. Lamps hide no light of other lamps,
and none of what objects reflect.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from engine.core.generators import run_to_end
from engine.precompute.direct.linking import emitter_reach
from engine.realtime.zonal_harmonics.bending_points import BendingPoints
from engine.realtime.zonal_harmonics.lamp_gloss import LampLight, view_lamp
from engine.realtime.zonal_harmonics.neighbours import neighbours_of, objects_lit_at_rest
from engine.realtime.zonal_harmonics.pose import Motion, Poses
from engine.realtime.zonal_harmonics.scene_lamps import (
    Lamp,
    LampSample,
    PosedLamps,
    emitters_of,
    lamp_placements,
    light_around,
    light_by_rays,
)
from engine.realtime.zonal_harmonics.shading import band_light
from engine.realtime.zonal_harmonics.shading_state import LampRays, ShadingState
from engine.scene.scene_loader import Scene

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]

N_LIVE, MOST_LIVE = 8, 300_000  # rays of a point to a lamp that moves, and of all points in a picture
MOST_NEAR = 6  # lamps that light each point of a bending object from where they are; others are distant to it


class MovingLamps:
    """The lamps of a scene; `placements`: where they rest, by name."""

    def __init__(self) -> None:
        self.placements: Poses = ()
        self._resting, self._posed = PosedLamps(), PosedLamps()
        self._rays: dict[int, tuple[tuple[object, ...], LampRays]] = {}
        self._live: dict[int, tuple[tuple[object, ...], LampRays]] = {}  # the same by few rays
        self._around: dict[tuple[int, int], tuple[tuple[object, ...], tuple[Float64Array, float]]] = {}
        self._moved: tuple[ShadingState, Poses, ShadingState] | None = None

    def forget(self) -> None:
        """Forget what rays have found: points are made anew."""
        self._rays, self._live, self._around, self._moved = {}, {}, {}, None

    # --------------------------------------------------------------------------------------------------------- at rest

    def first_missing(self, scene: Scene, alone: tuple[int, ...], away: tuple[int, ...]) -> int | None:
        """The first lamp whose light is to be traced anew, None for none. away: what blocks no light at rest."""
        for i in emitters_of(scene):
            if self._known(self._rays, i, self._made_of(scene, i, self.placements, alone, away)) is None:
                return i
        return None

    def trace(
        self, scene: Scene, points: BendingPoints, i: int, alone: tuple[int, ...], away: tuple[int, ...]
    ) -> Generator[float, None, None]:
        """Trace the light of a lamp on objects at rest; yields the share that is done of each."""
        made_of = self._made_of(scene, i, self.placements, alone, away)
        samples = self._lamps(scene, self.placements)[i].samples
        self._rays[i] = made_of, (yield from _traced(scene, points, samples, alone, away))

    def _made_of(
        self, scene: Scene, i: int, placements: Poses, alone: tuple[int, ...], away: tuple[int, ...]
    ) -> tuple[object, ...]:
        return _row(placements, scene.object_names[i]), alone, away

    @staticmethod
    def _known(
        rays: Mapping[int, tuple[tuple[object, ...], LampRays]], i: int, made_of: tuple[object, ...]
    ) -> LampRays | None:
        return rays[i][1] if i in rays and rays[i][0] == made_of else None

    def _by_rays(
        self, scene: Scene, i: int, placements: Poses, alone: tuple[int, ...], away: tuple[int, ...]
    ) -> LampRays | None:
        """The best that is known of a lamp at these placements: where other objects bend than then, as it was."""
        made_of = self._made_of(scene, i, placements, alone, away)
        for rays in self._rays, self._live:
            if (best := self._known(rays, i, made_of)) is not None:
                return best
        return self._rays[i][1] if i in self._rays and self._rays[i][0][0] == made_of[0] else None

    def _lamps(self, scene: Scene, placements: Poses) -> dict[int, Lamp]:
        posed = self._resting if placements == self.placements else self._posed
        return posed.lamps(scene, placements)

    # -------------------------------------------------------------------------------------------------------- pictures

    def lit_scene(self, scene: Scene) -> Scene:
        """The scene at rest with its emitters where they rest."""
        return self._resting.scene(scene, self.placements)

    def added_to(
        self, state: ShadingState, scene: Scene, points: BendingPoints, alone: tuple[int, ...], away: tuple[int, ...]
    ) -> ShadingState:
        """Add the lamps where they rest; scene: at rest."""
        lamps, reach = self._lamps(scene, self.placements), emitter_reach(state.light, len(scene.smooth))
        known = tuple(None if state.is_plain else self._by_rays(scene, i, self.placements, alone, away) for i in lamps)
        state = replace(
            state, emitters=tuple(lamps), lamps=tuple(lamps.values()), placements=self.placements, by_rays=known,
            alone=frozenset(alone), lamp_reach=reach[list(lamps)].T,
        )  # fmt: skip
        return self._with_local_light(state, scene, points, away, points.rest_places)

    def in_pose(
        self, state: ShadingState, scene: Scene, points: BendingPoints, away: tuple[int, ...], poses: Poses
    ) -> ShadingState:
        """The state with the lamps where poses have them, in which the points are."""
        placements = lamp_placements(scene, poses)
        if not state.emitters or placements == state.placements and not state.alone:
            return state
        if self._moved is None or self._moved[0] is not state or self._moved[1] != poses:
            self._moved = state, poses, self._moved_to(state, scene, points, away, placements)
        return self._moved[2]

    def _moved_to(
        self, state: ShadingState, scene: Scene, points: BendingPoints, away: tuple[int, ...], placements: Poses
    ) -> ShadingState:
        if placements != state.placements:
            names = [scene.object_names[i] for i in state.emitters]
            rests = [_row(placements, name) == _row(state.placements, name) for name in names]
            now = tuple(self._lamps(scene, placements).values())
            lamps = tuple(old if still else new for old, new, still in zip(state.lamps, now, rests, strict=True))
            moving = [k for k, still in enumerate(rests) if not still and lamps[k].emission.any()]
            known = list(state.by_rays)
            for k in moving:
                of = state.emitters[k], lamps[k], len(moving)
                known[k] = self._live_rays(state, scene, points, of, away, placements)
            state = replace(
                state, scene=self._posed.scene(scene, placements), placements=placements, lamps=lamps,
                by_rays=tuple(known),
            )  # fmt: skip
        return self._with_local_light(state, scene, points, away, points.places)

    def _live_rays(
        self, state: ShadingState, scene: Scene, points: BendingPoints, of: tuple[int, Lamp, int],
        away: tuple[int, ...], placements: Poses,
    ) -> LampRays | None:  # fmt: skip
        """What few rays find of a lamp where it is now, of: its object, the lamp, how many move; None where points are
        to be drawn without any."""
        (i, lamp, n_moving), alone = of, tuple(sorted(state.alone))
        if state.is_plain:
            return None
        if (best := self._by_rays(scene, i, placements, alone, away)) is not None:
            return best
        n = min(max(MOST_LIVE // max(len(points) * n_moving, 1), 1), N_LIVE)
        step = max(len(lamp.samples) // n, 1)
        found = run_to_end(_traced(scene, points, lamp.samples[step // 2 :: step], alone, away))
        every, lit = np.arange(len(points)), replace(lamp, emission=np.ones(3))
        unblocked = view_lamp(lit, every, points.rest_places, points.rest_frames_of_drawn[:, 2].copy()).unblocked
        found = found._replace(radiance=(unblocked * found.share[:, None]).astype(np.float32))
        self._live[i] = self._made_of(scene, i, placements, alone, away), found
        return found

    def _with_local_light(
        self, state: ShadingState, scene: Scene, points: BendingPoints, away: tuple[int, ...], places: Float32Array
    ) -> ShadingState:
        """What reaches the middles of objects that are alone: the shares of lamps' light that neighbours leave, and
        that light in bands where it is a part of distant light."""
        left, lights, mirrored, unlit = dict[tuple[int, int], float](), dict(state.lights), dict(state.mirrored), {}
        far_lamps = dict[int, dict[int, LampLight]]()
        for i in state.alone.intersection(state.layers_of):
            own = places[points.points_of(i)].astype(np.float64)
            low, high = own.min(axis=0), own.max(axis=0)
            middle, none = 0.5 * (low + high), np.zeros((state.order**2, 3))
            around, nearness = dict[int, Float64Array](), dict[int, float]()
            for k, lamp in enumerate(state.lamps):
                if lamp.emission.any() and state.emitters[k] != i and state.reaches(k, i):
                    harmonics, left[i, k] = self._light_around(state, points, (i, k), middle, away)
                    around[k] = harmonics * lamp.emission
                    away_from = np.linalg.norm(lamp.rows[:, :3].mean(axis=0) - middle)
                    nearness[k] = float(around[k][0].sum() * np.linalg.norm(high - low) / max(away_from, 1e-9))
            if i not in state.distant:
                continue
            if i in state.details or not state.is_opaque(i):
                # What transmits light mirrors lamps by its BRDF, as opaque objects do.
                nearby = sum(around.values(), none) if i in state.details else none
                mirrored[i] = band_light(state.distant[i] + nearby)
            if i in state.details:
                lights[i] = mirrored[i]
            elif len(around) > MOST_NEAR:
                far = sorted(around, key=lambda k: nearness[k])[:-MOST_NEAR]
                if state.is_opaque(i):
                    unlit[i] = lights[i]
                lights[i] = band_light(state.distant[i] + sum((around[k] for k in far), none))
                far_lamps[i] = {k: LampLight(band_light(around[k]), left[i, k]) for k in far}
        return replace(state, shares_left=left, lights=lights, mirrored=mirrored, far_lamps=far_lamps, unlit=unlit)

    def _light_around(
        self, state: ShadingState, points: BendingPoints, of: tuple[int, int], middle: Float64Array,
        away: Iterable[int],
    ) -> tuple[Float64Array, float]:  # fmt: skip
        i, k = of
        lamp = state.lamps[k]
        casters = () if state.is_plain else neighbours_of(points, i, state.alone, tuple(away))
        made_of = *middle.tolist(), casters
        known = self._around.get(of)
        # Lamps of one placement share their samples, whatever they emit.
        if known is None or known[0][0] is not lamp.samples or known[0][1:] != made_of:
            known = (lamp.samples, *made_of), light_around(points, middle, lamp.samples, casters, state.order)
            self._around[of] = known
        return known[1]


def _traced(
    scene: Scene, points: BendingPoints, samples: Sequence[LampSample], alone: tuple[int, ...], away: tuple[int, ...]
) -> Generator[float, None, LampRays]:
    """The light of a lamp's parts, of emission 1, on objects at rest; yields the share that is done of each."""
    casters = tuple(i for i in range(len(scene.smooth)) if i not in away)
    lit = objects_lit_at_rest(scene, alone)
    found = LampRays(frozenset(lit), np.zeros((len(points), 3), np.float32), np.zeros(len(points), np.float32))
    for i in lit:
        of_object = yield from light_by_rays(points, i, samples, casters)
        mine = points.points_of(i)
        found.radiance[mine], found.share[mine] = of_object
    return found


def _row(poses: Poses, name: str) -> Motion:
    return next((row for each, row in poses if each == name), ())
