"""The distant light and the emitters, as they reach each object of a scene."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from engine.light.emitters import EmitterPatches
from engine.precompute.direct.linking import object_groups, sky_numbers
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.triple_product.incident import ReachingLight, SceneEmitters, SkyMap, make_sky
from engine.realtime.triple_product.lit_points import LitPoints
from engine.realtime.triple_product.scene_patches import ScenePatches
from engine.scene.scene_loader import Scene


class ReachingLights:
    """The distant light, `sky`, as points look it up; and with the emitters' patches what reaches whom."""

    def __init__(self) -> None:
        self.sky, self.sky_map = SkyState(None), make_sky(None, 0.0)
        self._linked: list[SkyMap] = []

    def set_sky(self, sky: SkyState) -> bool:
        """Set the distant light; returns whether it is another."""
        if sky == self.sky:
            return False
        self.sky, self.sky_map = sky, _sky_map(sky)
        self._linked = [_sky_map(link.sky) for link in sky.links]
        return True

    def sky_maps(self, n_objects: int) -> list[SkyMap]:
        """The distant light for each object: what its links say."""
        maps = self.sky_map, *self._linked
        return [maps[number] for number in sky_numbers(self.sky, n_objects)]

    def reaching(self, scene: Scene, patches: ScenePatches | None, lit: LitPoints) -> list[ReachingLight]:
        """What reaches each group of objects."""
        skies = {id(link.sky): own for link, own in zip(self.sky.links, self._linked, strict=True)}
        return [
            ReachingLight(objects, skies.get(id(sky), self.sky_map), _scene_emitters(scene, patches, lit, emitters))
            for objects, sky, emitters in object_groups(self.sky, len(scene.emission))
        ]


def shining_patches(scene: Scene, patches: ScenePatches | None) -> EmitterPatches | None:
    """The emitters' patches with their radiance; None where nothing emits."""
    if patches is None:
        return None
    of_all, owner = patches
    return replace(of_all, radiance=scene.emission[owner] * of_all.radiance)


def _scene_emitters(
    scene: Scene, patches: ScenePatches | None, lit: LitPoints, reaching: NDArray[np.bool_]
) -> SceneEmitters | None:
    """Those of the emitters that reach some objects."""
    if patches is None:
        return None
    of_all, owner = patches
    emission = np.where(reaching[:, None], scene.emission, np.float32(0.0))
    return SceneEmitters(replace(of_all, radiance=emission[owner] * of_all.radiance), lit.patch_bits)


def _sky_map(sky: SkyState) -> SkyMap:
    return make_sky(sky.environment, sky.rotation, sky.scale)
