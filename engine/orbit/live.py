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
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from engine.light.environment import Environment
from engine.material.layer import Layer
from engine.orbit.incident import Incident, Lamps, light, no_light
from engine.orbit.picture import Seen, look, picture, reflected, sunlit
from engine.orbit.shading_points import ShadingPoints, shading_points
from engine.orbit.sky import Sky, make_sky
from engine.orbit.slices import Slices, make_slices
from engine.orbit.visibility import N_UPPER, Bits, see, see_patches
from engine.render.maps import MapFactors
from engine.render.still import StillProgress
from engine.scene.description import CameraDescription
from engine.scene.load import Scene
from engine.scene.raycaster import RayCaster
from engine.transport.pipeline import SkyState, patches_of

Floats = NDArray[np.float32]
LayersOf = Mapping[int, Sequence[Layer]]
Quality = Literal["moving", "rest"]
Steps = Iterator[StillProgress]

N_POINTS = 40_000  # besides the meshes' own vertices
N_COEFFICIENTS = 320
N_PATCHES = 64
# How far the work is when its parts end.
_POINTS, _SEEING, _LIGHTING = 0.05, 0.8, 0.95


@dataclass(frozen=True)
class _Term:
    """Layers of an object that are reflected together, and which of its visible layers' maps multiply them."""

    i_object: int
    layers: tuple[Layer, ...]
    factor: int | None = None


