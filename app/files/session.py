"""Session files: a document and the state of its view, as versioned TOML (``NAME.insitu``).

The scene's own file is referred to and never written. All values are checked by pydantic models and by the parameter
tables before anything changes; a faulty file is refused with the place of the error. A document saved and opened is
equal to the last bit (see `app.files.layer_records`).
"""

from __future__ import annotations

import base64
import binascii
import hashlib
import os
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    Field,
    PlainValidator,
    StrictInt,
    StrictStr,
    ValidationError,
    create_model,
    field_validator,
    model_validator,
)

from app.document.commands.light import INTENSITY, check_light
from app.document.commands.plan import FirstBands
from app.document.commands.poses import MAX_DEFORMERS
from app.document.document import Document, LightState, ObjectState, Selection, all_factors
from app.document.named_files import with_full_paths
from app.document.sources import SESSION_ENDING
from app.document.view_state import Bookmark, SetView, Viewpoint, ViewState
from app.files.bookmarks import MAX_BOOKMARKS, MAX_NAME, MAX_THUMBNAIL_BYTES, check_thumbnail, is_name
from app.files.layer_records import MAX_LAYERS, Flag, LayerRecord, StrictModel, layer_lines, layers_of
from app.files.old_names import upgrade_session
from app.system.atomic import save_file
from app.system.paths import full_path, written_path
from engine.core.colour import ToneMapping
from engine.core.errors import InsituError, LoadError, describe_value
from engine.core.safe_files import read_regular_file, resolved
from engine.material.bumps import Bumps, bump_parts, bumps_of_parts
from engine.material.layer import object_of, place_of
from engine.material.parameters import ParameterError
from engine.realtime.zonal_harmonics.pose import MAX_GROWTH, Deformation, Moment, largest_growth
from engine.scene.description import MAX_OBJECTS, Camera, Name, Number, Pixels, Radiance, Text
from engine.scene.surface_kinds import DeformSurface
from engine.scene.toml_text import check_version, parse_toml_bytes, toml_lines, toml_value
from engine.scene.validation_errors import first_validation_error
from engine.settings import (
    PICTURE_LINES,
    SETTINGS,
    LineValue,
    RenderSettings,
    Setting,
    checked_bands,
    checked_line,
)

SUFFIX = SESSION_ENDING
SESSION_VERSION = 2
MAX_SESSION_BYTES = 64 * 2**20
MAX_OVERRIDES = 4096
CHANGED = "it has been written elsewhere since it was opened here; save under another name, or replace it"
# A path of any length that systems take, each byte of it as "%E9".
PathText = Annotated[str, Field(min_length=1, max_length=3 * 4096 + 5, strict=True)]


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


def _bumps(value: object) -> Bumps:
    """An object's bumps, from their parts by name."""
    if not isinstance(value, dict):
        raise ValueError("a table")
    try:
        return bumps_of_parts(value)
    except ParameterError as error:
        raise ValueError(f"{error.what}: {error.expected}") from None


SavedBumps = Annotated[Bumps, PlainValidator(_bumps)]


class ObjectRecord(StrictModel):
    name: Name
    visible: Flag = True
    frozen: Flag = False
    editable: Flag = True
    emission: Radiance | None = None
    layers: tuple[LayerRecord, ...] = Field(default=(), alias="layer", max_length=MAX_LAYERS)
    bumps: SavedBumps | None = None
    deform: DeformSurface | None = None
    time: Number | None = None
    clip: Text | None = None
    deformers: tuple[DeformerRecord, ...] = Field(default=(), alias="deformer", max_length=MAX_DEFORMERS)

    @model_validator(mode="after")
    def _is_a_pose(self) -> ObjectRecord:
        if (self.time is None) != (self.clip is None):
            raise ValueError("time and clip: both or none")
        if (times := largest_growth([each.deformation for each in self.deformers])) > MAX_GROWTH:
            raise ValueError(f"deformers make it {times:.3g} times as large: at most {MAX_GROWTH:g} times")
        return self


class LightRecord(StrictModel):
    environment: PathText
    mapping: Literal["latlong", "angular"] = "latlong"
    rotation: Number = 0.0
    intensity: Annotated[Number, Field(ge=0.0, le=INTENSITY.maximum)] = 1.0
    radiance: Radiance | None = None


def _type_of(setting: Setting) -> Any:
    """The type of a setting's values in a session."""
    if isinstance(setting.values, range):
        least, most = setting.bounds
        return Annotated[int, Field(ge=least, le=most, strict=True)]
    values = tuple(value for value in (*setting.as_required, *setting.values) if value is not None)
    return Literal[values] | None if None in setting.as_required else Literal[values]  # type: ignore[valid-type]


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


@dataclass(frozen=True)
class Session:
    """The content of a session file. ``view`` has defaults where the file has no value; ``journal`` is a journal's;
    ``digest`` distinguishes it from what another window may have saved there since."""

    document: Document
    view: ViewState
    journal: JournalRecord | None = None
    digest: str = field(default="", compare=False)


