"""Curves that the worker finds from pixels: those that made the picture, with light between surfaces as well."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.messages.worker_messages import RequestFailed, Response
from app.modes.placement.inverse_messages import CurvesFitted, FitCurves
from app.modes.placement.placement_messages import (
    ContractTransport,
    FreezeIndirect,
    IndirectFound,
    IndirectFrozen,
    LayerPicture,
)
from app.worker import indirect_tasks as indirect_module
from app.worker.cache import ArrayCache
from app.worker.tasks import RequestDispatcher
from engine.curve.operators import Operator
from engine.inverse.highlight_brush import evenly
from engine.precompute.indirect.frozen_light import LightEdit
from engine.precompute.indirect.sampling_settings import ROUGH
from engine.render.picture_difference import errors
from tests.app.worker.ball_and_lamp import GLOSS, compute, failure, opened, pictures, work
from tests.opened import run_in_process

METAL = work(GLOSS, "rough_conductor", alpha=0.3)
WIDER = replace(METAL, layer=METAL.layer.with_operators(
    "theta_h", [Operator("amplify", "y", 0.2, 0.4, 0.8, 1.2, magnitude=4.0)]
))  # fmt: skip


def view_of(tasks: RequestDispatcher, key: str = GLOSS) -> np.ndarray:
    """f_q f_o of the metal at the ball's points."""
    placement = tasks.context.open_placement
    rows = placement.rows_of(placement.scene.object_index(key.rpartition(".")[0]))
    return METAL.layer.scale() * METAL.layer.view_factors(placement.hits.view_angles(rows))


def picture(tasks: RequestDispatcher, layer: object) -> np.ndarray:
    """The metal's direct radiance under a layer's curves, with f_q and f_o."""
    [answer] = [a for a in run_in_process(tasks, ContractTransport(layer, None)) if isinstance(a, LayerPicture)]  # type: ignore[arg-type]
    return np.array(answer.radiance) * view_of(tasks)


def asked(points: np.ndarray, seen: np.ndarray, wanted: np.ndarray, **changes: object) -> FitCurves:
    request = FitCurves((METAL,), ("theta_h",), points, seen, wanted, points, 1e-6, 0.0)
    return replace(request, **changes)  # type: ignore[arg-type]


def fitted(answers: list[Response]) -> CurvesFitted:
    [found] = [answer for answer in answers if isinstance(answer, CurvesFitted)]
    return found


@pytest.fixture
def tasks(source: str, store: ArrayCache) -> RequestDispatcher:
    tasks = opened(source, store)
    assert pictures(run_in_process(tasks, compute()))
    return tasks


def test_the_curve_that_made_a_picture_is_found(tasks: RequestDispatcher) -> None:
    seen, wanted = picture(tasks, METAL), picture(tasks, WIDER)
    found = fitted(run_in_process(tasks, asked(np.arange(len(seen)), seen, wanted)))
    after = METAL.coefficients[0] + found.fits["theta_h"].change
    assert errors(after, WIDER.coefficients[0]).rmse < 0.05 < errors(METAL.coefficients[0], WIDER.coefficients[0]).rmse
    assert len(found.left) == len(seen) and np.abs(found.left).max() < 0.02 * wanted.max()


def test_few_pixels_decide_where_few_are_asked_for(tasks: RequestDispatcher) -> None:
    seen, wanted = picture(tasks, METAL), picture(tasks, WIDER)
    some = evenly(np.arange(len(seen)), 40)
    found = fitted(run_in_process(tasks, asked(some, seen[some], wanted[some], touched=np.arange(len(seen)))))
    assert len(found.left) == len(some) <= 40
    after = METAL.coefficients[0] + found.fits["theta_h"].change
    assert errors(after, WIDER.coefficients[0]).rmse < errors(METAL.coefficients[0], WIDER.coefficients[0]).rmse


def test_what_is_not_touched_is_held(tasks: RequestDispatcher) -> None:
    seen = picture(tasks, METAL)
    bright = np.flatnonzero(seen[:, 0] > 0.5 * seen.max())
    wanted = 2.0 * seen[bright]

    def elsewhere(holding: float) -> float:
        found = fitted(run_in_process(tasks, asked(bright, seen[bright], wanted, holding=holding)))
        rows = np.setdiff1d(np.arange(len(seen)), bright)
        return float(np.abs(_changed(tasks, found)[rows]).sum())

    assert elsewhere(10.0) < 0.8 * elsewhere(0.0)


def _changed(tasks: RequestDispatcher, found: CurvesFitted) -> np.ndarray:
    """The change of the direct picture by a fit."""
    data = tasks._workers[0]._current[GLOSS]
    change = found.fits["theta_h"].change
    return np.array(data.store.radiance(change, METAL.coefficients[1])) * data.unit * view_of(tasks)


def test_coarse_light_is_refused_in_one_line(source: str, store: ArrayCache) -> None:
    tasks = opened(source, store)
    line = failure(run_in_process(tasks, asked(np.arange(3), np.ones((3, 3)), np.ones((3, 3)))))
    assert line.startswith("ball: its light is still coarse")


def test_rows_of_indirect_light_are_those_of_the_picture(
    source: str, store: ArrayCache, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(indirect_module, "FINE", ROUGH)
    tasks = opened(source, store)
    request = compute(n_bounces=3)
    answers = run_in_process(tasks, request)
    answers += run_in_process(tasks, FreezeIndirect(request.scene, GLOSS, 0))
    frozen = [a for a in answers if isinstance(a, IndirectFrozen)][-1]
    found = [a for a in answers if isinstance(a, IndirectFound)][-1]
    indirect = tasks._workers[0]._indirect
    placement = tasks.context.open_placement
    rows = placement.rows_of(placement.scene.object_index("ball"))
    by_band = indirect.curve_rows(METAL, "theta_h", rows)
    assert by_band is not None and indirect.curve_rows(METAL, "theta_d", rows) is None
    # The picture that the window would draw of the same freezing, without what its own gloss sends on.
    i_layer = frozen.keys.index(GLOSS)
    albedo = indirect._frozen_rows._albedo("ball")
    edit = LightEdit(albedo, {i_layer: METAL.coefficients[0]}, {})
    drawn = replace(frozen.light, gloss=()).radiance(i_layer, edit) * frozen.unit
    expected = np.einsum("pk,pkc->pc", found.weights[rows], drawn[found.rows[rows]])
    assert np.einsum("jpc,jc->pc", by_band, METAL.coefficients[0]) == pytest.approx(expected, rel=1e-4)
    assert expected.max() > 0.0
    failures = [a for a in answers if isinstance(a, RequestFailed)]
    assert not failures
