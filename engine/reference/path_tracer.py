"""Light after up to N bounces by brute force: paths from the camera, with the whole BRDF at each of their vertices.

The oracle of the indirect light. Like `integrator` it shares the scene, the hits and the rays with what it tests, and
nothing else. At each vertex the sky and the emitters are sampled once each, and the path continues by BRDF sampling;
light that both strategies can find is weighted by the balance heuristic [Veach97, eq. 9.8],

    weight of a direction with density p_1 where the other strategy has p_2  =  p_1 / (p_1 + p_2),

so that the estimate is unbiased for any curves, whatever the densities miss. N counts surface reflections between light
and camera: 1 is direct light. Samples of a pixel come in passes; the random numbers of a pass are scrambled Sobol
points, with a random digital shift for each pixel. Passes are independent of one another, and the difference of two
halves of them gives the noise.
"""

from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from engine.core.frames import local_frames
from engine.core.generators import StillProgress
from engine.core.threads import n_threads, pool
from engine.light.environment import LUMINANCE
from engine.material.layer import Layer
from engine.precompute.direct.linking import emitter_reach
from engine.precompute.direct.pipeline import Placement, SkyState
from engine.precompute.indirect.sampling_settings import MOST_BOUNCES
from engine.reference.path_lights import EmitterLight, LightSamples, LinkedSky, PathLight
from engine.reference.path_lobes import N_NUMBERS, Scattering
from engine.reference.texel_parameters import PixelTexels, TexelParameters, sampling_layers
from engine.scene.map_sampler import MapFactors
from engine.scene.primary_hits import PrimaryHits, emission_towards, object_ids
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene
from engine.scene.shading_frames import shading_frames

Float64Array = NDArray[np.float64]
Rows = NDArray[np.integer]
LayersOf = Mapping[int, Sequence[Layer]]

MOST_SAMPLES = 1 << 20
N_SAMPLES = 64
_PASS, _BATCH = 1024, 1 << 14
_PASSES_PAY = 64  # number of samples from which on passes of a quarter are large enough to be well stratified
# First bounce with Russian roulette. The bounces before it, by which pictures are judged, stay complete.
_FIRST_ROULETTE = 5
# Keeps a picture finite in single precision, whatever the albedo.
_BRIGHTEST = 1e30
_LIGHT_NUMBERS = 3
_ROULETTE = N_NUMBERS + 2 * _LIGHT_NUMBERS  # index of the random number for Russian roulette
_N_NUMBERS = _ROULETTE + 1


@dataclass(frozen=True, eq=False)
class PathEstimate:
    """Radiance (P, 3) float64 towards the camera and its noise: the relative RMS error; None for a single pass."""

    radiance: Float64Array
    noise: float | None


