"""What the user asks of matching a picture, and what comes back, as the window has them: light to import, and plain
data between the window and the process that matches.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.lib.format import open_memmap
from numpy.typing import NDArray
from pydantic import Field, ValidationError

from app.document.commands.curves import CurveEdit, SetOperators
from app.document.commands.layers import SetMaterial, SetParameter
from app.document.commands.light import SetRotation
from app.document.commands.mix import SetMix
from app.document.commands.several import Several
from app.document.document import Document, layer_key
from app.document.linked_layers import Layers
from app.files.layer_records import OperatorRecord, StrictModel, operator_values
from app.photo.photo_request import MOST_SIDE
from engine.core.errors import InsituError
from engine.inverse.photo_targets import SCALE, Target, default_targets, scale_parameter, target_of
from engine.material.layer import Layer
from engine.scene.description import Camera

# The file beside an answer that has the photograph as light.
LIGHT_FILE = "light.npy"
# Of files of photographs that are linear light.
LINEAR_ENDINGS = (".exr", ".hdr")
Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Row = tuple[Positive, Positive, Positive]


class PhotoPair(NamedTuple):
    """A place in the photograph, in fractions of its width and height from its upper left corner, and the point of the
    scene there, metres."""

    place: tuple[float, float]
    point: tuple[float, float, float]


@dataclass(frozen=True)
class MatchSettings:
    """object: whose material is matched; file: of the photograph; transfer, exposure (None to find it): see
    `app.photo.photo_match`; targets: "LAYER.NAME" of what is found; pairs: what aligns the camera, none
    where the scene's is right; scene: the document's source that they belong to; finds_rotation, finds_lights: whether
    the rotation of the environment is found, and the strengths of the lights; mask: a picture of the photograph's size,
    black where that does not count; start, start_layers: the material of the library that the match begins with, "" and
    none for the object's own."""

    object: str
    file: Path
    transfer: str = "srgb"
    targets: tuple[str, ...] = ()
    exposure: float | None = None
    pairs: tuple[PhotoPair, ...] = ()
    scene: str = ""
    finds_rotation: bool = False
    finds_lights: bool = False
    mask: Path | None = None
    start: str = ""
    start_layers: Layers = ()

    def dump(self) -> str:
        """As text for the process, whose document is that with the material to begin with."""
        mask = None if self.mask is None else str(self.mask)
        own = asdict(replace(self, start="", start_layers=()))
        return json.dumps({**own, "file": str(self.file), "mask": mask})

    @property
    def begin(self) -> tuple[SetMaterial, ...]:
        """The edit that gives the object the material that the match begins with, none for its own."""
        return (SetMaterial(self.object, self.start_layers, self.start),) if self.start_layers else ()

    def begun(self, document: Document) -> Document:
        """The document with that material on the object. Raises InsituError."""
        for command in self.begin:
            document = command.apply(document)
        return document


def load_settings(text: str) -> MatchSettings:
    """Settings that were dumped."""
    values = json.loads(text)
    pairs = tuple(PhotoPair(tuple(place), tuple(point)) for place, point in values["pairs"])
    values |= {"file": Path(values["file"]), "targets": tuple(values["targets"]), "pairs": pairs}
    values |= {"mask": None if values["mask"] is None else Path(values["mask"]), "start_layers": ()}
    return MatchSettings(**values)


def possible_targets(layers: Sequence[Layer]) -> Iterator[Target]:
    """All that a picture can determine of layers: scales, curves and shapes, in the order of the layers."""
    for i, layer in enumerate(layers):
        if not layer.visible or layer.follows or layer.rises:
            continue
        names = [SCALE] if scale_parameter(layer) else []
        names += [factor.name for factor in layer.model.factors]
        names += [p.name for p in layer.model.parameters if p.kind == "scalar" and p.drives]
        found = dict.fromkeys(filter(None, (_target(layers, i, name) for name in names)))
        yield from found


def _target(layers: Sequence[Layer], i: int, name: str) -> Target | None:
    try:
        return target_of(layers, i, name)
    except InsituError:
        return None


def written_targets(targets: Sequence[Target]) -> tuple[str, ...]:
    """Targets as settings have them."""
    return tuple(f"{each.layer}.{each.name}" for each in targets)


def usual_targets(document: Document, name: str) -> tuple[Target, ...]:
    """What is found of an object where nothing else is asked for: of frozen layers nothing."""
    targets = default_targets(document.object(name).layers)
    return tuple(each for each in targets if not document.is_frozen(layer_key(name, each.layer)))


def default_settings(document: Document, name: str, file: Path) -> MatchSettings:
    """The settings that a photograph is opened with, for an object."""
    return MatchSettings(name, file, targets=written_targets(usual_targets(document, name)), scene=document.source)


def with_object(settings: MatchSettings, document: Document, name: str) -> MatchSettings:
    """The settings for another object of the document, with what is found of that by default."""
    return _with_usual_targets(replace(settings, object=name), document)


def with_start(settings: MatchSettings, document: Document, name: str, layers: Layers) -> MatchSettings:
    """The settings that begin with a material of the library, "" and none: with the object's own."""
    return _with_usual_targets(replace(settings, start=name, start_layers=layers), document)


def layers_to_match(settings: MatchSettings, document: Document) -> Layers:
    """The layers that the match begins with."""
    return settings.start_layers or document.object(settings.object).layers


