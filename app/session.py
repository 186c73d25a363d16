"""Session files: a document and how it was looked at, as versioned TOML (``NAME.insitu``).

The scene's own file is referred to and never written. All values are checked by pydantic models and by the parameter
tables before anything changes; a file that is wrong in one place is refused with that place. Numbers are written in
the shortest form that reads back the same, so a document saved and opened is equal to the last bit. Angles of
operators are radians as inside, for the same reason.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from app.atomic import write_atomically
from app.commands import MAX_OPERATORS, CurveEdit
from app.described_layers import layers_from_descriptions
from app.document import Document, LightState, ObjectState, Selection, all_factors, layer_key
from app.light_commands import MAX_INTENSITY, check_light
from app.linked_layers import FRESNEL_NAME, alike
from app.paths import full_path, is_file_name
from app.toml_text import check_version, load_toml, toml_lines, toml_value
from app.view_state import AS_PLANNED, SetView, ViewState
from engine.curve.operators import Operator, Tabulated
from engine.errors import InsituError, LoadError
from engine.material.layer import Layer
from engine.material.parameters import FRESNEL
from engine.scene.complaints import first_complaint
from engine.scene.description import MAX_BOUNCES, MAX_OBJECTS, LayerDescription, Name, Number, Parameter, Radiance, Text

SUFFIX = ".insitu"
SESSION_VERSION = 1
MAX_SESSION_BYTES = 64 * 2**20
MAX_TABLE = 8192

Flag = Annotated[bool, Field(strict=True)]
Triple = tuple[Number, Number, Number]


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class OperatorRecord(_Record):
    """An operator, or (kind "curve") the table that a collapsed curve became."""

    kind: Literal["translate", "amplify", "curve"]
    axis: Literal["x", "y"] | None = None
    regions: tuple[Number, Number, Number, Number] | None = None
    magnitude: Number | None = None
    baseline: Number = 0.0
    channels: tuple[Flag, Flag, Flag] = (True, True, True)
    muted: Flag = False
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
        """The operator itself."""
        if self.kind == "curve":
            return Tabulated(self.gammas, self.values, self.muted)
        if self.axis is None or self.regions is None or self.magnitude is None:
            raise ValueError("with axis, regions and magnitude")
        return Operator(self.kind, self.axis, *self.regions, self.magnitude, self.baseline, self.channels, self.muted)


class CurveRecord(_Record):
    """The operators on one curve, in the order in which they apply."""

    factor: Text
    operators: Annotated[tuple[OperatorRecord, ...], Field(alias="operator", max_length=MAX_OPERATORS)]


class LayerRecord(_Record):
    model: Text
    name: Name
    follows: Name | None = None
    visible: Flag = True
    frozen: Flag = False
    values: dict[str, Parameter] = Field(default_factory=dict)
    curves: tuple[CurveRecord, ...] = Field(default=(), alias="curve", max_length=8)


class ObjectRecord(_Record):
    name: Name
    visible: Flag = True
    frozen: Flag = False
    editable: Flag = True
    emission: Radiance | None = None
    layers: tuple[LayerRecord, ...] = Field(default=(), alias="layer", max_length=64)


class LightRecord(_Record):
    environment: Text
    mapping: Literal["latlong", "angular"] = "latlong"
    rotation: Number = 0.0
    intensity: Annotated[Number, Field(ge=0.0, le=MAX_INTENSITY)] = 1.0
    radiance: Radiance | None = None


class ViewRecord(_Record):
    selected: Text | None = None
    exposure: Annotated[Number, Field(ge=-20.0, le=20.0)] = 0.0
    tone_mapping: Literal["filmic", "linear", "false_colour"] = "filmic"
    fit: Flag = True
    log_y: Flag = False
    frame_budget_ms: Annotated[Number, Field(ge=2.0, le=200.0)] = 16.0
    n_lights: Annotated[int, Field(ge=20, le=20000, strict=True)] = 4000
    n_bounces: Annotated[int, Field(ge=AS_PLANNED, le=MAX_BOUNCES, strict=True)] = 1
    second_bands: Literal[1, 8, 16] | None = None
    precision: Literal["half", "float"] = "half"


class JournalRecord(_Record):
    """In a journal only: when it was written (seconds since 1970), and as what the session was saved last."""

    written_at: Number
    session_path: Text | None = None


class SessionRecord(_Record):
    """A whole session file."""

    version: Annotated[int, Field(strict=True)]
    scene: Text
    light: LightRecord
    view: ViewRecord = ViewRecord()
    journal: JournalRecord | None = None
    objects: tuple[ObjectRecord, ...] = Field(alias="object", min_length=1, max_length=MAX_OBJECTS)

    @model_validator(mode="after")
    def _names_differ(self) -> SessionRecord:
        names = [record.name for record in self.objects]
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise ValueError(f"object {twice!r}: names that differ")
        return self


@dataclass(frozen=True)
class Session:
    """What a session file holds. ``view`` has defaults where the file does not say; ``journal`` is a journal's."""

    document: Document
    view: ViewState
    journal: JournalRecord | None = None