@dataclass(frozen=True)
class KnownFile:
    """A session's file as it was read or written here last; None before."""

    path: Path | None = None
    digest: str = ""

    @property
    def has_changed(self) -> bool:
        """Whether another window or program has written it since. A file that was deleted is no loss."""
        if self.path is None or not self.digest or not os.path.exists(self.path):
            return False
        try:
            return _digest(read_regular_file(self.path, MAX_SESSION_BYTES)) != self.digest
        except LoadError:
            return True


def save_session(path: Path, document: Document, view: ViewState) -> Path:
    """Write a session file, whole or not at all, replacing any other; returns the path, which ends in ``.insitu``.

    Raises InsituError that says why it cannot be written; the file that was there is then untouched.
    """
    written = write_session(path, document, view)
    assert written.path is not None
    return written.path


def write_session(path: Path, document: Document, view: ViewState, last: KnownFile | None = None) -> KnownFile:
    """The same; returns the file as it is now. last: as it was read or written here last: where it has changed since,
    it is refused as well."""
    path = path if path.suffix else path.with_suffix(SUFFIX)
    if path.suffix != SUFFIX:
        raise InsituError(f"{path}: a session's name ends in {SUFFIX}; the scene's own file is never overwritten")
    data = dump_checked(path, document, view, resolved(path).parent)
    if last is not None and last.path == path and last.has_changed:
        raise InsituError(f"{path}: not saved, {CHANGED}")
    save_file(path, data, session=path)
    return KnownFile(path, _digest(data))


def dump_checked(
    path: Path, document: Document, view: ViewState, folder: Path | None = None, journal: JournalRecord | None = None,
    known: Document | None = None,
) -> bytes:  # fmt: skip
    """The new content of the file at ``path``. It is read back before it replaces another: raises InsituError where
    opening it would refuse it, or give another document. known: one that was read back before, as were the objects that
    it shares with this: of 500 objects reading takes a sixth of a second."""
    data = dump_session(document, view, folder, journal).encode()
    unread = _changed_objects(document, known)
    text = dump_session(unread, view, folder, journal)
    if len(data) > MAX_SESSION_BYTES:
        raise InsituError(f"{path}: not written, {len(data)} bytes are more than could be opened again")
    try:
        found = parse_session(text.encode(), path, folder)
    except LoadError as error:
        why = f"{error.what} = {describe_value(error.value)}, expected {error.expected}"
        raise InsituError(f"{path}: not written, it could not be opened again: {why}") from None
    if dump_session(found.document, replace(view, bookmarks=found.view.bookmarks), folder, journal) != text:
        raise InsituError(f"{path}: not written, another document would be opened from it")
    return data


def _changed_objects(document: Document, known: Document | None) -> Document:
    """The document with only those objects that it does not share with another; one of them at least."""
    if known is None:
        return document
    shared = set(map(id, known.objects))
    return replace(document, objects=tuple(o for o in document.objects if id(o) not in shared) or document.objects[:1])


def load_session(path: Path) -> Session:
    """Read a session file; LoadError names the place of the first error."""
    data = read_regular_file(path, MAX_SESSION_BYTES)
    return replace(parse_session(data, path, resolved(path).parent), digest=_digest(data))


def parse_session(data: bytes, path: Path, folder: Path | None) -> Session:
    """The session of a file at ``path`` with this data; files are named from ``folder``. Raises LoadError."""
    if len(data) > MAX_SESSION_BYTES:
        raise LoadError(path, "size", f"{len(data)} bytes", f"at most {MAX_SESSION_BYTES} bytes")
    tree = upgrade_session(parse_toml_bytes(data, path))
    check_version(tree, path, SESSION_VERSION)
    try:
        record = SessionRecord.model_validate(tree)
    except ValidationError as error:
        raise first_validation_error(error, tree, path, SessionRecord) from None
    objects = tuple(_object(str(path), folder, each) for each in record.objects)
    light = LightState(**{**record.light.model_dump(), "environment": full_path(record.light.environment, folder)})
    document = Document(full_path(record.scene, folder), objects, check_light(light, str(path)), record.first_bands)
    document = replace(document, overrides=tuple(sorted(record.overrides.items())))
    view = replace(_view(record.view, document), bookmarks=tuple(each.bookmark for each in record.bookmarks))
    return Session(document, view, record.journal)


def _digest(data: bytes) -> str:
    """Distinguishes two contents of a session file."""
    return hashlib.blake2b(data, digest_size=20).hexdigest()


def fit_session(session: Session, scene: Document, file: str) -> Document:
    """The session's document for a scene as it is now; LoadError when the scene has other objects.

    Layers are the session's own, where it has some: an object may have been given another material.
    """
    have, want = ({state.name for state in document.objects} for document in (scene, session.document))
    for name in sorted(have ^ want):
        found, there = ("not in the session", "all objects") if name in have else ("in the session", "only objects")
        raise LoadError(file, f"object {name!r}", found, f"{there} of the scene")
    saved = {state.name: state for state in session.document.objects}
    for state in scene.objects:
        _check_moment(state, saved[state.name].moment, file)
    objects = tuple(_with_scene_emission(state, saved[state.name]) for state in scene.objects)
    return replace(session.document, source=scene.source, objects=objects)


