"""Operators that place objects and lamps by hand: handles over the picture, and moves by numbers in scripts."""

from __future__ import annotations

from functools import partial
from typing import Annotated, Literal

from pydantic import ConfigDict, Field, model_validator

from app.document.arranging import Pivot, RestingBox, dropping, move_together, placed_objects
from app.document.commands.groups import RenameGroup, SetGroup, free_group_name, members_of, switching, ungrouping
from app.document.commands.linked_objects import single_users
from app.document.commands.objects import AddObject, DeleteObject, DuplicateObjects, ShowObjects, duplicates_of
from app.document.commands.painted import AddPainted
from app.document.commands.poses import MoveObject, PlaceObjects
from app.document.commands.several import Several, named_together
from app.document.commands.suns import AddSun, DeleteSun, DuplicateSun, sun_addition
from app.document.document import Document
from app.document.light_state import sun_key
from app.document.linked_objects import linked_objects
from app.document.painted_parameters import FILE, TITLES
from app.document.scene_objects import numbered_name, taken_names
from app.editor.editor import Editor
from app.operators.edits import PictureIndex
from app.operators.operator import OBJECT, SCENE, Gesture, Need, Operator, OperatorContext, ScriptKey, ValueRecord
from app.operators.snapping import PIVOTING, SNAPPING
from app.system.paths import full_path
from engine.light.painted_lights import PAINTED_KINDS, PaintedKind
from engine.scene.arrangement import PlacedObject
from engine.scene.composition import ADDABLE, LIGHTS, SUN
from engine.scene.description import Name, Number, Text, Vector
from engine.scene.transform import Transform

PicturePixel = tuple[PictureIndex, PictureIndex]


class Grouping(ValueRecord):
    """Objects that are put in a group, with those that it has."""

    name: Annotated[Name, Field(description="Of the group.")]
    objects: Annotated[tuple[Text, ...], Field(min_length=1, description="What is put in it.")]


class Move(ValueRecord):
    """An object or several, and by how much they are moved, rotated and scaled from where they are."""

    object: Annotated[Text | None, Field(description="Which one is moved; or `objects` or `group`.")] = None
    objects: Annotated[tuple[Text, ...] | None, Field(
        min_length=1, description="Which ones are moved together, about their middle and along the world's axes."
    )] = None  # fmt: skip
    group: Annotated[Text | None, Field(description="Whose objects are moved together.")] = None
    by: Annotated[Vector, Field(description="Metres along the axes of the world.")] = (0.0, 0.0, 0.0)
    rotate: Annotated[Vector, Field(description="Degrees about the world's X, then Y, then Z, through its pivot.")] = (
        0.0, 0.0, 0.0
    )  # fmt: skip
    scale: Annotated[Number | Vector, Field(description="One factor, or one along each axis.")] = 1.0
    about: Annotated[Pivot, Field(
        description="Of several: their common middle, or each about its own centre and along its own axes, or the "
        "centre of the active one, the last."
    )] = "middle"  # fmt: skip

    onto: Annotated[PicturePixel | None, Field(
        description="The pixel of a surface that they are moved to stand on, instead of `by` and the others."
    )] = None  # fmt: skip
    align: Annotated[bool, Field(description="With `onto`: turned so that they are upright on the surface.")] = False

    @model_validator(mode="after")
    def _moves(self) -> Move:
        if [self.object, self.objects, self.group].count(None) != 2:
            raise ValueError("object: exactly one of object, objects and group")
        if bool(self.model_fields_set & {"by", "rotate", "scale"}) == (self.onto is not None):
            raise ValueError("object, and at least one of by, rotate, scale, or onto")
        if self.align and self.onto is None:
            raise ValueError("align: beside onto")
        return self

    def command(self, document: Document, resting_box: RestingBox) -> MoveObject | PlaceObjects:
        """The edit. Raises InsituError."""
        scale = self.scale if isinstance(self.scale, tuple) else (self.scale, self.scale, self.scale)
        if self.object is not None:
            return MoveObject(self.object, self.by, self.rotate, scale)
        placed = self.placed(document, resting_box)
        return move_together(placed, self.by, self.rotate, scale, self.about)

    def placed(self, document: Document, resting_box: RestingBox) -> list[PlacedObject]:
        """What is moved, as it stands. Raises InsituError."""
        if self.group is not None:
            names = members_of(document, self.group)
        else:
            names = self.objects or (self.object or "",)
        return placed_objects(document, dict.fromkeys(names), resting_box)


PaintedValue = Number | tuple[Number, Number, Number] | Text


