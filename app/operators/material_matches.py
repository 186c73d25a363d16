"""The operator that matches a material with a model."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from app.document.material_match import MaterialMatch
from app.editor.editor import Editor
from app.operators.operator import Operator, ScriptKey, ValueRecord
from app.project.material_matching import found_source
from engine.scene.description import Text

Names = Annotated[tuple[Text, ...], Field(max_length=16)]


class MatchMaterial(ValueRecord):
    """A material, and the model that an object gets to look like it."""

    object: Annotated[Text, Field(description="The object that gets what is found.")]
    source: Annotated[
        Text,
        Field(
            description="What is matched: an object or a layer of the scene, a material of the library or of a file, "
            "or a measured BRDF's file."
        ),
    ]
    model: Annotated[Text, Field(description="The model, by its name.")]
    curves: Annotated[Names | None, Field(description="The curves that change; else all of the model.")] = None
    search: Annotated[
        Names | None, Field(description="The scalar parameters that are searched for; else those that no curve has.")
    ] = None


def _match_material(editor: Editor, value: MatchMaterial) -> str | None:
    match = MaterialMatch(value.object, value.source, value.model, value.curves, value.search)
    editor.material_matching.begin(found_source(match, editor.document))
    return None


MATERIAL_MATCHES = (
    Operator(
        "match_material", _match_material, waits=True,
        script=ScriptKey(MatchMaterial, "Matches a material with a model and an operator on each curve: see below."),
    ),
)  # fmt: skip
