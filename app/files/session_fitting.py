"""Fits a session to its scene as it is now: other objects, other names, other animations."""

from __future__ import annotations

from dataclasses import replace

from app.document.document import Document, ObjectState
from app.document.looks import in_all_looks
from app.document.scene_objects import NONE_ADDED, AddedStates, by_source, in_scene_order, with_free_names
from app.files.session import Session
from engine.core.errors import LoadError, list_names


def fit_session(session: Session, scene: Document, file: str, added: AddedStates = NONE_ADDED) -> Document:
    """The session's document for a scene as it is now; added: the objects that its file does not have, as they were
    read. Objects that the scene no longer has, or that could not be read, are `absent`, new ones are as the scene has
    them (`session_notes` says so). LoadError where there are none of the session's objects.

    Layers are the session's own, where it has some: an object may have been given another material.
    """
    own, fitted = by_source(scene, added), dict[int, tuple[ObjectState, ObjectState]]()

    def with_saved(state: ObjectState) -> ObjectState:
        """A saved object; looks share objects, which are held, so that their numbers stay theirs."""
        if id(state) not in fitted:
            fitted[id(state)] = state, _with_saved(own[state.source], state)
        return fitted[id(state)][1]

    def fit(document: Document) -> Document:
        saved = document.objects
        if saved and not any(state.source in own for state in saved):
            name = min(state.name for state in saved)
            raise LoadError(file, f"object {name!r}", "in the session", f"an object of the scene, {scene.source}")
        there = [with_saved(state) for state in saved if state.source in own]
        new = with_free_names(_new_objects(document, scene), {state.name for state in saved})
        deleted = tuple(name for name in document.deleted if name in own)
        deleted += tuple(state.original for state in new if state.original)
        objects = in_scene_order([*there, *new], scene)
        absent = tuple(state for state in saved if state.source not in own)
        light = document.light.with_own_suns(scene.light.own_suns)
        return replace(document, source=scene.source, objects=objects, absent=absent, light=light, deleted=deleted)

    return in_all_looks(_with_present_names(session.document, scene), fit)


def _new_objects(document: Document, scene: Document) -> list[ObjectState]:
    """The objects of a scene that the document of a session neither has nor has deleted."""
    known = {*document.deleted, *(state.name for state in document.objects if state.is_of_file)}
    return [state for state in scene.objects if state.name not in known]


def session_notes(session: Session, scene: Document, added: AddedStates = NONE_ADDED) -> tuple[str, ...]:
    """What of a session the scene no longer has, and what it has besides; a line each. added: as of `fit_session`."""
    document = _with_present_names(session.document, scene)
    saved = {state.name: state for state in document.objects}
    there = by_source(scene, added)
    gone = [name for name, state in saved.items() if state.source not in there]
    new = [state.name for state in _new_objects(document, scene)]
    still = [name for name, state in saved.items() if state.source in there and _lost_clip(there[state.source], state)]
    lines = (
        (gone, "no longer in the scene; their edits stay in the session"),
        (new, "not in the session, shown as the scene has them"),
        (still, "the animation of the session is no longer in the file, shown at rest"),
    )
    return tuple(f"{list_names(names)}: {what}" for names, what in lines if names)


def _with_present_names(document: Document, scene: Document) -> Document:
    """The document of a session with the present names of parts of glTF files, which sessions of version 2 call by
    their numbers."""
    saved, there = {state.name for state in document.objects}, {state.name for state in scene.objects}
    names = {each.former_name: each.name for each in scene.objects if each.former_name in saved - there}

    def renamed(look: Document) -> Document:
        objects = tuple(replace(each, name=names.get(each.name, each.name)) for each in look.objects)
        return replace(look, objects=objects, light=look.light.with_renamed_rows(names))

    return in_all_looks(document, renamed) if names else document


def _lost_clip(scene: ObjectState, saved: ObjectState) -> bool:
    """Whether an object was posed by an animation that its file no longer has."""
    return saved.moment is not None and saved.moment.clip not in [each.name for each in scene.animations]


def _with_saved(scene: ObjectState, saved: ObjectState) -> ObjectState:
    """The saved state of an object; the scene determines whether it emits, and its material where none is saved."""
    emission = saved.emission or scene.emission if scene.emits else None
    new = saved.new_bumps if saved.new_bumps != scene.own_bumps and not scene.is_lamp else None
    opacity = saved.new_opacity if saved.new_opacity != scene.own_opacity and not scene.is_lamp else None
    surface = saved.new_surface if saved.new_surface != scene.own_surface and not scene.is_lamp else None
    return replace(
        saved, emission=emission, layers=saved.layers or scene.layers, animations=scene.animations,
        moment=None if _lost_clip(scene, saved) else saved.moment, own_bumps=scene.own_bumps, new_bumps=new,
        emission_texture=scene.emission_texture,
        own_opacity=scene.own_opacity, new_opacity=opacity,
        own_surface=scene.own_surface, new_surface=surface, variants=scene.variants, lamp=scene.lamp,
        new_cone=None if scene.cone in (None, saved.new_cone) else saved.new_cone,
    )  # fmt: skip
