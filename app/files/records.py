"""What sessions consist of in TOML: records, checked by pydantic models and by the parameter tables.

Those of layers, which materials have as well, are in `app.files.layer_records`.
"""

from __future__ import annotations

import base64
import binascii
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    Field,
    PlainValidator,
    StrictInt,
    StrictStr,
    create_model,
    field_validator,
    model_validator,
)

from app.document.background import Background, BackgroundKind
from app.document.commands.looks import MAX_LOOKS
from app.document.commands.plan import FirstBands
from app.document.commands.poses import MAX_DEFORMERS
from app.document.named_files import renamed_image
from app.document.view_state import MOST_PROBES, Bookmark, LooksShown, Viewpoint
from app.files.bookmarks import MAX_BOOKMARKS, MAX_NAME, MAX_THUMBNAIL_BYTES, check_thumbnail, is_name
from app.files.layer_records import MAX_LAYERS, Flag, LayerRecord, StrictModel
from app.files.light_records import LightRecord, PathText
from app.system.paths import full_path
from engine.core.colour import ToneMapping
from engine.core.errors import InsituError
from engine.material.bumps import Bumps, bumps_of_parts
from engine.material.layer_maps import LayerMaps
from engine.material.opacity import Opacity, opacity_of_parts
from engine.realtime.zonal_harmonics.pose import MAX_GROWTH, Deformation, largest_growth
from engine.render.crop import Crop
from engine.scene.description import (
    MAX_OBJECTS,
    Camera,
    ConeDescription,
    EmissionTexture,
    Name,
    Number,
    ObjectDescription,
    Pixels,
    Primitive,
    Radiance,
    Text,
    table_validator,
)
from engine.scene.surface_kinds import DeformSurface
from engine.scene.transform import Transform
from engine.settings import (
    PICTURE_LINES,
    SETTINGS,
    LineValue,
    RenderSettings,
    Setting,
    checked_bands,
    checked_line,
)

MAX_OVERRIDES = 4096


class DeformerRecord(StrictModel):
    """One of an object's deformers; amounts in degrees or fractions, as its kind defines."""

    kind: Text
    amount: Number
    axis: Literal["x", "y", "z"] = "y"

    @model_validator(mode="after")
    def _is_one(self) -> DeformerRecord:
        self.deformation  # noqa: B018 - it says what is wrong
        return self

    @property
    def deformation(self) -> Deformation:
        """The deformer."""
        return Deformation(self.kind, self.amount, self.axis)


