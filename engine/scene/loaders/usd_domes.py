"""The dome lights of a USD stage [UsdLux] as one environment, in the file's frame.

A dome shines with the radiance of its image, seen from inside with +Z of its own frame at the centre and its pole up,
times a colour. One upright dome with a grey colour and an image beside the file is left as it is: the environment is
that file, turned. Of any others one image is computed, at most `MOST_ROWS` high: each dome's own is turned by 2 x 2
samples a texel and tinted, and all are added up. The light of each keeps its sum over the sphere.
"""

from __future__ import annotations

import math
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from engine.core.errors import LoadError, describe_value
from engine.core.safe_files import temporary_file
from engine.light.environment import Environment, downsample, load_environment, texel_solid_angles
from engine.light.radiance_files import MAX_FILE_BYTES
from engine.scene.description import MAX_RADIANCE
from engine.scene.loaders.model import ImportedDome, triple
from engine.scene.loaders.usd_layers import UsdLayers, UsdPlace
from engine.scene.loaders.usd_prims import Float64Array, UsdPrim, UsdScene
from engine.texture.texture_files import read_texture

DOMES = ("DomeLight", "DomeLight_1")
MOST_ROWS = 1024
MOST_IMAGES = 4
IMAGE = "#domes"  # what the image of several is called
_FLOATS, _INTEGERS = (".exr", ".hdr", ".pic"), (".png", ".jpg", ".jpeg", ".webp")
_TILTED = math.cos(math.radians(0.5))
_BAND = 64  # rows that are turned at once
# The pole of a dome along +Z, as `OrientToStageUpAxis` turns it; and images of ours, whose centre is at −Z.
_POLE_Z = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
_BACKWARDS = np.diag([-1.0, 1.0, -1.0])


@dataclass(frozen=True)
class _Dome:
    """colour (3,): what multiplies the image, or the radiance of one without; frame (3, 3): its axes."""

    prim: UsdPrim
    colour: Float64Array
    frame: Float64Array
    image: UsdPlace | None

    @property
    def is_upright(self) -> bool:
        """Whether its image is only turned about the vertical axis."""
        return float(self.frame[1, 1]) >= _TILTED and float(np.linalg.det(self.frame)) > 0.0

    @property
    def rotation(self) -> float:
        """Degrees, of `EnvironmentDescription`, of one that is upright."""
        centre = self.frame[:, 2]
        return math.degrees(math.atan2(-centre[0], -centre[2]))


