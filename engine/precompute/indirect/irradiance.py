"""Light between irradiance cache records, as a polynomial in the equivalent albedo of one object.

With E_0 the direct irradiance of the records, G the mean over the records that a record's rays hit, and d the albedos,

    E_n = G d E_(n-1),      radiosity = d (E_0 + E_1 + ... + E_(N-2))      for N bounces in all,

where d of the edited object remains a variable: each product with it raises the power by one instead, which leaves N
numbers per record, whatever the number of objects [BenArtzi07, eq. 6.8, sect. 6.1.2]. Nothing is divided by d, which
may be 0.
"""

from collections.abc import Generator, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from engine.core.threads import even_parts, on_threads
from engine.precompute.indirect import _reflection_kernels as kernels
from engine.precompute.indirect._cache_kernels import Lights
from engine.precompute.indirect.albedo_from_curves import N_SLANTS
from engine.precompute.indirect.clamping import clamp_radiance
from engine.precompute.indirect.direction_patterns import cosine_tables
from engine.precompute.indirect.irradiance_cache import CHUNK, IrradianceCache
from engine.precompute.indirect.ordered_threads import OrderedSection, run_in_order
from engine.precompute.indirect.record_maps import RecordReflectance

NO_OBJECT = -1
MOST_GENERATIONS = 4
_SAMPLES = 1 << 18  # rays to each kind of light at a time


@dataclass(frozen=True, eq=False)
class CacheLight:
    """Light between C records. records_hit (C_seen, R) uint16: what the rays of those records hit that light reaches
    the camera from in more than two bounces; objects (C,); direct (C, N_SLANTS, 3): irradiance from the lights,
    distributed by hat functions over the square root of the cosine of its angle of incidence, see
    `albedo_from_curves.slant_roots`."""

    objects: NDArray[np.int32]
    records_hit: NDArray[np.uint16]
    direct: NDArray[np.float32]

    @property
    def irradiance(self) -> NDArray[np.float32]:
        """Direct irradiance over all angles, (C, 3)."""
        return self.direct.sum(axis=1)

    @property
    def n_bytes(self) -> int:
        return self.objects.nbytes + self.records_hit.nbytes + self.direct.nbytes


def connect(cells: IrradianceCache, n_bounces: int, n_rays: int) -> Iterator[tuple[float, NDArray[np.uint16]]]:
    """Traces the rays of all records, generation by generation; new records appear on the way. Yields (fraction,
    records hit (c, R)).

    Light of N bounces in all reaches the records of the gather points over N - 2 others: the last generation needs no
    rays.
    """
    tables = cosine_tables(n_rays)
    begin, step = 0, max(1, CHUNK // n_rays)
    generations = min(n_bounces - 2, MOST_GENERATIONS)
    for generation in range(generations):
        end = len(cells)
        look = partial(_trace_records, cells, tables, end)
        parts = [(i, min(i + step, end)) for i in range(begin, end, step)]
        for k, seen in enumerate(run_in_order(look, parts, 1)):
            yield (generation + (k + 1) / len(parts)) / generations, seen
        begin = end


def _trace_records(
    cells: IrradianceCache, tables: NDArray[np.float32], first_open: int, part: tuple[int, int], turn: OrderedSection
) -> NDArray[np.uint16]:
    """The records hit (end - begin, R) from the records [begin, end) of a part."""
    rays = cells.rays(*part, tables)
    return cells.records_hit(rays, first_open, turn).reshape(part[1] - part[0], -1)


def direct_irradiance(
    cells: IrradianceCache, lights: tuple[Lights, ...], n_samples: int
) -> Generator[float, None, NDArray[np.float32]]:
    """Irradiance (C, N_SLANTS, 3) of the records from all lights, see `CacheLight`, with `n_samples` samples of each
    kind; yields the fraction done."""
    total = np.zeros((len(cells), N_SLANTS, 3), np.float32)
    step = max(_SAMPLES // n_samples, 1)
    for begin in range(0, len(cells), step):
        for seed, each in enumerate(lights):
            total[begin : begin + step] += cells.irradiance(each, n_samples, seed, begin, begin + step)
        yield min((begin + step) / len(cells), 1.0)
    return total


def radiosity(
    light: CacheLight, albedos: NDArray[np.floating], n_bounces: int, cells: RecordReflectance, edited: int = NO_OBJECT,
    lit_apart: bool = False,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:  # fmt: skip
    """Radiosity (C, D, 3) of the records in a picture of N bounces, a polynomial in the albedo of the object `edited`;
    and the same for N - 1 bounces, for light that is reflected once more on its way.

    albedos (M, 3), scaled per record by `cells`; D = N powers, from 0 to N - 1, or 1 if no object is edited. N ≥ 2.
    lit_apart: whether the reflection of the lights by glossy layers is computed elsewhere. The second result then omits
    it, and the first includes it as if it were diffuse.
    """
    n_powers = n_bounces if edited != NO_OBJECT else 1
    albedos = np.ascontiguousarray(albedos, np.float32)
    latest = np.zeros((len(light.objects), n_powers, 3), np.float32)
    latest[:, 0] = light.irradiance if cells.slant is None else np.einsum("cbk,cbk->ck", light.direct, cells.slant)
    total, sent = latest.copy(), np.empty((*latest.shape[:2], 4), np.float32)
    once_less, before = total.copy(), np.zeros_like(total)
    if lit_apart:
        total[:, 0] = light.irradiance
        once_less[:, 0] = cells.diffuse * light.irradiance
    # E_n = G d E_(n-1), accumulated.
    for bounce in range(n_bounces - 2):
        kernels.brighten(latest, light.objects, albedos, cells.relative, edited, sent)
        latest = bounce_radiosity(light.records_hit, sent, min(bounce + 2, n_powers))
        before[:] = once_less
        total += latest
        once_less += latest
    bright = np.empty_like(latest)
    kernels.brighten(before, light.objects, albedos, cells.relative, edited, bright)
    kernels.brighten(total, light.objects, albedos, cells.relative, edited, before)
    return clamp_radiance(before), clamp_radiance(bright)


def bounce_radiosity(seen: NDArray[np.uint16], bright: NDArray[np.float32], n_powers: int) -> NDArray[np.float32]:
    """Irradiance (C, D, 3) from radiosity (C, D, 4) that is 0 beyond its first n_powers; 0 where a record has no
    rays."""
    out = np.zeros((*bright.shape[:2], 3), np.float32)
    on_threads(lambda begin, end: kernels.bounce(begin, end, seen, bright, n_powers, out), *even_parts(len(seen)))
    return out
