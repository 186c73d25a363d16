"""The map of errors: errors of points spread over their own objects."""

from __future__ import annotations

import numpy as np

from app.project.project import open_project
from engine.core.generators import run_to_end
from engine.precompute.direct.pipeline import Placement
from engine.render.display import error_to_radiance, false_colour
from engine.render.error_estimate import OPACITY, PointErrors, error_colours, error_map
from engine.render.picture_error import ErrorEstimate


def test_errors_stay_on_their_object_and_follow_their_points() -> None:
    hits = Placement(open_project("cornell", (48, 36)).with_settings(n_edge_rays=0).scene).hits
    objects, off, fine = hits.objects, 0.08, 0.005
    first = int(objects[0])
    # One object is off by 8 %, but for chance that makes every other point's square less than 0; others by 0.5 %.
    rows = np.arange(0, len(objects), 2)
    squares = np.where(objects[rows] == first, off**2, fine**2)
    noisy = squares + np.where(np.arange(len(rows)) % 2, 2.0, -2.0) * fine**2
    found = run_to_end(error_map(hits, PointErrors(ErrorEstimate(0.0), hits.pixel[rows], noisy)))
    seen = hits.row_image >= 0
    assert np.isnan(found[~seen]).all() and np.isfinite(found[seen]).all()
    mine = seen & (hits.object_image == first)
    np.testing.assert_allclose(found[mine], off, rtol=0.05)
    assert (found[seen & ~mine] < 3.0 * fine).all() and abs(np.median(found[seen & ~mine]) - fine) < 0.6 * fine


def test_colours_are_those_of_the_errors_and_clear_where_nothing_is_known() -> None:
    hits = Placement(open_project("cornell", (24, 18)).with_settings(n_edge_rays=0).scene).hits
    judged = PointErrors(ErrorEstimate(0.0), hits.pixel, np.full(len(hits.pixel), 0.03**2))
    image = run_to_end(error_colours(hits, judged))
    seen = hits.row_image >= 0
    expected = np.rint(255 * false_colour(np.repeat(error_to_radiance([0.03])[:, None], 3, axis=1)))[0]
    assert image.shape == (18, 24, 4) and not image[~seen].any() and not seen.all()
    assert (image[seen] == [*expected, round(255 * OPACITY)]).all()
    nothing = PointErrors(ErrorEstimate(0.0), np.zeros(0, np.int32), np.zeros(0))
    assert not run_to_end(error_colours(hits, nothing)).any()
