"""Orbit and Deform at few points and rays: what tests ask of whole pictures is as true there, and quicker."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from app.stills import stills

if TYPE_CHECKING:
    import pytest


def use_few_points(patch: pytest.MonkeyPatch, n_points: int = 500, n_rays: int = 200) -> None:
    """Pictures of this process: so many points in addition to the meshes' vertices, and rays of each in Deform."""
    patch.setattr(stills, "STILL_SETTINGS", replace(stills.STILL_SETTINGS, n_points=n_points, n_rays=n_rays))
    patch.setattr("engine.realtime.zonal_harmonics.deform_engine.N_POINTS", n_points)
