"""What all work in the worker shares: the cache, the scene that is open, and its light.

A scene is open as a camera sees it: its surfaces, what can be traced in them, the primary hits and, as far as it has
been found, what of the sphere each of those sees.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from app.document import LightState
from app.jobs.cache import Store, content_key
from app.jobs.kernels import Kernels
from app.jobs.messages import Noted, SkyImage
from app.sky import sky_of
from engine.errors import InsituError
from engine.light.environment import Environment, downsampled, load_environment
from engine.scene.load import Scene
from engine.transport.pipeline import Placement, SkyState

# Raised when anything that changes the numbers in a cached array changes.
CACHE_VERSION = 4
BACKGROUND_HEIGHT = 1024


class Bench:
    """The shared state of the worker.

    kernels: what is to be ready before the first picture; None where nobody prepares them. fills: only fill the cache;
    results are neither held nor answered with.
    """

    def __init__(self, store: Store | None = None, kernels: Kernels | None = None, fills: bool = False) -> None:
        self.store = store or Store()
        self.kernels = kernels
        self.fills = fills
        self.scene_key, self.scene_id = "", 0
        self._placement: Placement | None = None
        self._environments: dict[tuple[str, str], Environment] = {}
        self._sky_shown: object = None

    @property
    def open_placement(self) -> Placement:
        """The scene that is open; InsituError where none is."""
        if self._placement is None:
            raise InsituError("no scene is open")
        return self._placement

    def open(self, placement: Placement, id: int) -> None:
        """This scene is open, by the request of that number."""
        self._placement, self.scene_key, self.scene_id = placement, _scene_key(placement.scene), id

    def noted(self) -> Iterator[Noted]:
        """What is wrong with the cache, as soon as there is something new."""
        if lines := self.store.take_notes():
            yield Noted(lines)

    def sky(self, light: LightState) -> SkyState:
        """The sky of the scene that is open, under a document's light. Raises LoadError."""
        return sky_of(self.open_placement.scene, light, self._environment)

    def sky_image(self, sky: SkyState, light: LightState) -> SkyImage | None:
        """The background, when it is not the one that was sent last."""
        shown = (light.environment, light.mapping, light.radiance)
        if shown == self._sky_shown:
            return None
        self._sky_shown = shown
        if sky.environment is None:
            return SkyImage(np.zeros((1, 2, 3), np.float32), id=self.scene_id)
        environment = sky.environment
        if environment.radiance.shape[0] > BACKGROUND_HEIGHT:
            environment = downsampled(environment, BACKGROUND_HEIGHT)
        return SkyImage(environment.radiance * np.float32(sky.scale), sky.environment.notes, id=self.scene_id)

    def forget_sky(self) -> None:
        """What was told of the sky while a scene is being opened goes unheard."""
        self._sky_shown = None

    def _environment(self, path: Path, mapping: str) -> Environment:
        key = (str(path), mapping)
        if key not in self._environments:
            self._environments = {key: load_environment(path, mapping)}  # type: ignore[arg-type]
        return self._environments[key]


def _scene_key(scene: Scene) -> str:
    camera = scene.description.camera.model_dump_json()
    return content_key(
        CACHE_VERSION, camera, scene.resolution, scene.vertices, scene.normals, scene.triangles,
        scene.object_of_triangle, scene.smooth, scene.emission,
    )  # fmt: skip


def seen_from_camera(scene: Scene, file: Path) -> Placement:
    """A scene as its camera sees it. Raises InsituError, that names the scene's file, where that is nothing to edit."""
    placement = Placement(scene)
    if not len(placement.hits.pixel):
        seen = "lamps alone" if np.any(placement.hits.object_image >= 0) else "no surface"
        raise InsituError(f"{file}: camera = sees {seen}, expected an object in view; nothing was changed")
    return placement


def frame_arrays(placement: Placement) -> dict[str, np.ndarray]:
    """What the window needs of the primary hits."""
    hits = placement.hits
    cos_o = np.clip(np.einsum("pc,pc->p", hits.normal, hits.wo), 0.0, 1.0)
    return {
        "resolution": np.array(hits.resolution),
        "pixel": hits.pixel,
        "object_ranges": hits.object_ranges,
        "object_image": hits.object_image,
        "distance": np.einsum("pc,pc->p", placement.scene.eye - hits.position, hits.wo).astype(np.float32),
        "front": hits.front,
        "theta_o": np.arccos(cos_o).astype(np.float32),
        "normal": hits.normal.astype(np.float16),
        "tangent": hits.tangent.astype(np.float16),
        "emission_image": hits.emission_image,
        "ray_directions": hits.ray_directions,
        "edge_pixels": hits.edge_pixels,
        "edge_neighbours": hits.edge_neighbours,
        "edge_weights": hits.edge_weights,
    }