def save_session(path: Path, document: Document, view: ViewState) -> Path:
    """Write a session file, whole or not at all; the path, which ends in ``.insitu``.

    Raises InsituError that says why it cannot be written; the file that was there is then untouched.
    """
    path = path if path.suffix else path.with_suffix(SUFFIX)
    if path.suffix != SUFFIX:
        raise InsituError(f"{path}: a session's name ends in {SUFFIX}; the scene's own file is never overwritten")
    try:
        write_atomically(path, dump_session(document, view, path.resolve().parent).encode())
    except OSError as error:
        raise InsituError(f"{path}: not saved, {error.strerror or error}; what was there is untouched") from error
    return path


def load_session(path: Path) -> Session:
    """Read a session file; LoadError names the place of the first thing wrong."""
    tree = load_toml(path, MAX_SESSION_BYTES)
    check_version(tree, path, SESSION_VERSION)
    try:
        record = SessionRecord.model_validate(tree)
    except ValidationError as error:
        raise first_complaint(error, tree, path, SessionRecord) from None
    folder = path.resolve().parent
    objects = tuple(_object(str(path), each) for each in record.objects)
    light = LightState(**{**record.light.model_dump(), "environment": full_path(record.light.environment, folder)})
    document = Document(full_path(record.scene, folder), objects, check_light(light, str(path)))
    return Session(document, _view(record.view, document), record.journal)


def fit_session(session: Session, scene: Document, file: str) -> Document:
    """The session's document for a scene as it is now; LoadError when the scene has other objects or layers.

    Fresnel terms may have come or gone.
    """
    have, want = (
        {state.name: sum(not layer.rises for layer in state.layers) for state in document.objects}
        for document in (scene, session.document)
    )
    for name in have.keys() | want.keys():
        if have.get(name) != want.get(name):
            found = f"{want[name]} layers" if name in want else "not in the session"
            there = f"{have[name]} layers as in the scene" if name in have else "only objects of the scene"
            raise LoadError(file, f"object {name!r}", found, there)
    saved = {state.name: state for state in session.document.objects}
    objects = tuple(replace(saved[state.name], emission=state.emission) for state in scene.objects)
    return Document(scene.source, objects, session.document.light)


def dump_session(
    document: Document, view: ViewState, folder: Path | None = None, journal: JournalRecord | None = None
) -> str:
    """The TOML text. Files inside ``folder`` are written relative to it, so that the folder can move."""
    light = {**vars(document.light), "environment": _written_path(document.light.environment, folder)}
    lines = [
        "# An Insitu session: materials and light on top of a scene. Angles of operators in radians.",
        *toml_lines({"version": SESSION_VERSION, "scene": _written_path(document.source, folder)}),
    ]
    if journal is not None:
        lines += ["[journal]", *toml_lines(journal.model_dump())]
    lines += ["[light]", *toml_lines(light), "[view]", *toml_lines(_view_values(view))]
    for state in document.objects:
        lines += _object_lines(state)
    return "\n".join(lines) + "\n"


