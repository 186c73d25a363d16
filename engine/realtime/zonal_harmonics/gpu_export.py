"""Exports the parts that a graphics card draws (`engine.realtime.core.gpu_parts`), which the window's
process can read without this module's imports; for a moving pose, only the parts that the window does not have."""

from __future__ import annotations

from itertools import count
from secrets import randbits

import numpy as np
from numpy.typing import ArrayLike, NDArray

from engine.realtime.core.gpu_parts import (
    NO_PARTS,
    OBJECT_ROW,
    AppearancePart,
    BackdropPart,
    CoverPart,
    DeformTerm,
    ExportedDetail,
    Float32Array,
    Numbers,
    PictureExport,
    PosedPart,
    ShapePart,
    as_triple,
)
from engine.realtime.core.terms import diffuse_albedo, is_glossy
from engine.realtime.zonal_harmonics._shading_kernels import LEAST_BLOCKED
from engine.realtime.zonal_harmonics.bending_points import BendingPoints, PosedPoints
from engine.realtime.zonal_harmonics.gloss_rows import N_ROW_LOBES
from engine.realtime.zonal_harmonics.lamp_light import light_of_lamps
from engine.realtime.zonal_harmonics.picture_renderer import add_gloss_of_lamps
from engine.realtime.zonal_harmonics.pose import Poses
from engine.realtime.zonal_harmonics.shading import (
    STEEPEST,
    Blockers,
    Lobes,
    LowGloss,
    even_light,
    low_gloss,
    spread_of,
)
from engine.realtime.zonal_harmonics.shading_state import ShadingState
from engine.realtime.zonal_harmonics.surface_details import Detail
from engine.scene.scene_loader import Scene
from engine.scene.surface_uvs import corner_colours
from engine.sphere.harmonics import clamped_cosine
from engine.texture.gpu_export import ImageExporter, colour_words, image_words, in_all_sets, opacity_rows, stroke_words

_numbers = count(1 + randbits(48))  # of parts: random start, so that another worker's numbers differ


class PictureExporter:
    """Exports pictures of one scene's points."""

    def __init__(self, points: BendingPoints, posed: PosedPoints, blockers: Blockers) -> None:
        self._points, self._posed, self._blockers = points, posed, blockers
        self._shape: tuple[tuple[Lobes, ...], ShapePart] | None = None
        self._appearance: tuple[tuple[object, ...], AppearancePart] | None = None
        self._cover: tuple[tuple[object, ...], CoverPart] | None = None
        self._sky: BackdropPart | None = None

    def export(
        self, of: ShadingState, camera_position: NDArray[np.float64], poses: Poses, known: Numbers = NO_PARTS
    ) -> PictureExport:
        """Export a picture without the parts whose numbers are known; camera_position (3,)."""
        places, frames = self._posed.at(poses)
        made_of = of.lobes, *(lobes for i in of.layers_of for lobes, _ in of.rows_of(i))
        if self._shape is None or self._shape[0] != made_of:  # compared by identity
            self._shape = made_of, shape_part(self._points, *made_of)
        lit = of.version, of.scene.cones.tobytes(), *of.lights.values(), *of.mirrored.values()
        if self._appearance is None or self._appearance[0] != lit:
            self._appearance = lit, self._export_appearance(of)
        backdrop = of.backdrop.radiance
        if self._sky is None or self._sky.radiance is not backdrop:
            self._sky = BackdropPart(next(_numbers), backdrop)
        assert self._cover is not None
        shape, appearance, cover, sky = self._shape[1], self._appearance[1], self._cover[1], self._sky
        axes = [self._posed.axes_of(i)[1].reshape(-1, 9) for i in of.details]
        all_axes, rows = (
            np.concatenate(axes) if axes else np.zeros((0, 9), np.float32),
            self._blockers.rows(of.casting_objects),
        )
        of_lamps = np.zeros((len(frames) if of.mirrored_lamps else 0, 6), np.float32)
        if of.mirrored_lamps:
            by_lamp, shares = light_of_lamps(of, self._points, frames, places)
            of_lamps[:, :3], to_camera = by_lamp.sum(axis=1), np.zeros((len(frames), 3), np.float32)
            add_gloss_of_lamps(of, self._points, places, frames, camera_position, shares, to_camera, is_moving=True)
            of_lamps[:, 3:] = to_camera
        posed = posed_part(places, frames, all_axes, rows, of_lamps, camera_position)
        numbers = shape.number, appearance.number, cover.number, sky.number
        is_new = [number != here for number, here in zip(numbers, known, strict=True)]
        return PictureExport(
            posed,
            numbers,
            shape if is_new[0] else None,
            appearance if is_new[1] else None,
            cover if is_new[2] else None,
            sky if is_new[3] else None,
        )

    def _export_appearance(self, of: ShadingState) -> AppearancePart:
        """Export the appearance, after the cover that it refers to."""
        images, details = ImageExporter(of.scene.textures, of.scene.origin), dict[int, ExportedDetail]()
        n_exported = 0
        for i, each in of.details.items():
            details[i] = _export_detail(n_exported, each, images)
            n_exported += _lobe_rows(each).size
        gloss, by_points = gloss_rows(of)
        terms = list[DeformTerm]()
        for i in of.layers_of:
            for layer in of.pixel_layers(i):
                maps = None if layer.maps.is_plain else images.maps(layer.maps)
                if is_glossy(layer):
                    terms.append(DeformTerm(i, (1.0, 1.0, 1.0), maps, details[i], len(gloss)))
                    gloss.append(_gloss_row(low_gloss(layer, of.order)))
                else:
                    terms.append(DeformTerm(i, as_triple(diffuse_albedo(layer)), maps, details.get(i)))
        for i in of.scene.emission_textures.tinted:
            maps = images.maps(of.scene.description.objects[i].emission_texture)
            terms.append(DeformTerm(i, as_triple(of.scene.emission[i]), maps, None, emits=True))
        covered = tuple(dict.fromkeys(term.i_object for term in terms))
        opacities = opacity_rows(of.scene, images)
        made_of = covered, tuple(of.details.items()), images.images, images.strokes, opacities.tobytes()
        if self._cover is None or self._cover[0] != made_of:
            self._cover = made_of, self._export_cover(of, covered, images, opacities)
        return appearance_part(of, gloss, by_points, tuple(terms))

    def _export_cover(
        self, of: ShadingState, objects: tuple[int, ...], images: ImageExporter, opacities: Float32Array
    ) -> CoverPart:
        first_axes, n_axes = dict[int, int](), 0
        for i in of.details:
            first_axes[i], n_axes = n_axes, n_axes + len(self._posed.axes_of(i)[1])
        corners, ranges, n = [np.zeros((0, 3, 16), np.int32)], dict[int, tuple[int, int]](), 0
        for i in objects:
            mine = np.flatnonzero(self._points.surface.i_object == i)
            ranges[i], n = (n, n + len(mine)), n + len(mine)
            corners.append(_covered_corners(of.scene, self._points, mine))
            if i in first_axes:
                corners[-1][..., 3] = first_axes[i] + self._posed.axes_of(i)[0][mine]
        lobes = [np.zeros(0, np.float32), *(_lobe_rows(each).ravel() for each in of.details.values())]
        n_strokes = sum(len(each.strokes) for each in images.strokes)
        return CoverPart(
            next(_numbers), np.concatenate(corners).reshape(-1, 16), ranges, np.concatenate(lobes),
            image_words(images.images), stroke_words(images.strokes), n_strokes, opacities,
            self._hole_corners(of.scene) if len(opacities) else np.zeros((0, 5), np.float32),
        )  # fmt: skip

    def _hole_corners(self, scene: Scene) -> Float32Array:
        """Texture coordinates and vertices' opacity at the corners of all triangles (3 T, 5)."""
        points, every = self._points, np.arange(len(self._points.surface.corners))
        opacity = points.between(every, corner_colours(scene, points.source[every])[..., 3:])
        uvs = in_all_sets(points.corner_uvs(scene, every))
        return np.concatenate([uvs, opacity], axis=2).reshape(-1, 5).astype(np.float32)


