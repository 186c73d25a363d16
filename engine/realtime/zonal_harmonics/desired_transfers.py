"""Which transfer each object of a scene is to get in Deform."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace

from engine.realtime.zonal_harmonics.object_transfer import (
    N_LOBES,
    UNSHADOWED,
    ObjectTransfer,
    Reflectance,
)
from engine.scene.description import ObjectDescription
from engine.scene.surface_kinds import DeformSurface

N_BOUNCES = 2  # of an object's light onto itself
FEW_RAYS = 128  # for the first approximation


class DesiredTransfers:
    """What transfer is to be like. posed: the objects that bend; surfaces: descriptions of surfaces, by name, that
    replace those of the scene's file; n_rays of each point, n_lobes that approximate the result, n_bounces between the
    light and the camera."""

    def __init__(self, objects: Sequence[ObjectDescription], n_rays: int) -> None:
        """objects: all of the scene, as its file describes them."""
        self._objects = objects
        self.posed: frozenset[int] = frozenset()
        self.surfaces: dict[str, DeformSurface] = {}
        self.n_rays, self.n_lobes, self.n_bounces = n_rays, N_LOBES, N_BOUNCES

    def surface_of(self, i: int) -> DeformSurface:
        """The description of an object's surface."""
        described = self._objects[i]
        return self.surfaces.get(described.name, described.deform)

    @property
    def alone(self) -> tuple[int, ...]:
        """Objects whose transfer contains only themselves."""
        return tuple(i for i, each in enumerate(self._objects) if not each.is_lamp and self._is_alone(i))

    def _is_alone(self, i: int) -> bool:
        return i in self.posed or bool(self.surface_of(i).kind)

    @property
    def translucent(self) -> frozenset[int]:
        """Objects that transmit light. They need evenly spaced points: their sums over points would show where
        triangles are split."""
        return frozenset(i for i in range(len(self._objects)) if self.surface_of(i).subsurface is not None)

    def final(self, objects: Iterable[int], reflectance_of: Callable[[int], Reflectance]) -> list[ObjectTransfer]:
        """The best transfer that each of these objects is to get; reflectance_of: with which one reflects light onto
        itself."""
        # Lamps, which move live, shade others as bending objects do.
        resting = tuple(i for i, each in enumerate(self._objects) if i not in self.posed and not each.is_light)
        found = []
        for i in objects:
            surface = self.surface_of(i)
            casters = (i,) if i in self.posed or surface.kind else resting
            bright = reflectance_of(i) if surface.is_opaque and self.n_bounces else Reflectance()
            if surface.is_mapped:  # one map for all of the object
                bright = bright.average
            n_bounces = self.n_bounces if bright.brightest else 0
            if self.n_lobes == UNSHADOWED:
                found.append(ObjectTransfer(i, (), surface, Reflectance(), 0, 0, UNSHADOWED))
            else:
                found.append(ObjectTransfer(i, casters, surface, bright, n_bounces, self.n_rays, self.n_lobes))
        return found

    def missing_casters(
        self, known: Mapping[int, ObjectTransfer], shown: Collection[int], lamps: Collection[int]
    ) -> tuple[frozenset[int], ...]:
        """For each object the other bending objects, of those that are shown, and lamps, whose shadows its transfer, as
        it is known, does not contain."""
        if self.n_lobes == UNSHADOWED:
            return (frozenset(),) * len(self._objects)
        # Unlit objects have no transfer, and cast as those do that have one.
        unlit = {i for i in self.posed if self._objects[i].is_lamp}
        casters = self.posed.intersection(shown).union(unlit, lamps)
        seen = {i: each.casters for i, each in known.items()}
        return tuple(casters.difference((i, *seen.get(i, ()))) for i in range(len(self._objects)))

    def first(self, final: ObjectTransfer) -> ObjectTransfer:
        """The first approximation of a transfer, by few rays."""
        return replace(final, reflectance=Reflectance(), n_rays=min(FEW_RAYS, self.n_rays), n_lobes=1)
