"""Reflection models as editable factors [BenArtzi07, ch. 3].

    parameters --generate--> curves --operators--> edited curves --bands, wavelet--> coefficients
         \\--quotient_parameters--> compiled quotient (`_kernels`, worker only)

`MODELS` lists what there is; `Layer` is one use of a model. Importing this package imports no compiler.
"""

from engine.material import (
    ashikhmin_shirley,
    ashikhmin_shirley_ratio,
    blinn_phong,
    cook_torrance,
    lambert,
    phong,
    rough_conductor,
)
from engine.material.layer import Layer, make_layer
from engine.material.model import Factor, Model, validate_parameters
from engine.material.parameters import Parameter, ParameterError

MODELS: dict[str, Model] = {
    model.name: model
    for model in (
        lambert.MODEL,
        phong.MODEL,
        blinn_phong.MODEL,
        cook_torrance.MODEL,
        rough_conductor.MODEL,
        ashikhmin_shirley.MODEL,
        ashikhmin_shirley_ratio.MODEL,
    )
}

__all__ = ["MODELS", "Factor", "Layer", "Model", "Parameter", "ParameterError", "make_layer", "validate_parameters"]
