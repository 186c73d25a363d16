"""Session files: a document and the state of its view, as versioned TOML (``NAME.insitu``).

The scene's own file is referred to and never written. All values are checked by pydantic models and by the parameter
tables before anything changes; a faulty file is refused with the place of the error. A document saved and opened is
equal to the last bit (see `app.files.layer_records`).
"""

from __future__ import annotations

import base64
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from pydantic import (
    ValidationError,
)

from app.document.background import Background
from app.document.commands.light import MAP_PARAMETERS, check_light
from app.document.document import Document, ObjectState, Selection, all_factors
from app.document.light_state import MIX_FIELDS, PLAIN_ROW, LightState, MixRow, sun_key
from app.document.linked_objects import with_shared_materials, without_material
from app.document.looks import Look, LookState, in_all_looks, objects_of_looks
from app.document.named_files import renamed_image, with_full_paths
from app.document.painted_parameters import painted_values
from app.document.scene_files import renamed, session_of_archive, split_axis
from app.document.selection import sun_of_path
from app.document.sources import SESSION_ENDING
from app.document.targets import TRANSFORM_FIELDS
from app.document.view_state import Bookmark, SetView, ViewState
from app.files.known_file import MAX_SESSION_BYTES, KnownFile, digest_of
from app.files.layer_records import layer_lines, layers_of
from app.files.light_records import LightRecord
from app.files.old_names import upgrade_session
from app.files.records import (
    SAVED_SETTINGS,
    AddedRecord,
    JournalRecord,
    LookRecord,
    ObjectRecord,
    SessionRecord,
    ViewRecord,
)
from app.system.atomic import save_file
from app.system.paths import full_path, written_path
from engine.core.colour import ConfigView
from engine.core.colour_config import BUILT_IN
from engine.core.errors import InsituError, LoadError, describe_value
from engine.core.safe_files import read_regular_file, resolved
from engine.light.cones import Cone
from engine.light.painted_lights import PaintedLight
from engine.light.suns import Sun
from engine.material.bumps import bump_parts
from engine.material.layer import object_of, place_of
from engine.material.map_tables import map_values
from engine.material.opacity import opacity_parts
from engine.realtime.zonal_harmonics.pose import Moment
from engine.scene.description import Camera, ObjectDescription
from engine.scene.toml_text import check_version, first_validation_error, parse_toml_bytes, toml_lines, toml_value
from engine.scene.transform import Transform

SUFFIX = SESSION_ENDING
SESSION_VERSION = 2
CHANGED = "it has been written elsewhere since it was opened here; save under another name, or replace it"


@dataclass(frozen=True)
class Session:
    """The content of a session file. ``view`` has defaults where the file has no value; ``journal`` is a journal's;
    ``digest`` distinguishes it from what another window may have saved there since."""

    document: Document
    view: ViewState
    journal: JournalRecord | None = None
    digest: str = field(default="", compare=False)


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
    return KnownFile(path, digest_of(data))


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
    shared = set(map(id, objects_of_looks(known)))
    names = {state.name for state in objects_of_looks(document) if id(state) not in shared}
    names = names or {state.name for state in document.objects[:1]}

    def changed(look: Document) -> Document:
        return replace(look, objects=tuple(state for state in look.objects if state.name in names))

    return in_all_looks(document, changed)


def load_session(path: Path) -> Session:
    """Read a session file; LoadError names the place of the first error."""
    data = read_regular_file(path, MAX_SESSION_BYTES)
    return replace(parse_session(data, path, resolved(path).parent), digest=digest_of(data))


def archived_session(source: str) -> Session | None:
    """The session of a scene in an archive that is unpacked, in which its scene is the archive's; None for none. Raises
    LoadError."""
    path = session_of_archive(source)
    if path is None:
        return None
    session = load_session(path)
    named = renamed(session.document.source, split_axis(source)[0])
    return replace(session, document=replace(session.document, source=named))


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
    objects = with_shared_materials(_object(str(path), folder, each) for each in record.objects)
    light = _light(str(path), folder, record.light)
    document = Document(full_path(record.scene, folder), objects, light, record.first_bands)
    document = replace(
        document, overrides=tuple(sorted(record.overrides.items())), deleted=record.deleted,
        background=record.background.background,
    )  # fmt: skip
    looks = (Look(each.name, None if each.current else _look(path, folder, each, document)) for each in record.looks)
    document = replace(document, looks=tuple(looks))
    view = replace(_view(record.view, document, folder), bookmarks=tuple(each.bookmark for each in record.bookmarks))
    return Session(document, view, record.journal)


def _with_full_file(light: PaintedLight, folder: Path | None) -> PaintedLight:
    """A painted light with the absolute path of its image."""
    return replace(light, file=full_path(light.file, folder)) if light.file else light


def _painted_values(light: PaintedLight, folder: Path | None) -> dict[str, Any]:
    """A painted light as it is written."""
    values = painted_values(light)
    return {**values, "file": written_path(light.file, folder)} if light.file else values


