"""The process that matches a photograph: its answer is that of the engine, and strangers' files do no harm."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from app.document.view_state import SetView, ViewState
from app.photo.match_settings import MatchSettings
from app.photo.photo_matcher import Ended, PhotoMatcher
from app.project.project import Project, open_project
from tests.pictures import write_exr
from tests.scene_text import camera, environment, facing_up, material, placed, scaled

SCENE = (
    camera((0.4, 1.2, 2.6), 42, (64, 48), (0, 0.45, 0), "bounces = 1\n") + environment((0.5, 0.6, 0.7))
    + placed("ground", "quad", facing_up(5), material('model = "lambert", name = "clay", albedo = [0.5, 0.5, 0.5]'))
    + placed("ball", "sphere", scaled(0.9, (0, 0.5, 0)), material('model = "lambert", albedo = [{albedo}]'))
)  # fmt: skip
VIEW = SetView.of(n_bounces=1).apply(ViewState())
FOUND = 0.7, 0.3, 0.1


def scene(folder: Path, name: str, albedo: tuple[float, float, float]) -> Project:
    file = folder / f"{name}.toml"
    file.write_text(SCENE.replace("{albedo}", ", ".join(map(str, albedo))))
    return open_project(str(file))


@pytest.fixture
def matcher() -> Iterator[PhotoMatcher]:
    made = PhotoMatcher()
    yield made
    made.close()


def ended(matcher: PhotoMatcher) -> Ended:
    until = time.monotonic() + 300.0
    while not (found := matcher.take_ended()):
        assert time.monotonic() < until
        time.sleep(0.02)
    (one,) = found
    return one


def test_an_albedo_is_found_in_a_picture_of_it(matcher: PhotoMatcher, tmp_path: Path) -> None:
    from app.stills.stills import render_picture
    from engine.precompute.indirect.sampling_settings import BounceSeries

    picture = render_picture(scene(tmp_path, "true", FOUND), lambda step: None, series=BounceSeries(1))
    write_exr(tmp_path / "photo.exr", 0.5 * picture[..., :3])
    start = scene(tmp_path, "start", (0.4, 0.4, 0.4))
    matcher.begin(start.document, VIEW, MatchSettings("ball", tmp_path / "photo.exr", targets=("0.scale",)))
    answer = ended(matcher).answer
    assert answer is not None and not matcher.is_busy
    matched = answer.edit.apply(start.document).object("ball").layers[0].values["albedo"]
    np.testing.assert_allclose(matched, FOUND, atol=0.02)
    # It was exposed by half; what is compared with is light again, in the picture's size.
    assert answer.exposure == pytest.approx(0.5, rel=0.02) and answer.error < 0.1 * answer.before
    np.testing.assert_allclose(answer.light[..., :3], picture[..., :3], rtol=0.03, atol=1e-3)


def test_what_is_no_picture_is_told_in_a_line(matcher: PhotoMatcher, tmp_path: Path) -> None:
    (tmp_path / "photo.png").write_bytes(b"\x89PNG but not really")
    start = scene(tmp_path, "start", (0.4, 0.4, 0.4))
    matcher.begin(start.document, VIEW, MatchSettings("ball", tmp_path / "photo.png", targets=("0.scale",)))
    said = ended(matcher)
    assert said.answer is None and "photo.png" in said.line and "\n" not in said.line


def test_a_match_that_is_stopped_says_nothing(matcher: PhotoMatcher, tmp_path: Path) -> None:
    start = scene(tmp_path, "start", (0.4, 0.4, 0.4))
    matcher.begin(start.document, VIEW, MatchSettings("ball", tmp_path / "photo.png", targets=("0.scale",)))
    matcher.stop()
    assert not matcher.is_busy and not matcher.progress
    matcher.close()
    assert matcher.take_ended() == []
