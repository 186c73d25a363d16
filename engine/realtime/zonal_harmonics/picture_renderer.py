"""Draws pictures of bending points with compiled code: the points' radiance, triangles between them, and pixel by pixel
what needs more detail than interpolation between points gives."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from engine.core.camera import centre_directions
from engine.realtime.core.picture_parts import with_part
from engine.realtime.core.raster import BLACK, RasterResult, draw, paint
from engine.realtime.core.terms import diffuse_albedo, is_glossy
from engine.realtime.zonal_harmonics.bending_points import BendingPoints, PosedPoints
from engine.realtime.zonal_harmonics.drawn_pixels import Pixels, pixels_of
from engine.realtime.zonal_harmonics.gloss_rows import add_gloss_rows
from engine.realtime.zonal_harmonics.lamp_gloss import add_lamp_gloss, share_by_rays
from engine.realtime.zonal_harmonics.lamp_light import light_of_lamps
from engine.realtime.zonal_harmonics.pose import Poses
from engine.realtime.zonal_harmonics.posed_shadows import blocked_light
from engine.realtime.zonal_harmonics.shading import (
    BandLight,
    Blockers,
    Lobes,
    add_gloss,
    add_shadows,
    even_light,
    low_gloss,
    shade,
    shade_some,
)
from engine.realtime.zonal_harmonics.shading_state import ShadingState
from engine.realtime.zonal_harmonics.surface_details import detail_frames
from engine.render.display import error_to_radiance
from engine.scene.cutouts import pixel_chances
from engine.scene.description import CameraDescription
from engine.scene.map_sampler import mean_factor
from engine.scene.scene_loader import Scene

Quality = Literal["moving", "rest"]

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]

_TINY = np.float32(1e-20)  # so that what nothing lights has all of its light left


@dataclass(frozen=True, eq=False)
class WhitePoints:
    """Radiance of white Lambertian points: white (S, 3), with all shadows and all light; of it mirrored (S, 3), by the
    light that gloss mirrors in bands; own (S, 3), that as their own transfer has it. shares (S, L): of the light
    of each lamp, and of suns after these, that arrives."""

    white: Float32Array
    mirrored: Float32Array
    own: Float32Array
    shares: Float32Array


class PictureRenderer:
    """Draws pictures of one scene's points."""

    def __init__(self, scene: Scene, points: BendingPoints) -> None:
        self._points = points
        self._white: tuple[tuple[object, ...], WhitePoints] | None = None
        self._added: Float32Array | None = None  # in these
        self.posed, self.blockers = PosedPoints(scene, points), Blockers(points)

    def draw(
        self, of: ShadingState, camera: CameraDescription, resolution: tuple[int, int], poses: Poses = (),
        quality: Quality = "moving", turned: bool = True, transparent: bool = False, apart: Collection[int] = (),
    ) -> Float32Array:  # fmt: skip
        """Draw radiance (H, W, 3), or with alpha (H, W, 4), or a part of that besides (H, W, 8); see `Deform.draw`."""
        points, camera_position, fine = (
            self._points,
            camera_position_of(of.scene, camera),
            2 if quality == "rest" else 1,
        )
        places, frames = self.posed.at(poses)
        found = self._shade_points(of, poses, places, frames, turned, quality)
        white, gloss = found.white, self._gloss(of, places, frames, camera_position, found, quality)
        drawn = self._rasterize(of.scene, places, camera, (resolution[0] * fine, resolution[1] * fine))
        emission = of.even_emission, of.scene.cones
        behind = BLACK if transparent or apart else of.backdrop
        picture = paint(drawn, points.surface, white, gloss, of.albedos, *emission, behind)
        self._add_emission(of.scene, drawn, picture, quality)
        for i in of.layers_of:
            self._add_by_pixel(of, i, drawn, white, camera_position, picture, quality)
        if transparent or apart:
            covered = drawn.found >= 0
            picture = np.concatenate([picture, covered[..., None]], axis=2, dtype=np.float32)
            if apart:
                is_apart = np.isin(points.surface.i_object[np.where(covered, drawn.found, 0)], list(apart))
                picture = with_part(picture, covered & is_apart)
        return _downsample(picture) if fine == 2 else picture

    def draw_errors(
        self, of: ShadingState, camera: CameraDescription, resolution: tuple[int, int], poses: Poses = ()
    ) -> Float32Array:
        """Draw the errors of the visible lobes (H, W, 3); see `Deform.draw_errors`."""
        drawn = self._rasterize(of.scene, self.posed.at(poses)[0], camera, resolution)
        errors = np.repeat(error_to_radiance(of.errors).astype(np.float32)[:, None], 3, axis=1)
        one = np.ones((len(of.scene.smooth), 3), np.float32)
        emission = np.zeros_like(one), of.scene.cones
        picture = paint(drawn, self._points.surface, errors, np.zeros_like(errors), one, *emission)
        for i, found in of.details.items():
            if (pixels := pixels_of(i, drawn, self._points)) is not None:
                of_pixels = error_to_radiance(found.errors_at(pixels.uvs(of.scene))).astype(np.float32)
                picture[pixels.rows, pixels.columns] = of_pixels[:, None]
        return picture

    def _rasterize(
        self, scene: Scene, places: Float32Array, camera: CameraDescription, size: tuple[int, int]
    ) -> RasterResult:
        """Rasterize the triangles; trace rays where some have holes, behind which others show."""
        surface, camera_position, found = self._points.surface, camera_position_of(scene, camera), None
        if scene.cutouts.passable.any():
            caster = self._points.caster_of(np.ones(len(surface.corners), bool), places[surface.corners])
            directions = centre_directions(camera, size).reshape(-1, 3)
            origins = np.tile(camera_position.astype(np.float32), (len(directions), 1))
            centres = np.stack(np.divmod(np.arange(len(directions)), size[0])[::-1], axis=1) + 0.5
            found = caster.intersect(origins, directions, pixel_chances(centres, size[0])).triangle.reshape(size[::-1])
        return draw(surface, places, camera, camera_position, size, found)

    def _shade_points(
        self, of: ShadingState, poses: Poses, places: Float32Array, frames: Float32Array, turned: bool,
        quality: Quality,
    ) -> WhitePoints:  # fmt: skip
        """Radiance of white Lambertian points. Shadows are those of clusters while objects move, and found by rays at
        rest."""
        made_of = (
            poses, turned, quality, of.lobes, of.skies, of.casters, of.lights, of.lamps, of.by_rays, of.light.links,
            of.shares_left,
        )  # fmt: skip
        if self._white is None or self._white[0] != made_of or self._added is not of.added:
            turns = frames if turned else self._points.rest_frames_of_drawn
            own = shade_objects(of, self._points, turns)
            if quality == "rest":
                shade_own_light(of.unlit, of.lobes, self._points, turns, own)
            white = own.copy()
            objects, normals = of.casting_objects, np.ascontiguousarray(frames[:, 2])
            mirrored = own
            by_lamp, shares = light_of_lamps(of, self._points, turns, places, of.rayed if quality == "rest" else ())
            if of.mirrored_lamps:
                mirrored = np.zeros_like(own)
                for i in of.layers_of:
                    shade_some(self._points.points_of(i), of.lobes, turns, of.mirrored_light(i), mirrored)
                np.maximum(mirrored, np.float32(0.0), out=mirrored)
            added = np.zeros((1, 3), np.float32) if of.added is None else of.added
            if quality == "rest":
                of_sky, lacking = blocked_light(
                    self._points, of.light, of.lamps, of.alone, of.rayed, of.casts, objects, places, normals,
                    of.lamp_reach, of.shining,
                )  # fmt: skip
                white = np.maximum(white - of_sky, np.float32(0.0))
                left = (white + _TINY) / (own + _TINY)
                # What bends hides of suns the share that it hides of the sky.
                shares[:, len(of.lamps) :] *= np.clip(left.mean(axis=1), 0.0, 1.0)[:, None]
                by_lamp = np.maximum(by_lamp - lacking, np.float32(0.0))
                for k, lamp in enumerate(of.lamps):
                    found = np.flatnonzero(lacking[:, k].any(axis=1))
                    shares[found, k] = share_by_rays(lamp, by_lamp[:, k], places, normals)[found]
            else:
                self._add_moving_shadows(of, self.blockers.rows(objects), places, normals, white)
                left = (white + _TINY) / (own + _TINY)
            white = np.maximum(white + added + by_lamp.sum(axis=1), np.float32(0.0))
            found_points = WhitePoints(white, mirrored * left + added, mirrored, shares)
            self._white, self._added = (made_of, found_points), of.added
        return self._white[1]

    def shade_at_rest(self, of: ShadingState) -> Float32Array:
        """Radiance of white Lambertian points (S, 3) with all objects at rest, without what neighbours add."""
        points, frames = self._points, self._points.rest_frames_of_drawn
        white = shade_objects(of, points, frames)
        rows, normals = self.blockers.rows(of.casting_objects, points.rest_places), np.ascontiguousarray(frames[:, 2])
        self._add_moving_shadows(of, rows, points.rest_places, normals, white)
        return white

    def _add_moving_shadows(
        self, of: ShadingState, rows: Float32Array, places: Float32Array, normals: Float32Array, white: Float32Array
    ) -> None:
        """Darken white points by clusters (K, `CLUSTER_ROW`), each object of the light that reaches it."""
        for sky in of.skies:
            casts = of.casts & of.is_under(sky)[:, None]
            add_shadows(rows, casts, self._points, places, normals, sky.bands, white)

    def _gloss(
        self, of: ShadingState, places: Float32Array, frames: Float32Array, camera_position: Float64Array,
        found: WhitePoints, quality: Quality,
    ) -> Float32Array:  # fmt: skip
        """Radiance that points with glossy layers send to the camera (S, 3). Rows, which have an object's own shadows,
        take from these points the share that others leave."""
        sent, own, white = np.zeros_like(found.white), found.own, found.mirrored
        normals = np.ascontiguousarray(frames[:, 2])
        for i in of.layers_of:
            which, light = self._points.points_of(i), of.mirrored_light(i)
            for low, factor in of.glosses_of(i):
                add_gloss(low, factor, which, places, normals, camera_position, light, white, sent)
            even = even_light(light)
            for rows, views in of.rows_of(i):
                reached = (white[which].sum(axis=1) + even) / np.maximum(own[which].sum(axis=1) + even, 1e-20)
                reached = np.clip(reached, 0.0, 1.0).astype(np.float32)
                add_gloss_rows(rows, views, which, frames, places, camera_position, light, reached, sent)
        add_gloss_of_lamps(of, self._points, places, frames, camera_position, found.shares, sent, quality == "moving")
        return sent

    def _add_emission(self, scene: Scene, drawn: RasterResult, picture: Float32Array, quality: Quality) -> None:
        """Add the emission that has textures."""
        for i in scene.emission_textures.tinted:
            if (pixels := pixels_of(i, drawn, self._points)) is not None:
                maps = scene.description.objects[i].emission_texture
                factor = pixels.factor(scene, maps, quality == "moving") * pixels.is_front[:, None]
                picture[pixels.rows, pixels.columns] += scene.emission[i] * factor

    def _add_by_pixel(
        self,
        of: ShadingState,
        i: int,
        drawn: RasterResult,
        white: Float32Array,
        camera_position: Float64Array,
        picture: Float32Array,
        quality: Quality,
    ) -> None:
        layers = list(of.pixel_layers(i))
        pixels = pixels_of(i, drawn, self._points) if layers else None
        if pixels is None:
            return
        if i in of.details:
            diffuse, normals = self._shade_detail(of, i, pixels)
        else:
            diffuse, normals = np.einsum("nk,nki->ni", pixels.weights, white[pixels.points]), None
        for layer in layers:
            if normals is not None and is_glossy(layer):
                sent = np.zeros_like(diffuse)
                low, every, places = low_gloss(layer, of.order), np.arange(len(diffuse)), pixels.places()
                add_gloss(low, np.ones(3), every, places, normals, camera_position, of.light_of(i), diffuse, sent)
            else:
                sent = diffuse * diffuse_albedo(layer).astype(np.float32)
            sent = sent * pixels.factor(of.scene, layer.maps, quality == "moving") * (pixels.points[:, :1] >= 0)
            picture[pixels.rows, pixels.columns] += np.maximum(sent, 0.0)

    def _shade_detail(self, of: ShadingState, i: int, pixels: Pixels) -> tuple[Float32Array, Float32Array]:
        """Radiance of white Lambertian pixels (N, 3) with detail, and their normals (N, 3)."""
        numbers, axes = self.posed.axes_of(i)
        frames = detail_frames(axes[numbers[pixels.triangle]], pixels.weights, pixels.is_front)
        found, uvs = of.details[i], pixels.uvs(of.scene)
        normals = np.einsum("nk,nki->ni", found.normals_at(uvs), frames).astype(np.float32)
        return np.maximum(shade(found.at(uvs), frames, of.light_of(i)), np.float32(0.0)), normals