class Aim(ValueRecord):
    """A light, and what it is turned to shine at."""

    light: Annotated[Text, Field(description="A flat light or a spot.")]
    at: Annotated[Vector | None, Field(description="A point, metres; or `onto`.")] = None
    onto: Annotated[PicturePixel | None, Field(description="A pixel of the picture, whose surface it is.")] = None

    @model_validator(mode="after")
    def _is_one(self) -> Aim:
        if (self.at is None) == (self.onto is None):
            raise ValueError("at: exactly one of at and onto")
        return self


class PlacedByHand(ValueRecord):
    """A light, and where in the picture its highlight is seen or a shadow falls; pixels are column and row."""

    light: Annotated[Text, Field(description="Which one is placed; it stays as far away as it was. Or `painted.Key`.")]
    highlight: Annotated[PicturePixel | None, Field(
        description="The pixel of a surface at which the camera sees the light mirrored."
    )] = None  # fmt: skip
    shadow: Annotated[tuple[PicturePixel, PicturePixel] | None, Field(
        description="The pixel of what casts a shadow, and the pixel where this falls."
    )] = None  # fmt: skip

    @model_validator(mode="after")
    def _is_one(self) -> PlacedByHand:
        if (self.highlight is None) == (self.shadow is None):
            raise ValueError("highlight: exactly one of highlight and shadow")
        return self


class PaintedAddition(ValueRecord):
    """A light that is painted onto the environment, and values of its parameters."""

    model_config = ConfigDict(frozen=True, extra="allow")

    __pydantic_extra__: dict[str, PaintedValue]
    kind: Annotated[Literal["box", "disc", "gradient", "sky", "image"], Field(description="What is painted.")]
    name: Annotated[Name | None, Field(description="Its own where it is left out.")] = None
    file: Annotated[Text | None, Field(description="Of an image.")] = None

    @property
    def command(self) -> AddPainted:
        """The edit."""
        file = {} if self.file is None else {FILE: full_path(self.file)}
        return AddPainted(self.kind, self.name or "", tuple({**file, **self.__pydantic_extra__}.items()))


class Addition(ValueRecord):
    """A shape, a light or a file, and where it is added."""

    shape: Annotated[Literal[
        "box", "sphere", "plane", "cylinder", "cone", "torus", "backdrop", "shader ball", "pedestal"
    ] | None, Field(description="A shape or a prop; or `light` or `file`.")] = None  # fmt: skip
    light: Annotated[Literal["rectangle", "disc", "sphere", "point", "spot", "sun"] | None, Field(
        description="A light that shines down; a sun does from the camera's upper left, and has no place."
    )] = None  # fmt: skip
    file: Annotated[Text | None, Field(description="A mesh file, whose objects are all added.")] = None
    name: Annotated[Name | None, Field(description="Of the object; its own where it is left out.")] = None
    at: Annotated[Vector | None, Field(
        description="The point that it stands on, of a light its middle, metres; else where there is room."
    )] = None  # fmt: skip
    size: Annotated[Number | None, Field(
        description="Its largest side in metres, else a share of the scene's; of a sun degrees."
    )] = None  # fmt: skip

    @model_validator(mode="after")
    def _is_one(self) -> Addition:
        if [self.shape, self.light, self.file].count(None) != 2:
            raise ValueError("shape: exactly one of shape, light and file")
        return self

    @property
    def command(self) -> AddObject | AddSun:
        """The edit. Raises InsituError."""
        if self.light == SUN:
            return sun_addition(self.name or "", self.at, self.size)
        named = self.shape if self.light is None else f"{self.light} light"
        return AddObject(named or full_path(self.file or ""), self.name or "", self.at, self.size)


def _has_moved(context: OperatorContext) -> bool:
    return any(not context.document.object(name).transform.is_identity for name in context.view.selected_objects)


def _add(editor: Editor, value: Addition) -> str | None:
    return editor.do(value.command)


def _add_named(name: str, editor: Editor, value: None) -> str | None:
    return editor.do(AddObject(name))


def _move(editor: Editor, value: Move) -> str | None:
    return editor.do(value.command(editor.document, editor.camera_history.resting_box))


def _add_sun(editor: Editor, value: None) -> str | None:
    return editor.do(AddSun())


def _drop(editor: Editor, names: str | tuple[str, ...] | None) -> str | None:
    """Let objects stand on what is below them; without names those that are selected."""
    chosen = editor.view.selected_objects if names is None else (names,) if isinstance(names, str) else names
    return editor.do(dropping(editor.document, chosen, editor.camera_history.resting_box))


def _paint(kind: PaintedKind, editor: Editor, value: None) -> str | None:
    return editor.do(AddPainted(kind))


def _put_back(editor: Editor, value: None) -> str | None:
    names = editor.view.selected_objects
    return editor.do(PlaceObjects(tuple((name, Transform()) for name in names), f"put back {named_together(names)}"))