def _object_lines(state: ObjectState) -> Iterator[str]:
    switches = {"visible": state.visible, "frozen": state.frozen, "editable": state.editable}
    yield "[[object]]"
    yield from toml_lines({"name": state.name, **switches, "emission": state.emission})
    for layer in state.layers:
        yield "[[object.layer]]"
        model = FRESNEL_NAME if layer.rises else layer.model.name
        named = {"model": model, "name": layer.name, "follows": layer.follows or None}
        yield from toml_lines({**named, "visible": layer.visible, "frozen": layer.frozen})
        yield "[object.layer.values]"
        yield from toml_lines({name: value for name, value in layer.values.items() if _is_written(layer, name)})
        for factor, operators in () if layer.rises else layer.edits:
            yield "[[object.layer.curve]]"
            yield from toml_lines({"factor": factor})
            yield "operator = ["
            yield from (f"  {toml_value(_operator_values(operator))}," for operator in operators)
            yield "]"


def _is_written(layer: Layer, parameter: str) -> bool:
    """Of a layer and its Fresnel term R stands with the term, all else with the layer."""
    return (parameter == FRESNEL.name) == layer.rises


def _operator_values(operator: CurveEdit) -> dict[str, Any]:
    if isinstance(operator, Tabulated):
        return {"kind": "curve", "muted": operator.muted, "gammas": operator.gammas, "values": operator.values}
    return {
        "kind": operator.kind,
        "axis": operator.axis,
        "regions": operator.regions,
        "magnitude": operator.magnitude,
        "baseline": operator.baseline,
        "channels": operator.channels,
        "muted": operator.muted,
    }


def _view_values(view: ViewState) -> dict[str, Any]:
    values = {name: getattr(view, name) for name in ViewRecord.model_fields if name != "selected"}
    return {"selected": None if view.selected is None else view.selected.path, **values}


def _object(file: str, record: ObjectRecord) -> ObjectState:
    described = [
        LayerDescription(model=each.model, name=each.name, follows=each.follows, parameters=each.values)
        for each in record.layers
    ]
    layers = layers_from_descriptions(file, record.name, described)
    pairs = enumerate(zip(layers, record.layers, strict=True))
    edited = alike(tuple(_edited(file, layer_key(record.name, i), *pair) for i, pair in pairs))
    return ObjectState(record.name, edited, record.emission, record.editable, record.visible, record.frozen)


def _edited(file: str, key: str, layer: Layer, record: LayerRecord) -> Layer:
    known = [factor.name for factor in all_factors(layer.model)]
    names = [curve.factor for curve in record.curves]
    for curve in record.curves:
        if curve.factor not in known or names.count(curve.factor) > 1:
            raise LoadError(file, f"{key}: curve", curve.factor, f"each of {', '.join(known)} once at most")
        layer = layer.with_operators(curve.factor, [operator.edit() for operator in curve.operators])
    return layer.replace(visible=record.visible, frozen=record.frozen)


def _view(record: ViewRecord, document: Document) -> ViewState:
    values = record.model_dump(exclude={"selected"})
    return replace(SetView.of(**values).apply(ViewState()), selected=_selection(record.selected, document))


def _selection(path: str | None, document: Document) -> Selection | None:
    """The selection a path names; a selection that fits no more is no reason to refuse a session."""
    for key, layer in document.layers():
        for factor in all_factors(layer.model):
            if path == f"{key}.{factor.name}":
                name, _, index = key.rpartition(".")
                return Selection(name, int(index), factor.name)
    return None


def _written_path(source: str, folder: Path | None) -> str:
    if not is_file_name(source):
        return source
    path = Path(source).resolve()
    inside = folder is not None and path.is_relative_to(folder)
    return str(path.relative_to(folder)) if inside and folder is not None else str(path)
