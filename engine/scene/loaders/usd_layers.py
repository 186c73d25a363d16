"""The layers of a USD file: the file itself and what it refers to, read here and handed to the decoder as bytes.

A reference, a payload or a sublayer is followed only to a file in the folder of the file that was opened, or below, and
within a .usdz archive to a file of it; what leads elsewhere, is remote or of another format is listed as not shown. A
layer is read once however often it is referred to, so that a circle of references ends here, and the library finds and
leaves out the circle itself. Images are found by the same rules.
"""

from __future__ import annotations

import importlib.util
import json
import posixpath
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from engine.core.errors import LoadError, describe_value
from engine.core.native_decoders import Arrays, DecoderError, decode_natively
from engine.core.safe_files import find_inside, read_regular_file
from engine.core.zip_files import ZipArchive
from engine.scene.loaders.model import UnshownProperty
from engine.scene.loaders.usd_stage import layer_dependencies, pack_layers, stage_tree
from engine.scene.mesh import MAX_MESH_BYTES

MOST_LAYERS = 512
INSTALL = "the extra for USD: pip install 'insitu[usd]', or usd-core"
ARCHIVE_ENDING = ".usdz"
_LAYER_ENDINGS = (".usd", ".usda", ".usdc")
_TEXT, _CRATE, _ZIP = b"#usda", b"PXR-USDC", (b"PK\3\4", b"PK\5\6")
_EXPECTED = "a USD layer (#usda or PXR-USDC) or a .usdz archive"


@dataclass(frozen=True)
class UsdPlace:
    """Where a layer or an image is: a file, or one of an archive by its name there."""

    file: Path
    inner: str = ""


@dataclass
class UsdLayers:
    """The layers of a file, the root first, the links of each by the paths that it has, and what is not shown."""

    path: Path
    places: list[UsdPlace] = field(default_factory=list)
    contents: list[bytes] = field(default_factory=list)
    links: list[dict[str, int]] = field(default_factory=list)
    unshown: dict[tuple[str, str], int] = field(default_factory=dict)
    _archives: dict[Path, ZipArchive] = field(default_factory=dict)

    @property
    def n_bytes(self) -> int:
        """The bytes of all layers, by which the cost of what they describe is limited."""
        return sum(map(len, self.contents))

    def tree(self, variants: Mapping[str, str]) -> tuple[dict[str, Any], Arrays]:
        """The tree of the stage with these variants of sets, and its arrays, see `usd_stage`; with meshes at rest where
        their skins end the decoder. Raises LoadError."""
        header = {"links": self.links, "variants": dict(variants)}
        try:
            arrays = _decode(self.path, stage_tree, pack_layers({**header, "with_pose": True}, self.contents))
        except LoadError:
            arrays = _decode(self.path, stage_tree, pack_layers({**header, "with_pose": False}, self.contents))
        return _parsed(self.path, arrays, "tree"), arrays

    def find(self, name: str, layer: int) -> UsdPlace | None:
        """The file that a layer names; None where there is none that may be read."""
        if layer >= len(self.places) or not name or name.startswith("`") or "://" in name:
            return None
        own = self.places[layer]
        outer, _, inner = name.partition("[")
        if own.inner:
            found = _in_archive(self._archive(own.file), own.inner, outer)
            return None if found is None or inner else UsdPlace(own.file, found)
        path = find_inside(self.path.parent, own.file.parent, outer)
        if path is None or not inner:
            return None if path is None else UsdPlace(path)
        found = _in_archive(self._archive(path), "", inner.rstrip("]"))
        return None if found is None else UsdPlace(path, found)

    def read(self, place: UsdPlace, most: int) -> bytes:
        """The bytes of a file. Raises LoadError."""
        return self._archive(place.file).read(place.inner) if place.inner else read_regular_file(place.file, most)

    def image_name(self, place: UsdPlace) -> str:
        """The name of an image in a part: `#N` is the Nth file of the archive that was opened."""
        number = f"#{self._archive(place.file).names.index(place.inner)}" if place.inner else ""
        if place.file == self.path and number:
            return number
        return place.file.resolve().relative_to(self.path.parent.resolve()).as_posix() + number

    @property
    def n_files(self) -> int:
        """How many files the archive has that was opened; 0 where it is none."""
        archive = self._archives.get(self.path)
        return 0 if archive is None or self.path.suffix.lower() != ARCHIVE_ENDING else len(archive.names)

    def list_unshown(self) -> list[UnshownProperty]:
        """What is referred to and not shown."""
        return [UnshownProperty(name, count, effect) for (name, effect), count in self.unshown.items()]

    def _archive(self, file: Path) -> ZipArchive:
        if file not in self._archives:
            self._archives[file] = ZipArchive(read_regular_file(file, MAX_MESH_BYTES), file)
        return self._archives[file]

    def add(self, place: UsdPlace) -> int:
        """The number of a layer, which is read where it is new; of an archive that of its first. Raises LoadError."""
        if place in self.places:
            return self.places.index(place)
        content = self.read(place, MAX_MESH_BYTES)
        if content.startswith(_ZIP) and not place.inner:
            self._archives[place.file] = ZipArchive(content, place.file)
            names = self._archives[place.file].names
            if not names or not names[0].lower().endswith(_LAYER_ENDINGS):
                raise LoadError(place.file, "first file of the archive", names[0] if names else "none", "a USD layer")
            return self.add(UsdPlace(place.file, names[0]))
        if not content.startswith((_TEXT, _CRATE)):
            raise LoadError(place.file, "first bytes", content[:8], _EXPECTED)
        if len(self.places) >= MOST_LAYERS or self.n_bytes + len(content) > MAX_MESH_BYTES:
            expected = f"at most {MOST_LAYERS}, of {MAX_MESH_BYTES} bytes together"
            raise LoadError(self.path, "layers", f"more than {len(self.places)}", expected)
        self.places.append(place)
        self.contents.append(content)
        self.links.append({})
        return len(self.places) - 1

    def follow(self, number: int) -> None:
        """Add what a layer refers to."""
        arrays = _decode(self.path, layer_dependencies, self.contents[number], self._name(number))
        for name in _parsed(self.path, arrays, "paths"):
            if not isinstance(name, str) or not name:
                continue
            effect = "not in the file's folder, or remote: what it has is missing"
            try:
                place = self.find(name, number)
                if place is not None:
                    self.links[number][name] = self.add(place)
                    continue
            except LoadError as error:
                effect = f"what it has is missing: {error.reason}"
            key = f"references.{describe_value(name)}", effect
            self.unshown[key] = self.unshown.get(key, 0) + 1

    def _name(self, number: int) -> str:
        place = self.places[number]
        return place.inner or place.file.name


