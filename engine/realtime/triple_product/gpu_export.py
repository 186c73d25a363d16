"""Exports Orbit's data to a graphics card that draws moving pictures: all parts (`gpu_parts`) once, then their changes.

    exporter = PointExporter(number_of_bytes)
    for part in exporter.parts(orbit): ...      everything that changed since the last call

Coefficients of light that are 0 are not exported.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from engine.material.layer import FRAMES, Frame
from engine.realtime.core.gpu_parts import (
    N_HEAD,
    BouncedPart,
    ExportedBumps,
    Float32Array,
    LightPart,
    MeshPart,
    OrbitPart,
    OrbitTerm,
    Range,
    SkyPart,
    TablePart,
    TermsPart,
    Words,
    as_triple,
)
from engine.realtime.triple_product._slice_kernels import Tables
from engine.scene.surface_uvs import corner_colours, corner_uvs
from engine.texture.gpu_export import (
    ImageExporter,
    colour_words,
    image_words,
    in_all_sets,
    opacity_rows,
    stroke_words,
)

if TYPE_CHECKING:
    from engine.material.bumps import Bumps
    from engine.precompute.direct.pipeline import SkyState
    from engine.realtime.core.shading_points import ShadingPoints
    from engine.realtime.triple_product.incident import Incident
    from engine.realtime.triple_product.lit_points import LitPoints
    from engine.realtime.triple_product.orbit_engine import Orbit
    from engine.realtime.triple_product.reflections import Term
    from engine.scene.scene_loader import Scene
    from engine.texture.pyramid import Pyramid

_AT_ONCE = 4096  # points: 11 MB at 320 coefficients


class PointExporter:
    """Remembers what has been exported."""

    def __init__(self, most_bytes: int) -> None:
        """most_bytes: limit of any one buffer; coefficients of light are truncated to fit."""
        self._most_bytes = most_bytes
        self._points: ShadingPoints | None = None
        self._incident: Incident | None = None
        self._bumps: tuple[Bumps, ...] = ()
        self._n = 0
        self._indirect: Float32Array | None = None
        self._sky: SkyState | None = None
        self._image: object = self
        self._terms: tuple[object, ...] = ()
        self._tables: set[int] = set()
        self._images: tuple[Pyramid, ...] | None = None

    def parts(self, orbit: Orbit) -> Iterator[OrbitPart]:
        """Export everything that changed; nothing before points exist."""
        lit = orbit.lit
        if lit is None:
            return
        bumps = tuple(described.bumps for described in orbit.scene.description.objects)
        if (lit.points, lit.incident, bumps) != (self._points, self._incident, self._bumps):
            self._points, self._incident, self._bumps = lit.points, lit.incident, bumps
            self._n = self._n_exported_coefficients(lit.incident)
            lit.not_exported[:], self._indirect = True, None
            yield _mesh(orbit.scene, lit, self._n)
        yield from self._sky_parts(orbit)
        yield from self._terms_parts(orbit)
        which = np.flatnonzero(lit.not_exported)
        for start in range(0, len(which), _AT_ONCE):
            some = which[start : start + _AT_ONCE]
            yield _light(lit.incident, some, self._n)
            lit.not_exported[some] = False
        if lit.indirect is not self._indirect:
            self._indirect = lit.indirect
            yield BouncedPart(_with_fourth(lit.indirect))

    def _n_exported_coefficients(self, incident: Incident) -> int:
        n_rows, n = incident.stored.number.shape
        room = self._most_bytes // 4 // max(n_rows, 1) - N_HEAD
        return max(min(n, room // 2), 1)

    def _sky_parts(self, orbit: Orbit) -> Iterator[OrbitPart]:
        sky, maps = orbit.light, orbit.sky_maps
        if sky != self._sky:
            is_new, self._sky = self._image is not sky.environment, sky
            self._image = sky.environment
            black = np.zeros((1, 1, 3), np.float32)
            image = black if sky.environment is None else np.asarray(sky.environment.radiance, np.float32)
            peaks, ranges, n_peaks = [np.zeros((0, 8), np.float32)], dict[int, Range](), 0
            for each in maps:
                if id(each) not in ranges:
                    peaks.append(np.hstack([_with_fourth(each.peak_direction), _with_fourth(each.peak_power)]))
                    ranges[id(each)] = n_peaks, n_peaks + len(peaks[-1])
                    n_peaks += len(peaks[-1])
            turn, of_objects = float(np.radians(sky.rotation % 360.0)), tuple(ranges[id(each)] for each in maps)
            yield SkyPart(image if is_new else None, turn, sky.scale, np.concatenate(peaks), of_objects)

    def _terms_parts(self, orbit: Orbit) -> Iterator[OrbitPart]:
        made = _Terms(orbit)
        described = orbit.scene.description.objects
        emission_maps = {
            i: made.exported.maps(described[i].emission_texture) for i in orbit.scene.emission_textures.tinted
        }
        opacities = opacity_rows(orbit.scene, made.exported)
        strokes, images = made.exported.strokes, made.exported.images
        emitted = orbit.scene.emission.tobytes(), tuple(emission_maps.items())
        terms_state = made.terms, strokes, emitted, opacities.tobytes()
        if terms_state == self._terms and images == self._images:
            return
        new = {serial: _table(tables) for serial, tables in made.tables.items() if serial not in self._tables}
        words = None if images == self._images else image_words(images)
        self._terms, self._images, self._tables = terms_state, images, set(made.tables)
        emission = orbit.scene.emission.astype(np.float32)
        lamps = emission, orbit.scene.cones, emission_maps
        yield TermsPart(made.terms, new, words, stroke_words(strokes), *lamps, opacities)


class _Terms:
    """The terms of an Orbit in exported form, with the tables and images that they use."""

    def __init__(self, orbit: Orbit) -> None:
        self.tables: dict[int, Tables] = {}
        self.exported = ImageExporter(orbit.scene.textures, orbit.scene.origin)
        self._orbit = orbit
        self.terms = tuple(self._export_term(term) for term in orbit.reflections.terms)

    def _export_term(self, term: Term) -> OrbitTerm:
        orbit = self._orbit
        albedo = orbit.reflections.albedo(term) / np.pi * (orbit.n_bounces > 1)
        tables = None if term.reflectance is not None else orbit.reflections.tables(term.layers)
        if tables is not None:
            self.tables[tables.serial] = tables
        maps = None
        if term.factor is not None:
            maps = self.exported.maps(term.layers[0].maps)
        is_sharp = tables is not None and orbit.reflections.is_sharp(term.layers)
        bumps = None
        scene = orbit.scene.in_frame(term.frame)
        perturbs = term.i_object in scene.bump_normals.objects and _has_axes(orbit.scene, term.i_object, term.frame)
        if (term.reflectance is not None or is_sharp) and perturbs:
            own = scene.description.objects[term.i_object].bumps
            slopes = self.exported.image(orbit.scene.textures.slopes(own))
            bumps = ExportedBumps(slopes, own.bump_repeats, own.slope_scale, bool(own.normal_map))
        reflectance, serial = term.reflectance or (0.0, 0.0, 0.0), tables.serial if tables else 0
        sharp = term.layers if is_sharp else ()
        return OrbitTerm(term.i_object, reflectance, maps, as_triple(albedo), serial, bumps, sharp)


def _has_axes(scene: Scene, i_object: int, frame: Frame) -> bool:
    """Whether the exported axes of an object's offsets are those of a frame: they are the base's where that has bumps,
    and a coat with other axes is smooth in moving pictures."""
    if frame == "base" or i_object not in scene.bump_normals.objects:
        return True
    base, coat = (scene.in_frame(each).description.objects[i_object].bumps for each in FRAMES)
    return bool(base.normal_map and coat.normal_map) and base.bump_uv_set == coat.bump_uv_set


def _mesh(scene: Scene, lit: LitPoints, n: int) -> MeshPart:
    points, stored = lit.points, lit.incident.stored
    zero = np.zeros((len(points), 1), np.float32)
    row = lit.incident.slot.astype(np.int32)[:, None].view(np.float32)
    each = np.concatenate([points.position, row, points.normal, zero, points.tangent, zero], axis=1)
    order = np.argsort(scene.object_of_triangle[points.source], kind="stable")
    source = points.source[order]
    shares = _shares(points.within[order])
    uvs = np.einsum("tpk,tki->tpi", shares, in_all_sets(corner_uvs(scene, source))).astype(np.float32)
    colours = colour_words(np.einsum("tpk,tki->tpi", shares, corner_colours(scene, source))).view(np.float32)
    offset_axes = np.zeros((len(order), 3, 6), np.float32)
    faces = np.repeat(scene.geometric_normals[source][:, None], 3, axis=1).astype(np.float32)
    sides = np.ascontiguousarray(points.shown[order].swapaxes(1, 2)).view(np.float32)
    bounds = np.searchsorted(scene.object_of_triangle[source], np.arange(len(scene.smooth) + 1)).tolist()
    bumpy = {i: each.bump_normals for each in map(scene.in_frame, reversed(FRAMES)) for i in each.bump_normals.objects}
    for i, bump_normals in bumpy.items():
        begin, end = bounds[i], bounds[i + 1]
        own = bump_normals.offset_axes(i)[source[begin:end] - scene.triangle_ranges[i][0]]
        offset_axes[begin:end] = np.einsum("tpk,tki->tpi", shares[begin:end], own)
    places = points.corners[order].astype(np.float32)
    corners = np.concatenate([places, faces, uvs, sides, offset_axes, colours], axis=2)
    runs = [_runs(np.flatnonzero(points.i_object == i)) for i in range(len(scene.smooth))]
    low, high = scene.vertices.min(axis=0), scene.vertices.max(axis=0)
    return MeshPart(
        each.astype(np.float32).view(np.uint32), corners.reshape(-1, 20).astype(np.float32).view(np.uint32),
        tuple(zip(bounds[:-1], bounds[1:], strict=True)), tuple(runs), as_triple(scene.origin),
        as_triple((low + high) / 2.0),
        float(np.linalg.norm(high - low)) / 2.0, len(stored.number), n,
    )  # fmt: skip


def _shares(within: Float32Array) -> Float32Array:
    """Barycentric weights of a triangle's three corners (..., 3) at u and v (..., 2)."""
    return np.stack([1.0 - within[..., 0] - within[..., 1], within[..., 0], within[..., 1]], axis=-1)


