"""A reader of libraries of materials of OBJ files (MTL): numbers and images by key.

Lines before the first material are skipped. A value that is no number is not read; `unread` has its key.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from engine.core.errors import LoadError
from engine.material.layer_maps import LEAST_REPEATS, MAX_REPEATS

MAX_MATERIALS = 4096
_MOST_KEYS = 256  # of one material
_IMAGES = {
    "map_kd": "map_kd", "map_ks": "map_ks", "map_d": "map_d", "map_bump": "bump", "bump": "bump", "norm": "norm",
    "map_ke": "map_ke", "map_pr": "map_pr", "map_pm": "map_pm", "map_ns": "map_ns",
}  # fmt: skip
_NAMING = frozenset({"newmtl", "usemtl", "mtllib", *_IMAGES})
# Options of images: how many numbers follow at most, 0 for a word.
_OPTIONS = {"-o": 3, "-s": 3, "-t": 3, "-mm": 2, "-bm": 1, "-boost": 1, "-texres": 1,
            "-clamp": 0, "-blendu": 0, "-blendv": 0, "-cc": 0, "-imfchan": 0, "-type": 0}  # fmt: skip


@dataclass(frozen=True)
class MtlImage:
    """An image by its name in the file; repeats and offset along u and v, upwards; whether it is clamped; its strength
    (-bm)."""

    name: str
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)
    is_clamped: bool = False
    strength: float = 1.0


@dataclass
class MtlMaterial:
    """A material of a library in `folder`: numbers and images by key in lower case; `unread`: keys that are not known
    here, or whose value is not of that form; by_blender: whether Blender wrote the library."""

    folder: Path
    by_blender: bool = False
    values: dict[str, list[float]] = field(default_factory=dict)
    images: dict[str, MtlImage] = field(default_factory=dict)
    unread: dict[str, None] = field(default_factory=dict)

    @property
    def is_physical(self) -> bool:
        """Whether it has numbers or images of the extension for physically based materials."""
        return bool({"pr", "pm"} & self.values.keys() or {"map_pr", "map_pm"} & self.images.keys())

    def colour(self, key: str, default: float = 0.0, most: float = 1.0) -> tuple[float, float, float]:
        """Three numbers from 0 to `most`; a single one stands for all."""
        found = self.values.get(key, [default])
        red, green, blue = (min(max(v, 0.0), most) for v in (found if len(found) == 3 else found[:1] * 3))
        return red, green, blue

    def number(self, key: str, default: float, least: float = 0.0, most: float = 1.0) -> float:
        """One number from `least` to `most`."""
        return min(max(self.values.get(key, [default])[0], least), most)


def parse_library(data: bytes, path: Path) -> dict[str, MtlMaterial]:
    """The materials of a library by name; raises LoadError for too many."""
    text = data.decode("utf-8", "replace")
    by_blender = text[:200].lstrip().startswith("# Blender")
    found: dict[str, MtlMaterial] = {}
    material = MtlMaterial(path.parent)
    for line in text.splitlines():
        words = words_of_line(line)
        if not words:
            continue
        if words[0].lower() == "newmtl":
            material = found.setdefault(" ".join(words[1:]), MtlMaterial(path.parent, by_blender))
            if len(found) > MAX_MATERIALS:
                raise LoadError(path, "materials", f"more than {MAX_MATERIALS}", f"at most {MAX_MATERIALS}")
        elif len(material.values) + len(material.unread) < _MOST_KEYS:
            _read_line(material, words[0].lower(), words[1:])
    return found


def words_of_line(line: str) -> list[str]:
    """The words of a line without its comment. Where a line gives a name, a number sign belongs to it unless it stands
    alone: 3ds Max calls materials "Material #25"."""
    words = line.split()
    if "#" in line and words:
        alone = words.index("#") if "#" in words else len(words)
        words = words[:alone] if words[0].lower() in _NAMING else line.partition("#")[0].split()
    return words


def _read_line(material: MtlMaterial, key: str, words: list[str]) -> None:
    """One value of a material."""
    if key in _IMAGES:
        image, ignored = _read_image(words)
        material.images[_IMAGES[key]] = image
        material.unread |= {f"{key} {option}": None for option in ignored}
    elif numbers := _leading_numbers(words, 3):
        material.values[key] = numbers
    else:
        material.unread[key] = None


def _read_image(words: list[str]) -> tuple[MtlImage, list[str]]:
    """An image, and those of its options that are not read."""
    found: dict[str, list[float]] = {}
    ignored: list[str] = []
    at, is_clamped = 0, False
    while at < len(words) - 1 and words[at].lower() in _OPTIONS:
        option = words[at].lower()
        numbers = _leading_numbers(words[at + 1 :], _OPTIONS[option])
        at += 1 + (len(numbers) or 1)
        found[option] = numbers
        if option == "-clamp":
            is_clamped = words[at - 1].lower() == "on"
        elif option not in ("-o", "-s", "-bm", "-blendu", "-blendv", "-texres", "-type"):
            ignored.append(option)
    across, up = [*found.get("-s", []), 1.0, 1.0][:2] if len(found.get("-s", [])) != 1 else found["-s"] * 2
    right, above = [*found.get("-o", []), 0.0, 0.0][:2]
    image = MtlImage(
        " ".join(words[at:]), (_repeat(across), _repeat(up)), (_offset(right), _offset(above)), is_clamped,
        [*found.get("-bm", []), 1.0][0],
    )  # fmt: skip
    return image, ignored


def _leading_numbers(words: Sequence[str], most: int) -> list[float]:
    """The finite numbers that a line begins with."""
    numbers: list[float] = []
    for word in words[:most]:
        try:
            number = float(word)
        except ValueError:
            break
        if not abs(number) <= 1e30 or "_" in word:
            break
        numbers.append(number)
    return numbers


def _repeat(number: float) -> float:
    """Repeats of an image that a layer can have."""
    size = min(max(abs(number), LEAST_REPEATS), MAX_REPEATS)
    return -size if number < 0.0 else size


def _offset(number: float) -> float:
    return min(max(number, -MAX_REPEATS), MAX_REPEATS)
