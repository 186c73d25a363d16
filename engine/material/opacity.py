"""How much of an object is there, point by point: holes in leaves, fences and lace, and partly covering surfaces.

The opacity of a point is that of the object times the alpha of an image and of the mesh's vertex colours [glTF20,
3.9.4]:

    mask    the surface is there where the opacity is at least the cutoff, and rays pass elsewhere;
    blend   it is there with the opacity as probability: a ray that meets it passes in (1 - opacity) of all cases.

Both hold for every ray: to the camera, of shadows and of further bounces. Colours are not multiplied by the opacity
(alpha is straight, as in glTF and PNG). Blending is coverage, as by a fine grid of holes: what covers a half reflects
half of what it would, and its highlights are half as bright. It refracts and tints nothing.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, cast

from engine.material.layer_maps import TEXTURE_SCALE, TextureTransform, Wrap
from engine.material.map_tables import (
    flag_value,
    image_file_name,
    offset_value,
    rotation_value,
    uv_set_value,
    wrap_value,
)
from engine.material.parameters import Parameter, ParameterError

Mode = Literal["opaque", "mask", "blend"]
MODES: tuple[Mode, ...] = ("opaque", "mask", "blend")
OPACITY_MODE = Parameter(
    "opacity_mode",
    "choice",
    "opaque",
    "Opacity",
    "Whether all of the surface is there (opaque), what is at least as opaque as the cutoff (mask), or the share of it "
    "that its opacity says (blend). Shown when idle.",
    choices=MODES,
)
OPACITY_CUTOFF = Parameter(
    "opacity_cutoff",
    "scalar",
    0.5,
    "Cutoff",
    "Where the opacity is lower, a masked surface is not there, nor is its shadow. Shown when idle.",
)
OPACITY_FACTOR = Parameter(
    "opacity_factor", "scalar", 1.0, "Factor", "Multiplies the opacity of image and vertices. Shown when idle."
)


@dataclass(frozen=True)
class Opacity:
    """The opacity of one object, see the module.

    opacity_map: an image, named like textures (`engine.material.layer_maps.LayerMaps`), whose alpha counts, or, where
    it has none, its luminance; opacity_repeats, opacity_offset, opacity_rotation, opacity_wrap and opacity_uv_set lay
    it out. opacity_vertices: whether the alpha of the mesh's vertex colours counts.
    """

    opacity_mode: Mode = "opaque"
    opacity_cutoff: float = 0.5
    opacity_factor: float = 1.0
    opacity_map: str = ""
    opacity_repeats: tuple[float, float] = (1.0, 1.0)
    opacity_offset: tuple[float, float] = (0.0, 0.0)
    opacity_rotation: float = 0.0
    opacity_wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")
    opacity_uv_set: int = 0
    opacity_vertices: bool = False

    @property
    def transform(self) -> TextureTransform:
        """The mapping of texture coordinates to the image."""
        return TextureTransform(self.opacity_rotation, self.opacity_offset, self.opacity_wrap, self.opacity_uv_set)

    @property
    def lets_pass(self) -> bool:
        """Whether any ray can pass."""
        is_whole = not self.opacity_map and not self.opacity_vertices and self.opacity_factor >= self._least
        return self.opacity_mode != "opaque" and not is_whole

    @property
    def _least(self) -> float:
        return self.opacity_cutoff if self.opacity_mode == "mask" else 1.0


# By the names of objects.
OpacityByObject = tuple[tuple[str, Opacity], ...]
OPAQUE = Opacity()


def opacity_fields() -> tuple[str, ...]:
    """The names of `Opacity`'s parts in sessions, scripts and paths."""
    return tuple(field.name for field in dataclasses.fields(Opacity))


def set_opacity_field(opacity: Opacity, name: str, value: object) -> Opacity:
    """Set one part. Raises ParameterError for a value that the part does not accept."""
    if name not in _ACCEPTED:
        raise ParameterError(name, value, "one of " + ", ".join(_ACCEPTED))
    changes: dict[str, Any] = {name: _ACCEPTED[name](name, value)}
    return dataclasses.replace(opacity, **changes)


def opacity_of_parts(parts: Mapping[str, object]) -> Opacity:
    """Opacity from its parts by name, the others at their defaults. Raises ParameterError."""
    opacity = OPAQUE
    for name, value in parts.items():
        opacity = set_opacity_field(opacity, name, value)
    return opacity


def opacity_parts(opacity: Opacity) -> dict[str, Any]:
    """The parts that differ from the default, by name."""
    return {name: value for name, value in vars(opacity).items() if value != getattr(OPAQUE, name)}


def opacity_from(table: Mapping[str, object]) -> Opacity:
    """Opacity from its table in a scene's file: {mode, cutoff, factor, file, ...}. Raises ParameterError."""
    names = {_key(name): name for name in opacity_fields()}
    if not set(table) <= set(names):
        raise ParameterError("opacity", table, f"a table of {', '.join(names)}")
    return opacity_of_parts({names[key]: value for key, value in table.items()})


def opacity_values(opacity: Opacity) -> dict[str, Any]:
    """The inverse; empty for a surface that is all there."""
    return {
        _key(name): list(value) if isinstance(value, tuple) else value for name, value in opacity_parts(opacity).items()
    }


def _key(name: str) -> str:
    """The name of a part in a scene's file."""
    return "file" if name == "opacity_map" else name.removeprefix("opacity_")


_ACCEPTED: dict[str, Callable[[str, object], Any]] = {
    "opacity_mode": lambda name, value: cast(Mode, OPACITY_MODE.accept(value)),
    "opacity_cutoff": lambda name, value: OPACITY_CUTOFF.accept(value),
    "opacity_factor": lambda name, value: OPACITY_FACTOR.accept(value),
    "opacity_map": image_file_name,
    "opacity_repeats": lambda name, value: TEXTURE_SCALE.accept(value),
    "opacity_offset": offset_value,
    "opacity_rotation": rotation_value,
    "opacity_wrap": wrap_value,
    "opacity_uv_set": uv_set_value,
    "opacity_vertices": flag_value,
}