def dump_session(
    document: Document, view: ViewState, folder: Path | None = None, journal: JournalRecord | None = None
) -> str:
    """The TOML text. Files inside ``folder`` are written relative to it, so that the folder can move."""
    lines = [
        "# An Insitu session: materials, light and poses on top of a scene. Angles of operators in radians.",
        *toml_lines({"version": SESSION_VERSION, "ends": True, "scene": written_path(document.source, folder)}),
        *toml_lines({"first_bands": document.first_bands, "deleted": document.deleted or None}),
    ]
    if journal is not None:
        lines += ["[journal]", *toml_lines(journal.model_dump())]
    lines += ["[light]", *toml_lines(_light_values(document.light, folder))]
    if document.background != Background():
        lines += ["[background]", *toml_lines(vars(document.background))]
    lines += ["[overrides]", *toml_lines(dict(document.overrides))]
    lines += ["[view]", *toml_lines(_view_values(view, folder))]
    leads = dict[str, str]()
    for state in (*document.objects, *document.absent):
        lead = leads.setdefault(state.linked, state.name) if state.linked else state.name
        lines += _object_lines(state if lead == state.name else without_material(state), folder)
    for look in document.looks:
        lines += _look_lines(look, document, folder)
    for bookmark in view.bookmarks:
        lines += ["[[bookmark]]", *toml_lines(_bookmark_values(bookmark))]
    return "\n".join([*lines, "[end]"]) + "\n"


def _changed(row: MixRow) -> dict[str, Any]:
    """The values of a row that are not as at first."""
    return {name: getattr(row, name) for name in MIX_FIELDS if getattr(row, name) != getattr(PLAIN_ROW, name)}


def _light_values(light: LightState, folder: Path | None) -> dict[str, Any]:
    """The values of a light; suns are those that were edited."""
    values = {**vars(light), "environment": written_path(light.environment, folder)}
    del values["own_suns"]
    new_suns = values.pop("new_suns")
    marks: dict[str, dict[str, bool]] = {name: {"added": True} for name in light.added_suns}
    values["suns"] = None if new_suns is None else [each._asdict() | marks.get(each.name, {}) for each in new_suns]
    values["deleted_suns"] = light.deleted_suns or None
    values["painted"] = [_painted_values(each, folder) for each in light.painted] or None
    values |= {name: None for name, each in MAP_PARAMETERS.items() if values[name] == each.default}
    values["sides"] = light.sides or None
    values["mix"] = [{"light": key, **_changed(row)} for key, row in light.mix] or None
    return values


def _look_lines(look: Look, document: Document, folder: Path | None) -> Iterator[str]:
    """A look: its differences to the current one, object by object; of an object with the same layers these are left
    out."""
    yield "[[look]]"
    yield from toml_lines({"name": look.name, "current": True if look.state is None else None})
    if look.state is None:
        return
    if look.state.light != document.light:
        yield "[look.light]"
        yield from toml_lines(_light_values(look.state.light, folder))
    if look.state.background != document.background:
        yield "[look.background]"
        yield from toml_lines(vars(look.state.background))
    current = {state.name: state for state in (*document.objects, *document.absent)}
    for state in (*look.state.objects, *look.state.absent):
        if (same := current[state.name]) != state:
            layers = () if state.layers == same.layers else state.layers
            yield from _object_lines(
                replace(state, layers=layers, original="", added=None, linked=""), folder, "look.object"
            )


def _object_lines(state: ObjectState, folder: Path | None, table: str = "object") -> Iterator[str]:
    switches = {"visible": state.visible, "frozen": state.frozen, "editable": state.editable}
    switches |= {"shadow_catcher": True} if state.shadow_catcher else {}
    yield f"[[{table}]]"
    names = {"name": state.name, "original": state.original or None, "in_group": state.in_group or None}
    names["linked"] = state.linked or None
    yield from toml_lines({**names, **switches, "emission": state.emission})
    if state.added is not None:
        yield f"added = {toml_value(_added_values(state.added, folder))}"
    if state.new_bumps is not None:
        yield f"bumps = {toml_value(bump_parts(state.new_bumps))}"
    if state.new_opacity is not None:
        yield f"opacity = {toml_value(opacity_parts(state.new_opacity))}"
    if state.new_surface is not None:
        yield f"deform = {toml_value(state.new_surface.model_dump(exclude_none=True))}"
    if state.moment is not None:
        yield from toml_lines(vars(state.moment))
    if not state.transform.is_identity:
        own = {name: getattr(state.transform, field) for name, field in TRANSFORM_FIELDS.items()}
        own |= {"axes": state.transform.axes} if any(state.transform.axes) else {}
        yield f"transform = {toml_value(own)}"
    if state.new_cone is not None:
        yield f"cone = {toml_value(vars(state.new_cone))}"
    yield from toml_lines({"target_distance": state.target_distance})
    yield from layer_lines(state.layers, f"{table}.layer", folder)
    for deformation in state.deformations:
        yield f"[[{table}.deformer]]"
        yield from toml_lines(vars(deformation))


