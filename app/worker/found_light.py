"""Indirect light that was found, and what it was found for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from app.document.scene_state import LayerState
from app.modes.placement.placement_messages import FreezeIndirect, IndirectRelit
from app.worker.array_files import Tiles
from engine.core.stored_arrays import Arrays
from engine.material.layer import Layer
from engine.precompute.indirect.indirect_light import IndirectLight
from engine.precompute.indirect.moved_light import CARRIED
from engine.precompute.indirect.relighting import RelitLayer, SceneLight
from engine.precompute.indirect.sampling_settings import ROUGH, SamplingSettings

# The visible layers by key.
Materials = tuple[tuple[str, Layer], ...]
MOST_PARTS = 1024


@dataclass(frozen=True, eq=False)
class FoundLight:
    """Indirect light, and what its rays and its irradiance were computed for; lit_by: the key of `lit`; n_rays: 0 for
    as many as it needs; sampled_for: the materials that decided last where rays go, None for light
    that an edit changed, until rays are added; filtered_for: those of the filter since rays were added, None before."""

    light: IndirectLight
    lit: SceneLight
    settings: SamplingSettings
    n_rays: int
    models: tuple[tuple[str, str], ...]
    lit_by: str
    depth: int  # bounces that the rays were traced for
    sampled_for: Materials | None
    number: int = 0
    filtered_for: Materials | None = None

    def lacks_rays(self, materials: Materials) -> bool:
        """Whether rays may be missing where these materials need them: not where gloss goes by albedo."""
        return self.sampled_for != materials and self.settings not in (ROUGH, CARRIED) and self.light.points.glossy


class Checkpoints:
    """The finished parts of light that is being computed, as the solver stores them."""

    def __init__(self, tiles: Tiles) -> None:
        self._tiles = tiles

    def load(self, index: int) -> Arrays | None:
        return self._tiles.tile(index, dict)

    def store(self, index: int, arrays: Arrays) -> None:
        if index < MOST_PARTS:
            self._tiles.append_tile(index, arrays)


def relit_message(found: FoundLight, layers: Sequence[LayerState], relit: Sequence[RelitLayer]) -> IndirectRelit:
    parts = (
        {each.key: getattr(layer, what) for each, layer in zip(layers, relit, strict=True)}
        for what in ("now", "resting", "gloss", "mirrored")
    )
    return IndirectRelit(found.number, *parts)


def materials_of(layers: Sequence[LayerState]) -> Materials:
    return tuple((each.key, each.layer) for each in layers)


def layer_visibility(found: FoundLight, desired: FreezeIndirect) -> IndirectLight:
    return found.light.without_glossy_hits() if desired.second_bands == 1 else found.light
