"""The path tracer of others: where it is looked for, what its spread tells, and how errors are cleared of it."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import benchmarks.peer as peer
from app.measure.subject import open_subject
from benchmarks.figures import NotMeasured
from benchmarks.peer import FIGURE, VARIABLE, Stills, inner_pixels, peer_figure, render_stills
from engine.precompute.direct.pipeline import Placement

MASK = np.ones((60, 80), bool)


def stills(noise: float, n: int = 8, seed: int = 1) -> Stills:
    """Stills of an even picture of radiance 2 with normal noise of that standard deviation."""
    rng = np.random.default_rng(seed)
    pictures = 2.0 + noise * rng.standard_normal((n, *MASK.shape, 3))
    return Stills(pictures, np.array([10.0, 12.0, 11.0]), 64, "a test")


def test_without_an_interpreter_the_figure_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    said: list[str] = []
    figure = peer_figure(1, tmp_path, 10.0, said.append)
    assert figure.name == FIGURE and figure.value is None and VARIABLE in figure.how
    assert len(said) == 1 and VARIABLE in said[0]


@pytest.mark.parametrize("python", ["/nowhere/python", "/bin/false"])
def test_an_interpreter_that_does_not_do_is_told(python: str, tmp_path: Path) -> None:
    with pytest.raises(NotMeasured, match=python):
        render_stills(python, tmp_path / "scene.toml", (8, 8), 4, tmp_path / "peer", 10.0)


def test_an_interpreter_without_mitsuba_is_told(tmp_path: Path) -> None:
    (tmp_path / "mitsuba.py").write_text("raise ModuleNotFoundError(\"No module named 'mitsuba'\")")
    program = tmp_path / "python"
    program.write_text(f'#!/bin/sh\nPYTHONPATH={tmp_path} exec {sys.executable} "$@"\n')
    program.chmod(0o755)
    with pytest.raises(NotMeasured, match="No module named 'mitsuba'"):
        render_stills(str(program), tmp_path / "scene.toml", (8, 8), 4, tmp_path / "peer", 30.0)


def test_the_spread_of_stills_is_the_error_of_one() -> None:
    # 0.02 over a mean of 2; clamping at the 99.9 percentile of the mean, near 2, cuts some of the upper half off.
    pictures = stills(0.02)
    bright = np.zeros(MASK.shape)
    bright[:2] = 4.0  # more than a thousandth of the pixels: nothing else is clamped
    pictures.pictures[...] += bright[..., None]
    rest = MASK.copy()
    rest[:2] = False
    mean = 2.0 + 4.0 * 2 / 60
    assert pictures.noise(MASK) == pytest.approx(0.02 / mean, rel=0.05)
    assert pictures.noise(rest) < 0.02 / 2.0


def test_seconds_of_a_still_grow_with_the_square_of_what_is_asked() -> None:
    found = stills(0.02)
    noise = found.noise(MASK)
    # The median of 10, 11 and 12.
    assert found.still_seconds(MASK, noise) == pytest.approx(11.0)
    assert found.still_seconds(MASK, noise / 2) == pytest.approx(44.0)


def test_our_error_does_not_hold_the_stills_noise() -> None:
    found = stills(0.4)
    ours = np.full((*MASK.shape, 3), 1.9)  # 5 % too dark
    plain = np.sqrt(np.mean((ours - found.pictures.mean(axis=0)) ** 2)) / 2.0
    assert plain > 0.08
    assert found.error_of(ours, MASK) == pytest.approx(0.05, abs=0.004)


def test_too_large_an_error_of_ours_is_no_figure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if peer.reference_folder() is None:
        pytest.skip("the references are not beside this checkout")
    picture = np.full((*MASK.shape, 3), 1.8)
    monkeypatch.setenv(VARIABLE, "python")
    monkeypatch.setattr(peer, "_timed", lambda project: (picture, 3.0))
    monkeypatch.setattr(peer, "inner_pixels", lambda hits: MASK)
    monkeypatch.setattr(peer, "render_stills", lambda *arguments: stills(0.1))
    assert "0.1" in peer_figure(1, tmp_path, 1.0, print).how
    picture += 0.16  # 2 % too dark
    figure = peer_figure(2, tmp_path, 1.0, print)
    assert figure.samples == pytest.approx([3.0 / figure.parts["peer_seconds"]] * 2)
    assert figure.parts["error"] == pytest.approx(0.02, abs=0.01)


def test_inner_pixels_keep_off_silhouettes_creases_and_the_background(tiny_scene: str) -> None:
    hits = Placement(open_subject(tiny_scene, (64, 48)).scene).hits
    keep = inner_pixels(hits)
    normals = np.zeros((*hits.object_image.shape, 3))
    normals.reshape(-1, 3)[hits.pixel] = hits.normal
    assert 0.2 < keep.mean() < 0.9 and not keep[:2].any() and not keep[:, -2:].any()
    for y, x in np.argwhere(keep):
        around = np.s_[y - 2 : y + 3, x - 2 : x + 3]
        assert len(np.unique(hits.object_image[around])) == 1 and hits.object_image[y, x] >= 0
        assert (normals[around] @ normals[y, x]).min() > 0.9
