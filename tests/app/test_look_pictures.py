"""Pictures of looks beside the edited one: they are the stills of these looks, and follow any sequence of edits."""

from __future__ import annotations

import random
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.cli.planning import describe_plan, plan_project
from app.document.commands import AddLook, RenameLook, SetLook, SetParameter, SetRotation
from app.document.document import Document
from app.document.looks import shown_looks
from app.document.view_state import Viewpoint
from app.project.project import Project, open_project
from app.stills import look_pictures
from app.stills.look_pictures import IDLE_SECONDS, LookPictures, LookView, look_alone
from app.stills.stills import render_picture
from app.system.system import resident_bytes
from engine.settings import RenderSettings
from tests.scene_text import LAMBERT, camera, environment, facing_up, placed

SIZE = 16, 12
SCENE = (
    camera((0.0, 1.0, 3.0), 40, SIZE, (0, 0.3, 0), "bounces = 1\n") + environment((0.4, 0.5, 0.7))
    + placed("ground", "quad", facing_up(1), LAMBERT)
)  # fmt: skip
SETTINGS = RenderSettings(n_bounces=1)


@pytest.fixture
def project(tmp_path: Path) -> Project:
    """A scene of three looks."""
    (tmp_path / "scene.toml").write_text(SCENE)
    project = open_project(str(tmp_path / "scene.toml"))
    document = project.document
    for command in (AddLook("Dark"), SetParameter("ground.0", "albedo", 0.1), AddLook("Turned"), SetRotation(40.0)):
        document = command.apply(document)
    return replace(project, document=document, settings=SETTINGS)


@pytest.fixture
def pictures() -> Iterator[LookPictures]:
    made = LookPictures()
    yield made
    made.close(5.0)


def views(project: Project, document: Document | None = None, size: tuple[int, int] = SIZE) -> dict[str, LookView]:
    """All looks but the current one."""
    document = document or project.document
    names = [each.name for each in document.looks if each.name != document.look]
    seen = project.scene.description.camera
    return {name: LookView(look_alone(document, name), seen, size, SETTINGS) for name in names}


def draw(pictures: LookPictures, wanted: dict[str, LookView]) -> list[tuple[str, bool]]:
    """Have all drawn; which pictures came, and whether they were coarse."""
    until, came, seen = time.monotonic() + 180.0, list[tuple[str, bool]](), dict(pictures.pictures)
    pictures.want(time.monotonic() - IDLE_SECONDS, wanted)
    pictures.want(time.monotonic() + IDLE_SECONDS, wanted)
    while not pictures.is_finished:
        assert time.monotonic() < until
        pictures.want(time.monotonic() + IDLE_SECONDS, wanted)
        pictures.take()
        for name, picture in pictures.pictures.items():
            if seen.get(name) is not picture:
                came.append((name, picture.is_coarse))
                seen[name] = picture
        time.sleep(0.01)
    return came


@pytest.mark.parametrize("size", [SIZE, (160, 120)])
def test_the_plan_has_at_least_what_looks_take(project: Project, pictures: LookPictures, size: tuple[int, int]) -> None:
    planned = replace(project, scene=project.scene.from_camera(None, size))
    plan = plan_project(planned, lambda step: None)
    assert plan.cost is not None and plan.cost.looks_mib > 0.0
    peak, ended = [0], threading.Event()

    def watch() -> None:
        while not ended.wait(0.01):
            if (process := pictures.process) is not None:
                peak[0] = max(peak[0], resident_bytes(process))

    thread = threading.Thread(target=watch)
    thread.start()
    draw(pictures, views(project, size=size))
    ended.set()
    thread.join()
    width, height = size
    assert pictures.n_bytes == 2 * width * height * 3 * 4  # finished ones of two looks
    assert peak[0] > 100 << 20
    assert peak[0] + pictures.n_bytes <= plan.cost.looks_mib * 2**20
    lines = list(describe_plan(plan))
    assert any(line.startswith(f"looks side by side take up to {plan.cost.looks_mib:.0f} MiB") for line in lines)


