"""The operator that matches a material with a model."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from app.document.material_match import MaterialMatch
from app.editor.editor import Editor
from app.operators.operator import Operator, ScriptKey, ValueRecord
from app.project.matching import source_layers
from engine.scene.description import Text

Names = Annotated[tuple[Text, ...], Field(max_length=16)]


class Match(ValueRecord):
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


def _match(editor: Editor, value: Match) -> str | None:
    layers, title = source_layers(editor.document, value.source)
    return editor.matching.request(MaterialMatch(value.object, layers, title, value.model, value.curves, value.search))


MATCHES = (
    Operator(
        "match_material", _match, waits=True,
        script=ScriptKey(Match, "Matches a material with a model and an operator on each curve: see below."),
    ),
)  # fmt: skip
