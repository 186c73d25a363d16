"""What a document is without the objects that throw shadows: its shadow catchers and what emits, alone."""

from __future__ import annotations

from dataclasses import dataclass, replace

from app.document.background import Background
from app.document.document import Document
from app.document.scene_state import SceneState, scene_state
from app.document.selection import solo_layer
from app.document.view_state import ViewState
from engine.realtime.zonal_harmonics.pose import Poses
from engine.scene.transform import Transform


@dataclass(frozen=True)
class CatchersAlone:
    """A document of catchers and what emits alone, and its layers and light. lamps: the names of those that are in it
    as in the scene's file, because each picture has poses of its own for them."""

    document: Document
    scene: SceneState
    lamps: tuple[str, ...] = ()

    def with_posed_lamps(self) -> CatchersAlone:
        """The same for pictures that have poses for all lamps: it stays as these are moved."""
        lamps = tuple(state.name for state in self.document.objects if state.is_light)
        objects = tuple(
            replace(
                state, transform=Transform(), new_cone=None, deformations=(), moment=None, target_distance=None
            ) if state.is_light else state
            for state in self.document.objects
        )  # fmt: skip
        return CatchersAlone(replace(self.document, objects=objects), self.scene, lamps)

    def lamps_of(self, poses: Poses) -> Poses:
        """What poses say of these lamps."""
        return tuple(each for each in poses if each[0] in self.lamps)

    def is_in(self, poses: Poses) -> bool:
        """Whether all other objects are in these poses."""
        names = {state.name for state in self.document.objects}.difference(self.lamps)
        return tuple(each for each in poses if each[0] in names) == self.document.poses


def why_as_objects(document: Document, view: ViewState) -> str:
    """Why the window shows catchers as objects, in a few words; empty where it need not."""
    if view.compare is not None:
        return "while pictures are compared"
    if solo_layer(document, view) is not None:
        return "beside a layer that is shown alone"
    if view.mode == "deform" and (view.split is not None or view.fit_error):
        return "beside paths and errors"
    return "in light that is not the scene's" if view.lighting != "scene" and view.mode == "placement" else ""


def moving_catchers(document: Document, view: ViewState) -> CatchersAlone | None:
    """What pictures need that follow the camera; None without catchers, and where they are shown as objects: also while
    one or a light is animated."""
    alone = None if why_as_objects(document, view) else catchers_alone(document)
    if alone is None or view.playing is not None and any(state.animations for state in alone.objects):
        return None
    return CatchersAlone(alone, scene_state(alone))


def catchers_alone(document: Document) -> Document | None:
    """The document of its catchers and what emits alone; None where no catcher is shown.

    Equal ones light their catchers equally: intensity and background, which act on the finished picture, are left out.
    """
    if not document.shadow_catchers:
        return None
    stay = tuple(state for state in document.objects if state.shadow_catcher or state.emits)
    gone = {state.name for state in document.objects if state.is_of_file and state not in stay}
    return replace(
        document, objects=stay, deleted=tuple(sorted({*document.deleted, *gone})), absent=(), looks=(),
        light=replace(document.light, intensity=1.0), background=Background(),
    )  # fmt: skip
