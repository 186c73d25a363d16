"""The document of a scene, and each of its objects, as the scene's file describes them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from app.document.document import Document, ObjectState, Variant
from app.document.light_state import NO_SUNS, LightState
from app.document.linked_layers import layers_from_descriptions
from engine.light.suns import Sun
from engine.scene.description import EnvironmentDescription, ObjectDescription, SceneDescription, free_name
from engine.scene.lamp_shape import lamp_shape_of
from engine.scene.rig import Animations

# The name of the variant that a scene opens in, where its file names none for that.
AS_IN_THE_FILE = "As in the file"


def document_from_description(
    source: str, description: SceneDescription, animations: Sequence[Animations] = ()
) -> Document:
    """The document of a scene as its file describes it; animations: each object's, where there are any. Raises
    LoadError that names a bad layer's key."""
    objects = tuple(_object_state(source, described) for described in description.objects)
    if animations:
        objects = tuple(replace(state, animations=own) for state, own in zip(objects, animations, strict=True))
    environment = description.environment
    light = (
        LightState()
        if environment is None
        else LightState(rotation=environment.rotation, own_suns=_suns_of(environment))
    )
    document = Document(source, objects, light)
    # What the file shows unasked may be none of its variants: it is one more, so that it can be chosen again.
    if not document.variants or document.variant:
        return document
    return replace(document, objects=tuple(map(_with_own_variant, objects)))


def added_state(source: ObjectDescription, described: ObjectDescription, animations: Animations = ()) -> ObjectState:
    """An object that was added, as its file describes it. Raises LoadError."""
    state = _object_state(described.mesh or described.name, described)
    return _with_own_variant(replace(state, animations=animations, added=source, former_name=""))


def _with_own_variant(state: ObjectState) -> ObjectState:
    """An object as its file describes it, with that among its variants, where it has any."""
    if not state.variants or AS_IN_THE_FILE in [each.name for each in state.variants]:
        return state
    own = Variant(AS_IN_THE_FILE, state.layers, state.own_bumps, state.own_opacity, state.emission)
    return replace(state, variants=(own, *state.variants))


def _suns_of(environment: EnvironmentDescription) -> tuple[Sun, ...]:
    """The suns of a scene's environment, with names of their own."""
    suns, taken = list[Sun](), set(NO_SUNS)
    for number, each in enumerate(environment.suns, 1):
        red, green, blue = (environment.scale * value for value in each.irradiance)
        length, (x, y, z) = math.hypot(*each.direction), each.direction
        name = free_name(each.name or f"sun {number}", taken)
        suns.append(Sun((x / length, y / length, z / length), (red, green, blue), each.diameter, name))
    return tuple(suns)


def _object_state(source: str, described: ObjectDescription) -> ObjectState:
    layers = layers_from_descriptions(source, described.name, described.layers)
    emission = (described.emission or (0.0, 0.0, 0.0)) if described.emits else None
    variants = tuple(
        Variant(
            each.name, layers_from_descriptions(source, described.name, each.layers), each.bumps, each.opacity,
            each.emission,
        )
        for each in described.variants
    )  # fmt: skip
    return ObjectState(
        described.name, layers, emission, described.editable, emission_texture=described.emission_texture,
        own_bumps=described.bumps,
        lamp=lamp_shape_of(described), own_opacity=described.opacity, own_surface=described.deform, variants=variants,
        former_name=described.former_name, unlit=described.unlit,
    )  # fmt: skip
