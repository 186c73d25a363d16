"""What a file of geometry contains, whatever its format: parts with their materials, cameras, and what is not shown.

Every reader returns an `ImportedModel` (`formats.read_model`), in the file's own frame, with Y up and in metres.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from engine.light.environment import Environment
from engine.light.suns import SUN_DIAMETER
from engine.material.bumps import NO_BUMPS, Bumps
from engine.material.layer_maps import LayerMaps
from engine.material.opacity import OPAQUE, Opacity
from engine.scene.description import Camera, LayerDescription
from engine.scene.mesh import Mesh
from engine.scene.rig import Rig

RGB = tuple[float, float, float]


@dataclass(frozen=True)
class Emission:
    """What a material shines: radiance from its front, None for none, which its texture multiplies. unlit: the camera
    alone sees it, and it lights nothing."""

    radiance: RGB | None = None
    texture: LayerMaps = LayerMaps()
    unlit: bool = False

    def is_like(self, other: Emission) -> bool:
        """Whether it is another but for its radiance."""
        return (self.texture, self.unlit) == (other.texture, other.unlit)

    @property
    def without_images(self) -> Emission:
        """On a mesh without texture coordinates: the texture white; vertex colours remain."""
        return replace(self, texture=LayerMaps(vertex_colours=self.texture.vertex_colours))


NO_EMISSION = Emission()


@dataclass(frozen=True)
class ImportedVariant:
    """The material of a part in one of the file's variants, by its name."""

    name: str
    layers: tuple[LayerDescription, ...]
    emission: RGB | None = None
    bumps: Bumps = NO_BUMPS
    opacity: Opacity = OPAQUE


@dataclass(frozen=True)
class ImportedPart:
    """All triangles of one material. layers: empty where the file has no material that is read; smooth: whether normals
    are interpolated, computed where the mesh has none; name: the material's, empty if it has none; variants: other
    materials, empty where all are the same; object_name: what an object of this part is called, as its material where
    that is empty."""

    mesh: Mesh
    layers: tuple[LayerDescription, ...] = ()
    emission: Emission = NO_EMISSION
    rig: Rig | None = None
    bumps: Bumps = NO_BUMPS
    opacity: Opacity = OPAQUE
    smooth: bool = True
    name: str = ""
    variants: tuple[ImportedVariant, ...] = ()
    object_name: str = ""


@dataclass(frozen=True)
class ImportedCamera:
    """A camera of the file. aspect: the picture's width by its height, None if the file does not say it."""

    name: str
    camera: Camera
    aspect: float | None = None

    def under(self, matrix: npt.NDArray[np.float64]) -> ImportedCamera:
        """The camera under an affine transform (4, 4) of what it shows; the angle of view stays."""
        own, linear = self.camera, matrix[:3, :3]
        placed = {
            "position": linear @ own.position + matrix[:3, 3],
            "target": linear @ own.target + matrix[:3, 3],
            "up": linear @ own.up,
        }
        return replace(self, camera=own.model_copy(update={key: triple(value) for key, value in placed.items()}))


@dataclass(frozen=True)
class ImportedLight:
    """A light without size. intensity: RGB, W/sr, of a directional one the irradiance in W/m²; direction: unit, in
    which its light goes; inner, outer: half angles of a spot's cone, radians; diameter: of a directional one, degrees.
    The name is one for an object."""

    name: str
    kind: Literal["point", "spot", "directional"]
    intensity: RGB
    position: RGB = (0.0, 0.0, 0.0)
    direction: RGB = (0.0, 0.0, -1.0)
    inner: float = 0.0
    outer: float = 0.0
    diameter: float = SUN_DIAMETER


LampShape = Literal["sphere", "disc", "quad"]


@dataclass(frozen=True)
class ImportedLamp:
    """A light of some size: a primitive of that shape under a matrix (4, 4), which shines from its front with a
    radiance, RGB in W/(m² sr), in all directions or into a cone about its +Z with these half angles, radians; texture:
    an image, by its name in parts, that multiplies it. The name is one for an object."""

    name: str
    shape: LampShape
    matrix: npt.NDArray[np.float64]
    radiance: RGB
    cone: tuple[float, float] | None = None
    texture: str = ""


@dataclass(frozen=True)
class ImportedDome:
    """Light from infinity: a radiance, or, where there is an image by its name from the file's folder, what multiplies
    it; rotation: degrees, of `EnvironmentDescription`; image: that of this name (`#domes`), where it is no file."""

    radiance: RGB
    file: str = ""
    rotation: float = 0.0
    image: Environment | None = None


def triple(vector: npt.NDArray[np.float64]) -> RGB:
    """The numbers of a vector (3,)."""
    x, y, z = vector.tolist()
    return x, y, z


@dataclass(frozen=True)
class UnshownProperty:
    """A property that the picture does not show, or shows in part.

    name: its path in the file's own words, such as "materials.KHR_materials_volume.thicknessFactor"; count: of places
    that have it; effect: what the picture lacks, in a few words.
    """

    name: str
    count: int
    effect: str


@dataclass(frozen=True)
class VariantSet:
    """A choice that a file offers of what it shows: its name, the variants, and the one that was read, "" for none."""

    name: str
    variants: tuple[str, ...]
    chosen: str = ""


@dataclass(frozen=True)
class ImportedModel:
    """Parts, one for each material in use; notes on what was repaired or left out; cameras; lights without size, lamps,
    the dome; properties that are not shown; sets of variants, of which others are read anew. unread: the names of
    materials that are not read, empty if there are none."""

    parts: tuple[ImportedPart, ...]
    notes: tuple[str, ...] = ()
    cameras: tuple[ImportedCamera, ...] = ()
    unshown: tuple[UnshownProperty, ...] = ()
    unread: str = ""
    lights: tuple[ImportedLight, ...] = ()
    lamps: tuple[ImportedLamp, ...] = ()
    dome: ImportedDome | None = None
    variant_sets: tuple[VariantSet, ...] = ()