class TransformRecord(StrictModel):
    """Where an object was moved to, about the centre of its box as its file has it."""

    position: tuple[Number, Number, Number] = (0.0, 0.0, 0.0)
    rotation: tuple[Number, Number, Number] = (0.0, 0.0, 0.0)
    scale: tuple[Number, Number, Number] = (1.0, 1.0, 1.0)
    axes: tuple[Number, Number, Number] = (0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _is_one(self) -> TransformRecord:
        self.transform  # noqa: B018 - it says what is wrong
        return self

    @property
    def transform(self) -> Transform:
        """The transform."""
        return Transform(self.position, self.rotation, self.scale, self.axes)


class AddedRecord(StrictModel):
    """What an object is read from that the scene's file does not have: a shape, or a part of a mesh file; of a lamp
    what it emits, into which cone, and its image."""

    name: Name
    mesh: PathText | None = None
    primitive: Primitive | None = None
    part: Annotated[int, Field(ge=0, strict=True)] | None = None
    transform: Annotated[tuple[Number, ...], Field(min_length=16, max_length=16)]
    emission: Radiance | None = None
    cone: ConeDescription | None = None
    emission_texture: EmissionTexture = LayerMaps()

    @model_validator(mode="after")
    def _is_one(self) -> AddedRecord:
        self.description(None)
        return self

    def description(self, folder: Path | None) -> ObjectDescription:
        """The object, its files by their full paths; they are named from `folder`."""
        values = {name: getattr(self, name) for name in AddedRecord.model_fields}
        new_name = partial(full_path, folder=folder)
        texture = self.emission_texture.with_files(partial(renamed_image, new_name=new_name))
        values |= {"mesh": self.mesh and full_path(self.mesh, folder), "emission_texture": texture}
        return ObjectDescription(**values)


SavedBumps = Annotated[Bumps, PlainValidator(table_validator(Bumps, bumps_of_parts))]
SavedOpacity = Annotated[Opacity, PlainValidator(table_validator(Opacity, opacity_of_parts))]


class ObjectRecord(StrictModel):
    name: Name
    visible: Flag = True
    frozen: Flag = False
    editable: Flag = True
    shadow_catcher: Flag = False
    emission: Radiance | None = None
    layers: tuple[LayerRecord, ...] = Field(default=(), alias="layer", max_length=MAX_LAYERS)
    bumps: SavedBumps | None = None
    opacity: SavedOpacity | None = None
    deform: DeformSurface | None = None
    time: Number | None = None
    clip: Text | None = None
    transform: TransformRecord | None = None
    original: Name | None = None
    added: AddedRecord | None = None
    in_group: Name | None = None
    linked: Name | None = None
    cone: ConeDescription | None = None
    target_distance: Annotated[Number, Field(gt=0.0)] | None = None
    deformers: tuple[DeformerRecord, ...] = Field(default=(), alias="deformer", max_length=MAX_DEFORMERS)

    @property
    def has_material(self) -> bool:
        """Whether it says any of what linked objects share."""
        return any((self.layers, self.emission, self.bumps, self.opacity, self.deform))

    @model_validator(mode="after")
    def _is_a_pose(self) -> ObjectRecord:
        if (self.time is None) != (self.clip is None):
            raise ValueError("time and clip: both or none")
        if self.original is not None and self.added is not None:
            raise ValueError("added: at most one of original and added")
        if (times := largest_growth([each.deformation for each in self.deformers])) > MAX_GROWTH:
            raise ValueError(f"deformers make it {times:.3g} times as large: at most {MAX_GROWTH:g} times")
        return self


def _type_of(setting: Setting) -> Any:
    """The type of a setting's values in a session."""
    if isinstance(setting.values, range):
        least, most = setting.bounds
        kind: Any = Annotated[int, Field(ge=least, le=most, strict=True)]
    else:
        kind = Literal[tuple(value for value in (*setting.as_required, *setting.values) if value is not None)]
    return kind | None if None in setting.as_required else kind


# The render settings that are saved with a view, and a model that has them all.
SAVED_SETTINGS = tuple(name for name, setting in SETTINGS.items() if setting.is_saved)
_FIELDS: Any = {name: (_type_of(SETTINGS[name]), getattr(RenderSettings(), name)) for name in SAVED_SETTINGS}
_SettingsRecord = create_model("_SettingsRecord", __base__=StrictModel, **_FIELDS)


class ConfigViewRecord(StrictModel):
    """A view of an OpenColorIO configuration."""

    config: PathText
    display: Annotated[str, Field(strict=True, max_length=1000)] = ""
    view: Annotated[str, Field(strict=True, max_length=1000)] = ""
    look: Annotated[str, Field(strict=True, max_length=1000)] = ""


Fraction = Annotated[Number, Field(ge=0.0, le=1.0)]


class ViewRecord(_SettingsRecord):  # type: ignore[misc, valid-type]
    mode: Text = "placement"
    selected: Text | None = None
    exposure: Annotated[Number, Field(ge=-20.0, le=20.0)] = 0.0
    gamma: Annotated[Number, Field(ge=0.2, le=5.0)] = 1.0
    tone_mapping: ToneMapping = "filmic"
    ocio: ConfigViewRecord | None = None
    fit: Flag = True
    log_y: Flag = False
    frame_budget_ms: Annotated[Number, Field(ge=2.0, le=200.0)] = 16.0
    camera: Camera | None = None
    resolution: tuple[Pixels, Pixels] | None = None
    looks_shown: LooksShown = 1
    crop: tuple[Number, Number, Number, Number] | None = None
    probes: Annotated[tuple[tuple[Fraction, Fraction], ...], Field(max_length=MOST_PROBES)] = ()

    @field_validator("crop")
    @classmethod
    def _is_a_crop(cls, sides: tuple[float, ...] | None) -> tuple[float, ...] | None:
        try:
            return sides and Crop.checked(sides)
        except InsituError as error:
            raise ValueError(str(error)) from None


class BookmarkRecord(StrictModel):
    """A bookmark; camera and resolution None: the scene's own. thumbnail: a JPEG file in base 64."""

    name: Annotated[str, Field(strict=True)]
    camera: Camera | None = None
    resolution: tuple[Pixels, Pixels] | None = None
    thumbnail: Annotated[str, Field(strict=True, max_length=4 * MAX_THUMBNAIL_BYTES // 3 + 4)] = ""

    @field_validator("name")
    @classmethod
    def _is_a_name(cls, name: str) -> str:
        if not is_name(name):
            raise ValueError(f"a name of 1 to {MAX_NAME} characters")
        return name

    @field_validator("thumbnail")
    @classmethod
    def _is_a_picture(cls, text: str) -> str:
        if text:
            check_thumbnail(_decoded(text))
        return text

    @property
    def bookmark(self) -> Bookmark:
        """The bookmark."""
        return Bookmark(self.name, Viewpoint(self.camera, self.resolution), _decoded(self.thumbnail))


def _decoded(text: str) -> bytes:
    try:
        return base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError):
        return b"?"  # no picture


class JournalRecord(StrictModel):
    """In a journal only: when it was written (seconds since 1970), the session's last file, and what distinguishes that
    file from one that another window may have saved there since."""

    written_at: Number
    session_path: PathText | None = None
    session_digest: Text | None = None


class EndRecord(StrictModel):
    """The last line: without it a file that was cut between two lines would be taken for a shorter one."""


class BackgroundRecord(StrictModel):
    kind: BackgroundKind = "environment"
    colour: Radiance = Background().colour

    @property
    def background(self) -> Background:
        return Background(self.kind, self.colour)


class LookRecord(StrictModel):
    """A look: what differs from the current one, which has nothing but its name. Its objects have all values but which
    objects they are; one without layers has those of the current look."""

    name: Name
    current: Flag = False
    light: LightRecord | None = None
    background: BackgroundRecord | None = None
    objects: tuple[ObjectRecord, ...] = Field(default=(), alias="object", max_length=MAX_OBJECTS)

    @model_validator(mode="after")
    def _is_a_difference(self) -> LookRecord:
        if self.current and (self.light or self.background or self.objects):
            raise ValueError("current: a look without values of its own, which are those of the session")
        other = next((each.name for each in self.objects if each.original or each.added or each.linked), None)
        if other is not None:
            raise ValueError(f"object {other!r}: without original, added and linked, which all looks share")
        return self


class SessionRecord(StrictModel):
    """A whole session file; `ends`: it has its last line."""

    version: Annotated[int, Field(strict=True)]
    ends: Flag = False
    scene: PathText
    light: LightRecord
    background: BackgroundRecord = BackgroundRecord()
    first_bands: FirstBands | None = None
    overrides: Annotated[dict[Text, StrictInt | StrictStr], Field(max_length=MAX_OVERRIDES)] = {}
    view: ViewRecord = ViewRecord()
    journal: JournalRecord | None = None
    deleted: Annotated[tuple[Name, ...], Field(max_length=MAX_OBJECTS)] = ()
    objects: tuple[ObjectRecord, ...] = Field(default=(), alias="object", max_length=MAX_OBJECTS)
    looks: tuple[LookRecord, ...] = Field(default=(), alias="look", max_length=MAX_LOOKS)
    bookmarks: tuple[BookmarkRecord, ...] = Field(default=(), alias="bookmark", max_length=MAX_BOOKMARKS)
    end: EndRecord | None = None

    @model_validator(mode="after")
    def _is_whole(self) -> SessionRecord:
        if self.ends and self.end is None:
            raise ValueError("end: the file's last line; it was cut short")
        return self

    @field_validator("overrides")
    @classmethod
    def _are_lines(cls, lines: dict[str, LineValue]) -> dict[str, LineValue]:
        try:
            for line, value in lines.items():  # that of a curve may be of a layer that no longer exists
                checked_line(line, value) if line in PICTURE_LINES else checked_bands(line, value, 1)
        except InsituError as error:
            raise ValueError(str(error)) from None
        return lines

    @model_validator(mode="after")
    def _names_differ(self) -> SessionRecord:
        names = [record.name for record in self.objects]
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise ValueError(f"object {twice!r}: names that differ")
        views = [record.name for record in self.bookmarks]
        if len(set(views)) < len(views):
            raise ValueError("bookmark: names that differ")
        return self

    @model_validator(mode="after")
    def _links_are_of_one_source(self) -> SessionRecord:
        first = dict[str, ObjectRecord]()
        for each in (record for record in self.objects if record.linked):
            lead = first.setdefault(each.linked or "", each)
            if (each.added or each.original or each.name) != (lead.added or lead.original or lead.name):
                raise ValueError(f"object {each.name!r}: linked: a duplicate of what {lead.name!r} is")
            if each is not lead and each.has_material:
                raise ValueError(f"object {each.name!r}: linked: without a material, which is that of {lead.name!r}")
        return self

    @model_validator(mode="after")
    def _has_one_current_look(self) -> SessionRecord:
        looks, there = [each.name for each in self.looks], {each.name for each in self.objects}
        if len(set(looks)) < len(looks):
            raise ValueError("look: names that differ")
        if self.looks and sum(each.current for each in self.looks) != 1:
            raise ValueError("look: exactly one that is current")
        for look in self.looks:
            names = [each.name for each in look.objects]
            other = next((name for name in names if name not in there or names.count(name) > 1), None)
            if other is not None:
                raise ValueError(f"look {look.name!r}: object {other!r}: an object of the session, once")
        return self