def shape_part(points: BendingPoints, lobes: Lobes, *gloss: Lobes) -> ShapePart:
    """gloss: of the rows of each layer that is drawn by rows, object after object."""
    surface, (_, n_lobes, order) = points.surface, lobes.coefficients.shape
    corners = _corners(points, np.arange(len(surface.corners)))
    corners[..., 3] = surface.i_object[:, None]
    owners = np.zeros((len(points), 2), np.int32)
    owners[:, 0] = points.owners
    for i in np.unique(points.owners):
        mine = points.points_of(i)
        owners[mine, 1] = np.arange(len(mine))
    rows = [np.zeros((0, 4 + N_ROW_LOBES * (3 + order)), np.float32), *map(_rows, gloss)]
    return ShapePart(
        next(_numbers), corners.reshape(-1, 4), owners, _rows(lobes), n_lobes, order, np.concatenate(rows), N_ROW_LOBES
    )


def gloss_rows(of: ShadingState) -> tuple[list[Float32Array], dict[int, tuple[int, int]]]:
    """Rows of the glossy layers that are shaded at points, and first and last, excluded, of each object's."""
    rows, ranges = list[Float32Array](), dict[int, tuple[int, int]]()
    for i in of.layers_of:
        first = len(rows)
        rows += [_gloss_row(low, factor) for low, factor in of.glosses_of(i)]
        ranges[i] = first, len(rows)
    return rows, ranges


def _gloss_row(low: LowGloss, factor: ArrayLike = 1.0) -> Float32Array:
    """Bands, times factor (3,), and lean by polar angles of wo (A, 3 n + 1)."""
    bands = (low.bands * np.asarray(factor, np.float32)).reshape(len(low.lean), -1)
    return np.hstack([bands, low.lean[:, None]])