def _runs(numbers: NDArray[np.integer]) -> tuple[Range, ...]:
    """Split ascending numbers into runs of consecutive ones: first and last (excluded) of each."""
    if not len(numbers):
        return ()
    breaks = np.flatnonzero(np.diff(numbers) != 1)
    firsts, lasts = numbers[np.r_[0, breaks + 1]], numbers[np.r_[breaks, len(numbers) - 1]] + 1
    return tuple((int(a), int(b)) for a, b in zip(firsts, lasts, strict=True))


def _light(incident: Incident, which: NDArray[np.integer], n: int) -> LightPart:
    stored = incident.stored
    place = incident.slot[which]
    glossy = place >= 0
    place = place[glossy]
    value, number = stored.value[place, :n], stored.number[place, :n]
    n_exported = np.where((value != 0).any(axis=2), np.arange(1, value.shape[1] + 1), 0).max(axis=1, initial=0)
    most = int(n_exported.max(initial=0))
    rows = np.zeros((len(place), N_HEAD + 2 * most), np.uint32)
    rows[:, 0] = n_exported
    rows[:, 1:7] = stored.irradiance_gradient[place].reshape(-1, 6).view(np.uint32)
    rows[:, 7:47] = stored.peak_place[place].astype(np.int32).view(np.uint32)
    rows[:, 47:167] = stored.peak_power[place].reshape(-1, 120).view(np.uint32)
    bits = np.zeros((len(place), 16), np.uint8)
    bits[:, : stored.peak_bits.shape[1]] = stored.peak_bits[which[glossy]]
    rows[:, 167:171] = bits.view(np.uint32)
    four = np.concatenate([number[:, :most, None].view(np.uint16), value[:, :most]], axis=2)
    rows[:, N_HEAD:] = np.ascontiguousarray(four).reshape(len(place), 4 * most).view(np.uint32)
    return LightPart(which.astype(np.int32), _with_fourth(stored.irradiance[which]), place, rows)


def _with_fourth(colours: Float32Array) -> Float32Array:
    """Pad colours (N, 3) to (N, 4)."""
    return np.concatenate([colours, np.zeros((len(colours), 1), np.float32)], axis=1)


def _table(tables: Tables) -> TablePart:
    return TablePart(
        _entries(tables.table), _entries(tables.values), tables.images, tables.places, tables.n_polar,
        tables.n_columns, tables.steepest,
    )  # fmt: skip


def _entries(flat: NDArray[np.uint16]) -> Words:
    colours = flat[:-1].reshape(-1, 3)
    four = np.zeros((len(colours), 4), np.uint16)
    four[:, :3] = colours
    return four.view(np.uint32)