def _with_usual_targets(settings: MatchSettings, document: Document) -> MatchSettings:
    of_start = default_targets(settings.start_layers)
    targets = of_start if settings.start_layers else usual_targets(document, settings.object)
    return replace(settings, targets=written_targets(targets))


# ----------------------------------------------------------------------------------------------------------- the answer


class _ParameterRecord(StrictModel):
    key: str
    name: str
    value: Number | str | tuple[Number, ...]


class _CurveRecord(StrictModel):
    key: str
    factor: str
    operators: tuple[OperatorRecord, ...]


class _StrengthRecord(StrictModel):
    light: str
    strength: Number


class _DeviationRecord(StrictModel):
    layer: Annotated[int, Field(ge=0)]
    name: str
    values: Annotated[tuple[Row, ...], Field(min_length=2, max_length=65536)]


class _AnswerRecord(StrictModel):
    label: str
    parameters: tuple[_ParameterRecord, ...]
    curves: tuple[_CurveRecord, ...]
    rotations: tuple[Number, ...]
    strengths: tuple[_StrengthRecord, ...]
    exposure: Positive
    error: Positive
    before: Positive
    notes: tuple[str, ...]
    deviations: tuple[_DeviationRecord, ...]
    camera: Camera | None
    missed: tuple[Positive, ...]


@dataclass(frozen=True, eq=False)
class MatchAnswer:
    """edit: what was found, as one edit; exposure: the factor from light to the photograph; error, before: relRMSE of
    the pixels that were held back, with what was found and with the material as it was; deviations: of curves, by layer
    and name, (J, 3); light (H, W, 4): the photograph as light of the scene, to compare the picture with;
    camera: where it was aligned, and how far each pair is missed, pixels of the photograph."""

    edit: Several
    exposure: float
    error: float
    before: float
    notes: tuple[str, ...]
    deviations: dict[Target, NDArray[np.float64]]
    light: NDArray[np.float32]
    camera: Camera | None = None
    missed: tuple[float, ...] = ()


def dump_answer(answer: MatchAnswer, folder: Path) -> str:
    """The answer as JSON; its light becomes a file of a folder. Raises OSError."""
    np.save(folder / LIGHT_FILE, np.asarray(answer.light, np.float32), allow_pickle=False)
    commands = answer.edit.commands
    return json.dumps({
        "label": answer.edit.label,
        "parameters": [
            {"key": each.key, "name": each.name, "value": each.value}
            for each in commands if isinstance(each, SetParameter)
        ],
        "curves": [
            {"key": each.key, "factor": each.factor, "operators": [_operator(o) for o in each.operators]}
            for each in commands if isinstance(each, SetOperators)
        ],
        "rotations": [each.degrees for each in commands if isinstance(each, SetRotation)],
        "strengths": [
            {"light": each.light, "strength": each.value} for each in commands if isinstance(each, SetMix)
        ],
        "exposure": answer.exposure, "error": answer.error, "before": answer.before, "notes": list(answer.notes),
        "deviations": [
            {"layer": target.layer, "name": target.name, "values": values.tolist()}
            for target, values in answer.deviations.items()
        ],
        "camera": None if answer.camera is None else answer.camera.model_dump(),
        "missed": list(answer.missed),
    })  # fmt: skip


def _operator(operator: CurveEdit) -> dict[str, Any]:
    return {name: value for name, value in operator_values(operator).items() if value is not None}


def load_answer(text: str, folder: Path) -> MatchAnswer:
    """The answer that was dumped. Raises InsituError where it is none: the process has read a stranger's file."""
    try:
        record = _AnswerRecord.model_validate_json(text)
        light = _load_light(folder / LIGHT_FILE)
    except (ValidationError, ValueError, OSError) as error:
        raise InsituError(f"what the match found cannot be read: {str(error).splitlines()[0]}") from None
    rotations = [SetRotation(degrees) for degrees in record.rotations]
    strengths = [SetMix(each.light, "strength", each.strength) for each in record.strengths]
    parameters = [SetParameter(each.key, each.name, each.value) for each in record.parameters]
    curves = [SetOperators(each.key, each.factor, tuple(o.edit() for o in each.operators)) for each in record.curves]
    return MatchAnswer(
        Several((*rotations, *strengths, *parameters, *curves), record.label), record.exposure, record.error,
        record.before, record.notes,
        {Target(each.layer, each.name): np.array(each.values) for each in record.deviations},
        light, record.camera, record.missed,
    )  # fmt: skip


def _load_light(file: Path) -> NDArray[np.float32]:
    # Mapped, so that a header which claims more than the file has takes no memory; objects are refused.
    mapped = open_memmap(file, mode="r")
    sides = mapped.shape[:2]
    if mapped.dtype != np.float32 or mapped.ndim != 3 or mapped.shape[2] != 4:
        raise ValueError(f"light is {mapped.dtype} {mapped.shape}, expected float32 (height, width, 4)")
    if not 1 <= min(sides) <= max(sides) <= MOST_SIDE:
        raise ValueError(f"light is {sides[1]} x {sides[0]}, expected sides of 1 to {MOST_SIDE}")
    return np.nan_to_num(mapped, posinf=0.0, neginf=0.0)


def result_line(answer: MatchAnswer) -> str:
    """What the user is told of it."""
    gain = f"error {100.0 * answer.before:.3g} % before, {100.0 * answer.error:.3g} % now"
    return "; ".join((f"{answer.edit.label}: {gain}, exposure {answer.exposure:.4g}", *answer.notes))
