"""The process that matches a photograph: its answer is that of the engine, and strangers' files do no harm."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.document.view_state import SetView, ViewState
from app.files.materials import Library
from app.files.session import dump_session
from app.photo import match_settings
from app.photo.match_settings import MatchAnswer, MatchSettings, PhotoPair, load_answer, with_start
from app.photo.photo_matcher import PhotoMatcher, main
from app.project.project import Project, open_project
from app.worker.session_process import TaskAnswer
from engine.core.camera import project
from engine.light.radiance_files import read_radiance_image
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


def ended(matcher: PhotoMatcher) -> TaskAnswer[MatchAnswer]:
    until = time.monotonic() + 300.0
    while not (found := matcher.take_ended()):
        assert time.monotonic() < until
        time.sleep(0.02)
    (one,) = found
    return one


@pytest.fixture
def readers(monkeypatch: pytest.MonkeyPatch) -> dict[str, set[bool]]:
    """By function: whether the window's thread called it, and whether another did."""
    called: dict[str, set[bool]] = {}

    def spied(name: str, function: Callable[..., object]) -> Callable[..., object]:
        def spy(*given: object, **named: object) -> object:
            called.setdefault(name, set()).add(threading.current_thread() is threading.main_thread())
            return function(*given, **named)

        return spy

    for owner, name in ((json, "loads"), (match_settings, "open_memmap"), (np, "nan_to_num")):
        monkeypatch.setattr(owner, name, spied(name, getattr(owner, name)))
    return called


def test_an_albedo_is_found_in_a_picture_of_it(
    matcher: PhotoMatcher, tmp_path: Path, readers: dict[str, set[bool]]
) -> None:
    from app.stills.stills import render_picture
    from engine.precompute.indirect.sampling_settings import BounceSeries

    picture = render_picture(scene(tmp_path, "true", FOUND), lambda step: None, series=BounceSeries(1))
    write_exr(tmp_path / "photo.exr", 0.5 * picture[..., :3])
    start = scene(tmp_path, "start", (0.4, 0.4, 0.4))
    matcher.begin(start.document, VIEW, MatchSettings("ball", tmp_path / "photo.exr", targets=("0.scale",)))
    readers.clear()
    answer = ended(matcher).answer
    # The window's thread only takes it: another has read it.
    assert readers["loads"] == readers["open_memmap"] == readers["nan_to_num"] == {False}
    assert answer is not None and not matcher.progress
    matched = answer.edit.apply(start.document).object("ball").layers[0].values["albedo"]
    np.testing.assert_allclose(matched, FOUND, atol=0.02)
    # It was exposed by half; what is compared with is light again, in the picture's size.
    assert answer.exposure == pytest.approx(0.5, rel=0.02) and answer.error < 0.1 * answer.before
    np.testing.assert_allclose(answer.light[..., :3], picture[..., :3], rtol=0.03, atol=1e-3)


def test_the_process_begins_with_a_material_of_the_library(matcher: PhotoMatcher, tmp_path: Path) -> None:
    """As the window has it: targets are of its layers; the edit that gives them to the object is the window's."""
    write_exr(tmp_path / "photo.exr", np.full((48, 64, 3), 0.5, np.float32))
    start = scene(tmp_path, "start", (0.4, 0.4, 0.4))
    mine = tuple(each.replace(name="mine") for each in Library().entry("Gold").material.layers)
    settings = with_start(MatchSettings("ball", tmp_path / "photo.exr"), start.document, "Mine", mine)
    matcher.begin(start.document, VIEW, replace(settings, targets=("0.scale",)))
    found = ended(matcher)
    assert found.answer is not None, found.line
    (layer,) = found.answer.edit.apply(settings.begun(start.document)).object("ball").layers
    assert layer.name == "mine" and layer.model is mine[0].model and layer.values["scale"] != mine[0].values["scale"]


def test_whatever_goes_wrong_the_task_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(text: str, folder: Path) -> MatchAnswer:
        raise MemoryError("no room")

    monkeypatch.setattr("app.photo.photo_matcher.load_answer", fail)
    write_exr(tmp_path / "photo.exr", np.full((48, 64, 3), 0.5, np.float32))
    made = PhotoMatcher()
    made.begin(scene(tmp_path, "start", (0.4, 0.4, 0.4)).document, VIEW, MatchSettings("ball", tmp_path / "photo.exr"))
    assert ended(made) == (None, "photo.exr: it could not be matched: MemoryError no room")
    made.close()


def test_the_photograph_is_read_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    read: list[Path] = []

    def reading(file: Path, **how: bool) -> object:
        read.append(file)
        return read_radiance_image(file, **how)

    monkeypatch.setattr("engine.inverse.photo.read_radiance_image", reading)
    write_exr(tmp_path / "photo.exr", np.full((96, 128, 3), 0.5, np.float32))
    start = scene(tmp_path, "start", (0.4, 0.4, 0.4))
    camera = start.scene.description.camera
    points = np.array([(0.0, 0.5, 0.9), (0.5, 0.5, 0.7), (-0.5, 0.2, 0.7), (0.0, 1.0, 0.6), (0.8, 0.0, 1.0)])
    shares = project(camera, (64, 48), points - np.array(camera.position)) / np.array((64, 48))
    pairs = tuple(
        PhotoPair((float(u), float(v)), (float(x), float(y), float(z)))
        for (u, v), (x, y, z) in zip(shares, points, strict=True)
    )
    session = tmp_path / "task" / "document.insitu"
    session.parent.mkdir()
    session.write_text(dump_session(start.document, VIEW), encoding="utf-8")
    main(str(session), MatchSettings("ball", tmp_path / "photo.exr", targets=("0.scale",), pairs=pairs))
    *_, line = capsys.readouterr().out.splitlines()
    words = json.loads(line)
    assert not words["failed"], words["said"]
    answer = load_answer(words["answer"], session.parent)
    # Places in shares of the photograph are pixels of it, and what comes back is the photograph.
    assert len(read) == 1 and max(answer.missed) < 0.5
    np.testing.assert_allclose(answer.light[..., :3] * answer.exposure, 0.5, rtol=1e-5)


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
    assert not matcher.progress
    matcher.close()
    assert matcher.take_ended() == []
