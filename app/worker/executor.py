"""Who does the long work on a view of a scene: this process, or others that are asked to
(`app.cluster.cluster_executor`)."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np

from engine.precompute.direct.bandstore import BandTile
from engine.precompute.direct.pipeline import Placement, Quality, SkyState
from engine.precompute.direct.projection import LayerShape, VisibleLight, project_layer

if TYPE_CHECKING:
    from app.document.scene_state import LayerState
    from app.messages.worker_messages import Response
    from engine.core.stored_arrays import Arrays

LightSteps = Generator[float, None, VisibleLight]
IndirectSteps = Generator["Response | None", None, "Arrays"]


class Executor(Protocol):
    """What is computed comes out the same, to the last bit, whoever computes it."""

    def compute_light(self, placement: Placement, sky: SkyState, quality: Quality) -> LightSteps:
        """See all the light of a stage; yields how much of that is done. A final one leaves the sphere's visibility
        in `placement_worker`."""

    def project_tiles(
        self, placement: Placement, rows: np.ndarray, light: VisibleLight, layer: LayerShape,
        skip: frozenset[int] = frozenset(),
    ) -> Iterator[BandTile | None]:  # fmt: skip
        """The tiles of a layer's points as they are made, in any order, but those to skip; None while there is none."""

    def find_indirect(
        self, layers: Sequence[LayerState], lit_by: str, n_bounces: int, n_rays: int
    ) -> IndirectSteps | None:
        """The fine indirect light, as it is kept on disk; None: it is to be found here."""


class LocalExecutor:
    """This process does it all."""

    def compute_light(self, placement: Placement, sky: SkyState, quality: Quality) -> LightSteps:
        return placement.light(sky, quality)

    def project_tiles(
        self, placement: Placement, rows: np.ndarray, light: VisibleLight, layer: LayerShape,
        skip: frozenset[int] = frozenset(),
    ) -> Iterator[BandTile | None]:  # fmt: skip
        return project_layer(placement.hits, rows, light, layer, skip)

    def find_indirect(
        self, layers: Sequence[LayerState], lit_by: str, n_bounces: int, n_rays: int
    ) -> IndirectSteps | None:
        return None
