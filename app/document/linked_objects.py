"""Objects that share their material: linked duplicates.

All objects that have a link of the same name (`ObjectState.linked`) have the same layers, images, bumps, opacity,
surface and emission: what is edited of one is edited of all. They are read from one source, so that their mesh is the
same anyway, and what the file says of it. Transform, deformers, time, visibility, groups and the row in the mix are
each object's own, as in Blender a linked duplicate shares the mesh with its materials, and not its modifiers.

The link is the object's own, as that of a curve is its layer's (`app.document.linked_curves`): it goes along through
renames, looks and sessions, and nothing is left to tidy where an object is deleted. A link that one object alone has is
none. Rejected: links of all curves, which share neither images nor parameters that drive no curve.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from engine.material.layer import object_of, place_of

if TYPE_CHECKING:
    from app.document.document import Document, ObjectState

SHARED_FIELDS = ("layers", "emission", "new_bumps", "new_opacity", "new_surface", "variants")
ObjectLinks = Mapping[str, tuple[str, ...]]


def object_links(document: Document) -> ObjectLinks:
    """The names of the objects that have each link, by the link's; those of several objects."""
    found = dict[str, list[str]]()
    for state in document.objects:
        if state.linked:
            found.setdefault(state.linked, []).append(state.name)
    return {link: tuple(names) for link, names in found.items() if len(names) > 1}


def linked_objects(document: Document, name: str) -> tuple[str, ...]:
    """The names of the other objects that share the material of an object."""
    link = document.object(name).linked
    return tuple(other for other in document.object_links.get(link, ()) if other != name)


def linked_places(document: Document, key: str) -> tuple[str, ...]:
    """The keys of the same layer in the other objects that share it."""
    if not document.object_links:
        return ()
    return tuple(f"{other}.{place_of(key)}" for other in linked_objects(document, object_of(key)))


def frozen_one(document: Document, name: str) -> str:
    """The name of an object that is frozen, of this and those that share its material; "" for none."""
    return next((each for each in (name, *linked_objects(document, name)) if document.object(each).frozen), "")


def with_material_of(state: ObjectState, other: ObjectState) -> ObjectState:
    """An object with what objects of one link share; itself where it has that."""
    if all(_is_same(getattr(state, name), getattr(other, name)) for name in SHARED_FIELDS):
        return state
    return replace(state, **{name: getattr(other, name) for name in SHARED_FIELDS})


def _is_same(one: object, two: object) -> bool:
    """Whether two values are one object, or tuples of such: layers are not compared number by number in each frame."""
    if isinstance(one, tuple) and isinstance(two, tuple):
        return len(one) == len(two) and all(a is b for a, b in zip(one, two, strict=True))
    return one is two


def without_material(state: ObjectState) -> ObjectState:
    """An object without what objects of one link share."""
    return replace(state, layers=(), emission=None, new_bumps=None, new_opacity=None, new_surface=None)


def with_shared_materials(states: Iterable[ObjectState]) -> tuple[ObjectState, ...]:
    """Objects, those of one link with the material of the first of them."""
    first: dict[str, ObjectState] = {}
    return tuple(
        with_material_of(each, first.setdefault(each.linked, each)) if each.linked else each for each in states
    )


def free_link(document: Document, name: str) -> str:
    """A name for a new link of an object: the object's, with a number where that is taken."""
    from app.document.scene_objects import numbered_name

    taken = {state.linked for state in (*document.objects, *document.absent)}
    return numbered_name(name, taken) if name in taken else name