def _duplicate(editor: Editor, value: None) -> str | None:
    """Duplicate all selected objects, or the selected sun, which is selected then."""
    if (sun := editor.view.sun) is not None:
        name = numbered_name(sun, taken_names(editor.document))
        return editor.do(DuplicateSun(sun, name)) or editor.select(sun_key(name))
    return _duplicate_objects(editor)


def _duplicate_linked(editor: Editor, value: None) -> str | None:
    return _duplicate_objects(editor, linked=True)


def _duplicate_objects(editor: Editor, linked: bool = False) -> str | None:
    """Duplicate all selected objects; the duplicates are selected then, with the same curve of the active one."""
    names, selected, before = editor.view.selected_objects, editor.view.selected, editor.document
    if selected is None or (refusal := editor.do(DuplicateObjects(names, linked))) is not None:
        return refusal
    new = duplicates_of(before, editor.document)
    return editor.select((*(new[name] for name in names[:-1]), selected._replace(object=new[names[-1]])))


def _make_single_user(editor: Editor, value: None) -> str | None:
    return editor.do(single_users(editor.document, editor.view.selected_objects))


def _delete(editor: Editor, value: None) -> str | None:
    if editor.view.sun is not None:
        return editor.do(DeleteSun(editor.view.sun))
    names = editor.view.selected_objects
    return editor.do(Several(tuple(map(DeleteObject, names)), f"delete {named_together(names)}"))


def _group_selected(editor: Editor, value: None) -> str | None:
    return editor.do(SetGroup(editor.view.selected_objects, free_group_name(editor.document)))


def _ungroup_selected(editor: Editor, value: None) -> str | None:
    """Dissolve the groups that selected objects are in."""
    return editor.do(ungrouping(editor.document, editor.view.selected_objects))


def _is_linked(context: OperatorContext) -> bool:
    return any(linked_objects(context.document, name) for name in context.view.selected_objects)


def _is_grouped(context: OperatorContext) -> bool:
    return any(context.document.object(name).in_group for name in context.view.selected_objects)


def _has_light(context: OperatorContext) -> bool:
    selected = context.view.selected
    return selected is not None and context.document.object(selected.object).emits


def _hide(editor: Editor, value: None) -> str | None:
    names = editor.view.selected_objects
    return editor.do(switching(names, "visible", not editor.document.object(names[-1]).visible))


def _show_all(editor: Editor, value: None) -> str | None:
    return editor.do(ShowObjects())


def _has_hidden(context: OperatorContext) -> bool:
    return len(context.document.shown) < len(context.document.objects)


LIGHT = Need("select a light", _has_light)
LINKED = Need("select an object that shares its material", _is_linked)
GROUPED = Need("select objects of a group", _is_grouped)
OBJECT_OR_SUN = Need(
    "select an object or a sun", lambda context: context.view.selected is not None or context.view.sun is not None
)
HIDDEN = Need("hide an object first", _has_hidden)
MOVED = Need("select an object that was moved", _has_moved)


def adding(name: str) -> str:
    """The operator that adds a shape or a light of this name."""
    return f"add_{name.replace(' ', '_')}"


def painting(kind: str) -> str:
    """The operator that paints a light of this kind."""
    return f"paint_{kind}"


_ADDED_HELP = {
    "backdrop": "A seamless sweep behind all that stands there, which stands on it; it faces the camera.",
    "shader ball": "A ball on a base, two objects, to see a material on.",
}

