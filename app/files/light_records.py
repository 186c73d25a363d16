"""What sessions have of light: its environment, suns, mix and painted lights, as records (`app.files.records`)."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from app.document.commands.light import INTENSITY
from app.document.commands.mix import changed_row
from app.document.commands.painted import MAX_PAINTED
from app.document.light_state import MIX_FIELDS, NO_SUNS, PLAIN_ROW, MixRow
from app.document.painted_parameters import restored_painted
from app.files.layer_records import Flag, StrictModel, Triple
from engine.core.errors import InsituError
from engine.light.painted_lights import PaintedLight
from engine.light.probe_mappings import Mapping
from engine.light.suns import Sun
from engine.material.parameters import ParameterError
from engine.scene.description import MAX_OBJECTS, MAX_SUNS, Name, Number, Radiance, SunDescription, Text

MAX_MIX_ROWS = 2 * MAX_OBJECTS  # each light in a group of its own
# A path of any length that systems take, each byte of it as "%E9".
PathText = Annotated[str, Field(min_length=1, max_length=3 * 4096 + 5, strict=True)]


class SunRecord(SunDescription):
    """An edited sun, named as in the scene, or an added one."""

    name: Name
    added: Flag = False

    @property
    def sun(self) -> Sun:
        return Sun(self.direction, self.irradiance, self.diameter, self.name)


class MixRecord(StrictModel):
    """A light's row in the mix, by its key."""

    light: Annotated[Text, Field(min_length=1)]
    on: Flag = True
    solo: Flag = False
    strength: Number = 0.0
    colour: Triple = (1.0, 1.0, 1.0)
    kelvin: Number = 0.0
    group: Text = ""
    excludes: Annotated[tuple[Text, ...], Field(max_length=MAX_OBJECTS)] = ()

    @model_validator(mode="after")
    def _is_a_row(self) -> MixRecord:
        try:
            assert self.row
        except ParameterError as error:
            raise ValueError(f"{error.what}: {error.expected}") from None
        return self

    @property
    def row(self) -> MixRow:
        row = PLAIN_ROW
        for name in MIX_FIELDS:
            if name in self.model_fields_set:
                row = changed_row(row, name, getattr(self, name))
        return row


class PaintedRecord(StrictModel):
    """A painted light; values that are left out are those of its kind."""

    name: Name
    kind: Literal["box", "disc", "gradient", "sky", "image"]
    file: PathText | None = None
    placement: Literal["card", "panorama"] | None = None
    blend: Literal["add", "cover"] | None = None
    azimuth: Number | None = None
    elevation: Number | None = None
    width: Number | None = None
    height: Number | None = None
    rotation: Number | None = None
    softness: Number | None = None
    radiance: Radiance | None = None
    far: Radiance | None = None
    opacity: Number | None = None
    turbidity: Number | None = None
    ground: Radiance | None = None
    sun: Number | None = None
    diameter: Number | None = None

    @model_validator(mode="after")
    def _is_one(self) -> PaintedRecord:
        try:
            assert self.painted
        except InsituError as error:
            raise ValueError(str(error)) from None
        return self

    @property
    def painted(self) -> PaintedLight:
        """The light; an image's file is named as in the session."""
        given = {name: value for name, value in self if value is not None and name not in ("name", "kind")}
        return restored_painted(self.kind, self.name, given)


class LightRecord(StrictModel):
    environment: PathText
    mapping: Mapping = "latlong"
    rotation: Number = 0.0
    intensity: Annotated[Number, Field(ge=0.0, le=INTENSITY.maximum)] = 1.0
    radiance: Radiance | None = None
    suns: Annotated[tuple[SunRecord, ...], Field(max_length=MAX_SUNS)] | None = None
    deleted_suns: Annotated[tuple[Name, ...], Field(max_length=MAX_SUNS)] = ()
    mix: Annotated[tuple[MixRecord, ...], Field(max_length=MAX_MIX_ROWS)] = ()
    tilt: Number = 0.0
    hue: Number = 0.0
    contrast: Number = 1.0
    clamp: Number = 0.0
    sides: Flag = False
    painted: Annotated[tuple[PaintedRecord, ...], Field(max_length=MAX_PAINTED)] = ()

    @field_validator("painted")
    @classmethod
    def _have_own_names(cls, painted: tuple[PaintedRecord, ...]) -> tuple[PaintedRecord, ...]:
        names = [each.name for each in painted]
        if len(set(names)) < len(names):
            raise ValueError("painted lights with names that differ")
        return painted

    @model_validator(mode="after")
    def _has_suns_of_one_name_each(self) -> LightRecord:
        names = [*(each.name for each in self.suns or ()), *self.deleted_suns]
        twice = next((name for k, name in enumerate(names) if name in (*names[:k], *NO_SUNS)), None)
        if twice is not None:
            raise ValueError(f"suns: each with a name of its own, and none of {', '.join(NO_SUNS)}")
        return self
