"""Histogram and waveform of pictures whose counts are known."""

import numpy as np

from engine.render.scopes import measure_scopes, waveform_picture


def picture() -> np.ndarray:
    """Four columns and three rows: black, a red of 100, a grey that grows downwards, white."""
    pixels = np.zeros((3, 4, 3), np.uint8)
    pixels[:, 1, 0] = 100
    pixels[:, 2] = np.array([50, 60, 70])[:, None]
    pixels[:, 3] = 255
    return pixels


def test_counts_are_those_of_the_pixels() -> None:
    scopes = measure_scopes(picture(), 48)
    assert (scopes.counts.sum(axis=1) == 12).all() and (scopes.n_pixels, scopes.n_all) == (12, 48)
    red, green, _, luma = scopes.counts
    assert (red[0], red[100], red[50], red[255]) == (3, 3, 1, 3)
    assert (green[0], green[100], green[60], green[255]) == (6, 0, 1, 3)
    assert luma[21] == 3 and luma[60] == 1  # 0.2126 of 100; a grey is its own luma
    np.testing.assert_allclose(scopes.black, [0.25, 0.5, 0.5])
    np.testing.assert_allclose(scopes.white, 0.25)


def test_waveforms_keep_columns() -> None:
    waveforms = measure_scopes(picture()).waveforms
    assert waveforms.shape == (4, 256, 4) and (waveforms.sum(axis=1) == 3).all()
    assert waveforms[0, 100].tolist() == [0, 3, 0, 0] and waveforms[3, 70].tolist() == [0, 0, 1, 0]
    luma, parade = waveform_picture(waveforms, False), waveform_picture(waveforms, True)
    assert luma.shape == (256, 4, 3) and parade.shape == (256, 12, 3)
    assert luma[0, 3].min() > 200 and luma[255, 0].min() > 200  # white at the top, black at the bottom
    assert luma[1:255, 0].max() == 0
    assert parade[155, 1].tolist()[0] > 200 and parade[155, 5].max() == 0  # red of 100 in the first part alone
