"""Descriptions of an object's surface for Deform alone: `[object.deform]` in a scene's file, see docs/deform.md."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, get_args

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from engine.core.errors import LoadError
from engine.material.parameters import Parameter
from engine.scene.toml_text import first_validation_error

MAX_NAME = 4096


def _pair(value: object) -> object:
    """Expand one number to a pair."""
    return (value, value) if isinstance(value, (int, float)) else value


def _share_or_file(value: object) -> object:
    """Validate with one message for values that are neither, where pydantic has one for each."""
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool) and 0.0 <= value <= 1.0
    if is_number or isinstance(value, str) and 1 <= len(value) <= MAX_NAME:
        return value
    raise ValueError("a number from 0 to 1, or the name of an image")


Share = Annotated[float, Field(ge=0.0, le=1.0, allow_inf_nan=False, strict=False)]
Positive = Annotated[float, Field(gt=0.0, le=1e4, allow_inf_nan=False)]
Pair = Annotated[tuple[Positive, Positive], BeforeValidator(_pair)]
File = Annotated[str, Field(min_length=1, max_length=MAX_NAME, strict=True)]
ShareOrFile = Annotated[float | str, BeforeValidator(_share_or_file)]

Scattering = Annotated[float, Field(gt=0.0, le=1e9, allow_inf_nan=False)]
Absorption = Annotated[float, Field(ge=0.0, le=1e9, allow_inf_nan=False)]
RefractiveIndex = Annotated[float, Field(ge=1.0, le=3.0, allow_inf_nan=False)]

PATTERNS = Literal["bumps", "waffle", "swirl", "weave"]
MEDIUM = ("scattering", "absorption", "ior")  # parameters of what is inside, which count where there is a thickness


class _Surface(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Membrane(_Surface):
    """A membrane so thin that light passes through: a share of it, or a map of shares; or by its thickness in metres,
    0 for none, and the scattering and absorption inside per metre."""

    translucency: ShareOrFile = 0.5
    thickness: Annotated[float, Field(ge=0.0, le=1.0, allow_inf_nan=False)] = 0.0
    scattering: Scattering = 5000.0
    absorption: Absorption = 10.0
    ior: RefractiveIndex = 1.3


class Subsurface(_Surface):
    """Subsurface scattering: reduced scattering and absorption per metre, index of refraction."""

    scattering: Scattering
    absorption: Absorption = 0.0
    ior: RefractiveIndex = 1.3


class Detail(_Surface):
    """Heights that repeat over the texture coordinates: of a pattern, or a file's brightness; times `height`.

    thickness: of a slab that light comes through from behind, below height 0, in sides of the patch; 0: opaque.
    scattering, absorption: of the slab, per side of the patch.
    """

    kind: PATTERNS | None = None
    file: File | None = None
    repeats: Pair = (1.0, 1.0)
    height: Annotated[float, Field(gt=0.0, le=10.0, allow_inf_nan=False)] = 1.0
    thickness: Annotated[float, Field(ge=0.0, le=10.0, allow_inf_nan=False)] = 0.0
    scattering: Scattering = 40.0
    absorption: Absorption = 0.1
    ior: RefractiveIndex = 1.3

    @model_validator(mode="after")
    def _has_one_source(self) -> Detail:
        if (self.kind is None) == (self.file is None):
            raise ValueError("kind: exactly one of kind and file")
        return self


class Wrinkles(_Surface):
    """Grooves across one texture coordinate: how many repeat over it, and `depth`, relative to their width, or a map of
    it by texture coordinates."""

    across: Literal["u", "v"] = "u"
    repeats: Positive = 1.0
    depth: ShareOrFile = 0.3


class DeformSurface(_Surface):
    """One of these, or none: then the object's material alone determines the light."""

    membrane: Membrane | None = None
    subsurface: Subsurface | None = None
    patch: Detail | None = None
    wrinkles: Wrinkles | None = None

    @model_validator(mode="after")
    def _is_one(self) -> DeformSurface:
        if sum(getattr(self, kind) is not None for kind in type(self).model_fields) > 1:
            raise ValueError(f"at most one of {', '.join(type(self).model_fields)}")
        return self

    @property
    def kind(self) -> str:
        """The name of its kind; empty if none."""
        return next((kind for kind in type(self).model_fields if getattr(self, kind) is not None), "")

    @property
    def values(self) -> dict[str, Any]:
        """Its values by name."""
        return dict(getattr(self, self.kind)) if self.kind else {}

    @property
    def files(self) -> tuple[tuple[str, str], ...]:
        """The images that it names, and the purpose of each."""
        found = []
        if self.membrane is not None and isinstance(self.membrane.translucency, str):
            found.append(("translucency", self.membrane.translucency))
        if self.patch is not None and self.patch.file is not None:
            found.append(("patch", self.patch.file))
        if self.wrinkles is not None and isinstance(self.wrinkles.depth, str):
            found.append(("depth", self.wrinkles.depth))
        return tuple(found)

    def with_files(self, new_name: Callable[[str], str]) -> DeformSurface:
        """The same with other names of its images."""
        changed: dict[str, Any] = {}
        for kind, field in (("membrane", "translucency"), ("patch", "file"), ("wrinkles", "depth")):
            own = getattr(self, kind)
            if own is not None and isinstance(name := getattr(own, field), str):
                changed[kind] = own.model_copy(update={field: new_name(name)})
        return self.model_copy(update=changed)

    @property
    def is_mapped(self) -> bool:
        """Whether its transfer is a map over texture coordinates."""
        return self.patch is not None or self.wrinkles is not None

    @property
    def is_opaque(self) -> bool:
        """Whether no light passes through: it reflects light onto itself."""
        transmits = self.membrane or self.subsurface or self.patch is not None and self.patch.thickness
        return not transmits

    @property
    def idle_parameters(self) -> tuple[str, ...]:
        """Parameters without an effect at its present values."""
        if self.membrane is not None and self.membrane.thickness:
            return ("translucency",)
        may_be_thick = self.membrane or self.patch
        return () if may_be_thick is None or may_be_thick.thickness else MEDIUM