def appearance_part(
    of: ShadingState, rows: list[Float32Array], by_points: dict[int, tuple[int, int]], terms: tuple[DeformTerm, ...]
) -> AppearancePart:
    """rows: of all glossy layers; by_points: see `gloss_rows`."""
    objects = np.zeros((len(of.scene.smooth), OBJECT_ROW), np.float32)
    objects[:, :3], objects[:, 4:7], objects[:, 9] = of.albedos, of.even_emission, even_light(of.sky.dull_bands)
    objects[:, 12:] = of.scene.cones
    own_lights = list(dict.fromkeys((*of.lights, *of.linked)))
    for k, i in enumerate(own_lights):
        objects[i, 8:10] = 1 + k, even_light(of.mirrored_light(i))
    row_layers, views = list[tuple[int, int, int]](), [np.zeros(0, np.float32)]
    first_row = first_view = 0
    for i in of.layers_of:
        first_layer = len(row_layers)
        for lobes, of_layer in of.rows_of(i):
            row_layers.append((first_row, of_layer.shape[2], first_view))
            views.append(of_layer.ravel())
            first_row, first_view = first_row + len(lobes.low), first_view + of_layer.size
        objects[i, 10:12] = first_layer, len(row_layers) - first_layer
    for i, (first, last) in by_points.items():
        objects[i, 3], objects[i, 7] = first, last - first
    light, backdrop = of.sky.bands, of.backdrop
    order = light.table.shape[2]
    each_light = [*map(of.light_of, own_lights), *map(of.mirrored_light, own_lights), of.sky.dull_bands]
    each_light += [of.sky_of(i).bands for i in own_lights]  # of which moving objects block a part
    whole = [np.concatenate([each.harmonics, each.table.reshape(-1, 3)]) for each in each_light]
    lights = np.array(whole, np.float32).reshape(len(whole), len(light.harmonics) + light.table.size // 3, 3)
    added = np.zeros((0, 3), np.float32) if of.added is None else of.added
    gloss = np.array(rows, np.float32) if rows else np.zeros((0, 2, 3 * order + 1), np.float32)
    cosine = (clamped_cosine(order) / np.pi).astype(np.float32)
    return AppearancePart(
        next(_numbers), light.harmonics, light.table, lights, added, objects, gloss,
        np.array(row_layers, np.float32).reshape(-1, 3), np.concatenate(views), float(STEEPEST), cosine,
        of.casts.astype(np.float32), spread_of(order), LEAST_BLOCKED, backdrop.turn, backdrop.scale, terms,
    )  # fmt: skip


def posed_part(
    places: Float32Array,
    frames: Float32Array,
    axes: Float32Array,
    blockers: Float32Array,
    of_lamps: Float32Array,
    camera_position: NDArray[np.float64],
) -> PosedPart:
    """places (V, 3) of everything that is drawn; frames (S, 3, 3) of the points, which come first."""
    rows = np.zeros((len(places), 12), np.float32)
    rows[: len(frames), :9], rows[:, 9:] = frames.reshape(-1, 9), places
    return PosedPart(rows, axes, blockers, of_lamps, as_triple(camera_position))


def _corners(points: BendingPoints, which: NDArray[np.integer]) -> NDArray[np.int32]:
    """Corners of triangles (T, 3, 4): place, points on front and back, 0."""
    surface = points.surface
    found = np.zeros((len(which), 3, 4), np.int32)
    found[..., 0] = surface.corners[which]
    found[..., 1], found[..., 2] = surface.sides[which, 0], surface.sides[which, 1]
    return found


def _covered_corners(scene: Scene, points: BendingPoints, which: NDArray[np.integer]) -> NDArray[np.int32]:
    """Corners of triangles (T, 3, 16), without axes."""
    at_rest = np.zeros((len(which), 3, 10), np.float32)
    at_rest[..., :4] = in_all_sets(points.corner_uvs(scene, which))
    at_rest[..., 4:7] = points.corners_at_rest(which)
    at_rest[..., 7:] = scene.geometric_normals[points.source[which]][:, None]
    colours = colour_words(points.between(which, corner_colours(scene, points.source[which]))).view(np.int32)
    return np.concatenate([_corners(points, which), at_rest.view(np.int32), colours], axis=2)


def _export_detail(first: int, detail: Detail, images: ImageExporter) -> ExportedDetail:
    found = detail.map()
    height, width, n_lobes, _ = found.lobes.coefficients.shape
    depth = found.depth, images.image(found.depth_image)
    return ExportedDetail(first, (height, width), n_lobes, found.repeats, found.is_smooth, *depth)


def _lobe_rows(detail: Detail) -> Float32Array:
    """Pack a map's entries: normal, then as `_rows` (H W, 7 + N (3 + n))."""
    found = detail.map()
    maps = found.lobes.low, found.lobes.axes, found.lobes.coefficients
    flat = Lobes(*(each.reshape(-1, *each.shape[2:]) for each in maps))
    return np.hstack([found.normals.reshape(-1, 3), _rows(flat)])


def _rows(lobes: Lobes) -> Float32Array:
    """Pack lobes: low, then the axis and the bands of each lobe (P, 4 + N (3 + n))."""
    each = np.concatenate([lobes.axes, lobes.coefficients], axis=2).reshape(len(lobes.low), -1)
    return np.hstack([lobes.low, each])
