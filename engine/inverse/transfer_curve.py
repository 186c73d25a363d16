"""The transfer curves of photographs in whole numbers: how a file's values follow from light."""

from __future__ import annotations

import math

from engine.core.errors import InsituError

Transfer = str
SRGB, LINEAR = "srgb", "linear"
LEAST_GAMMA, MOST_GAMMA = 1.0, 4.0


def check_transfer(transfer: str) -> Transfer:
    """A transfer curve: "srgb", "linear", or a gamma, such as "2.2". Raises InsituError."""
    if transfer in (SRGB, LINEAR):
        return transfer
    try:
        gamma = float(transfer)
    except ValueError:
        gamma = math.nan
    if LEAST_GAMMA <= gamma <= MOST_GAMMA:
        return transfer
    raise InsituError(
        f"transfer = {transfer!r}, expected srgb, linear or a gamma from {LEAST_GAMMA:g} to {MOST_GAMMA:g}"
    )
