"""What sessions and materials consist of in TOML: records, checked by pydantic models and by the parameter tables.

Layers are written whole: model, parameters, and the operators on each curve. Numbers are written in the shortest form
that reads back the same, so layers written and read are equal to the last bit; angles of operators are radians as
inside, likewise.
"""

from __future__ import annotations

import base64
import binascii
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    PlainValidator,
    StrictInt,
    StrictStr,
    create_model,
    field_validator,
    model_validator,
)

from app.document.commands.curves import MAX_OPERATORS, CurveEdit
from app.document.commands.light import INTENSITY
from app.document.commands.mix import changed_row
from app.document.commands.plan import FirstBands
from app.document.commands.poses import MAX_DEFORMERS
from app.document.document import all_factors, layer_key
from app.document.light_state import MIX_FIELDS, PLAIN_ROW, MixRow
from app.document.linked_layers import FRESNEL_NAME, Layers, layers_from_descriptions, synchronize_layers
from app.document.view_state import Bookmark, Viewpoint
from app.files.bookmarks import MAX_BOOKMARKS, MAX_NAME, MAX_THUMBNAIL_BYTES, check_thumbnail, is_name
from app.system.paths import written_path
from engine.core.colour import ToneMapping
from engine.core.errors import InsituError, LoadError
from engine.curve.operators import Operator
from engine.curve.tables import ALL_CHANNELS, EVERYWHERE, TabulatedCurve
from engine.light.probe_mappings import Mapping
from engine.light.suns import Sun
from engine.material.bumps import Bumps, bumps_of_parts
from engine.material.layer import Layer
from engine.material.layer_maps import LayerMaps
from engine.material.map_tables import map_values
from engine.material.opacity import Opacity, opacity_of_parts
from engine.material.parameter_maps import parameter_map_table
from engine.material.parameters import FRESNEL, ParameterError, Value
from engine.measured.measurement import Measurement
from engine.realtime.zonal_harmonics.pose import MAX_GROWTH, Deformation, largest_growth
from engine.scene.description import (
    MAX_OBJECTS,
    MAX_SUNS,
    Camera,
    LayerDescription,
    Maps,
    Name,
    Number,
    Parameter,
    Pixels,
    Radiance,
    SunDescription,
    Text,
    table_validator,
)
from engine.scene.surface_kinds import DeformSurface
from engine.scene.toml_text import toml_lines, toml_value
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
MAX_MIX_ROWS = 2 * MAX_OBJECTS  # each light in a group of its own
# A path of any length that systems take, each byte of it as "%E9".
PathText = Annotated[str, Field(min_length=1, max_length=3 * 4096 + 5, strict=True)]
MAX_TABLE = 8192
MAX_LAYERS = 64

Flag = Annotated[bool, Field(strict=True)]
Triple = tuple[Number, Number, Number]