def _added_values(added: ObjectDescription, folder: Path | None) -> dict[str, Any]:
    values = {name: getattr(added, name) for name in AddedRecord.model_fields}
    mesh = None if added.mesh is None else written_path(added.mesh, folder)
    cone = None if added.cone is None else added.cone.model_dump()
    new_name = partial(written_path, folder=folder)
    texture = added.emission_texture.with_files(partial(renamed_image, new_name=new_name))
    values |= {"mesh": mesh, "cone": cone, "emission_texture": map_values(texture) or None}
    return {name: value for name, value in values.items() if value is not None}


def _view_values(view: ViewState, folder: Path | None) -> dict[str, Any]:
    settings = {name: getattr(view.settings, name) for name in SAVED_SETTINGS}
    apart = "selected", "ocio", *settings
    others = {name: getattr(view, name) for name in ViewRecord.model_fields if name not in apart}
    selected, shown = None if view.selected is None else view.selected.path, view.tone_mapping
    selected = selected if view.sun is None else sun_key(view.sun)
    if isinstance(shown, ConfigView):  # with the view that programs show which cannot read it
        others["tone_mapping"] = ViewState().tone_mapping
        config = shown.config if shown.config.startswith(BUILT_IN) else written_path(shown.config, folder)
        others["ocio"] = {**vars(shown), "config": config}
    return {"selected": selected, **others, **settings, "camera": _camera_values(view.camera)}


def _camera_values(camera: Camera | None) -> dict[str, Any] | None:
    return None if camera is None else dict(camera)


def _bookmark_values(bookmark: Bookmark) -> dict[str, Any]:
    camera, resolution = bookmark.viewpoint
    thumbnail = base64.b64encode(bookmark.thumbnail).decode() or None
    return {
        "name": bookmark.name, "camera": _camera_values(camera), "resolution": resolution, "thumbnail": thumbnail
    }  # fmt: skip


def _light(file: str, folder: Path | None, saved: LightRecord) -> LightState:
    """The light of a record. Raises LoadError for the file."""
    light = LightState(
        full_path(saved.environment, folder), saved.mapping, saved.rotation, saved.intensity, saved.radiance,
        # Those of the scene as far as the session knows them: what it has edited, and the names of deleted ones.
        own_suns=(
            *(each.sun for each in saved.suns or () if not each.added),
            *(Sun((0.0, 1.0, 0.0), (0.0, 0.0, 0.0), name=name) for name in saved.deleted_suns),
        ),
        new_suns=None if saved.suns is None else tuple(each.sun for each in saved.suns),
        tilt=saved.tilt, hue=saved.hue, contrast=saved.contrast, clamp=saved.clamp, sides=saved.sides,
        painted=tuple(_with_full_file(each.painted, folder) for each in saved.painted),
    )  # fmt: skip
    return check_light(light.with_rows({each.light: each.row for each in saved.mix}), file)


def _look(file: Path, folder: Path | None, record: LookRecord, current: Document) -> LookState:
    """A look that is not current, of its differences to the document. Raises LoadError for the file."""
    light, background = current.light, current.background
    if record.light is not None:
        light = _light(str(file), folder, record.light)
    if record.background is not None:
        background = record.background.background
    own = {each.name: _object(str(file), folder, each) for each in record.objects}

    def state(same: ObjectState) -> ObjectState:
        found = own.get(same.name)
        if found is None:
            return same
        layers = found.layers or same.layers
        return replace(found, layers=layers, original=same.original, added=same.added, linked=same.linked)

    return LookState(tuple(map(state, current.objects)), light, background)


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
        transform=Transform() if record.transform is None else record.transform.transform,
        new_bumps=record.bumps,
        new_opacity=record.opacity,
        new_surface=record.deform,
        shadow_catcher=record.shadow_catcher,
        original=record.original or "",
        added=None if record.added is None else record.added.description(folder),
        in_group=record.in_group or "",
        linked=record.linked or "",
        new_cone=None if record.cone is None else Cone(record.cone.inner, record.cone.outer),
        target_distance=record.target_distance,
    )


def _view(record: ViewRecord, document: Document, folder: Path | None) -> ViewState:
    values = {name: getattr(record, name) for name in ViewRecord.model_fields if name not in ("selected", "ocio")}
    if (own := record.ocio) is not None:
        config = own.config if own.config.startswith(BUILT_IN) else full_path(own.config, folder)
        values["tone_mapping"] = ConfigView(config, own.display, own.view, own.look)
    selected, sun = _selection(record.selected, document), sun_of_path(document, record.selected)
    return replace(SetView.of(**values).apply(ViewState()), selected=selected, sun=sun)


def _selection(path: str | None, document: Document) -> Selection | None:
    """The selection that a path names; a selection that no longer fits is no reason to refuse a session."""
    for key, layer in document.layers():
        for factor in all_factors(layer.model):
            if path == f"{key}.{factor.name}":
                return Selection(object_of(key), place_of(key), factor.name)
    return None
