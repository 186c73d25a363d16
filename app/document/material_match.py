"""Says what is to be matched with which model: the layers of a material, the one layer that takes their place, and how
far it is from them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, fields

from app.document.commands.layers import SetMaterial
from app.document.document import Document
from app.document.linked_layers import Layers
from engine.core.errors import InsituError, list_names
from engine.material import MODELS
from engine.material.layer import Layer, make_layer
from engine.material.model import Model


def matching_models() -> list[Model]:
    """The models that a BRDF can be matched with: not those of a file, nor those with one curve for two angles."""
    return [model for model in MODELS.values() if not model.needs_file and not model.shared]


def searched_parameters(model: Model) -> tuple[str, ...]:
    """The scalar parameters in a model's quotient, such as roughness: no curve changes what they do there."""
    return tuple(each.name for each in model.parameters if each.kind == "scalar" and "quotient" in each.drives)


@dataclass(frozen=True)
class MaterialMatch:
    """An object whose material becomes one layer of a model, as near as that comes to the BRDF of layers.

    source: whose BRDF that is, an object or a layer by its path, a material of the library or of a file, or a measured
    BRDF's file. curves: those that change, None for all of the model; searched: its scalar parameters that are searched
    for, None for `searched_parameters`. title, layers: what the source is called and its layers, also unread ones, once
    `app.project.material_matching` has found them.
    """

    object: str
    source: str
    model: str
    curves: tuple[str, ...] | None = None
    searched: tuple[str, ...] | None = None
    title: str = ""
    layers: Layers = ()

    def dump(self) -> str:
        """As text for another process, without the layers."""
        return json.dumps({each.name: getattr(self, each.name) for each in fields(self) if each.name != "layers"})

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the curves that change."""
        return tuple(each.name for each in self._model.factors) if self.curves is None else self.curves

    @property
    def parameters(self) -> tuple[str, ...]:
        """The names of the parameters that are searched for."""
        return searched_parameters(self._model) if self.searched is None else self.searched

    @property
    def has_images(self) -> bool:
        """Whether layers have images, which no BRDF has."""
        return any(not each.maps.is_plain or each.parameter_maps for each in self.layers)

    def start(self, document: Document) -> Layer:
        """The layer to begin from: one of this model that the object has, else one of the model's defaults. Raises
        InsituError where the match would not be carried out."""
        model = self._model
        if model not in matching_models():
            why = "its samples are in a file" if model.needs_file else "it has one curve for two angles"
            raise InsituError(f"{model.label} cannot be matched: {why}")
        if not any(layer.visible for layer in self.layers):
            raise InsituError(f"{self.title} has no visible layer to match")
        _check("curve", self.names, [each.name for each in model.factors], model)
        scalars = [each.name for each in model.parameters if each.kind == "scalar"]
        _check("scalar parameter", self.parameters, scalars, model)
        state = SetMaterial(self.object, self.layers).check(document)
        own = next((each for each in state.layers if each.model is model and not each.rises), None)
        return make_layer(model, {} if own is None else own.values)

    def command(self, layer: Layer) -> SetMaterial:
        """The edit that puts what was found on the object."""
        return SetMaterial(self.object, (layer,), f"{self._model.label}, as {self.title}")

    @property
    def _model(self) -> Model:
        if self.model not in MODELS:
            models = list_names(sorted(each.name for each in matching_models()))
            raise InsituError(f"there is no model {self.model!r}; available: {models}")
        return MODELS[self.model]


def load_match(text: str) -> MaterialMatch:
    """A match that was dumped."""
    values = json.loads(text)
    names = {name: None if values[name] is None else tuple(values[name]) for name in ("curves", "searched")}
    return MaterialMatch(**{**values, **names})


@dataclass(frozen=True)
class MaterialMatchErrors:
    """The error of the BRDF, before it was matched and after (`engine.inverse.brdf_fit.MatchedLayer`); and of the
    picture of the object (`engine.inverse.placed_error`), None where no pixel sees it."""

    before: float
    brdf: float
    picture: float | None

    @property
    def text(self) -> str:
        """Both in words."""
        seen = "not in the picture" if self.picture is None else f"{100.0 * self.picture:.1f} % in the picture"
        return f"{100.0 * self.brdf:.1f} % of the BRDF, {seen}"


@dataclass(frozen=True, eq=False)
class MaterialAnswer:
    """The layer that was found, and its errors."""

    layer: Layer
    errors: MaterialMatchErrors


def material_of(document: Document, path: str) -> tuple[Layers, str] | None:
    """The layers of an object, or of one of its layers, by its path, and what to call them; None where no object has
    such a name."""
    name, _, layer = path.partition(".")
    state = next((each for each in document.objects if each.name == name), None)
    if state is None or state.is_lamp:
        return None
    if not layer:
        return state.layers, name
    found = document.layer(f"{name}.{layer}") if layer.isdigit() and int(layer) < len(state.layers) else next(
        (each for each in state.layers if each.name == layer), None
    )  # fmt: skip
    if found is None:
        raise InsituError(f"{name} has no layer {layer!r}; available: {list_names([x.name for x in state.layers])}")
    return (found,), f"{name} {found.title}"


def _check(kind: str, given: Sequence[str], known: Sequence[str], model: Model) -> None:
    for name in given:
        if name not in known:
            raise InsituError(f"{model.label} has no {kind} {name!r}; available: {list_names(known) or 'none'}")