class StrictModel(BaseModel):
    """Frozen, without unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class OperatorRecord(StrictModel):
    """An operator: one with an axis, or a table (kind "curve"), a stroke or points, with gammas and values."""

    kind: Literal["translate", "amplify", "curve", "stroke", "points"]
    axis: Literal["x", "y"] | None = None
    regions: tuple[Number, Number, Number, Number] | None = None
    magnitude: Number | None = None
    baseline: Number = 0.0
    channels: tuple[Flag, Flag, Flag] = (True, True, True)
    muted: Flag = False
    joined: Flag = False
    gammas: Annotated[tuple[Number, ...], Field(max_length=MAX_TABLE)] = ()
    values: Annotated[tuple[Triple, ...], Field(max_length=MAX_TABLE)] = ()

    @model_validator(mode="after")
    def _is_an_edit(self) -> OperatorRecord:
        try:
            self.edit()
        except (ValueError, TypeError) as error:
            raise ValueError(f"kind: a complete operator ({error})") from None
        return self

    def edit(self) -> CurveEdit:
        """The operator."""
        if self.kind == "translate" or self.kind == "amplify":
            if self.axis is None or self.regions is None or self.magnitude is None:
                raise ValueError("with axis, regions and magnitude")
            return Operator(
                self.kind, self.axis, *self.regions, self.magnitude, self.baseline, self.channels, self.muted,
                self.joined,
            )  # fmt: skip
        return TabulatedCurve(
            self.gammas, self.values, self.muted, self.kind, EVERYWHERE if self.regions is None else self.regions,
            1.0 if self.magnitude is None else self.magnitude, self.channels,
        )  # fmt: skip


class CurveRecord(StrictModel):
    """The operators on one curve, in the order in which they apply."""

    factor: Text
    operators: Annotated[tuple[OperatorRecord, ...], Field(alias="operator", max_length=MAX_OPERATORS)]


class LayerRecord(StrictModel):
    model: Text
    name: Name
    follows: Name | None = None
    under: Name | None = None
    visible: Flag = True
    frozen: Flag = False
    maps: Maps = LayerMaps()
    parameter_maps: dict[str, dict[str, Any]] = Field(default_factory=dict)
    values: dict[str, Parameter] = Field(default_factory=dict)
    curves: tuple[CurveRecord, ...] = Field(default=(), alias="curve", max_length=8)


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

    @model_validator(mode="after")
    def _is_one(self) -> TransformRecord:
        self.transform  # noqa: B018 - it says what is wrong
        return self

    @property
    def transform(self) -> Transform:
        """The transform."""
        return Transform(self.position, self.rotation, self.scale)


SavedBumps = Annotated[Bumps, PlainValidator(table_validator(Bumps, bumps_of_parts))]
SavedOpacity = Annotated[Opacity, PlainValidator(table_validator(Opacity, opacity_of_parts))]


class ObjectRecord(StrictModel):
    name: Name
    visible: Flag = True
    frozen: Flag = False
    editable: Flag = True
    emission: Radiance | None = None
    layers: tuple[LayerRecord, ...] = Field(default=(), alias="layer", max_length=MAX_LAYERS)
    bumps: SavedBumps | None = None
    opacity: SavedOpacity | None = None
    deform: DeformSurface | None = None
    time: Number | None = None
    clip: Text | None = None
    transform: TransformRecord | None = None
    deformers: tuple[DeformerRecord, ...] = Field(default=(), alias="deformer", max_length=MAX_DEFORMERS)

    @model_validator(mode="after")
    def _is_a_pose(self) -> ObjectRecord:
        if (self.time is None) != (self.clip is None):
            raise ValueError("time and clip: both or none")
        if (times := largest_growth([each.deformation for each in self.deformers])) > MAX_GROWTH:
            raise ValueError(f"deformers make it {times:.3g} times as large: at most {MAX_GROWTH:g} times")
        return self


class SunRecord(SunDescription):
    """An edited sun, named as in the scene."""

    name: Name

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


class LightRecord(StrictModel):
    environment: PathText
    mapping: Mapping = "latlong"
    rotation: Number = 0.0
    intensity: Annotated[Number, Field(ge=0.0, le=INTENSITY.maximum)] = 1.0
    radiance: Radiance | None = None
    suns: Annotated[tuple[SunRecord, ...], Field(max_length=MAX_SUNS)] | None = None
    mix: Annotated[tuple[MixRecord, ...], Field(max_length=MAX_MIX_ROWS)] = ()


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


class ViewRecord(_SettingsRecord):  # type: ignore[misc, valid-type]
    mode: Text = "placement"
    selected: Text | None = None
    exposure: Annotated[Number, Field(ge=-20.0, le=20.0)] = 0.0
    tone_mapping: ToneMapping = "filmic"
    fit: Flag = True
    log_y: Flag = False
    frame_budget_ms: Annotated[Number, Field(ge=2.0, le=200.0)] = 16.0
    camera: Camera | None = None
    resolution: tuple[Pixels, Pixels] | None = None


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


class SessionRecord(StrictModel):
    """A whole session file; `ends`: it has its last line."""

    version: Annotated[int, Field(strict=True)]
    ends: Flag = False
    scene: PathText
    light: LightRecord
    first_bands: FirstBands | None = None
    overrides: Annotated[dict[Text, StrictInt | StrictStr], Field(max_length=MAX_OVERRIDES)] = {}
    view: ViewRecord = ViewRecord()
    journal: JournalRecord | None = None
    objects: tuple[ObjectRecord, ...] = Field(alias="object", min_length=1, max_length=MAX_OBJECTS)
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


def layers_of(file: str, name: str, records: Sequence[LayerRecord]) -> Layers:
    """The layers of the object or material called `name`, with all edits. Raises LoadError for `file`."""
    described = [
        LayerDescription(
            model=each.model,
            name=each.name,
            follows=each.follows,
            under=each.under,
            maps=each.maps,
            parameter_maps=each.parameter_maps,
            parameters=each.values,
        )
        for each in records
    ]
    plain = layers_from_descriptions(file, name, described)
    return synchronize_layers(
        tuple(
            with_curves(file, layer_key(name, i), layer, record.curves).replace(
                visible=record.visible, frozen=record.frozen
            )
            for i, (layer, record) in enumerate(zip(plain, records, strict=True))
        )
    )


def with_curves(file: str, key: str, layer: Layer, curves: Sequence[CurveRecord]) -> Layer:
    """The layer with the operators of its curves; LoadError for `file` and the layer called `key`."""
    known = [factor.name for factor in all_factors(layer.model)]
    names = [curve.factor for curve in curves]
    for curve in curves:
        if curve.factor not in known or names.count(curve.factor) > 1:
            raise LoadError(file, f"{key}: curve", curve.factor, f"each of {', '.join(known)} once at most")
        layer = layer.with_operators(curve.factor, [operator.edit() for operator in curve.operators])
    return layer


def description_of(layer: Layer, folder: Path | None = None) -> dict[str, Any]:
    """A layer without its edits as a scene file in that folder has it: an inline table's keys and values."""
    parameter_maps = _parameter_maps(layer)
    return (
        _named(layer) | _written(layer, folder) | _maps(layer)
        | ({"parameter_maps": parameter_maps} if parameter_maps else {})
    )  # fmt: skip


