"""Orbit, kept: one scene seen from anywhere, its materials and light changed at any time, computed piece by piece.

    orbit = Orbit(scene)
    orbit.set_light(sky)              what is wanted: costs nothing, and may be said again at any time
    orbit.set_layers(layers_of)
    for progress in orbit.work():     what is wanted and not there, the most urgent first, in pieces of some 30 ms
        ...                           between two pieces anything may be set or drawn
    picture = orbit.draw(camera, (512, 384), "moving")

What is drawn is what is known by then: at first without shadows, light coarse before fine, reflections coarse before
fine, where the last picture looked before elsewhere. `version` rises with all that changes pictures, so that a window
knows when another is worth drawing. An object of this class belongs to one thread, holds neither window nor process,
and may be dropped between any two pieces; so may its generators.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from engine.errors import InsituError
from engine.light.emitters import EmitterPatches, emitter_patches
from engine.material.layer import Layer
from engine.orbit import _slice_kernels
from engine.orbit.bounced import Bounces, bouncing
from engine.orbit.incident import Incident, Lamps, light, more_glossy, no_light
from engine.orbit.kept_visibility import deflated, inflated
from engine.orbit.picture import Canvas, Seen, interpolated, picture, reflected, shaded, sunlit
from engine.orbit.shading_points import ShadingPoints, shading_points, with_backs
from engine.orbit.sky import Sky, make_sky
from engine.orbit.slices import Slices, matt_reflectance, slicing
from engine.orbit.visibility import N_UPPER, Bits, see, see_patches
from engine.render.maps import MapFactors
from engine.render.still import StillProgress
from engine.render.surface_maps import mean_factor
from engine.scene.description import CameraDescription
from engine.scene.load import Scene
from engine.scene.raycaster import RayCaster
from engine.steps import finish
from engine.stored_arrays import ArrayReader, Arrays
from engine.threads import even_parts, n_threads, on_threads
from engine.transport.pipeline import SkyState

Floats = NDArray[np.float32]
LayersOf = Mapping[int, Sequence[Layer]]
Quality = Literal["moving", "rest", "still"]
Steps = Iterator[StillProgress]

N_POINTS = 40_000  # besides the meshes' own vertices
N_COEFFICIENTS = 320
N_MOVING = 64  # of these, while something moves
N_PATCHES = 64
N_BOUNCES = 4  # where a scene does not say
MOST_BYTES = 3 << 29
# Of what a pixel reflects: by which a sun may differ among the slices around it and be looked up in them.
_LITTLE = {"rest": 0.005, "still": 0.001}
_LEAST_COEFFICIENTS = 20
_BYTES_A_COEFFICIENT = 8
# Points a piece and thread: some 20 ms.
_COARSE, _FINE, _TRACED = 2048, 384, 128
_STALE, _COARSELY, _EXACTLY = 0, 1, 2


@dataclass(frozen=True)
class _Term:
    """What an object reflects in one sum: layers that are matt, of reflectance ρ (3,), or layers with gloss; and which
    of its visible layers' maps multiply it."""

    i_object: int
    layers: tuple[Layer, ...]
    reflectance: tuple[float, float, float] | None
    factor: int | None = None


