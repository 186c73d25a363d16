"""Reflection models as editable factors [BenArtzi07, ch. 3].

    parameters --generate--> curves --operators--> edited curves --band means--> coefficients
         \\--quotient_parameters--> compiled quotient (`_kernels`, worker only)

`MODELS` lists what there is; `Layer` is one use of a model. Importing this package imports no compiler.
"""

from engine.material import lambert, rough_conductor
from engine.material.layer import Layer, make_layer
from engine.material.model import Factor, Model, Parameter, ParameterError, validate_parameters

MODELS: dict[str, Model] = {m.MODEL.name: m.MODEL for m in (lambert, rough_conductor)}

__all__ = ["MODELS", "Factor", "Layer", "Model", "Parameter", "ParameterError", "make_layer", "validate_parameters"]