@dataclass
class UsdDomes:
    """The dome lights of a stage."""

    layers: UsdLayers
    scene: UsdScene
    _found: list[_Dome] = field(default_factory=list)

    def add(self, prim: UsdPrim, matrix: Float64Array, radiance: Float64Array) -> None:
        """Take a dome at its place (4, 4) with its radiance (3,). Raises LoadError."""
        lengths = np.linalg.norm(matrix[:3, :3], axis=0)
        frame = matrix[:3, :3] / np.maximum(lengths, 1e-300)
        if abs(np.linalg.det(frame)) < 1e-6:
            raise prim.error("xformOpOrder", "a flat transform", "three axes")
        if prim.kind == "DomeLight_1":
            pole = prim.word("poleAxis", "scene")
            if pole == "Z" or (pole == "scene" and self.scene.up == "Z"):
                frame = frame @ _POLE_Z
        image = self._image_of(prim)
        if image is not None and sum(each.image is not None for each in self._found) >= MOST_IMAGES:
            raise prim.error("texture:file", f"image {MOST_IMAGES + 1}", f"at most {MOST_IMAGES} domes with images")
        self._found.append(_Dome(prim, np.minimum(radiance, MAX_RADIANCE), frame, image))

    def environment(self) -> ImportedDome | None:
        """All of them together; None where there are none."""
        if not self._found:
            return None
        images = [each for each in self._found if each.image is not None]
        if len(self._found) == len(images) == 1:
            (only,) = images
            if only.is_upright and _is_grey(only.colour) and (name := self._file_beside(only)):
                return ImportedDome(triple(only.colour), name, only.rotation)
        read = [(each, self._read(each)) for each in images]
        maps = [(each, image) for each, image in read if image is not None]
        constant = sum((each.colour for each in self._found if each.image is None), np.zeros(3))
        constant += sum((each.colour for each, image in read if image is None), np.zeros(3))
        if not maps:
            return ImportedDome(triple(np.minimum(constant, MAX_RADIANCE)))
        if len(maps) == 1 and maps[0][0].is_upright:
            rotation, total = maps[0][0].rotation, maps[0][1].radiance * maps[0][0].colour
        else:
            rotation, total = 0.0, self._turned(maps)
        notes = tuple(dict.fromkeys(note for _, image in maps for note in image.notes))
        found = np.minimum(total + constant, MAX_RADIANCE).astype(np.float32)
        return ImportedDome((1.0, 1.0, 1.0), IMAGE, rotation, Environment(found, IMAGE, notes))

    def _turned(self, maps: list[tuple[_Dome, Environment]]) -> Float64Array:
        """The sum (H, 2 H, 3) of images in the file's frame, with its note."""
        height = min(max(len(image.radiance) for _, image in maps), MOST_ROWS)
        total = sum(turned_image(image, each.frame, height) * each.colour for each, image in maps)
        what = f"{len(maps)} domes, added up" if len(maps) > 1 else f"{maps[0][0].prim.name} is tilted"
        self.scene.log.notes[f"environment: {what}, as one image of {2 * height} x {height} texels"] = None
        return np.asarray(total)

    def _image_of(self, prim: UsdPrim) -> UsdPlace | None:
        """Where the image of a dome is; None, listed, where there is none that can be shown."""
        key = prim.input("texture:file")
        kind, (name, layer) = prim.word(prim.input("texture:format"), "automatic"), prim.asset(key)
        if not name:
            return None
        place, effect = self.layers.find(name, layer), ""
        if kind not in ("automatic", "latlong"):
            effect = f"the dome has one radiance: {describe_value(kind)} images are not shown"
        elif place is None:
            effect = "the dome has one radiance: its image is not in the file's folder"
        elif not (place.inner or place.file.name).lower().endswith((*_FLOATS, *_INTEGERS)):
            effect = f"the dome has one radiance: its image is none of {', '.join((*_FLOATS, *_INTEGERS))}"
        if effect:
            prim.not_shown(key, effect)
            return None
        return place

    def _file_beside(self, dome: _Dome) -> str:
        """The name of its image from the file's folder; "" where that has to be computed."""
        place = dome.image
        if place is None or place.inner or place.file.suffix.lower() not in _FLOATS:
            return ""
        return self.layers.image_name(place)

    def _read(self, dome: _Dome) -> Environment | None:
        """The image of a dome; None, listed, where it cannot be read."""
        assert dome.image is not None
        name = dome.image.inner or dome.image.file.name
        try:
            data = self.layers.read(dome.image, MAX_FILE_BYTES)
            if name.lower().endswith(_INTEGERS):
                return Environment(read_texture(data, name), name)
            with tempfile.NamedTemporaryFile(suffix=".exr") as copy:
                copy.write(data)
                copy.flush()
                with temporary_file(Path(copy.name)):
                    return load_environment(copy.name)
        except LoadError as error:
            effect = f"the dome has one radiance: {name}: {error.reason}"
            dome.prim.not_shown(dome.prim.input("texture:file"), effect)
            return None


def turned_image(image: Environment, frame: Float64Array, height: int) -> npt.NDArray[np.float32]:
    """The image (height, 2 height, 3) of a dome whose axes are the columns of frame (3, 3): means of 2 x 2 samples a
    texel, weighted by their solid angle, with the sum of the light over the sphere unchanged."""
    image = downsample(image, height)
    found = np.empty((height, 2 * height, 3), np.float32)
    # From a direction in the file's frame to one in that of our images.
    back = _BACKWARDS @ np.linalg.inv(frame)
    phi = (np.arange(4 * height) + 0.5) / (4 * height) * 2.0 * math.pi - math.pi
    for start in range(0, height, _BAND):
        stop = min(start + _BAND, height)
        theta = (np.arange(2 * start, 2 * stop) + 0.5) / (2 * height) * math.pi
        sine = np.sin(theta)[:, None]
        directions = np.stack(
            np.broadcast_arrays(sine * np.sin(phi), np.cos(theta)[:, None], -sine * np.cos(phi)), axis=-1
        )
        values = image.evaluate(directions.reshape(-1, 3) @ back.T).reshape(stop - start, 2, 2 * height, 2, 3)
        weights = (sine / sine.reshape(-1, 2).sum(axis=1).repeat(2)[:, None]).reshape(stop - start, 2)
        found[start:stop] = np.einsum("hiwjc,hi->hwc", values, weights) / 2.0
    before, after = (
        np.einsum("hwc,h->c", each, texel_solid_angles(*each.shape[:2]), dtype=np.float64)
        for each in (image.radiance, found)
    )
    found *= np.divide(before, after, out=np.ones(3), where=after > 0.0).astype(np.float32)
    return found


def _is_grey(colour: Float64Array) -> bool:
    return bool(np.ptp(colour) <= 1e-6 * colour.max(initial=0.0))
