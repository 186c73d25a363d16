"""The shading points of one scene, and the light there as far as it is known."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from engine.core.generators import StepRunner, run_to_end
from engine.light.emitters import EmitterPatches
from engine.realtime.core.shading_points import ShadingPoints, with_backs, with_rotated_tangents
from engine.realtime.core.view_samples import PointMesh
from engine.realtime.triple_product._slice_kernels import Tables
from engine.realtime.triple_product.glossy_bounces import GlossyTerm, reflect_indirect, second_bounce
from engine.realtime.triple_product.incident import (
    Incident,
    SceneEmitters,
    SkyMap,
    copy_light,
    empty_incident,
    evenly_lit,
    light_points,
    visible_peaks,
    with_glossy_points,
)
from engine.realtime.triple_product.irradiance_bounces import Bounces, Exchange, refining, trace_bounce_rays
from engine.realtime.triple_product.pixel_reflection import empty_shades
from engine.realtime.triple_product.visibility import N_UPPER, Bits, find_enclosed, trace_hemispheres, trace_patches
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene

Float32Array = NDArray[np.float32]
UNLIT, COARSELY, EXACTLY = 0, 1, 2
GLOSSILY = 3  # bounced exactly, and by gloss with its own lobe
_MOST_GLOSSY_TERMS = 16  # that do so: each takes a look at all rays


class LitPoints:
    """Shading points whose visibility and light are computed a few at a time.

    state (S,): how well the current light is known, UNLIT, COARSELY or EXACTLY; traced (S,): whether visibility is
    known; seen (S,): points of the last picture; behind: objects whose backs should get points, because a picture saw
    them or they pass light on; is_bounced: which state of the light the indirect irradiance (S, 3) belongs to, and the
    radiance sent_on (S, 3) that mirrors show; known (S,): whether the point was ever lit, by any light; shadowed (S,):
    whether that light included the point's visibility; n_traced: points traced since the visibility was last stored;
    not_exported (S,): points whose light changed since `gpu_export` exported it. caster: intersects the scene's
    triangles.
    """

    def __init__(
        self, scene: Scene, caster: RayCaster, points: ShadingPoints, n_coefficients: int, n_patches: int,
        is_glossy: NDArray[np.bool_],
    ) -> None:  # fmt: skip
        """caster: intersects the scene's triangles; is_glossy (M,): objects that are not diffuse."""
        self._scene, self.caster, self._n = scene, caster, len(points)
        self.points, self.mesh = points, PointMesh(scene, points)
        self.bits: Bits = np.full((self._n, N_UPPER // 2), 255, np.uint8)
        self.patch_bits: Bits = np.full((self._n, (n_patches + 7) // 8), 255, np.uint8)
        self.incident: Incident = empty_incident(is_glossy[points.i_object], n_coefficients)
        self.shades = empty_shades(self.incident)
        self.colours = np.zeros((self._n, 3), np.float32)
        self.state = np.zeros(self._n, np.uint8)
        self.traced, self.seen, self.known, self.shadowed, self.not_exported = np.zeros((5, self._n), bool)
        self._skip_enclosed()
        # Irradiance of each object's points, summed: before and after they had their shadows.
        self._unshaded, self._shaded = np.zeros((2, len(is_glossy), 3))
        self.n_traced = 0
        self.behind: set[int] = set()
        self._fronts, self._backs = np.arange(self._n), dict[int, NDArray[np.int64]]()
        self._needed = set(np.flatnonzero(points.relays).tolist())
        self._between: Exchange | None = None
        self._to_backs: dict[int, Exchange] = {}
        self.with_backs: list[int] = []
        self.bounces: Bounces | None = None
        self._bounce_steps: StepRunner[Bounces | None] | None = None
        self._sent_by_gloss: dict[tuple[object, ...], list[Float32Array]] = {}
        self._gloss_steps: tuple[tuple[object, ...], StepRunner[list[Float32Array]]] | None = None
        self.indirect, self.sent_on = np.zeros((2, self._n, 3), np.float32)
        self.is_bounced = UNLIT

    @property
    def is_lit(self) -> int:
        """How well the light of all traced points is known."""
        if (self.state == UNLIT).any():
            return UNLIT
        return EXACTLY if self.is_done else COARSELY

    @property
    def is_done(self) -> bool:
        return bool(self.traced.all() and (self.state == EXACTLY).all()) and self.behind.issubset(self.with_backs)

    @property
    def is_outdated(self) -> bool:
        """Whether visible points were traced after they were lit."""
        return bool((self.seen & self.traced & self.known & ~self.shadowed).any())

    @property
    def fraction(self) -> float:
        return float(0.75 * self.traced.mean() + 0.25 * (self.state / EXACTLY).mean()) if self._n else 1.0

    def next_points(self, wanted: NDArray[np.bool_], n: int) -> NDArray[np.int64]:
        """Choose n of the wanted points (S,), visible ones first."""
        found = np.flatnonzero(wanted & self.seen)[:n]
        return found if len(found) else np.flatnonzero(wanted)[:n]

    def light(
        self, which: NDArray[np.int64], sky: SkyMap, emitters: SceneEmitters | None, is_coarse: bool,
        asks_peaks: bool = False,
    ) -> None:  # fmt: skip
        """Light points by what reaches their object; asks_peaks: by rays of their own in coarse light as well."""
        self._forget_gloss()
        traced = which[self.traced[which]]
        asks_peaks |= not is_coarse
        peaks = visible_peaks(self.points, self.caster, sky, traced) if asks_peaks else None
        first = traced[~self.shadowed[traced] & (self.state[traced] != UNLIT)]
        unshaded, i_object = self.incident.irradiance[first], self.points.i_object[first]
        light_points(self.points, self.bits, sky, self.incident, emitters, which, is_coarse, peaks)
        np.add.at(self._unshaded, i_object, unshaded)
        np.add.at(self._shaded, i_object, self.incident.irradiance[first])
        slots = self.incident.slot[which]
        self.shades.key[slots[slots >= 0]] = -1
        self.state[which] = COARSELY if is_coarse else EXACTLY
        self.known[which] = self.not_exported[which] = True
        self.shadowed[which] = self.traced[which]

    def keep_light(self, which: NDArray[np.int64], other: LitPoints, theirs: NDArray[np.int64]) -> None:
        """Take over the exact light of other points: that of theirs (N,) at which (N,)."""
        same = (self.incident.slot[which] >= 0) == (other.incident.slot[theirs] >= 0)
        if self.incident.stored.number.shape[1] != other.incident.stored.number.shape[1]:
            same &= self.incident.slot[which] < 0
        which, theirs = which[same], theirs[same]
        copy_light(self.incident, which, other.incident, theirs)
        self.state[which] = EXACTLY
        self.known[which] = self.not_exported[which] = self.shadowed[which] = True

    def trace(self, which: NDArray[np.int64], patches: tuple[EmitterPatches, NDArray[np.intp]] | None) -> None:
        trace_hemispheres(self.points, self.caster, which, self.bits)
        if patches is not None:
            trace_patches(self.points, self.caster, patches[0], which, self.patch_bits)
        self.traced[which], self.state[which] = True, np.minimum(self.state[which], COARSELY)
        self.n_traced += len(which)

    def move(self, scene: Scene, caster: RayCaster, points: ShadingPoints, mesh: PointMesh) -> None:
        """Take over a scene in which some objects stand elsewhere, and their points with them. What points see, and
        their light, stays as it is."""
        self._scene, self.caster, self.points, self.mesh = scene, caster, points, mesh

    def restore(self, bits: Bits, patch_bits: Bits, backs: list[int], is_glossy: NDArray[np.bool_]) -> None:
        """Restore stored visibility; has no effect if it belongs to other points."""
        if backs:
            self.add_backs(backs, is_glossy)
        if len(bits) == len(self.points):
            self.bits, self.patch_bits = bits, patch_bits
            self.traced[:] = True

    @property
    def is_refined(self) -> bool:
        """Whether more points gather where indirect light has an edge."""
        return self.bounces is not None and self.bounces.between.is_refined

    def send_rays(self) -> None:
        """Trace part of the bounce rays."""
        if self._bounce_steps is None:
            self._bounce_steps = StepRunner(self._sending())
        if self._bounce_steps.advance():
            self.bounces, self._bounce_steps = self._bounce_steps.result, None
            self._forget_gloss()

    @property
    def late(self) -> NDArray[np.int32]:
        """The object of each point (S,) on a back that only cameras requested: such points light nothing else. −1 for
        all others."""
        found = np.full(self._n, -1, np.int32)
        for i_object in self._backs.keys() - self._needed:
            found[self._backs[i_object]] = i_object
        return found

    def _sending(self) -> Generator[None, None, Bounces | None]:
        """Step through the tracing of bounce rays; the result is None if more backs need points first."""
        late = self.late
        if self._needed <= self._backs.keys():
            if self._between is None:
                rows = np.concatenate([self._fronts, *(self._backs[i] for i in sorted(self._needed))])
                self._between = yield from trace_bounce_rays(self.points, self.mesh, late, rows=rows)
            if self._between.behind <= self._needed:
                open_ = late >= 0 if self.points.buried is None else (late >= 0) & ~self.points.buried
                for i in sorted(set(late[open_].tolist()) - self._to_backs.keys()):
                    self._to_backs[i] = yield from trace_bounce_rays(self.points, self.mesh, late, i, self._backs[i])
                return Bounces(self._between, tuple(self._to_backs.values()))
            self._needed |= self._between.behind
            self._between, self._to_backs = None, {}
        self.behind |= self._needed
        return None

    def refine_rays(self, patches: EmitterPatches | None) -> None:
        """Trace part of the additional bounce rays, once all shadows are known."""
        if self._bounce_steps is None:
            self._bounce_steps = StepRunner(self._refining(patches))
        if self._bounce_steps.advance():
            self.bounces, self._bounce_steps, self.is_bounced = self._bounce_steps.result, None, UNLIT
            self._forget_gloss()

    def _refining(self, patches: EmitterPatches | None) -> Generator[None, None, Bounces]:
        assert self.bounces is not None
        shone = evenly_lit(self.points, self.bits, patches, self.patch_bits)
        self._between = yield from refining(self.bounces.between, self.points, self.mesh, shone, self.late)
        return replace(self.bounces, between=self._between)

    def bounce(self, albedos: Float32Array, n_bounces: int, glossy: Sequence[Float32Array] = ()) -> None:
        """Compute the indirect light; albedos (M, 3); glossy: see `Bounces.indirect`."""
        assert self.bounces is not None
        self.is_bounced = self.is_lit
        albedo = albedos[self.points.i_object]
        self.indirect, before = self.bounces.indirect(self._direct(), albedo, n_bounces, glossy)
        self.sent_on = (before * albedo / np.float32(np.pi)).astype(np.float32)

    def bounce_gloss(self, terms: Sequence[GlossyTerm], albedos: Float32Array, n_bounces: int) -> None:
        """Do a piece of computing the indirect light anew, with what the terms of blunt gloss send to other surfaces.
        Terms that have not changed are not computed again while the light stays. Of many terms, those whose points
        reflect the most light are taken, the others by albedo."""
        assert self.bounces is not None
        keys = [term.key for term in terms]
        if self._gloss_steps is not None and self._gloss_steps[0] in keys:
            key, steps = self._gloss_steps
            if steps.advance():
                self._sent_by_gloss[key], self._gloss_steps = steps.result, None
            return
        light = np.bincount(self.points.i_object, self.incident.irradiance.sum(axis=1), len(albedos))
        terms = sorted(terms, key=lambda term: -float(term.albedo.sum() * light[term.i_object]))[:_MOST_GLOSSY_TERMS]
        missing = next((term for term in terms if term.key not in self._sent_by_gloss), None)
        if missing is not None:
            steps = StepRunner(second_bounce(self.bounces, self.points, self.incident, missing))
            self._gloss_steps = missing.key, steps
            return
        self._sent_by_gloss = {term.key: self._sent_by_gloss[term.key] for term in terms}
        if terms:
            found = zip(*self._sent_by_gloss.values(), strict=True)
            self.bounce(albedos, n_bounces, [np.sum(each, axis=0) for each in found])
        self.is_bounced = GLOSSILY

    def _forget_gloss(self) -> None:
        """Light or its paths have changed."""
        self._sent_by_gloss, self._gloss_steps = {}, None

    def _direct(self) -> Float32Array:
        """Direct irradiance (S, 3). Points that are not traced yet are scaled by the mean shadowing of their object's
        traced points, or of all traced points if the object has none."""
        if self.traced.all():
            return self.incident.irradiance
        of_all = self._unshaded == 0.0
        unshaded, shaded = (np.where(of_all, each.sum(axis=0), each) for each in (self._unshaded, self._shaded))
        share = np.divide(shaded, unshaded, out=np.ones_like(shaded), where=unshaded > 0.0)
        shares = np.where(self.traced[:, None], 1.0, np.minimum(share, 1.0)[self.points.i_object])
        return np.asarray(self.incident.irradiance * shares, np.float32)

    def diffuse_radiance(
        self, which: NDArray[np.int64], reflectance: Sequence[float] | None, albedo: NDArray[np.floating] | None,
        n_bounces: int,
    ) -> Float32Array:  # fmt: skip
        """Radiance (N, 3) that points send equally in all directions: of direct light by their reflectance (3,), and of
        further bounces by their albedo (3,), None if mirrored light shows these."""
        sent = np.zeros((len(which), 3), np.float32)
        if reflectance is not None:
            sent += self.incident.irradiance[which] * np.asarray(reflectance, np.float32)
        if n_bounces > 1 and albedo is not None:
            sent += self.indirect[which] * np.asarray(albedo / np.pi, np.float32)
        return sent

    def reflected_indirect(
        self, which: NDArray[np.int64], camera_position: Float32Array, tables: Tables
    ) -> Float32Array:  # fmt: skip
        """Radiance (N, 3) that points reflect to the camera, by slices, of what other surfaces send."""
        if self.bounces is None:
            return np.zeros((len(which), 3), np.float32)
        return reflect_indirect(self.bounces, self.points, which, camera_position, self.sent_on, tables)

    def add_gloss(self, is_glossy: NDArray[np.bool_]) -> None:
        """Allocate coefficients of light for objects (M,) that have become glossy."""
        new = is_glossy[self.points.i_object] & (self.incident.slot < 0)
        if new.any():
            self.incident = with_glossy_points(self.incident, new)
            self.shades = empty_shades(self.incident)
            self.state[new] = UNLIT

    def rotate_tangents(self, scene: Scene) -> None:
        """Rotate tangents as a scene has them. Points whose frames change see and are lit anew."""
        self._scene, points = scene, with_rotated_tangents(self.points, scene)
        changed = (points.tangent != self.points.tangent).any(axis=1)
        self.points, self.mesh = points, self.mesh.of(points)
        self.bits[changed], self.state[changed] = 255, UNLIT
        self.traced[changed] = self.known[changed] = self.shadowed[changed] = False

    def add_backs(self, objects: Sequence[int], is_glossy: NDArray[np.bool_]) -> None:
        """Add points for the backs of objects, one object after the other, so that `restore` finds them in the same
        places if they came at different times."""
        before = self._n
        for each in objects:
            n = len(self.points)
            self.points = with_backs(self.points, np.arange(len(self._scene.smooth)) == each)
            self._backs[each] = np.arange(n, len(self.points))
        if self._scene.tangent_rotations.digest:
            self.points = with_rotated_tangents(self.points, self._scene)
        self._n = len(self.points)
        if self.points.buried is not None:
            of_backs = run_to_end(find_enclosed(self._scene, self.caster, self.points, before))
            self.points = replace(self.points, buried=np.concatenate([self.points.buried, of_backs]))
        self.mesh, self.with_backs = self.mesh.of(self.points), [*self.with_backs, *objects]
        self.bits = _longer(self.bits, self._n, 255)
        self.patch_bits = _longer(self.patch_bits, self._n, 255)
        self.colours, self.state = _longer(self.colours, self._n, 0), _longer(self.state, self._n, UNLIT)
        self.traced, self.seen = _longer(self.traced, self._n, 0), _longer(self.seen, self._n, 0)
        self.known, self.not_exported = _longer(self.known, self._n, 0), _longer(self.not_exported, self._n, 1)
        self.shadowed = _longer(self.shadowed, self._n, 0)
        self.incident = with_glossy_points(self.incident, np.zeros(before, bool), self._n - before)
        self._skip_enclosed()
        self.indirect, self.sent_on = _longer(self.indirect, self._n, 0), _longer(self.sent_on, self._n, 0)
        self.is_bounced = UNLIT
        self.bounces = self._bounce_steps = None
        self._forget_gloss()
        self.add_gloss(is_glossy)

    def _skip_enclosed(self) -> None:
        """Points inside something solid see nothing: mark them as traced without rays."""
        if self.points.buried is not None:
            self.traced |= self.points.buried
            self.bits[self.points.buried] = self.patch_bits[self.points.buried] = 0


def _longer(array: NDArray, n: int, value: int) -> NDArray:
    """Extend an array to n rows, filled with a value."""
    return np.concatenate([array, np.full((n - len(array), *array.shape[1:]), value, array.dtype)])
