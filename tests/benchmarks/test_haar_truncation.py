import csv
from pathlib import Path

import numpy as np

from app.project.project import open_project
from app.stills.stills import layers_by_object
from benchmarks.haar_truncation import COUNTS, FILE, PLOT, RULES, WAYS, Truncated, truncation_errors, write_truncation
from engine.precompute.direct.pipeline import Placement
from tests.engine.realtime.conftest import SCENE


def errors_of(folder: Path, counts: tuple[int, ...]) -> list[Truncated]:
    (folder / "ball.toml").write_text(SCENE)
    project = open_project(str(folder / "ball.toml"), (24, 18))
    placement = Placement(project.scene)
    rows = np.random.default_rng(1).choice(len(placement.hits.pixel), 8, replace=False)
    return truncation_errors(
        "ball", placement.hits, rows, placement.caster, layers_by_object(project), project.sky, 2, 2, counts
    )


def test_all_coefficients_are_the_truth_and_the_fewest_are_means(tmp_path: Path) -> None:
    found = {(each.way, each.rule, each.n): each.rmse for each in errors_of(tmp_path, (20, 320))}
    assert len(found) == len(WAYS) * len(RULES) * 2
    # 320 triangles have 320 wavelets: nothing is left out. By 20 all rules keep the means alone, and something is.
    assert max(rmse for (_, _, n), rmse in found.items() if n == 320) < 1e-12
    for way in WAYS:
        assert len({found[way, rule, 20] for rule in RULES}) == 1
        assert found[way, "size", 20] > 1e-3


def test_the_table_and_the_plot_are_written(tmp_path: Path) -> None:
    found = [Truncated("ball", way, rule, n, 1.0 / n) for rule in RULES for n in COUNTS for way in WAYS]
    write_truncation(tmp_path, found)
    with open(tmp_path / FILE, newline="", encoding="utf-8") as file:
        rows = list(csv.reader(file))
    assert len(rows) == 1 + len(found) and rows[1] == ["ball", "all three", "size", "20", "0.05"]
    assert (tmp_path / PLOT).read_bytes()[:4] == b"\x89PNG"