def _with_scene_emission(scene: ObjectState, saved: ObjectState) -> ObjectState:
    """The saved state of an object; the scene determines whether it emits, and its material where none is saved."""
    emission = saved.emission or scene.emission if scene.emits else None
    new = saved.new_bumps if saved.new_bumps != scene.own_bumps and not scene.is_lamp else None
    surface = saved.new_surface if saved.new_surface != scene.own_surface and not scene.is_lamp else None
    return replace(
        saved, emission=emission, layers=saved.layers or scene.layers, animations=scene.animations,
        own_bumps=scene.own_bumps, new_bumps=new, own_surface=scene.own_surface, new_surface=surface,
    )  # fmt: skip


def _check_moment(scene: ObjectState, moment: Moment | None, file: str) -> None:
    names = [each.name for each in scene.animations]
    if moment is not None and moment.clip not in names:
        there = f"one of {', '.join(names)}" if names else "no time: it has no animation"
        raise LoadError(file, f"object {scene.name!r}: clip", moment.clip, there)


def dump_session(
    document: Document, view: ViewState, folder: Path | None = None, journal: JournalRecord | None = None
) -> str:
    """The TOML text. Files inside ``folder`` are written relative to it, so that the folder can move."""
    light = {**vars(document.light), "environment": written_path(document.light.environment, folder)}
    lines = [
        "# An Insitu session: materials, light and poses on top of a scene. Angles of operators in radians.",
        *toml_lines({"version": SESSION_VERSION, "ends": True, "scene": written_path(document.source, folder)}),
        *toml_lines({"first_bands": document.first_bands}),
    ]
    if journal is not None:
        lines += ["[journal]", *toml_lines(journal.model_dump())]
    lines += ["[light]", *toml_lines(light), "[overrides]", *toml_lines(dict(document.overrides))]
    lines += ["[view]", *toml_lines(_view_values(view))]
    for state in document.objects:
        lines += _object_lines(state, folder)
    for bookmark in view.bookmarks:
        lines += ["[[bookmark]]", *toml_lines(_bookmark_values(bookmark))]
    return "\n".join([*lines, "[end]"]) + "\n"


def _object_lines(state: ObjectState, folder: Path | None) -> Iterator[str]:
    switches = {"visible": state.visible, "frozen": state.frozen, "editable": state.editable}
    yield "[[object]]"
    yield from toml_lines({"name": state.name, **switches, "emission": state.emission})
    if state.new_bumps is not None:
        yield f"bumps = {toml_value(bump_parts(state.new_bumps))}"
    if state.new_surface is not None:
        yield f"deform = {toml_value(state.new_surface.model_dump(exclude_none=True))}"
    if state.moment is not None:
        yield from toml_lines(vars(state.moment))
    yield from layer_lines(state.layers, "object.layer", folder)
    for deformation in state.deformations:
        yield "[[object.deformer]]"
        yield from toml_lines(vars(deformation))


def _view_values(view: ViewState) -> dict[str, Any]:
    settings = {name: getattr(view.settings, name) for name in SAVED_SETTINGS}
    others = {name: getattr(view, name) for name in ViewRecord.model_fields if name not in ("selected", *settings)}
    selected = None if view.selected is None else view.selected.path
    return {"selected": selected, **others, **settings, "camera": _camera_values(view.camera)}


def _camera_values(camera: Camera | None) -> dict[str, Any] | None:
    return None if camera is None else dict(camera)


def _bookmark_values(bookmark: Bookmark) -> dict[str, Any]:
    camera, resolution = bookmark.viewpoint
    thumbnail = base64.b64encode(bookmark.thumbnail).decode() or None
    return {
        "name": bookmark.name, "camera": _camera_values(camera), "resolution": resolution, "thumbnail": thumbnail
    }  # fmt: skip


def _object(file: str, folder: Path | None, record: ObjectRecord) -> ObjectState:
    layers = with_full_paths(layers_of(file, record.name, record.layers), folder or Path())
    deformations = tuple(each.deformation for each in record.deformers)
    moment = None if record.clip is None or record.time is None else Moment(record.clip, record.time)
    return ObjectState(
        record.name,
        layers,
        record.emission,
        record.editable,
        record.visible,
        record.frozen,
        deformations,
        moment,
        new_bumps=record.bumps,
        new_surface=record.deform,
    )


def _view(record: ViewRecord, document: Document) -> ViewState:
    values = {name: getattr(record, name) for name in ViewRecord.model_fields if name != "selected"}
    return replace(SetView.of(**values).apply(ViewState()), selected=_selection(record.selected, document))


def _selection(path: str | None, document: Document) -> Selection | None:
    """The selection that a path names; a selection that no longer fits is no reason to refuse a session."""
    for key, layer in document.layers():
        for factor in all_factors(layer.model):
            if path == f"{key}.{factor.name}":
                return Selection(object_of(key), place_of(key), factor.name)
    return None
