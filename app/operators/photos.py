"""The step of a script that matches a photograph."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field

from app.operators.operator import Operator, ScriptKey, ValueRecord
from app.photo.photo_request import LEAST_SIDE, LONGER_SIDE, MOST_SIDE, PhotoRequest
from app.system.paths import full_path
from engine.inverse.camera_fit import PointPair
from engine.scene.description import Number, Text

Place = tuple[Number, Number]
Point = tuple[Number, Number, Number]


class MatchStep(ValueRecord):
    """A photograph, and the object whose material is found."""

    object: Annotated[Text, Field(description="Whose material is found.")]
    photo: Annotated[Text, Field(description="Taken in the light of the scene: EXR, HDR, PNG, JPEG or WebP.")]
    find: Annotated[
        tuple[Text, ...],
        Field(max_length=100, description="What is found, as `LAYER.NAME`: curves, scales, parameters."),
    ] = ()
    pairs: Annotated[
        tuple[tuple[Place, Point], ...],
        Field(
            max_length=1000,
            description="Four or more, which align the camera: `[[column, row], [x, y, z]]`, a pixel of the photograph "
            "and the point of the scene there, metres.",
        ),
    ] = ()
    mask: Annotated[
        Text | None, Field(description="A picture of the photograph's size, black where that does not count.")
    ] = None
    transfer: Annotated[Text, Field(description="Of whole numbers: `srgb`, `linear` or a gamma as `2.2`.")] = "srgb"
    exposure: Annotated[
        Number | None, Field(gt=0.0, description="From radiance to the photograph; found where it is not given.")
    ] = None
    rotation: Annotated[bool, Field(description="Whether to find how the environment was turned.")] = False
    lights: Annotated[bool, Field(description="Whether to find how strong each light was.")] = False
    bounces: Annotated[int | None, Field(ge=1, le=16, description="As the scene requires where it is not given.")] = (
        None
    )
    side: Annotated[
        int, Field(ge=LEAST_SIDE, le=MOST_SIDE, description="The longer side of the picture that is compared.")
    ] = LONGER_SIDE

    start: Annotated[
        Text | None, Field(description="The material of the library to begin with; else the object's own.")
    ] = None

    def request(self) -> PhotoRequest:
        """The request that it means. Raises InsituError."""
        return PhotoRequest(
            self.object, Path(full_path(self.photo)), self.transfer, tuple(PointPair(*pair) for pair in self.pairs),
            None if self.mask is None else Path(full_path(self.mask)), self.find, self.exposure, self.rotation,
            self.lights, self.bounces, self.side, self.start or "",
        )  # fmt: skip


PHOTOS = (Operator("match", script=ScriptKey(MatchStep, "Finds the material that a photograph shows: see below.")),)
