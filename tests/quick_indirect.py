"""Indirect light found with few rays: what tests of windows and talks ask of it is as true there, and quicker."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from engine.precompute.indirect.sampling_settings import FINE, ROUGH

if TYPE_CHECKING:
    import pytest

QUICK = replace(ROUGH, name=FINE.name, adaptive=FINE.adaptive)


def light_quickly(patch: pytest.MonkeyPatch) -> None:
    """The worker's finest light is the quick one, in this process."""
    patch.setattr("app.worker.indirect_tasks.FINE", QUICK)