def test_each_picture_is_the_still_of_its_look(project: Project, pictures: LookPictures) -> None:
    wanted = views(project)
    # All coarsely first; then finished ones.
    assert draw(pictures, wanted) == [("Look 1", True), ("Dark", True), ("Look 1", False), ("Dark", False)]
    for name, view in wanted.items():
        assert pictures.state(name) == "" and pictures.is_current(name)
        still = render_picture(project.edited(view.document, Viewpoint(view.camera, SIZE)), lambda step: None)
        np.testing.assert_array_equal(pictures.pictures[name].radiance, still)
    # Another look is made current: the picture of what it was stays, and no other is drawn anew.
    switched = SetLook("Dark").apply(project.document)
    assert draw(pictures, views(project, switched)) == [("Turned", True), ("Turned", False)]
    # Renamed, it is the same picture.
    renamed = RenameLook("Look 1", "First").apply(switched)
    assert draw(pictures, views(project, renamed)) == [] and pictures.is_current("First")


def test_what_is_no_longer_wanted_is_stopped_and_what_was_drawn_stays_until_the_next(
    project: Project, pictures: LookPictures
) -> None:
    draw(pictures, views(project))
    before = pictures.pictures["Dark"]
    other = views(project, size=(8, 6))
    pictures.want(0.0, other)
    assert pictures.state("Dark") == "updating" and pictures.pictures["Dark"] is before
    pictures.want(IDLE_SECONDS, other)
    assert pictures.progress.startswith("drawing Look 1")
    pictures.stop()
    assert pictures.is_stopped and pictures.progress == "" and pictures.state("Dark") == "stopped"
    pictures.want(2.0 * IDLE_SECONDS, other)
    assert pictures.progress == ""  # until something changes, or it is to go on
    pictures.resume()
    draw(pictures, other)
    assert pictures.pictures["Dark"].radiance.shape == (6, 8, 3)


def test_a_look_that_cannot_be_drawn_says_why(project: Project, pictures: LookPictures, tmp_path: Path) -> None:
    (tmp_path / "scene.toml").unlink()
    draw(pictures, views(project))
    assert "scene.toml" in pictures.state("Dark") and pictures.pictures == {}


def test_the_first_looks_are_shown_and_the_current_one(project: Project) -> None:
    document = project.document
    assert shown_looks(document, 4) == ("Look 1", "Dark", "Turned") and shown_looks(document, 2) == ("Look 1", "Turned")
    assert shown_looks(SetLook("Dark").apply(document), 2) == ("Look 1", "Dark")


def test_any_sequence_ends_with_the_pictures_that_are_wanted(
    project: Project, pictures: LookPictures, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The process is a stand-in that answers, or fails, or ends, in any order; no picture is of what is not wanted."""
    sent: list[object] = []
    monkeypatch.setattr(look_pictures, "_Painter", lambda answers: _Painter(sent))
    rng, now = random.Random(7), 0.0
    wanted = views(project)
    for _ in range(600):
        what = rng.choice(("answer", "answer", "answer", "late", "end", "size", "none", "stop", "resume", "wait"))
        now += rng.choice((0.0, 0.1, 1.0))
        number = pictures._number
        if what == "answer" and sent and sent[-1] is not None:
            said = rng.choice((("picture", np.zeros((1, 1, 3), np.float32)), ("fraction", 0.5)))
            pictures._answers.put((number, *said))
        elif what == "late":
            pictures._answers.put((number - 1, "picture", np.ones((1, 1, 3), np.float32)))
        elif what == "end":
            pictures._answers.put((0, "ended", pictures._painter))
        elif what == "size":
            wanted = views(project, size=rng.choice((SIZE, (8, 6), (4, 3))))
        elif what == "none":
            wanted = {}
        elif what in ("stop", "resume"):
            getattr(pictures, what)()
        pictures.want(now, wanted)
        pictures.take()
        for name, view in wanted.items():
            picture = pictures.pictures.get(name)
            # Late answers, all ones, are of nothing that is wanted.
            assert picture is None or not picture.radiance.any()
            is_there = picture is not None and not picture.is_coarse and picture.of == view
            assert (pictures.state(name) == "") == is_there


class _Painter:
    """A process that notes what it is given."""

    def __init__(self, sent: list[object]) -> None:
        self.put = sent.append

    def close(self, patience_s: float) -> None: ...