@dataclass(frozen=True, eq=False)
class _Vertices:
    """Path vertices on reflecting surfaces, named as in `PrimaryHits`, (N, 3) float64; the horizon is expressed in
    their frames; objects (N,); factors (N, K, 3) of the layers' textures and weight maps; texels (N, T): values of
    the images of their parameter maps; to_coat (N, 3, 3): from their frame to the coat's, or (N, 0, 0) where those
    are the same."""

    objects: Rows
    position: Float64Array
    lift: Float64Array
    geometric_normal: Float64Array
    horizon: Float64Array
    frame: Float64Array
    wo: Float64Array
    factors: NDArray[np.float32]
    texels: Float64Array
    to_coat: Float64Array

    def origins(self, wi: Float64Array) -> NDArray[np.float32]:
        """Origins of rays along wi (N, 3): on the side of the surface to which they leave."""
        side = np.where(np.einsum("ni,ni->n", wi, self.geometric_normal) >= 0.0, 1.0, -1.0)
        return (self.position + side[:, None] * self.lift).astype(np.float32)

    def of(self, rows: Rows) -> "_Vertices":
        return _Vertices(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    def turns(self, rows: Rows) -> Float64Array | None:
        """The rotations from the base's frame to the coat's of some of them, None where both are the same."""
        return self.to_coat[rows] if self.to_coat.shape[1] else None

    def to_local(self, vectors: Float64Array) -> Float64Array:
        return np.einsum("nij,nj->ni", self.frame, vectors)

    def to_world(self, vectors: Float64Array) -> Float64Array:
        return np.einsum("nij,ni->nj", self.frame, vectors)


class PathTracer:
    """One scene with its materials and lights, ready for path tracing. Safe to use from several threads."""

    def __init__(
        self, scene: Scene, caster: RayCaster, layers_of: LayersOf, sky: SkyState, later: Sequence[LayersOf] = (),
        scattering: Callable[[Sequence[Layer]], Scattering] = Scattering,
    ) -> None:  # fmt: skip
        """layers_of: at the first bounce; later: at the second, the third …, each also at all that follow it;
        scattering: what an object's layers reflect, another for another BRDF of the same images. Layers that have
        parameter maps are evaluated with their values at each hit, see `texel_parameters`."""
        self._scene, self._caster = scene, caster
        n_objects = len(scene.emission)
        # The objects that each emitter lights; None: all of them.
        self._reach = emitter_reach(sky, n_objects) if sky.links else None
        self._emitters = EmitterLight(scene, self._reach)
        linked = LinkedSky(sky, n_objects)
        self._sky = linked if linked.emits else None
        self._lights: list[PathLight] = [self._emitters] if self._emitters.emits else []
        self._lights += [self._sky] if self._sky is not None else []
        stages = [layers_of, *later]
        self._texels = [TexelParameters(scene, each) for each in stages]
        self._scattering = [
            [
                Scattering(layers, sampling_layers(scene, layers), images)
                if (images := texels.images(i))
                else scattering(layers)
                for i, layers in ((i, each.get(i, ())) for i in range(n_objects))
            ]
            for each, texels in zip(stages, self._texels, strict=True)
        ]
        self._maps = [MapFactors(scene, each) for each in stages]
        # The last one is -1, the background.
        able = [any(each[i].reflects for each in self._scattering) for i in range(n_objects)]
        self._reflecting = np.array([*able, False])

    @property
    def maps(self) -> MapFactors:
        """The textures and weight maps at the first bounce."""
        return self._maps[0]

    @property
    def texels(self) -> TexelParameters:
        """The images of parameter maps at the first bounce."""
        return self._texels[0]

    def follow(self, start: _Vertices, numbers: Float64Array) -> Float64Array:
        """Trace one path from each of the first vertices, with random numbers (N, bounces, 11); return the radiance
        (N, 2, 3) of direct light, and of all light."""
        radiance = np.zeros((len(start.objects), 3))
        once = radiance
        path: Rows = np.flatnonzero(self._reflecting[start.objects])
        vertices, weight = start.of(path), np.ones((len(path), 3))
        n_bounces = numbers.shape[1]
        for bounce in range(1, n_bounces + 1):
            if bounce >= _FIRST_ROULETTE:
                kept = _survivors(weight, numbers[path, bounce - 1, _ROULETTE])
                path, vertices, weight = path[kept], vertices.of(kept), weight[kept]
            if not len(path):
                break
            u = numbers[path, bounce - 1]
            wo = vertices.to_local(vertices.wo)
            stage = min(bounce, len(self._maps)) - 1
            # Next event estimation: one sample of each light, weighted by the balance heuristic.
            for i, light in enumerate(self._lights):
                random = u[:, N_NUMBERS + _LIGHT_NUMBERS * i :][:, :_LIGHT_NUMBERS]
                drawn = light.sample(vertices.position, vertices.objects, random)
                radiance[path] += weight * self._from_light(stage, vertices, wo, drawn)
            # BRDF sampling extends the path and adds the light that its rays find.
            path, vertices, weight = self._extend_paths(
                stage, radiance, path, vertices, wo, weight, u, bounce < n_bounces
            )
            once = radiance.copy() if bounce == 1 else once
        return np.minimum(np.stack([once, radiance], axis=1), _BRIGHTEST)

    def _from_light(
        self, stage: int, vertices: _Vertices, wo: Float64Array, drawn: LightSamples
    ) -> Float64Array:  # fmt: skip
        """Radiance (N, 3) from samples (N,) of a light, without the path's throughput; stage: whose layers reflect."""
        found = np.zeros((len(drawn.pdf), 3))
        useful = np.flatnonzero(drawn.pdf > 0.0)
        able = vertices.of(useful)
        # f cosθ, and the density of the same direction by BRDF sampling; skip samples that reflect nothing.
        value, pdf = self._evaluate(stage, able, able.to_local(drawn.wi[useful]), wo[useful])
        bright = value.max(axis=1, initial=0.0) > 0.0
        rows, value, pdf = useful[bright], value[bright], pdf[bright]
        # Shadow rays end just before the emitter.
        distance = None if drawn.distance is None else (drawn.distance[rows] * 0.9999).astype(np.float32)
        origins = vertices.of(rows).origins(drawn.wi[rows])
        lit = ~self._caster.occluded(origins, drawn.wi[rows].astype(np.float32), distance)
        seen = rows[lit]
        # f cosθ L / p_light × p_light / (p_light + p_brdf): the density of the light cancels.
        found[seen] = value[lit] * drawn.radiance[seen] / (pdf[lit] + drawn.pdf[seen])[:, None]
        return found

    def _extend_paths(
        self,
        stage: int,
        radiance: Float64Array,
        path: Rows,
        vertices: _Vertices,
        wo: Float64Array,
        weight: Float64Array,
        u: Float64Array,
        on: bool,
    ) -> tuple[Rows, _Vertices, Float64Array]:
        """Sample directions, add the light that they find to the radiance, and return the vertices where paths
        continue."""
        # Sample the BRDF; throughput × f cosθ / p.
        local = self._sample(stage, vertices, u[:, :N_NUMBERS], wo)
        value, pdf = self._evaluate(stage, vertices, local, wo)
        kept = np.flatnonzero((value.max(axis=1, initial=0.0) > 0.0) & (pdf > 0.0))
        path, vertices, pdf = path[kept], vertices.of(kept), pdf[kept]
        weight = np.minimum(weight[kept] * (value[kept] / pdf[:, None]), _BRIGHTEST)
        wi = vertices.to_world(local[kept])
        directions = wi.astype(np.float32)
        found = self._caster.intersect(vertices.origins(wi), directions)
        ids = object_ids(self._scene, found)
        # Sky: rays that miss, weighted by the balance heuristic.
        if self._sky is not None:
            out = np.flatnonzero(ids < 0)
            at = vertices.objects[out]
            share = pdf[out] / (pdf[out] + self._sky.pdf(at, wi[out]))
            radiance[path[out]] += weight[out] * share[:, None] * self._sky.radiance(at, wi[out])
        # Emitters that rays hit and that light the object where the rays begin, weighted likewise.
        emission = emission_towards(self._scene, found, ids, directions)
        if self._reach is not None:
            emission[~self._reach[ids, vertices.objects]] = 0.0
        lamp = np.flatnonzero(emission.any(axis=1))
        if len(lamp):
            other = self._emitters.pdf(found.of(lamp), wi[lamp])
            radiance[path[lamp]] += weight[lamp] * (pdf[lamp] / (pdf[lamp] + other))[:, None] * emission[lamp]
        # Paths continue where rays hit reflecting surfaces.
        rows = np.flatnonzero(self._reflecting[ids]) if on else np.zeros(0, np.int64)
        frames = shading_frames(self._scene, self._caster, found, ids, rows, -directions[rows])
        following = min(stage + 1, len(self._maps) - 1)
        factors = self._maps[following].at_path_vertices(found, ids, rows)
        texels = self._texels[following].at_path_vertices(found, ids, rows)
        return path[rows], _vertices(ids[rows], frames, factors, texels), weight[rows]

    def _evaluate(
        self, stage: int, vertices: _Vertices, wi: Float64Array, wo: Float64Array
    ) -> tuple[Float64Array, Float64Array]:
        value, pdf = np.zeros((len(wi), 3)), np.zeros(len(wi))
        for i in np.unique(vertices.objects):
            rows = np.flatnonzero(vertices.objects == i)
            value[rows], pdf[rows] = self._scattering[stage][int(i)].evaluate(
                wi[rows], wo[rows], vertices.factors[rows], vertices.texels[rows], vertices.turns(rows)
            )
        value[np.einsum("ni,ni->n", wi, vertices.horizon) <= 0.0] = 0.0
        return value, pdf

    def _sample(self, stage: int, vertices: _Vertices, u: Float64Array, wo: Float64Array) -> Float64Array:
        wi = np.empty((len(wo), 3))
        for i in np.unique(vertices.objects):
            rows = np.flatnonzero(vertices.objects == i)
            wi[rows] = self._scattering[stage][int(i)].sample(u[rows], wo[rows], vertices.turns(rows))
        return wi


def trace_paths(
    placement: Placement,
    layers_of: Mapping[int, Sequence[Layer]],
    sky: SkyState,
    n_bounces: int,
    n_samples: int = N_SAMPLES,
    seed: int = 0,
    rows: Rows | None = None,
    scattering: Callable[[Sequence[Layer]], Scattering] = Scattering,
) -> Generator[StillProgress, None, PathEstimate]:
    """Trace the radiance of some rows of the placement's hits (default: all) after up to n_bounces reflections.

    scattering: see `PathTracer`. The same seed and rows give the same numbers. Raises ValueError for bounces outside 1
    to 16 and samples outside 1 to 2^20.
    """
    sums, counts = yield from _trace(placement, layers_of, sky, n_bounces, n_samples, seed, rows, scattering=scattering)
    last = _progress(sums[:, :, 1], counts, n_samples)
    yield last
    return PathEstimate(sums[:, :, 1].sum(axis=0) / n_samples, last.noise)


def trace_halves(
    placement: Placement,
    layers_of: LayersOf,
    sky: SkyState,
    n_bounces: int,
    n_samples: int,
    seed: int,
    rows: Rows,
    later: Sequence[LayersOf] = (),
) -> Generator[StillProgress, None, Float64Array]:
    """The same from each half of the samples, at least two, which are independent: (2, p, 2, 3), direct light and all
    light. later: other layers at later bounces, see `PathTracer`, for series of simpler materials [BenArtzi07, 5.2]."""
    sums, counts = yield from _trace(placement, layers_of, sky, n_bounces, n_samples, seed, rows, later)
    return sums / counts[:, None, None, None]


def _trace(
    placement: Placement,
    layers_of: Mapping[int, Sequence[Layer]],
    sky: SkyState,
    n_bounces: int,
    n_samples: int,
    seed: int,
    rows: Rows | None,
    later: Sequence[LayersOf] = (),
    scattering: Callable[[Sequence[Layer]], Scattering] = Scattering,
) -> Generator[StillProgress, None, tuple[Float64Array, NDArray[np.integer]]]:
    """Sums (2, p, 2, 3) over both halves of the samples, as in `trace_halves`, and the number of samples in each
    (2,)."""
    if not 1 <= n_bounces <= MOST_BOUNCES:
        raise ValueError(f"n_bounces = {n_bounces}, expected 1 to {MOST_BOUNCES}")
    if not 1 <= n_samples <= MOST_SAMPLES:
        raise ValueError(f"n_samples = {n_samples}, expected 1 to {MOST_SAMPLES}")
    rows = np.arange(len(placement.hits.pixel)) if rows is None else np.asarray(rows)
    tracer = PathTracer(placement.scene, placement.caster, layers_of, sky, later, scattering)
    seen = tracer.maps.at_primary_hits(placement.caster, placement.hits)
    texels = tracer.texels.in_pixels(placement.caster, placement.hits)
    sizes = _pass_sizes(n_samples)
    halves, counts = np.zeros((2, len(rows), 2, 3)), np.zeros(2, int)
    for i_pass, n in enumerate(sizes):
        progress = _progress(halves[:, :, 1], counts, n_samples)
        blocks = np.array_split(np.arange(len(rows)), max(1, -(-len(rows) * n // _BATCH)))
        points = _sobol_points(n, n_bounces, (seed, i_pass))
        work = _pass_work(placement.hits, seen, texels, rows, tracer, points, (seed, i_pass))
        with pool() as threads:
            for i in range(0, len(blocks), n_threads()):
                group = list(enumerate(blocks))[i : i + n_threads()]
                for (_, block), found in zip(group, threads.map(work, group), strict=True):
                    halves[i_pass % 2, block] += found
                done = (counts.sum() + n * (i + len(group)) / len(blocks)) / n_samples
                yield replace(progress, fraction=float(done))
        counts[i_pass % 2] += n
    return halves, counts


def noise_of_halves(halves: Float64Array, counts: NDArray[np.integer]) -> float:
    """Relative RMS error of the mean of all samples, from the sums (2, P, 3) over two halves of counts (2,).

    With n = n_1 + n_2 samples and the halves' means A and B, E (A - B)^2 = sigma^2 n / (n_1 n_2), and the mean of all
    samples has variance sigma^2 / n.
    """
    n = int(counts.sum())
    mean = float(halves.sum()) / (n * halves[0].size) if halves[0].size else 0.0
    if not mean > 0.0:
        return 0.0
    difference = (halves[0] / counts[0] - halves[1] / counts[1]) / mean
    return float(np.sqrt(np.mean(difference**2) * counts[0] * counts[1])) / n


def _progress(halves: Float64Array, counts: NDArray[np.integer], n_samples: int) -> StillProgress:
    noise = noise_of_halves(halves, counts) if counts.all() else None
    text = f"{counts.sum()} of {n_samples} samples a pixel" + (f", noise {noise:.2%}" if noise is not None else "")
    return StillProgress(float(counts.sum()) / n_samples, text, noise)


def _pass_sizes(n_samples: int) -> list[int]:
    """Samples of each pass: at most 1,024; two passes at least, and four where that costs little."""
    n_passes = min(n_samples, max(2 if n_samples < _PASSES_PAY else 4, -(-n_samples // _PASS)))
    return [n_samples * (i + 1) // n_passes - n_samples * i // n_passes for i in range(n_passes)]


def _pass_work(
    hits: PrimaryHits, factors: NDArray[np.float32], texels: PixelTexels, rows: Rows, tracer: PathTracer,
    points: NDArray[np.uint32], seed: tuple[int, int],
) -> Callable[[tuple[int, Rows]], Float64Array]:  # fmt: skip
    """Return a function that sums one pass's samples, (p, 2, 3), for a numbered block of the rows."""
    objects = hits.objects.astype(np.int64)
    n = len(points)

    def work(block: tuple[int, Rows]) -> Float64Array:
        i_block, places = block
        own = np.repeat(rows[places], n)
        names = ["position", "offset_position", "horizon", "normal", "geometric_normal", "tangent", "wo"]
        names += [] if hits.coat_normal is None else ["coat_normal", "coat_tangent"]
        generator = np.random.default_rng((*seed, 1 + i_block))
        shifts = generator.integers(1 << 32, size=(len(places), 1, *points.shape[1:]), dtype=np.uint32)
        seen = texels.sample(own, generator.random((len(own), 2)))
        start = _vertices(objects[own], {name: getattr(hits, name)[own] for name in names}, factors[own], seen)
        numbers: Float64Array = ((points ^ shifts) * np.float64(2.0**-32)).reshape(-1, *points.shape[1:])
        return tracer.follow(start, numbers).reshape(len(places), n, 2, 3).sum(axis=1)

    return work


def _vertices(
    objects: Rows, fields: Mapping[str, NDArray[np.float32]], factors: NDArray[np.float32], texels: Float64Array
) -> _Vertices:
    exact = {name: field.astype(np.float64) for name, field in fields.items()}
    frame = local_frames(exact["tangent"], exact["normal"])
    to_coat = np.zeros((len(frame), 0, 0))
    if "coat_normal" in exact:
        to_coat = local_frames(exact["coat_tangent"], exact["coat_normal"]) @ frame.swapaxes(1, 2)
    return _Vertices(
        objects=objects,
        position=exact["position"],
        lift=exact["offset_position"] - exact["position"],
        geometric_normal=exact["geometric_normal"],
        horizon=np.einsum("nij,nj->ni", frame, exact["horizon"]),
        frame=frame,
        wo=exact["wo"],
        factors=factors,
        texels=texels,
        to_coat=to_coat,
    )


def _sobol_points(n: int, n_bounces: int, seed: tuple[int, int]) -> NDArray[np.uint32]:
    """The first n points of a scrambled Sobol sequence, (n, bounces, 11), as digits that exclusive or can shift."""
    from scipy.stats import qmc

    sampler = qmc.Sobol(n_bounces * _N_NUMBERS, scramble=True, seed=np.random.default_rng((*seed, 0)))
    points = sampler.random_base2(max(n - 1, 0).bit_length())[:n]
    return (points * 2.0**32).astype(np.uint32).reshape(n, n_bounces, _N_NUMBERS)


def _survivors(weight: Float64Array, u: Float64Array) -> Rows:
    """Choose paths (N,) that survive Russian roulette with numbers u (N,); their weights (N, 3) are raised in place."""
    chance = np.clip(weight @ LUMINANCE, 0.05, 1.0)
    kept = np.flatnonzero(u < chance)
    weight[kept] /= chance[kept][:, None]
    return kept