def shade_objects(of: ShadingState, points: BendingPoints, frames: Float32Array) -> Float32Array:
    """Radiance (S, 3) of white Lambertian points in axes (S, 3, 3), each object in its own light."""
    white = np.empty((len(points), 3), np.float32)
    for sky in of.skies:
        of_sky = of.is_under(sky)
        of_sky[list(of.lights)] = False
        shade_some(np.flatnonzero(of_sky[points.owners]), of.lobes, frames, sky.bands, white)
    shade_own_light(of.lights, of.lobes, points, frames, white)
    return np.maximum(white, np.float32(0.0), out=white)


def shade_own_light(
    lights: Mapping[int, BandLight], lobes: Lobes, points: BendingPoints, frames: Float32Array, white: Float32Array
) -> None:
    """Fill white (S, 3) at the points of objects that have these lights of their own; it may be negative."""
    for i, light in lights.items():
        shade_some(points.points_of(i), lobes, frames, light, white)


def add_gloss_of_lamps(
    of: ShadingState, points: BendingPoints, places: Float32Array, frames: Float32Array, camera_position: Float64Array,
    shares: Float32Array, sent: Float32Array, is_moving: bool,
) -> None:  # fmt: skip
    """Add to sent (S, 3) what points send to the camera (3,) of `mirrored_lamps`, of whose light the shares (S, L)
    arrive."""
    mirrored = of.mirrored_lamps
    for i, layers in of.layers_of.items():
        for layer in filter(is_glossy, layers if i not in of.details else ()):
            factor, which = mean_factor(of.scene, i, layer.maps), points.points_of(i)
            for k in (*range(len(of.lamps)), *of.suns_of(i)):
                add_lamp_gloss(
                    layer, factor, mirrored[k], shares[:, k], which, frames, places, camera_position, sent, is_moving
                )


def camera_position_of(scene: Scene, camera: CameraDescription) -> NDArray[np.float64]:
    """A camera's position in the coordinates of a scene's vertices (3,)."""
    return np.subtract(camera.position, scene.origin).astype(np.float64)


def _downsample(picture: Float32Array) -> Float32Array:
    """Halve the resolution."""
    height, width = picture.shape[0] // 2, picture.shape[1] // 2
    return np.asarray(picture.reshape(height, 2, width, 2, -1).mean(axis=(1, 3)), np.float32)
