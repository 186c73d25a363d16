"""What a scene file says of an object's surface for Deform alone: `[object.deform]`, in docs/deform.md."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

Share = Annotated[float, Field(ge=0.0, le=1.0, allow_inf_nan=False, strict=False)]
Positive = Annotated[float, Field(gt=0.0, le=1e4, allow_inf_nan=False)]
File = Annotated[str, Field(min_length=1, max_length=4096, strict=True)]

PATTERNS = Literal["bumps", "waffle", "swirl", "weave"]


class _Surface(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Membrane(_Surface):
    """So thin that light comes through: a share of it, or a map of shares."""

    translucency: Share | File = 0.5


class Subsurface(_Surface):
    """Light that enters comes out elsewhere: reduced scattering and absorption per metre, index of refraction."""

    scattering: Annotated[float, Field(gt=0.0, le=1e9, allow_inf_nan=False)]
    absorption: Annotated[float, Field(ge=0.0, le=1e9, allow_inf_nan=False)] = 0.0
    ior: Annotated[float, Field(ge=1.0, le=3.0, allow_inf_nan=False)] = 1.3


class Detail(_Surface):
    """Heights that repeat over the texture coordinates: of a kind, or a file's brightness; times `height`."""

    kind: PATTERNS | None = None
    file: File | None = None
    repeats: tuple[Positive, Positive] = (1.0, 1.0)
    height: Annotated[float, Field(gt=0.0, le=10.0, allow_inf_nan=False)] = 1.0

    @model_validator(mode="after")
    def _has_one_source(self) -> Detail:
        if (self.kind is None) == (self.file is None):
            raise ValueError("kind: exactly one of kind and file")
        return self


class Wrinkles(_Surface):
    """Grooves across one texture coordinate, so many over it, as deep as `depth` times their width."""

    across: Literal["u", "v"] = "u"
    repeats: Positive = 1.0
    depth: Share = 0.3


class DeformSurface(_Surface):
    """One of these."""

    membrane: Membrane | None = None
    subsurface: Subsurface | None = None
    patch: Detail | None = None
    wrinkles: Wrinkles | None = None

    @model_validator(mode="after")
    def _is_one(self) -> DeformSurface:
        if sum(getattr(self, kind) is not None for kind in type(self).model_fields) != 1:
            raise ValueError(f"exactly one of {', '.join(type(self).model_fields)}")
        return self

    @property
    def files(self) -> tuple[tuple[str, str], ...]:
        """Images that it names, and what each is."""
        found = []
        if self.membrane is not None and isinstance(self.membrane.translucency, str):
            found.append(("translucency", self.membrane.translucency))
        if self.patch is not None and self.patch.file is not None:
            found.append(("patch", self.patch.file))
        return tuple(found)

    @property
    def is_mapped(self) -> bool:
        """Whether its transfer lies on texture coordinates."""
        return self.patch is not None or self.wrinkles is not None
