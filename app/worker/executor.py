"""Executors of the long work on a view of a scene: this process, or others (`app.cluster.cluster_jobs`)."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np

from engine.precompute.direct.bandstore import BandTile
from engine.precompute.direct.linking import LightGroup
from engine.precompute.direct.pipeline import Placement, Quality
from engine.precompute.direct.projection import LayerShape, VisibleLight, project_layer

if TYPE_CHECKING:
    from app.document.scene_state import LayerState
    from app.messages.worker_messages import Response
    from engine.core.stored_arrays import Arrays

LightSteps = Generator[float, None, VisibleLight]
IndirectSteps = Generator["Response | None", None, "Arrays"]


class Executor(Protocol):
    """Does the long work; the result is the same to the last bit for each executor."""

    def compute_light(self, group: LightGroup, quality: Quality) -> LightSteps:
        """Compute the light of a stage that reaches a group of objects; yields the fraction done. A final stage leaves
        the sphere's visibility in `placement_worker`."""

    def project_tiles(
        self, placement: Placement, rows: np.ndarray, light: VisibleLight, layer: LayerShape,
        skip: frozenset[int] = frozenset(),
    ) -> Iterator[BandTile | None]:  # fmt: skip
        """The tiles of a layer's points as they are made, in any order, except those to skip; None while there is
        none."""

    def find_indirect(
        self, layers: Sequence[LayerState], lit_by: str, n_bounces: int, n_rays: int
    ) -> IndirectSteps | None:
        """The fine indirect light, cached on disk; None: it is to be computed here."""


class LocalExecutor:
    """Does all the work in this process."""

    def compute_light(self, group: LightGroup, quality: Quality) -> LightSteps:
        return group.placement.light(group.sky, quality)

    def project_tiles(
        self, placement: Placement, rows: np.ndarray, light: VisibleLight, layer: LayerShape,
        skip: frozenset[int] = frozenset(),
    ) -> Iterator[BandTile | None]:  # fmt: skip
        return project_layer(placement.hits, rows, light, layer, skip)

    def find_indirect(
        self, layers: Sequence[LayerState], lit_by: str, n_bounces: int, n_rays: int
    ) -> IndirectSteps | None:
        return None