class Orbit:
    """A scene of which pictures are drawn from anywhere; see above."""

    def __init__(
        self, scene: Scene, caster: RayCaster | None = None, n_points: int = N_POINTS,
        n_coefficients: int = N_COEFFICIENTS, n_patches: int = N_PATCHES,
    ) -> None:  # fmt: skip
        """caster: of the scene's triangles, where there is one; n_points: besides the meshes' vertices; n_coefficients:
        of light, 20 to 5,120 a point; n_patches: of all emitters."""
        self.scene = scene
        self.version = 0
        self._caster = caster or RayCaster(scene.vertices, scene.triangles)
        self._n_points, self._n_coefficients, self._n_patches = n_points, n_coefficients, n_patches
        self._points: ShadingPoints | None = None
        self._rays: RayCaster | None = None
        self._bits: Bits = np.empty((0, N_UPPER // 2), np.uint8)
        self._n_seen = 0
        self._light: SkyState = SkyState(None)
        self._sky: Sky | None = None
        self._lamps: Lamps | None = None
        self._incident: Incident | None = None
        self._n_lit = 0
        self._layers_of: LayersOf = {}
        self._slices: dict[tuple[Layer, ...], Slices] = {}

    # ------------------------------------------------------------------------------------------------ what is wanted

    def set_light(self, sky: SkyState) -> None:
        """The distant light from now on."""
        if sky != self._light:
            self._light, self._sky, self._n_lit = sky, None, 0

    def shine(self, emission: Mapping[str, tuple[float, float, float]]) -> None:
        """Give emitters, by name, this radiance from now on, see `Scene.shining`."""
        self.scene = self.scene.shining(emission)
        self._lamps, self._n_lit = None, 0

    def set_layers(self, layers_of: LayersOf) -> None:
        """The layers of each object, by its index, from now on; what did not change is not computed again."""
        self._layers_of = {i: tuple(layers) for i, layers in layers_of.items()}
        self.version += 1

    # ----------------------------------------------------------------------------------------------------- the work

    @property
    def is_ready(self) -> bool:
        """Whether anything can be drawn."""
        return self._points is not None

    @property
    def is_done(self) -> bool:
        """Whether there is no work left."""
        return self.is_ready and all(layers in self._slices for layers in self._wanted()) and self._is_lit

    def work(self) -> Steps:
        """All that is missing, piece by piece; ends where nothing is. What is set meanwhile is taken up at once."""
        while not self.is_done:
            if self._points is None:
                yield StillProgress(0.0, "shading points")
                self._place(shading_points(self.scene, self._caster, self._n_points))
            elif missing := [layers for layers in self._wanted() if layers not in self._slices]:
                self._slices[missing[0]] = make_slices(missing[0])
                self.version += 1
                yield StillProgress(_POINTS, "reflection")
            elif self._n_seen < len(self._points):
                yield from self._see(self._points)
            else:
                yield from self._relight(self._points)

    # ---------------------------------------------------------------------------------------------------- pictures

    def draw(self, camera: CameraDescription, resolution: tuple[int, int], quality: Quality = "rest") -> Floats:
        """Radiance (H, W, 3) as it is known by now; resolution (width, height).

        quality: "moving", as quick as it gets; "rest", every pixel on its own. Raises ValueError before `is_ready`.
        """
        drawing = self.drawing(camera, resolution, quality)
        while True:
            try:
                next(drawing)
            except StopIteration as end:
                drawn: Floats = end.value
                return drawn

    def drawing(
        self, camera: CameraDescription, resolution: tuple[int, int], quality: Quality = "rest"
    ) -> Generator[StillProgress, None, Floats]:
        """The same, piece by piece."""
        if self._points is None or self._rays is None or self._incident is None:
            raise ValueError("nothing is ready to be drawn: expected some steps of work before")
        points, incident = self._points, self._incident
        seen = look(self.scene, points, self._rays, camera, resolution)
        yield StillProgress(0.2, "rays")
        radiance = np.zeros((len(seen.pixel), 3), np.float32)
        terms = self._terms()
        factors = self._factors(seen)
        for done, term in enumerate(terms):
            slices = self._slices.get(term.layers)
            if slices is not None:
                own = reflected(points, seen, incident, {term.i_object: slices}, quality == "rest")
                if quality == "rest" and self._sky is not None:
                    own += sunlit(points, self._bits, seen, self._sky, {term.i_object: term.layers})
                radiance += own if term.factor is None else own * factors[:, term.factor]
            yield StillProgress(0.2 + 0.8 * (done + 1) / len(terms), "reflection")
        return picture(seen, radiance, self._environment, self._light.rotation)

    # ------------------------------------------------------------------------------------------------------ within

    @property
    def _environment(self) -> Environment | None:
        environment = self._light.environment
        if environment is None or self._light.scale == 1.0:
            return environment
        return replace(environment, radiance=environment.radiance * np.float32(self._light.scale))

    @property
    def _is_lit(self) -> bool:
        return self._points is not None and self._n_lit == self._n_seen == len(self._points)

    def _place(self, points: ShadingPoints) -> None:
        self._points, self._rays = points, points.caster()
        self._bits = np.full((len(points), N_UPPER // 2), 255, np.uint8)
        self._incident = no_light(points, self._n_coefficients)
        self.version += 1

    def _see(self, points: ShadingPoints) -> Steps:
        for start, stop, part in see(points, self._caster):
            self._bits[start:stop], self._n_seen = part, stop
            yield StillProgress(_POINTS + (_SEEING - _POINTS) * stop / len(points), "visibility")

    def _relight(self, points: ShadingPoints) -> Steps:
        """Ends early where other light is wanted meanwhile."""
        assert self._incident is not None
        wanted = self._light
        if self._sky is None:
            self._sky = make_sky(self._environment, self._light.rotation)
        patches = patches_of(self.scene, self._n_patches)
        if patches is not None and self._lamps is None:
            self._lamps = Lamps(patches, see_patches(points, self._caster, patches))
        for done in light(points, self._bits, self._sky.sunless, self._incident, self._lamps):
            self.version += 1
            yield StillProgress(_SEEING + (1.0 - _SEEING) * done / max(len(points), 1), "light")
            if self._light is not wanted:
                return
        self._n_lit = len(points)

    def _terms(self) -> list[_Term]:
        """What is reflected: of each object the layers without maps together, and each of the others."""
        terms = []
        for i, layers in self._layers_of.items():
            visible = tuple(layer for layer in layers if layer.visible)
            plain = tuple(layer for layer in visible if layer.maps.is_plain)
            terms += [_Term(i, plain)] if plain else []
            terms += [_Term(i, (layer,), k) for k, layer in enumerate(visible) if not layer.maps.is_plain]
        return terms

    def _wanted(self) -> set[tuple[Layer, ...]]:
        return {term.layers for term in self._terms()}

    def _factors(self, seen: Seen) -> Floats:
        """By what maps multiply the visible layers at the pixels, (P, K, 3)."""
        factors = MapFactors(self.scene, self._layers_of)
        return factors.of_hits(seen.found, seen.objects, seen.pixel)
