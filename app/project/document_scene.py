"""The scene that a document's pictures are of: its objects, with their emission and opacity, in their poses."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.document.document import Document
from app.document.light_mix import emission_of

if TYPE_CHECKING:
    from engine.scene.composed_scene import SceneComposer
    from engine.scene.scene_loader import Scene


def shape_of(document: Document) -> tuple[object, ...]:
    """What of a document the arrays of its scene depend on."""
    shape = document.composition, document.poses, document.new_bumps, document.new_opacities
    return *shape, emission_of(document)


def scene_at_rest(composer: SceneComposer, document: Document) -> Scene:
    """The scene where no object is deformed. Raises InsituError where some objects cannot be read."""
    scene = composer.compose_all(document.composition)
    opacities = {state.name: state.opacity for state in document.shown}
    return scene.with_emission(dict(emission_of(document))).with_opacities(opacities)


def posed_scene(composer: SceneComposer, document: Document) -> Scene:
    """The same with its objects where the document has them. Raises as above."""
    from engine.realtime.zonal_harmonics.posed_scene import pose_scene

    return pose_scene(scene_at_rest(composer, document), document.poses)