def open_layers(path: Path) -> UsdLayers:
    """All layers of a .usd, .usda, .usdc or .usdz file; raises LoadError."""
    if importlib.util.find_spec("pxr") is None:
        raise LoadError(path, "reader of USD", "not installed", INSTALL)
    layers = UsdLayers(path)
    layers.add(UsdPlace(path))
    number = 0
    while number < len(layers.places):
        layers.follow(number)
        number += 1
    return layers


class ArchiveFiles:
    """The files of a .usdz archive by their numbers, none where it is another file. Raises LoadError."""

    def __init__(self, path: Path) -> None:
        data = read_regular_file(path, MAX_MESH_BYTES) if path.suffix.lower() == ARCHIVE_ENDING else b""
        self._archive = ZipArchive(data, path) if data.startswith(_ZIP) else None

    @property
    def count(self) -> int:
        return 0 if self._archive is None else len(self._archive.names)

    def read(self, number: int) -> bytes:
        """The bytes of a file below `count`. Raises LoadError."""
        assert self._archive is not None
        return self._archive.read(self._archive.names[number])


def _in_archive(archive: ZipArchive, layer: str, name: str) -> str | None:
    """The name in an archive of what one of its layers names; names count from the layer's folder, or else from the
    top."""
    for folder in dict.fromkeys((posixpath.dirname(layer), "")):
        found = posixpath.normpath(posixpath.join(folder, name.replace("\\", "/")))
        if found in archive.names:
            return found
    return None


def _decode(path: Path, decoder: Any, data: bytes, name: str = "") -> Arrays:
    try:
        return decode_natively(decoder, data)
    except DecoderError as error:
        what = f"layer {describe_value(name)}" if name and name != path.name else "USD"
        raise LoadError(path, what, str(error), "a sound USD file") from None


def _parsed(path: Path, arrays: Arrays, key: str) -> Any:
    """The JSON of a decoder's answer, whose process the file may have corrupted."""
    try:
        return json.loads(arrays[key].tobytes())
    except (KeyError, ValueError, RecursionError):
        raise LoadError(path, "USD", "makes the decoder answer nonsense", "a sound USD file") from None
