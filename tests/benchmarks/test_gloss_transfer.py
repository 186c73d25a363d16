"""Rows of transfer beside one lobe, on the carved head in random poses, and what the program writes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.gloss_transfer import BODIES, HEADER, Body, GlossEffort, main, measure
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.realtime.zonal_harmonics.pose import Deformation

QUICK = GlossEffort(n_points=80, n_rays=400, orders=(6,), rows=(3, 16))


@pytest.mark.parametrize("seed", range(2))
def test_many_rows_are_nearer_to_the_sum_over_the_sky_than_the_lobe_in_any_pose(seed: int) -> None:
    """Broad gloss, for which order 6 suffices; three functions are too few for it."""
    random = np.random.default_rng(seed)
    pose = Deformation("bend", random.uniform(-60.0, 60.0)), Deformation("twist", random.uniform(-60.0, 60.0))
    layer = make_layer(MODELS["rough_conductor"], {"alpha": 0.5})
    found = [each.found for each in measure({"head": Body("idol", "head", layer, (("head", pose),))}, QUICK)]
    lobe, few, many = (each.error for each in found)
    assert [each.n_rows for each in found] == [0, 3, 16]
    assert many < 0.6 * lobe and many < few


def test_it_writes_a_line_for_each_and_a_plot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    few = {name: BODIES[name] for name in ("bat of leather (0.4)",)}
    monkeypatch.setattr("benchmarks.gloss_transfer.measure", lambda: measure(few, QUICK))
    main(tmp_path)
    lines = (tmp_path / "gloss_transfer.csv").read_text().splitlines()
    assert lines[0] == ",".join(HEADER)
    # of a row the constant and linear part, and three lobes of axis and six bands, four bytes each: 124
    assert [line.split(",")[2::3] for line in lines[1:]] == [["lobe", "0"], ["3", "372"], ["16", "1984"]]
    assert (tmp_path / "gloss_rows.png").stat().st_size > 1000
    assert capsys.readouterr().out.count("bat of leather") == 3
