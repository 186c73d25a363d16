"""The transfer of glossy layers that are drawn by rows: what it depends on, and how it is chosen and computed.

Where a layer is edited and the functions that there are hold the new reflection as well as its own would, as where only
its brightness changes, only their weights by the view are computed anew. Otherwise rows are simulated and fitted anew,
and until they are there the layer is drawn as one lobe.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable
from dataclasses import dataclass, replace

import numpy as np

from engine.core.generators import map_steps
from engine.light.environment import Environment
from engine.material.layer import Layer
from engine.realtime.zonal_harmonics.bending_points import BendingPoints
from engine.realtime.zonal_harmonics.gloss_pilot import LOBE, GlossChoice, choose_gloss
from engine.realtime.zonal_harmonics.gloss_rows import (
    N_ROW_LOBES,
    GlossBasis,
    basis_of_functions,
    gloss_basis,
    simulate_gloss_rows,
)
from engine.realtime.zonal_harmonics.object_transfer import ORDER, ObjectTransfer, TransferStore
from engine.realtime.zonal_harmonics.shading import Lobes, lobes
from engine.realtime.zonal_harmonics.zonal import Zonal, fit
from engine.scene.scene_loader import Scene

REUSE = 1e-6  # of a reflection's energy, that functions of another layer may lose in addition to its own


@dataclass(frozen=True)
class GlossTransfer:
    """Description of the transfer of one glossy layer: the diffuse transfer of its object; the layer; the number of
    rows, None for as many as a pilot finds under an environment, however that is rotated."""

    of: ObjectTransfer
    layer: Layer
    n_rows: int | None
    environment: Environment | None = None


@dataclass(frozen=True, eq=False)
class LayerGloss:
    """How a layer's gloss is drawn. rows: where it is drawn by rows, their lobes (P K, ...), point after point,
    and their basis."""

    choice: GlossChoice
    rows: tuple[Lobes, GlossBasis] | None = None

    @property
    def n_bytes(self) -> int:
        """Bytes of its arrays."""
        if self.rows is None:
            return 0
        lobes, basis = self.rows
        return sum(each.nbytes for each in (lobes.low, lobes.axes, lobes.coefficients, basis.views))

    def with_layer(self, layer: Layer) -> LayerGloss | None:
        """The same rows with the weights of another layer, if their functions hold its reflection."""
        if self.rows is None:
            return None
        lobes, basis = self.rows
        own = gloss_basis(layer, basis.order, basis.n_rows)
        found = basis_of_functions(basis.functions, layer, basis.order)
        return LayerGloss(self.choice, (lobes, found)) if found.lost_by_rows <= own.lost_by_rows + REUSE else None


class GlossTransfers:
    """The transfer of a scene's glossy layers: what is drawn, and the last of each object before that."""

    def __init__(self, scene: Scene, points: BendingPoints, store: TransferStore | None) -> None:
        self._scene, self._points, self._store = scene, points, store
        self._found: dict[GlossTransfer, LayerGloss] = {}

    def known(self, wanted: Iterable[GlossTransfer]) -> dict[tuple[int, Layer], LayerGloss]:
        """How layers, by object, are drawn, as far as it has been decided."""
        return {(each.of.i_object, each.layer): self._found[each] for each in wanted if each in self._found}

    def first_missing(self, wanted: Iterable[GlossTransfer]) -> GlossTransfer | None:
        """The first that is not known yet."""
        return next((each for each in wanted if each not in self._found), None)

    def put(self, made: GlossTransfer, gloss: LayerGloss, wanted: Iterable[GlossTransfer]) -> None:
        """Hold a new one, with those that are wanted and one more of its object."""
        needed, mine = set(wanted), [each for each in self._found if each.of.i_object == made.of.i_object]
        for other in [each for each in mine if each not in needed][:-1]:
            del self._found[other]
        self._found[made] = gloss

    def compute(self, wanted: GlossTransfer, diffuse: Zonal | None) -> Generator[float, None, LayerGloss]:
        """Choose the number of rows, where it is not given, and compute them. diffuse: of white points, with the light
        that the object reflects onto itself, None for direct light alone. Yields the share that is done."""
        for each, before in self._found.items():
            if replace(each, layer=wanted.layer) == wanted and (held := before.with_layer(wanted.layer)) is not None:
                return held
        mesh, caster = self._points.mesh(wanted.of.i_object, wanted.of.casters), self._points.caster(wanted.of.casters)
        choice = GlossChoice(wanted.n_rows or LOBE)
        if wanted.n_rows is None:
            pilot = choose_gloss(mesh, caster, wanted.layer, wanted.environment, ORDER)
            choice = yield from map_steps(pilot, lambda share: 0.2 * share)
        if choice.n_rows == LOBE:
            return LayerGloss(choice)
        for each, before in self._found.items():  # found under another environment
            if (each.of, each.layer, before.choice.n_rows) == (wanted.of, wanted.layer, choice.n_rows):
                return replace(before, choice=choice)
        found = gloss_basis(wanted.layer, ORDER, choice.n_rows)
        made_of = self._made_of(wanted, found, diffuse)
        n_vectors = len(mesh.frames) * choice.n_rows
        zonal = None if self._store is None else self._store.get(made_of, n_vectors)
        if zonal is None:
            vectors = None if diffuse is None else diffuse.harmonics()
            simulating = simulate_gloss_rows(mesh, caster, found, wanted.of.n_rays, vectors)
            rows = yield from map_steps(simulating, lambda share: 0.2 + 0.2 * share)
            fitting = fit(rows.reshape(n_vectors, -1), N_ROW_LOBES, 0)
            zonal = yield from map_steps(fitting, lambda share: 0.4 + 0.6 * share)
            if self._store is not None:
                self._store.put(made_of, zonal)
        return LayerGloss(choice, (lobes(zonal), found))

    def _made_of(self, wanted: GlossTransfer, found: GlossBasis, diffuse: Zonal | None) -> tuple[object, ...]:
        """Everything that rows depend on."""
        of_object = wanted.of.dependencies(self._scene, self._points)
        return "gloss rows 1", *of_object, found.functions.astype(np.float32), diffuse is not None
