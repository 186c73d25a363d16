"""Draws pictures of bending points with compiled code: the points' radiance, triangles between them, and details pixel
by pixel."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from engine.realtime.zonal_harmonics.bending_points import BendingPoints
from engine.realtime.zonal_harmonics.blockers import Blockers, add_shadows
from engine.realtime.zonal_harmonics.gloss import add_gloss
from engine.realtime.zonal_harmonics.object_pixels import Pixels, pixels_of
from engine.realtime.zonal_harmonics.pose import Poses
from engine.realtime.zonal_harmonics.posed_points import PosedPoints
from engine.realtime.zonal_harmonics.raster import RasterResult, draw, paint
from engine.realtime.zonal_harmonics.shading import shade
from engine.realtime.zonal_harmonics.shading_state import Float32Array, ShadingState, albedo
from engine.realtime.zonal_harmonics.surface_details import shade_pixels
from engine.render.error_colours import error_to_radiance
from engine.scene.description import CameraDescription
from engine.scene.scene_loader import Scene

Quality = Literal["moving", "rest"]


class PictureRenderer:
    """Draws pictures of one scene's points."""

    def __init__(self, scene: Scene, points: BendingPoints) -> None:
        self._points = points
        self._white: tuple[tuple[object, ...], Float32Array] = (), np.zeros((0, 3), np.float32)
        self.posed, self.blockers = PosedPoints(scene, points), Blockers(points)

    def draw(
        self, of: ShadingState, camera: CameraDescription, resolution: tuple[int, int], poses: Poses = (),
        quality: Quality = "moving", turned: bool = True,
    ) -> Float32Array:  # fmt: skip
        """Draw radiance (H, W, 3); see `Deform.draw`."""
        points, camera_position, fine = (
            self._points,
            camera_position_of(of.scene, camera),
            2 if quality == "rest" else 1,
        )
        places, frames = self.posed.at(poses)
        white = self._shade_points(of, poses, places, frames, turned)
        gloss = self._gloss(of, places, frames, camera_position, white)
        drawn = draw(points.surface, places, camera, camera_position, (resolution[0] * fine, resolution[1] * fine))
        picture = paint(drawn, points.surface, white, gloss, of.albedos, of.scene.emission, of.backdrop)
        for i in of.layers_of:
            self._add_by_pixel(of, i, drawn, white, picture, quality)
        return _downsample(picture) if fine == 2 else picture

    def draw_errors(
        self, of: ShadingState, camera: CameraDescription, resolution: tuple[int, int], poses: Poses = ()
    ) -> Float32Array:
        """Draw the errors of the visible lobes (H, W, 3); see `Deform.draw_errors`."""
        drawn = draw(
            self._points.surface, self.posed.at(poses)[0], camera, camera_position_of(of.scene, camera), resolution
        )
        errors = np.repeat(error_to_radiance(of.errors).astype(np.float32)[:, None], 3, axis=1)
        one = np.ones((len(of.scene.smooth), 3), np.float32)
        picture = paint(drawn, self._points.surface, errors, np.zeros_like(errors), one, np.zeros_like(one))
        for i, found in of.details.items():
            if (pixels := pixels_of(i, drawn, self._points)) is not None:
                of_pixels = error_to_radiance(found.errors_at(pixels.uvs(of.scene))).astype(np.float32)
                picture[pixels.rows, pixels.columns] = of_pixels[:, None]
        return picture

    def _shade_points(
        self, of: ShadingState, poses: Poses, places: Float32Array, frames: Float32Array, turned: bool
    ) -> Float32Array:
        """Radiance of white Lambertian points (S, 3), with the shadows that transfer does not contain."""
        made_of = (poses, turned, of.lobes, of.bands, of.casters)
        if self._white[0] != made_of:
            turns = frames if turned else self._points.rest_frames_of_drawn
            white = np.maximum(shade(of.lobes, turns, of.bands), np.float32(0.0))
            rows, normals = self.blockers.rows(of.casting_objects), np.ascontiguousarray(frames[:, 2])
            add_shadows(rows, of.casts, self._points, places, normals, of.bands, white)
            self._white = made_of, white
        return self._white[1]

    def _gloss(
        self,
        of: ShadingState,
        places: Float32Array,
        frames: Float32Array,
        camera_position: NDArray[np.float64],
        white: Float32Array,
    ) -> Float32Array:
        """Radiance that points with glossy layers send to the camera (S, 3)."""
        sent = np.zeros_like(white)
        normals = np.ascontiguousarray(frames[:, 2])
        for i in of.layers_of:
            for low, factor in of.glosses_of(i):
                add_gloss(
                    low, factor, self._points.points_of(i), places, normals, camera_position, of.bands, white, sent
                )
        return sent

    def _add_by_pixel(
        self,
        of: ShadingState,
        i: int,
        drawn: RasterResult,
        white: Float32Array,
        picture: Float32Array,
        quality: Quality,
    ) -> None:
        layers = list(of.pixel_layers(i))
        pixels = pixels_of(i, drawn, self._points) if layers else None
        if pixels is None:
            return
        diffuse = self._diffuse(of, i, pixels, white) * (pixels.points[:, :1] >= 0)
        for layer in layers:
            factor = pixels.factor(of.scene, layer.maps, quality == "moving")
            picture[pixels.rows, pixels.columns] += np.maximum(diffuse * factor * albedo(layer), 0.0)

    def _diffuse(self, of: ShadingState, i: int, pixels: Pixels, white: Float32Array) -> Float32Array:
        """Radiance of white Lambertian pixels (N, 3)."""
        if i not in of.details:
            return np.einsum("nk,nki->ni", pixels.weights, white[pixels.points])
        numbers, axes = self.posed.axes_of(i)
        own = axes[numbers[pixels.triangle]]
        return shade_pixels(of.details[i], pixels.uvs(of.scene), own, pixels.weights, pixels.is_front, of.bands)


def camera_position_of(scene: Scene, camera: CameraDescription) -> NDArray[np.float64]:
    """A camera's position in the coordinates of a scene's vertices (3,)."""
    return np.subtract(camera.position, scene.origin).astype(np.float64)


def _downsample(picture: Float32Array) -> Float32Array:
    """Halve the resolution."""
    height, width = picture.shape[0] // 2, picture.shape[1] // 2
    return np.asarray(picture.reshape(height, 2, width, 2, 3).mean(axis=(1, 3)), np.float32)