ARRANGE: tuple[Operator | Gesture, ...] = (
    Operator(
        "add", _add, ("Shift A",), "The menu of what can be added", needs=SCENE, waits=True,
        script=ScriptKey(Addition, "Adds a shape, a light or the objects of a file: see below."),
    ),
    *(
        Operator(
            adding(name), partial(_add_named, name), entry=name.capitalize(), needs=SCENE, waits=True,
            help=_ADDED_HELP.get(name, "Hangs above the point looked at and shines down." if name in LIGHTS
            else "Stands on the ground at the point looked at, in a size that fits the scene."),
        )
        for name in ADDABLE
    ),
    Operator(
        adding(SUN), _add_sun, entry=SUN.capitalize(), needs=SCENE, waits=True,
        help="Shines from the camera's upper left, 45° high, on all objects alike.",
    ),
    Operator(
        "add_file", entry="Objects of a file…", needs=SCENE,
        help="Adds all objects of a mesh file, in their own size; as a drop on the window does with Shift held.",
    ),
    *(
        Operator(
            painting(kind), partial(_paint, kind), entry=f"Painted {TITLES[kind].lower()}", needs=SCENE, waits=True,
            help="Painted onto the environment; the Light panel has its values.",
        )
        for kind in PAINTED_KINDS if kind != "image"
    ),
    Operator(
        "paint_image", entry="Painted image…", needs=SCENE, help="An image over the environment, or instead of it."
    ),
    Operator(
        "paint_light", lambda editor, value: editor.do(value.command),
        script=ScriptKey(PaintedAddition, "Paints a light onto the environment: see below."),
    ),
    Operator(
        "move", _move, script=ScriptKey(Move, "Moves, rotates and scales objects from where they are: see below."),
    ),
    Operator("drop", _drop, script=ScriptKey(
        Text | Annotated[tuple[Text, ...], Field(min_length=1)], "Lets objects stand on what is below them."
    )),
    Operator("place_light", script=ScriptKey(
        PlacedByHand, "Places a light by its highlight or by a shadow: see below."
    )),
    Operator(
        "grab", keys=("G",), help="Move, rotate, scale: follows the mouse", listed_keys="G   R   S", entry="Move",
        needs=OBJECT_OR_SUN, waits=True,
    ),
    Operator("turn", keys=("R",), entry="Rotate", needs=OBJECT_OR_SUN, waits=True),
    Operator("resize", keys=("S",), entry="Scale", needs=OBJECT, waits=True),
    Gesture("then X Y Z", "Along an axis; again: the object's; Shift: across"),
    Gesture("a number", "By so much; Enter or a click ends it, Esc not"),
    Operator(
        "gizmo_move", keys=("Shift G", "V"), help="Handles that move, rotate, scale", listed_keys="Shift G   R   S",
        entry="Handles to move", needs=OBJECT_OR_SUN,
    ),
    Operator("gizmo", script=ScriptKey(
        Literal["move", "rotate", "scale", "aim", "none"],
        "Shows handles of the selected objects, which `drag` takes by name."
    )),
    Operator("gizmo_rotate", keys=("Shift R",), entry="Handles to rotate", needs=OBJECT_OR_SUN),
    Operator("gizmo_scale", keys=("Shift S", "Z"), entry="Handles to scale", needs=OBJECT),
    Operator("gizmo_aim", entry="Handle to aim", help="A handle at what a light shines at.", needs=LIGHT),
    Operator(
        "aim", keys=("Shift T",), help="Aim the light at what is under the mouse", entry="Aim", needs=LIGHT, waits=True,
        script=ScriptKey(Aim, "Turns a light to shine at a point: see below."),
    ),
    Operator(
        "drop_selected", _drop, ("End",), "Stand on what is below", entry="Stand on the ground", needs=OBJECT,
        waits=True,
    ),
    *SNAPPING,
    Operator("keymap", entry="Keys"),
    *PIVOTING,
    Operator(
        "put_back", _put_back, help="Where the scene's file has the object.", entry="Put back", needs=MOVED, waits=True
    ),
    Operator(
        "duplicate", _duplicate, ("Shift D",), "Duplicate the selected objects or sun, in their place",
        entry="Duplicate", needs=OBJECT_OR_SUN, waits=True,
    ),
    Operator(
        "linked_duplicate", _duplicate_linked, ("Alt D",), "The same, with one material for both",
        entry="Linked duplicate", needs=OBJECT, waits=True,
    ),
    Operator(
        "make_single_user", _make_single_user, help="Edits of its material are its own from now on.",
        entry="Make single user", needs=LINKED, waits=True,
    ),
    Operator(
        "delete_object", _delete, ("Ctrl Delete",), "Delete the selected objects or sun", entry="Delete the objects",
        needs=OBJECT_OR_SUN, waits=True,
    ),
    Operator(
        "group", lambda editor, value: editor.do(SetGroup(value.objects, value.name)),
        script=ScriptKey(Grouping, "Puts objects in a group: see below."),
    ),
    Operator(
        "ungroup", lambda editor, name: editor.do(RenameGroup(name, "")),
        script=ScriptKey(Text, "Dissolves the group of this name."),
    ),
    Operator(
        "group_selected", _group_selected, ("Ctrl G",), "Group the selected objects; with Alt ungroup",
        entry="Group", needs=OBJECT, waits=True,
    ),
    Operator(
        "ungroup_selected", _ungroup_selected, ("Ctrl Alt G",), entry="Ungroup", needs=GROUPED, waits=True,
    ),
    Operator(
        "hide", _hide, ("Ctrl H",), "Hide the selected objects, or show them: hidden, they light and shade nothing",
        entry="Hide or show", needs=OBJECT, waits=True,
    ),
    Operator(
        "show_all", _show_all, ("Ctrl Shift H",), "Show all hidden objects", entry="Show all", needs=HIDDEN, waits=True
    ),
    Gesture("Ctrl drag", "Snap: 0.1 m, 15°, tenths"),
    Gesture("H click", "Place the light, or the painted light, by its highlight"),
    Gesture("J drag", "Place it by a shadow: from, to"),
)  # fmt: skip
