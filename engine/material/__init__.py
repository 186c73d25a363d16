r"""Reflection models as editable factors [BenArtzi07, ch. 3].

    parameters --generate--> curves --operators--> edited curves --bands, wavelet--> coefficients
         \--quotient_parameters--> compiled quotient (`Model.number`, worker only)

`MODELS` has the available models: those in the `MODELS` of every module of this package, so that a further model takes
just one file. `Layer` is one use of a model. Importing this package imports no compiler.
"""

import importlib
import pkgutil

from engine.material.layer import Layer, make_layer
from engine.material.model import Factor, Model, validate_parameters
from engine.material.parameters import Parameter, ParameterError


def _models() -> list[Model]:
    """All models of this package, diffuse ones first, then by label."""
    names = [name for _, name, _ in pkgutil.iter_modules(__path__) if not name.startswith("_")]
    modules = [importlib.import_module(f"{__name__}.{name}") for name in names]
    found: list[Model] = [model for module in modules for model in getattr(module, "MODELS", ())]
    return sorted(found, key=lambda model: (not model.is_diffuse, model.label))


MODELS: dict[str, Model] = {model.name: model for model in _models()}

__all__ = ["MODELS", "Factor", "Layer", "Model", "Parameter", "ParameterError", "make_layer", "validate_parameters"]
