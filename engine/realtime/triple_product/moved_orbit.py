"""Pictures of an Orbit whose objects and lamps are moved by hand: what changes follows step by step, coarse first.

    moved = MovedOrbit(orbit)
    moved.move(scene, matrices)       the scene with the objects elsewhere, and how they got there: some milliseconds
    for progress in moved.work():     sees and lights what the movement concerns, the most of it first
        ...                           between two pieces the caller may move on, or draw
    picture = orbit.draw(camera, (512, 384), "moving")

The points of a moved object go along, with what they see in their own frames; for the light there these are turned. A
part of them looks around anew at every step. Of the other points only those change above whose horizon the object was
or is, and they ask the objects that move alone (`moved_visibility`). Directly lit points follow; indirect light stays
as it was before the movement, because its paths would all have to be found again. So does the error that points have
by being placed for where the object was. An Orbit made for the new place takes over when the hand rests
(`kept_points`).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from engine.core.threads import n_threads
from engine.realtime.core.moved_points import move_points
from engine.realtime.core.shading_points import with_backs
from engine.realtime.triple_product.kept_points import FormerPoints
from engine.realtime.triple_product.lit_points import EXACTLY, UNLIT
from engine.realtime.triple_product.moved_visibility import MovedVisibility, see_lamp
from engine.realtime.triple_product.orbit_engine import Orbit, Steps
from engine.realtime.triple_product.scene_patches import ScenePatches
from engine.realtime.triple_product.visibility import trace_coarsely, trace_patches
from engine.render.still import StillProgress
from engine.scene.moved_caster import MovedCaster, MovedPart, RestCaster, movable_part
from engine.scene.scene_loader import Scene
from engine.visibility.moved_objects import rises_above_horizon

Float64Array = NDArray[np.float64]
Rows = NDArray[np.int64]

# Points a piece and thread: about 15 ms. Those that see objects elsewhere, coarsely and again; those that look around
# on objects that moved; those that are lit.
_SEEING, _AGAIN, _LOOKING, _COARSE, _FINE = 1024, 256, 96, 1536, 256
_BURIED_WITHIN = 1.05  # of the radius around an object that stands over a point


class MovedOrbit:
    """Moves objects in the pictures of an Orbit; see the module.

    orbit: whose pictures these are; scene: where everything was precomputed; changed (S,): points that no longer see
    what was precomputed for them, and relit (S,) those whose light may be another.
    """

    def __init__(self, orbit: Orbit) -> None:
        """orbit: is changed from now on. Raises ValueError if it is not ready."""
        if orbit.lit is None or not orbit.is_ready:
            raise ValueError("nothing is ready to be moved: expected some steps of work before")
        self.orbit, self._lit = orbit, orbit.lit
        self.scene, self._points, self._patches = orbit.scene, self._lit.points, orbit.patches
        self._casters_there = orbit.caster, self._lit.mesh.caster
        self._n_backs = len(self._lit.with_backs)
        self._parts = dict[int, tuple[MovedPart, MovedPart]]()
        self._matrices = dict[int, Float64Array]()
        self._cones = self.scene.cones
        self._caster = self._moved_caster(0)
        self._visibility = MovedVisibility(self._lit, self._caster)
        n = len(self._points)
        self.changed, self.relit, self._stale, self._turned, self._coarse = np.zeros((5, n), bool)
        self._waits, self._looks_next = np.zeros(n, np.float32), False

    # ------------------------------------------------------------------------------------------------------ a movement

    def move(self, scene: Scene, matrices: Mapping[int, Float64Array]) -> None:
        """Set where objects stand: the scene, and the affine matrix (4, 4) from where it was precomputed to there, of
        each by index."""
        self._follow_backs()
        there = {i: matrix for i, matrix in matrices.items() if np.ptp(self.scene.triangle_ranges[i])}
        self._set_apart(there.keys() - self._parts.keys())
        there = {i: there.get(i, np.eye(4)) for i in self._parts}
        turned_cones = (scene.cones != self._cones).any(axis=1)
        self._cones = scene.cones
        moving = [i for i, each in there.items() if turned_cones[i] or not np.array_equal(each, self._matrices[i])]
        before, self._matrices = self._caster.spheres_of(moving), there
        self._caster = self._moved_caster(0)
        points = move_points(self._points, scene.object_of_triangle, there)
        mesh = self._lit.mesh.moved(scene, points, self._moved_caster(1), there.keys())
        self._lit.move(scene, self._caster, points, mesh)
        self.orbit.move(scene, self._caster, self._moved_patches(scene))
        self._note(moving, np.concatenate([before, self._caster.spheres_of(moving)]))

    def _set_apart(self, objects: Collection[int]) -> None:
        """Let objects stand apart from the rest. Points find anew what this leaves free, from where all are now."""
        if not objects:
            return
        self._see(np.flatnonzero(self._stale))
        scene, corners = self.scene, self._points.corners.reshape(-1, 3)
        between = np.arange(len(corners)).reshape(-1, 3)
        object_of_part = scene.object_of_triangle[self._points.source]
        for i in objects:
            own = np.arange(*scene.triangle_ranges[i])
            mine = np.flatnonzero(object_of_part == i)
            there, of_points = self._casters_there
            self._parts[i] = (
                movable_part(scene.vertices, scene.triangles, own, there.cutouts),
                movable_part(corners, between, mine, of_points.cutouts),
            )
            self._matrices[i] = np.eye(4)
        self._caster = self._moved_caster(0)
        self._visibility = MovedVisibility(self._lit, self._caster)

    def _moved_caster(self, which: int) -> MovedCaster:
        """Intersects the scene's triangles (0), or those between points (1), with objects where they are now."""
        n = len(self.scene.triangles), len(self._points.source)
        parts = {i: each[which] for i, each in self._parts.items()}
        return MovedCaster(RestCaster(self._casters_there[which], n[which], parts), parts, self._matrices)

    def _note(self, moving: Collection[int], spheres: Float64Array) -> None:
        """Note which points a movement concerns of objects within some spheres, before and after it."""
        lit, i_object = self._lit, self._lit.points.i_object
        own, turned = np.isin(i_object, list(self._parts)), np.isin(i_object, list(moving))
        concerned = rises_above_horizon(spheres, lit.points.position, lit.points.normal)
        self.changed |= concerned | turned
        concerned |= bool(self.scene.emitters[list(moving)].any())
        self._stale |= concerned & ~own
        self._turned |= (concerned | turned) & own
        self.relit |= self._stale | self._turned
        lit.state[turned] = UNLIT
        # What the objects fill of the hemisphere, or filled, goes first; of two alike, what has waited for longer.
        for sphere in spheres.astype(np.float32):
            apart = np.square(lit.points.position - sphere[:3]).sum(axis=1)
            self._waits += np.minimum(sphere[3] ** 2 / np.maximum(apart, np.float32(1e-30)), np.float32(1.0))

    def _moved_patches(self, scene: Scene) -> ScenePatches | None:
        """The emitters' patches where they are now."""
        if self._patches is None:
            return None
        patches, owner = self._patches
        mine = np.isin(owner, list(self._matrices))
        if not mine.any():
            return self._patches
        corners = patches.corners.astype(np.float64)
        for i, matrix in self._matrices.items():
            corners[owner == i] = corners[owner == i] @ matrix[:3, :3].T + matrix[:3, 3]
        return patches.with_corners(corners.astype(np.float32), mine, scene.cones[owner]), owner

    def _follow_backs(self) -> None:
        """Follow backs of objects that pictures have seen since."""
        lit = self._lit
        for i in lit.with_backs[self._n_backs :]:
            self._points = with_backs(self._points, np.arange(len(self.scene.smooth)) == i)
        self._n_backs = len(lit.with_backs)
        n = len(lit.points) - len(self.changed)
        if n:
            self._points = replace(self._points, buried=lit.points.buried)
            self.changed, self.relit = (np.concatenate([each, np.ones(n, bool)]) for each in (self.changed, self.relit))
            self._stale, self._turned, self._coarse = (
                np.concatenate([each, np.zeros(n, bool)]) for each in (self._stale, self._turned, self._coarse)
            )
            self._waits = np.concatenate([self._waits, np.zeros(n, np.float32)])
            self._visibility.follow()

    # ------------------------------------------------------------------------------------------------------- the work

    def work(self) -> Steps:
        """See and light what movements concern, piece by piece, until nothing is left."""
        n_first = max(self._n_left, 1)
        while (piece := self._do_next_piece()) is not None:
            self.orbit.version += 1
            yield StillProgress(max(1.0 - self._n_left / n_first, 0.0), piece)

    @property
    def waits_in_sight(self) -> bool:
        """Whether points in sight are still to be seen or lit anew."""
        lit = self._lit
        waits = self._stale | self._turned | self._coarse | (lit.state == UNLIT) | lit.traced & (lit.state != EXACTLY)
        return bool((waits & lit.seen).any())

    @property
    def former_points(self) -> FormerPoints:
        """What an Orbit for the place where everything is now can take over."""
        self._follow_backs()
        return self.orbit.former_points(self.scene, self._casters_there[0], ~self.changed, ~self.relit)

    @property
    def _n_left(self) -> int:
        return int(np.count_nonzero(self._stale) + np.count_nonzero(self._turned))

    def _do_next_piece(self) -> str | None:
        """Do the most urgent piece and return its name; None if nothing is left."""
        self._follow_backs()
        lit, reflections, n = self._lit, self.orbit.reflections, n_threads()
        if reflections.find_coarse():
            return "reflection"
        unlit = lit.state == UNLIT
        if (unlit & lit.seen).any():
            self._light(lit.next_points(unlit, _COARSE * n))
            return "light"
        for are_seen in (lit.seen, ~lit.seen):
            if self._see_or_look(are_seen):
                return "visibility"
            if len(which := np.flatnonzero(self._coarse & are_seen)[: _AGAIN * n]):
                self._see(which, is_coarse=False)
                return "visibility"
            if len(which := np.flatnonzero(lit.traced & are_seen & (lit.state != EXACTLY))[: _FINE * n]):
                self.orbit.light_points(lit, which, is_coarse=False)
                return "light"
        if unlit.any():
            self._light(lit.next_points(unlit, _COARSE * n))
            return "light"
        if not reflections.is_done:
            reflections.refine()
            return "reflection"
        return None

    def _see_or_look(self, among: NDArray[np.bool_]) -> bool:
        """Let some of these points (S,) see the objects elsewhere, and some on the objects look around, in turn."""
        stale, turned = np.flatnonzero(self._stale & among), np.flatnonzero(self._turned & among)
        self._looks_next = len(turned) > 0 and (self._looks_next or not len(stale))
        if self._looks_next:
            self._look_around(self._longest_waiting(turned, _LOOKING * n_threads()))
        elif len(stale):
            self._see(self._longest_waiting(stale, _SEEING * n_threads()))
        else:
            return False
        self._looks_next = not self._looks_next
        return True

    def _longest_waiting(self, which: Rows, n: int) -> Rows:
        if len(which) > n:
            which = np.sort(which[np.argpartition(-self._waits[which], n)[:n]])
        return which

    def _see(self, which: Rows, is_coarse: bool = True) -> None:
        """Let points (N,) see objects, and lamps, where these are now, and light those that see something else."""
        if not len(which):
            return
        lit, patches, owner = self._lit, None, np.zeros(0, np.intp)
        if self.orbit.patches is not None:
            patches, owner = self.orbit.patches
        lamps = [i for i in self._parts if self.scene.emitters[i]]
        changed = self._visibility.update(self._caster, patches, ~np.isin(owner, lamps), which, is_coarse)
        if patches is not None:
            for i in lamps:
                see_lamp(lit.points, self._caster, patches, owner == i, i, which, lit.patch_bits)
        self._stale[which], self._coarse[which], self._waits[which] = False, is_coarse, 0.0
        self._light(which if lamps and is_coarse else which[changed])

    def _look_around(self, which: Rows) -> None:
        """Trace anew what points (N,) on moved objects see, coarsely."""
        lit = self._lit
        trace_coarsely(lit.points, self._caster, which, lit.bits)
        if self.orbit.patches is not None:
            trace_patches(lit.points, self._caster, self.orbit.patches[0], which, lit.patch_bits)
        self._turned[which], self._waits[which] = False, 0.0
        self._light(which)

    def _light(self, which: Rows) -> None:
        if len(which):
            self.orbit.light_points(self._lit, which, is_coarse=True, asks_peaks=True)