# The purposes of a surface's images: the kind that has it, and the value that names it.
SURFACE_IMAGES: Mapping[str, tuple[str, str]] = {
    "translucency": ("membrane", "translucency"),
    "heights": ("patch", "file"),
    "depth": ("wrinkles", "depth"),
}

# By the names of objects.
SurfacesByObject = tuple[tuple[str, DeformSurface], ...]
NO_SURFACE = DeformSurface()


@dataclass(frozen=True)
class SurfaceKind:
    """A kind as a panel shows it; its choices and sliders, with their initial values."""

    title: str
    tooltip: str
    parameters: tuple[Parameter, ...]

    @property
    def defaults(self) -> dict[str, Any]:
        """The values with which an object of this kind begins."""
        return {each.name: each.default for each in self.parameters}


def _slider(
    name: str, default: float, label: str, tooltip: str, high: float, low: float = 0.0, *, unit: str = "",
    is_wide: bool = False,
) -> Parameter:  # fmt: skip
    return Parameter(name, "scalar", default, label, tooltip, (), low, high, unit, is_wide)


def _pair_of(name: str, default: float, label: str, tooltip: str, high: float, low: float) -> Parameter:
    return Parameter(name, "pair", (default, default), label, tooltip, (), low, high)


def _choice(name: str, label: str, tooltip: str, choices: tuple[str, ...]) -> Parameter:
    return Parameter(name, "choice", choices[0], label, tooltip, (), choices=choices)


_REPEATS = "How often it repeats over the texture coordinates."
_DENSITY = "Reduced scattering: less lets light further through."
_INDEX = "Index of refraction: a higher one keeps more light inside."
SURFACES: Mapping[str, SurfaceKind] = {
    "membrane": SurfaceKind(
        "Membrane",
        "So thin that light comes through from behind: wings, leaves, paper.",
        (
            _slider("translucency", 0.5, "Translucency", "Share of the light from behind that comes through.", 1.0),
            _slider(
                "thickness", 0.0, "Thickness",
                "With a thickness, what is inside says how much comes through. At 0 the translucency does.",
                0.1, unit="m", is_wide=True,
            ),
            _slider("scattering", 5000.0, "Density", _DENSITY, 1e6, 1.0, unit="/m", is_wide=True),
            _slider("absorption", 10.0, "Absorption", "Absorption inside.", 1e5, unit="/m", is_wide=True),
            _slider("ior", 1.3, "Index", _INDEX, 3.0, 1.0),
        ),
    ),
    "subsurface": SurfaceKind(
        "Subsurface",
        "Light that enters comes out elsewhere, so that thin parts let it through: marble, wax, skin.",
        (
            _slider("scattering", 150.0, "Density", _DENSITY, 1e5, 1.0, unit="/m", is_wide=True),
            _slider("absorption", 0.5, "Absorption", "Absorption inside.", 1e4, unit="/m", is_wide=True),
            _slider("ior", 1.3, "Index", _INDEX, 3.0, 1.0),
        ),
    ),
    "patch": SurfaceKind(
        "Patch",
        "Detail that repeats over the surface and shades itself, as a texture of transfer.",
        (
            _choice("kind", "Pattern", "What is repeated.", get_args(PATTERNS)),
            _pair_of("repeats", 8.0, "Repeats", _REPEATS, 100.0, 1.0),
            _slider("height", 1.0, "Height", "Factor of the pattern's heights.", 10.0, 0.01, is_wide=True),
            _slider(
                "thickness", 0.0, "Thickness",
                "Of what is below the lowest heights and lets light through, by the pattern's side. At 0 it is opaque.",
                1.0,
            ),
            _slider(
                "scattering", 40.0, "Density", "Reduced scattering by the pattern's side: less lets light further in.",
                1e4, 1.0, is_wide=True,
            ),
            _slider("absorption", 0.1, "Absorption", "Absorption inside, by the pattern's side.", 1e3, is_wide=True),
            _slider("ior", 1.3, "Index", _INDEX, 3.0, 1.0),
        ),
    ),
    "wrinkles": SurfaceKind(
        "Wrinkles",
        "Grooves across one texture coordinate.",
        (
            _choice("across", "Across", "The texture coordinate across the grooves.", ("u", "v")),
            _slider("repeats", 8.0, "Grooves", _REPEATS, 200.0, 1.0, is_wide=True),
            _slider("depth", 0.3, "Depth", "By the width of a groove.", 1.0),
        ),
    ),
}  # fmt: skip


def surface_with(surface: DeformSurface, kind: str, values: Mapping[str, Any], owner: str = "") -> DeformSurface:
    """A surface of a kind ("" for none) with these values; the others stay, or are that kind's initial values. Raises
    LoadError, which names the owner."""
    if not kind:
        return NO_SURFACE
    if kind not in SURFACES:
        raise LoadError(owner, "surface", kind, f"none or one of {', '.join(SURFACES)}")
    given = {**(surface.values if surface.kind == kind else SURFACES[kind].defaults), **values}
    if kind == "patch":  # a pattern replaces a file, and a file a pattern
        given |= {other: None for name, other in (("kind", "file"), ("file", "kind")) if values.get(name)}
    tree = {kind: {name: value for name, value in given.items() if value is not None}}
    try:
        return DeformSurface.model_validate(tree)
    except ValidationError as error:
        raise first_validation_error(error, tree, owner, DeformSurface) from None