class Orbit:
    """A scene of which pictures are drawn from anywhere; see above."""

    def __init__(
        self, scene: Scene, caster: RayCaster | None = None, n_points: int = N_POINTS,
        n_coefficients: int = N_COEFFICIENTS, n_patches: int = N_PATCHES, most_bytes: int = MOST_BYTES,
    ) -> None:  # fmt: skip
        """caster: of the scene's triangles, where there is one; n_points: besides the meshes' vertices; n_coefficients:
        of light, 20 to 5,120 a point; n_patches: of all emitters; most_bytes: what points may keep, see `notes`."""
        self.scene = scene
        self.version = 0
        self.notes: tuple[str, ...] = ()
        self._caster = caster or RayCaster(scene.vertices, scene.triangles)
        self._n_points, self._n_coefficients, self._n_patches = n_points, n_coefficients, n_patches
        self._most_bytes = most_bytes
        self._lit: _Lit | None = None
        self._kept: tuple[Bits, Bits, list[int]] | None = None
        self._patches = _emitters(scene, n_patches)
        self._n_bounces = scene.description.bounces or N_BOUNCES
        self._light, self._sky = SkyState(None), make_sky(None, 0.0)
        self._layers_of: dict[int, tuple[Layer, ...]] = {}
        self._terms: tuple[_Term, ...] = ()
        self._slices: dict[Layer, Slices] = {}
        self._fine: set[Layer] = set()
        self._tables: dict[tuple[Layer, ...], _slice_kernels.Tables] = {}
        self._slicing: tuple[Layer, Generator[float, None, Slices]] | None = None

    # ------------------------------------------------------------------------------------------- what can be kept

    @property
    def geometry(self) -> tuple[NDArray[np.generic] | int, ...]:
        """All that visibility hangs on."""
        scene = self.scene
        arrays = scene.vertices, scene.normals, scene.triangles, scene.object_of_triangle, scene.smooth, scene.emitters
        return (*arrays, self._n_points, self._n_patches)

    @property
    def has_traced(self) -> bool:
        """Whether all that was asked for so far is seen, some of it traced and not restored."""
        return self._lit is not None and self._lit.n_traced > 0 and bool(self._lit.traced.all())

    def stored(self) -> dict[str, NDArray[np.generic]]:
        """The visibility of all points, to be kept by `geometry`. Raises ValueError before any are there."""
        if self._lit is None:
            raise ValueError("nothing is seen yet: expected some steps of work before")
        lit = self._lit
        lit.n_traced = 0
        arrays = {
            "backs": np.array(sorted(lit.with_backs), np.int64),
            "n_points": np.array([len(lit.points)], np.int64),
        }
        return arrays | deflated("bits", lit.bits) | deflated("patch_bits", lit.patch_bits)

    def restore(self, arrays: Arrays) -> None:
        """Become what sees as `stored` gave it, of the same geometry; before any work. Raises UnsoundArrays."""
        reader = ArrayReader(arrays)
        n = int(reader.take("n_points", np.int64, 1)[0])
        backs = reader.take("backs", np.int64, "backs", below=len(self.scene.smooth))
        bits = inflated("bits", reader, n, N_UPPER // 2)
        n_patches = 0 if self._patches is None else len(self._patches[0])
        self._kept = bits, inflated("patch_bits", reader, n, (n_patches + 7) // 8), backs.tolist()

    # ------------------------------------------------------------------------------------------------ what is wanted

    def set_light(self, sky: SkyState) -> None:
        """The distant light from now on."""
        if sky != self._light:
            self._light, self._sky = sky, make_sky(sky.environment, sky.rotation, sky.scale)
            self._stale()

    def shine(self, emission: Mapping[str, tuple[float, float, float]]) -> None:
        """Give emitters, by name, this radiance from now on, see `Scene.shining`."""
        scene = self.scene.shining(emission)
        if not np.array_equal(scene.emission, self.scene.emission):
            self.scene = scene
            if self._lit is not None:
                self._lit.canvas.shines(scene)
            self._stale()

    def set_bounces(self, n_bounces: int) -> None:
        """How often light is reflected between light and eye from now on; at first as the scene says, or 4 times."""
        if n_bounces != self._n_bounces:
            self._n_bounces = n_bounces
            self._rebounce()

    def set_layers(self, layers_of: LayersOf) -> None:
        """The layers of each object, by its index, from now on; what did not change is not computed again."""
        layers = {i: tuple(own) for i, own in layers_of.items() if not self.scene.emitters[i]}
        if layers != self._layers_of:
            self._layers_of, self._terms = layers, tuple(_terms(layers))
            wanted = {layer for term in self._glossy for layer in term.layers}
            self._slices = {layer: slices for layer, slices in self._slices.items() if layer in wanted}
            self._fine &= wanted
            self._tables.clear()
            if self._lit is not None:
                self._lit.need_gloss(self._glossy_objects())
            self._rebounce()

    # ----------------------------------------------------------------------------------------------------- the work

    @property
    def is_ready(self) -> bool:
        """Whether a picture shows more than black: all points have been lit once, if only without shadows."""
        return self._lit is not None and self._lit.was_lit

    @property
    def is_done(self) -> bool:
        """Whether there is no work left."""
        lit = self._lit
        if lit is None or not lit.is_done or any(layer not in self._fine for layer in self._wanted()):
            return False
        return self._n_bounces == 1 or lit.is_bounced == _EXACTLY

    @property
    def fraction(self) -> float:
        """How much of the work is done."""
        return 0.0 if self._lit is None else self._lit.fraction

    @property
    def n_bytes(self) -> int:
        """What points keep."""
        lit = self._lit
        return 0 if lit is None else lit.bits.nbytes + lit.patch_bits.nbytes + lit.incident.n_bytes

    def work(self) -> Steps:
        """All that is missing, piece by piece; ends where nothing is. What is set meanwhile is taken up at once.

        Raises InsituError where the meshes have too many vertices.
        """
        if self._lit is None:
            yield StillProgress(0.0, "shading points")
            self._place()
        while (told := self._piece()) is not None:
            self.version += 1
            yield StillProgress(self.fraction, told)

    def _piece(self) -> str | None:
        """Do what is most urgent; what that was, or None where nothing is left."""
        lit = self._lit
        assert lit is not None
        if missing := [layer for layer in self._wanted() if layer not in self._slices]:
            self._take(missing[0], finish(slicing(missing[0], -1)), False)
            return "reflection"
        if len(which := lit.first(lit.state == _STALE, _COARSE * n_threads())):
            lit.light(which, self._sky, self._lamps(lit), is_coarse=True)
            lit.is_bounced = _STALE
            return "light"
        lit.was_lit = True
        if rough := [layer for layer in self._wanted() if layer not in self._fine]:
            if self._slicing is None or self._slicing[0] not in rough:
                self._slicing = rough[0], slicing(rough[0])
            try:
                next(self._slicing[1])
            except StopIteration as end:
                self._take(self._slicing[0], end.value, True)
                self._slicing = None
            return "reflection"
        if self._n_bounces > 1 and lit.bounces is not None and lit.is_bounced < lit.is_lit:
            lit.bounce(self._albedos(), self._n_bounces)
            return "bounces"
        if len(which := lit.first(lit.traced & (lit.state != _EXACTLY), _FINE * n_threads())):
            lit.light(which, self._sky, self._lamps(lit), is_coarse=False)
            return "light"
        if behind := sorted(lit.behind - lit.with_backs):
            lit.add_backs(behind, self._glossy_objects())
            return "backs"
        if len(which := lit.first(~lit.traced & lit.seen, _TRACED * n_threads())):
            lit.trace(which, self._caster, self._patches)
            return "visibility"
        if self._n_bounces > 1 and lit.bounces is None:
            lit.send_rays()
            return "bounces"
        if len(which := lit.first(~lit.traced, _TRACED * n_threads())):
            lit.trace(which, self._caster, self._patches)
            return "visibility"
        return None

    # ---------------------------------------------------------------------------------------------------- pictures

    def draw(
        self, camera: CameraDescription, resolution: tuple[int, int], quality: Quality = "rest",
        n_moving: int = N_MOVING,
    ) -> Floats:  # fmt: skip
        """Radiance (H, W, 3) as it is known by now; resolution (width, height).

        quality: "moving", as quick as it gets, by n_moving coefficients a point; "rest", every pixel on its own;
        "still", every sun exactly as well. Raises ValueError before `is_ready`.
        """
        return finish(self.drawing(camera, resolution, quality, n_moving))

    def drawing(
        self, camera: CameraDescription, resolution: tuple[int, int], quality: Quality = "rest",
        n_moving: int = N_MOVING,
    ) -> Generator[StillProgress, None, Floats]:  # fmt: skip
        """The same, piece by piece."""
        lit = self._lit
        if lit is None:
            raise ValueError("nothing is ready to be drawn: expected some steps of work before")
        seen = lit.canvas.look(camera, resolution, quality != "moving")
        lit.seen, lit.behind = seen.points_seen(), lit.behind | set(seen.from_behind)
        radiance = np.zeros((len(seen.pixel), 3), np.float32)
        factors: dict[int, Floats] = {}
        for done, term in enumerate(self._terms):
            which = seen.of(term.i_object)
            if not len(which):
                continue
            yield StillProgress(done / len(self._terms), "reflection")
            if term.factor is None:
                self._reflect(lit, seen, which, term, quality, n_moving, radiance)
                continue
            if term.i_object not in factors:
                factors[term.i_object] = self._factors(seen, which, term.i_object)
            own = np.zeros_like(radiance)
            self._reflect(lit, seen, which, term, quality, n_moving, own)
            radiance[which] += own[which] * factors[term.i_object][:, term.factor]
        sky = self._light
        return picture(seen, radiance, sky.environment, sky.rotation, sky.scale)

    def _reflect(
        self, lit: _Lit, seen: Seen, which: NDArray[np.int64], term: _Term, quality: Quality, n: int, radiance: Floats
    ) -> None:
        """Add what a term reflects at samples (N,) of its object, without its maps, to radiance (R, 3)."""
        if self._n_bounces > 1:
            interpolated(seen, which, lit.indirect, radiance, self._albedo(term) / np.pi)
        if term.reflectance is not None:
            interpolated(seen, which, lit.incident.irradiance, radiance, np.array(term.reflectance))
        elif (tables := self._tables_of(term.layers)) is not None:
            if quality != "moving":
                others = reflected(seen, which, lit.incident, tables)
                radiance[which] += others + sunlit(
                    seen, which, lit.incident, self._sky, term.layers, tables, others, _LITTLE[quality]
                )
            else:
                points = np.flatnonzero(lit.seen & (lit.points.i_object == term.i_object))
                shaded(seen, points, lit.incident, tables, n, lit.colours)
                interpolated(seen, which, lit.colours, radiance, np.ones(3))

    def _factors(self, seen: Seen, which: NDArray[np.int64], i_object: int) -> Floats:
        """By what maps multiply the visible layers of an object at samples (N,), (N, K, 3)."""
        maps = MapFactors(self.scene, {i_object: self._layers_of[i_object]})

        def part(start: int, stop: int) -> Floats:
            n = stop - start
            return maps.of_hits(seen.in_scene(which[start:stop]), np.full(n, i_object), np.arange(n))

        return np.concatenate(on_threads(part, *even_parts(len(which))))

    # ------------------------------------------------------------------------------------------------------ within

    @property
    def _glossy(self) -> list[_Term]:
        return [term for term in self._terms if term.reflectance is None]

    def _glossy_objects(self) -> NDArray[np.bool_]:
        found = np.zeros(len(self.scene.smooth), bool)
        found[[term.i_object for term in self._glossy]] = True
        return found

    def _wanted(self) -> list[Layer]:
        """The layers that want slices."""
        return list(dict.fromkeys(layer for term in self._glossy for layer in term.layers))

    def _take(self, layer: Layer, slices: Slices, is_fine: bool) -> None:
        self._slices[layer] = slices
        self._rebounce()
        if is_fine:
            self._fine.add(layer)
        self._tables = {layers: tables for layers, tables in self._tables.items() if layer not in layers}

    def _tables_of(self, layers: tuple[Layer, ...]) -> _slice_kernels.Tables | None:
        """The slices of layers that lie on one another; None while they are not known."""
        if layers not in self._tables:
            if any(layer not in self._slices for layer in layers):
                return None
            total = self._slices[layers[0]]
            for layer in layers[1:]:
                total = total + self._slices[layer]
            self._tables[layers] = total.tables
        return self._tables[layers]

    def _albedo(self, term: _Term) -> NDArray[np.float64]:
        """Of the matt reflection that stands for a term's, (3,); without its maps."""
        if term.reflectance is not None:
            return np.pi * np.array(term.reflectance)
        return np.sum(
            [self._slices[layer].albedo for layer in term.layers if layer in self._slices], axis=0
        ) + np.zeros(3)

    def _albedos(self) -> Floats:
        """The same of all objects, (M, 3), with the means of their maps."""
        albedos = np.zeros((len(self.scene.smooth), 3))
        for term in self._terms:
            maps = term.layers[0].maps
            mean = 1.0 if maps.is_plain else mean_factor(self.scene, term.i_object, maps)
            albedos[term.i_object] += self._albedo(term) * mean
        return albedos.astype(np.float32)

    def _stale(self) -> None:
        if self._lit is not None:
            self._lit.state[:] = _STALE
        self._rebounce()

    def _rebounce(self) -> None:
        if self._lit is not None:
            self._lit.is_bounced = _STALE
        self.version += 1

    def _place(self) -> None:
        points = shading_points(self.scene, self._caster, self._n_points)
        n = self._within_memory(len(points))
        if n < self._n_coefficients and self._n_points:
            points = shading_points(self.scene, self._caster, 0)
            n = self._within_memory(len(points))
        if n < _LEAST_COEFFICIENTS:
            raise InsituError(
                f"{self.scene.file}: {len(points)} vertices, of which Orbit would keep more than "
                f"{self._most_bytes / 2**20:.0f} MiB; expected fewer, or a simpler mesh"
            )
        if n < self._n_coefficients:
            self.notes = (f"{n} coefficients of light a point instead of {self._n_coefficients}, for want of memory",)
        n_patches = 0 if self._patches is None else len(self._patches[0])
        self._lit = _Lit(self.scene, points, n, n_patches, self._glossy_objects())
        if self._kept is not None:
            self._lit.restore(*self._kept, self._glossy_objects())
            self._kept = None
        self.version += 1

    def _within_memory(self, n_points: int) -> int:
        """So many coefficients, at most those wanted, go into memory."""
        rest = self._most_bytes - n_points * (N_UPPER // 2 + self._n_patches // 8 + 128)
        return min(self._n_coefficients, rest // (n_points or 1) // _BYTES_A_COEFFICIENT)

    def _lamps(self, lit: _Lit) -> Lamps | None:
        if self._patches is None:
            return None
        patches, owner = self._patches
        shining = EmitterPatches(
            patches.corners, patches.centre, patches.normal, self.scene.emission[owner], patches.area
        )
        return Lamps(shining, lit.patch_bits)


class _Lit:
    """The shading points of a scene, and what is known of the light there.

    state (S,): how the light that is wanted is known; traced (S,): whether shadows are; seen (S,): what the last
    picture saw; behind: objects whose backs any saw; is_bounced: of which light the indirect irradiance (S, 3) is;
    was_lit: whether there has been light everywhere;
    n_traced: points that were traced since this was stored.
    """

    def __init__(
        self, scene: Scene, points: ShadingPoints, n_coefficients: int, n_patches: int, is_glossy: NDArray[np.bool_]
    ) -> None:
        """is_glossy (M,): objects that do not reflect evenly."""
        self._scene, self._n = scene, len(points)
        self.points, self.canvas = points, Canvas(scene, points)
        self.bits: Bits = np.full((self._n, N_UPPER // 2), 255, np.uint8)
        self.patch_bits: Bits = np.full((self._n, (n_patches + 7) // 8), 255, np.uint8)
        self.incident: Incident = no_light(is_glossy[points.i_object], n_coefficients)
        self.colours = np.zeros((self._n, 3), np.float32)
        self.state = np.zeros(self._n, np.uint8)
        self.traced, self.seen = np.zeros((2, self._n), bool)
        self.was_lit = False
        self.n_traced = 0
        self.behind: set[int] = set()
        self.with_backs: set[int] = set()
        self.bounces: Bounces | None = None
        self._bouncing: Generator[float, None, Bounces] | None = None
        self.indirect = np.zeros((self._n, 3), np.float32)
        self.is_bounced = _STALE

    @property
    def is_lit(self) -> int:
        """How the light of all points is known that has shadows."""
        if (self.state == _STALE).any():
            return _STALE
        return _EXACTLY if self.is_done else _COARSELY

    @property
    def is_done(self) -> bool:
        return bool(self.traced.all() and (self.state == _EXACTLY).all()) and self.behind <= self.with_backs

    @property
    def fraction(self) -> float:
        return float(0.75 * self.traced.mean() + 0.25 * (self.state / _EXACTLY).mean()) if self._n else 1.0

    def first(self, wanted: NDArray[np.bool_], n: int) -> NDArray[np.int64]:
        """n of the points that are wanted (S,), those that are seen before others."""
        found = np.flatnonzero(wanted & self.seen)[:n]
        return found if len(found) else np.flatnonzero(wanted)[:n]

    def light(self, which: NDArray[np.int64], sky: Sky, lamps: Lamps | None, is_coarse: bool) -> None:
        light(self.points, self.bits, sky, self.incident, lamps, which, is_coarse)
        self.state[which] = _COARSELY if is_coarse else _EXACTLY

    def trace(
        self, which: NDArray[np.int64], caster: RayCaster, patches: tuple[EmitterPatches, NDArray[np.intp]] | None
    ) -> None:
        see(self.points, caster, which, self.bits)
        if patches is not None:
            see_patches(self.points, caster, patches[0], which, self.patch_bits)
        self.traced[which], self.state[which] = True, np.minimum(self.state[which], _COARSELY)
        self.n_traced += len(which)

    def restore(self, bits: Bits, patch_bits: Bits, backs: list[int], is_glossy: NDArray[np.bool_]) -> None:
        """Take over what was seen before; nothing where it is of other points."""
        if backs:
            self.add_backs(backs, is_glossy)
        if len(bits) == len(self.points):
            self.bits, self.patch_bits = bits, patch_bits
            self.traced[:] = True

    def send_rays(self) -> None:
        """A part of those by which light bounces on."""
        if self._bouncing is None:
            self._bouncing = bouncing(self.points, self.canvas)
        try:
            next(self._bouncing)
        except StopIteration as end:
            self.bounces, self._bouncing = end.value, None
            self.behind |= end.value.behind

    def bounce(self, albedos: Floats, n_bounces: int) -> None:
        """Find the indirect light; albedos (M, 3)."""
        assert self.bounces is not None
        self.is_bounced = self.is_lit
        self.indirect = self.bounces.indirect(self.incident.irradiance, albedos[self.points.i_object], n_bounces)

    def need_gloss(self, is_glossy: NDArray[np.bool_]) -> None:
        """Keep coefficients of light for objects (M,) that reflect with gloss by now."""
        new = is_glossy[self.points.i_object] & (self.incident.slot < 0)
        if new.any():
            self.incident = more_glossy(self.incident, new)
            self.state[new] = _STALE

    def add_backs(self, objects: Sequence[int], is_glossy: NDArray[np.bool_]) -> None:
        behind = np.zeros(len(self._scene.smooth), bool)
        behind[objects] = True
        before, self.points = self._n, with_backs(self.points, behind)
        self._n = len(self.points)
        self.canvas, self.with_backs = Canvas(self._scene, self.points), self.with_backs | set(objects)
        self.bits = _longer(self.bits, self._n, 255)
        self.patch_bits = _longer(self.patch_bits, self._n, 255)
        self.colours, self.state = _longer(self.colours, self._n, 0), _longer(self.state, self._n, _STALE)
        self.traced, self.seen = _longer(self.traced, self._n, 0), _longer(self.seen, self._n, 0)
        self.incident = more_glossy(self.incident, np.zeros(before, bool), self._n - before)
        self.indirect, self.is_bounced = _longer(self.indirect, self._n, 0), _STALE
        self.bounces = self._bouncing = None
        self.need_gloss(is_glossy)


def _longer(array: NDArray, n: int, value: int) -> NDArray:
    """The array with as many rows more, all of a value, as make it n."""
    return np.concatenate([array, np.full((n - len(array), *array.shape[1:]), value, array.dtype)])


def _emitters(scene: Scene, n_patches: int) -> tuple[EmitterPatches, NDArray[np.intp]] | None:
    """About n_patches patches of all that may shine, now or later, and the object of each; None where nothing may."""
    mine = scene.emitters[scene.object_of_triangle]
    if not mine.any():
        return None
    number = np.repeat(scene.object_of_triangle[mine, None] + 1.0, 3, axis=1)  # where radiance stands in patches
    patches = emitter_patches(scene.vertices[scene.triangles[mine]], number, n_patches)
    return patches, np.rint(patches.radiance[:, 0]).astype(np.intp) - 1


def _terms(layers_of: Mapping[int, Sequence[Layer]]) -> Iterator[_Term]:
    """What is reflected: of each object all matt layers without maps together, all others without, and each with."""
    for i, layers in layers_of.items():
        visible = [layer for layer in layers if layer.visible]
        plain = [layer for layer in visible if layer.maps.is_plain]
        glossy = tuple(layer for layer in plain if _matt(layer) is None)
        matt = [found for layer in plain if (found := _matt(layer)) is not None]
        if matt:
            red, green, blue = np.sum(matt, axis=0)
            yield _Term(i, tuple(layer for layer in plain if layer not in glossy), (red, green, blue))
        if glossy:
            yield _Term(i, glossy, None)
        yield from (_Term(i, (layer,), _matt(layer), k) for k, layer in enumerate(visible) if not layer.maps.is_plain)


@lru_cache(maxsize=256)
def _matt(layer: Layer) -> tuple[float, float, float] | None:
    found = matt_reflectance(layer)
    return None if found is None else (float(found[0]), float(found[1]), float(found[2]))
