"""The window behind a script: what it keeps, in a framebuffer on a tiny scene."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from app.worker.client import Client
from benchmarks.programs import renderer, window_edits
from tests.ui.quick_worker import HANDLERS


@pytest.mark.gl
@pytest.mark.slow
def test_a_script_is_followed_and_rests_without_flicker(tiny_scene: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(renderer, "Client", functools.partial(Client, HANDLERS))
    monkeypatch.setattr(window_edits, "SELECT_SECONDS", 0.1)
    ground = {"object": "ground", "layer": 0, "parameter": "albedo"}
    edits = [
        {**ground, "kind": kind, "value": [value, 0.2, 0.1], "horizon_s": 0.2}
        for kind, value in (("drag", 0.5), ("release", 0.9), ("undo", 0.0))
    ]
    found = window_edits.measure({"source": tiny_scene, "resolution": [32, 24], "edits": edits})
    last = [found["pictures"][np.flatnonzero(found["edit"] == index)] for index in range(3)]
    assert last[1][-1].mean() > last[0][-1].mean() and np.array_equal(last[1][-1], last[1][-2])
    assert last[2][-1] == pytest.approx(found["opened"], abs=1e-3)  # one undo takes the whole drag back
    for name in ("seconds", "cpu_seconds"):
        assert all((np.diff(found[name][found["edit"] == index]) >= 0).all() for index in range(3))
    assert (found["seconds"] > 0).all() and found["opening"].shape == (2,) and len(found["selecting"]) == 3