def layer_lines(layers: Layers, table: str, folder: Path | None = None) -> Iterator[str]:
    """The TOML lines of layers, an array of tables called `table`: "object.layer". Files are named from `folder`."""
    for layer in layers:
        yield f"[[{table}]]"
        yield from toml_lines({**_named(layer), "visible": layer.visible, "frozen": layer.frozen})
        if maps := _maps(layer):
            yield f"maps = {toml_value(maps)}"
        if parameter_maps := _parameter_maps(layer):
            yield f"parameter_maps = {toml_value(parameter_maps)}"
        yield f"[{table}.values]"
        yield from toml_lines(_written(layer, folder))
        for factor, operators in () if layer.rises else layer.edits:
            yield f"[[{table}.curve]]"
            yield from toml_lines({"factor": factor})
            yield from operator_lines(operators)


def operator_lines(operators: Sequence[CurveEdit]) -> Iterator[str]:
    """The TOML lines of a curve's operators."""
    yield "operator = ["
    yield from (f"  {toml_value(_operator_values(operator))}," for operator in operators)
    yield "]"


def _named(layer: Layer) -> dict[str, str | None]:
    model = FRESNEL_NAME if layer.rises else layer.model.name
    under = None if layer.rises else layer.under or None
    return {"model": model, "name": layer.name, "follows": layer.follows or None, "under": under}


def _maps(layer: Layer) -> dict[str, Any]:
    """The records of its images; empty for a Fresnel term, which has those of its layer."""
    return {} if layer.rises else map_values(layer.maps)


def _parameter_maps(layer: Layer) -> dict[str, Any]:
    """The tables of the maps of its parameters; empty for a Fresnel term, as above."""
    return {} if layer.rises else {each.parameter: parameter_map_table(each) for each in layer.parameter_maps}


def _written(layer: Layer, folder: Path | None) -> dict[str, Any]:
    """The parameters that are written with a layer; a measurement by its file's name."""
    # Of a layer and its Fresnel term, R is written with the term, all else with the layer.
    own = [(name, value) for name, value in layer.values.items() if (name == FRESNEL.name) == layer.rises]
    return {name: _plain(value, folder) for name, value in own}


def _plain(value: Value, folder: Path | None) -> float | str | tuple[float, ...] | None:
    if not isinstance(value, Measurement):
        return value
    return written_path(value.file, folder) if value.file else None


def _operator_values(operator: CurveEdit) -> dict[str, Any]:
    if isinstance(operator, TabulatedCurve):
        return {
            "kind": operator.kind,
            "muted": operator.muted,
            "regions": None if operator.regions == EVERYWHERE else operator.regions,
            "magnitude": None if operator.magnitude == 1.0 else operator.magnitude,
            "channels": None if operator.channels == ALL_CHANNELS else operator.channels,
            "gammas": operator.gammas,
            "values": operator.values,
        }
    return {
        "kind": operator.kind,
        "axis": operator.axis,
        "regions": operator.regions,
        "magnitude": operator.magnitude,
        "baseline": operator.baseline,
        "channels": operator.channels,
        "muted": operator.muted,
        "joined": operator.joined or None,
    }
