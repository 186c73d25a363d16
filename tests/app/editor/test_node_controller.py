"""The statistics of the images of parameter maps: asked for once, for all documents that are drawn."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from app.document.commands.maps import SetParameterMap
from app.document.document import Document
from app.document.history import History
from app.document.node_layers import channel_images, with_node_layers
from app.editor.node_controller import NodeController
from app.messages.file_messages import ChannelsRead, ReadChannels
from app.messages.worker_messages import OpenScene, Request, SetCamera
from app.project.project import open_project
from app.worker.cache import ArrayCache
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from tests.app.channel_answers import RAMP, channels_read
from tests.app.document.test_node_layers import METAL, opened
from tests.scene_text import camera, material, placed


class Host:
    """An editor that notes what is sent."""

    def __init__(self, document: Document) -> None:
        self.history, self.sent, self.said = History(document), list[Request](), list[str]()

    def send(self, request: Request) -> int:
        self.sent.append(request)
        return len(self.sent)

    def notify(self, text: str, is_error: bool = False) -> None:
        self.said.append(text)

    def document_changed(self) -> None:
        raise AssertionError


def answer(host: Host) -> ChannelsRead:
    """What the worker says to the last request."""
    request = host.sent[-1]
    assert isinstance(request, ReadChannels)
    return channels_read(request, len(host.sent))


@pytest.fixture
def documents() -> tuple[Document, Document]:
    """The present document, and side A, which has another image."""
    plain = opened(METAL)
    rough, worn = (SetParameterMap("ball.1", "alpha", file).apply(plain) for file in ("rough.png", "worn.png"))
    return rough, worn


def test_images_of_all_documents_are_asked_for_at_once_and_once(documents: tuple[Document, Document]) -> None:
    host = Host(documents[0])
    controller = NodeController(host)
    for _ in range(3):
        controller.request_missing(*documents)
    (asked,) = host.sent
    assert isinstance(asked, ReadChannels)
    assert set(asked.images) == {image for each in documents for image in channel_images(each)}
    assert not controller.is_complete(documents[0])
    controller.receive(answer(host))
    controller.request_missing(*documents)
    assert len(host.sent) == 1 and controller.is_complete(documents[0])


def test_nodes_are_counted_once_for_each_document(documents: tuple[Document, Document]) -> None:
    host = Host(documents[0])
    controller = NodeController(host)
    assert controller.counts(documents[0]) == ()
    controller.request_missing(documents[0])
    controller.receive(answer(host))
    found = controller.counts(documents[0])
    assert found[0].path == "ball.1.alpha" and controller.counts(documents[0]) is found
    controller.scene_opened({})
    assert controller.counts(documents[0]) == ()


def test_an_image_of_the_scene_that_cannot_be_read_is_said_beside_its_row(documents: tuple[Document, Document]) -> None:
    host = Host(documents[0])
    controller = NodeController(host)
    (image,) = channel_images(documents[0])
    controller.receive(ChannelsRead({}, {image: "rough.png: no such file"}, id=1))
    assert host.said == ["rough.png: no such file"] and host.history.document is documents[0]
    assert controller.refusal(documents[0].layer("ball.1")) == "rough.png: no such file"
    assert controller.refusal(documents[0].layer("ball.0")) == "" == controller.refusal(documents[1].layer("ball.1"))
    controller.reload(documents[0], "ball.1")
    assert controller.refusal(documents[0].layer("ball.1")) == ""


def test_a_map_whose_nodes_are_unknown_is_shown_as_before_and_asked_for_after_the_drag() -> None:
    """To find nodes takes longer than a frame: the worker does it, and not for each place of the mouse."""

    def with_range(low: float) -> Document:
        return SetParameterMap("ball.1", "alpha", {"map": "rough.png", "range": (low, 0.6137)}).apply(opened(METAL))

    first, second = with_range(0.1137), with_range(0.2137)
    host = Host(first)
    controller = NodeController(host)
    assert len(controller.with_nodes(first).object("ball").layers) == 2  # its parameter's own value
    controller.request_missing(first)
    controller.receive(answer(host))
    shown = controller.with_nodes(first)
    assert len(shown.object("ball").layers) > 3 and shown.layer("ball.1").values["alpha"] < 0.2
    host.history.begin_drag()
    controller.request_missing(second)
    assert len(host.sent) == 1 and controller.with_nodes(second).objects == shown.objects
    assert not controller.is_complete(second)
    host.history.end_drag()
    for _ in range(2):
        controller.request_missing(second)
    assert len(host.sent) == 2 and host.sent[-1] == ReadChannels((), (second,))
    controller.receive(answer(host))
    assert controller.is_complete(second)
    expected = with_node_layers(second, dict.fromkeys(channel_images(second), RAMP))
    assert controller.with_nodes(second).object("ball") == expected.object("ball")
    # Undo needs nothing.
    controller.request_missing(first)
    assert len(host.sent) == 2 and controller.with_nodes(first).objects == shown.objects


def test_an_image_that_was_written_meanwhile_is_read_with_the_nodes(tmp_path: Path) -> None:
    """Else nodes would follow from other statistics than the window's, which would ask for them again and again."""
    layer = material('model = "rough_conductor", name = "metal"')
    (tmp_path / "scene.toml").write_text(camera((0, 0, 3), 40, (6, 4)) + placed("ball", "sphere", more=layer))
    client = InProcessClient(RequestDispatcher(ArrayCache(tmp_path / "cache")))
    scene = client.send(OpenScene(str(tmp_path / "scene.toml")))
    client.send(SetCamera(scene))
    document = open_project(str(tmp_path / "scene.toml")).document
    statistics = []
    for least, ends in ((0, (0.2, 0.6)), (128, (0.2, 0.7))):
        Image.fromarray(np.linspace(least, 255, 64).astype(np.uint8).reshape(8, 8)).save(tmp_path / "worn.png")
        os.utime(tmp_path / "worn.png", ns=(least + 1, least + 1))
        document = SetParameterMap("ball.0", "alpha", {"map": "worn.png", "range": ends}).apply(document)
        client.send(ReadChannels((), (document,)))
        answers: list[ChannelsRead] = []
        while not answers:
            answers = [each for each in client.poll(0.1) if isinstance(each, ChannelsRead)]
        ((_, found),) = answers[0].statistics.items()
        statistics.append(found)
        assert {key.statistics for key in answers[0].nodes if key.parameter_map.high == ends[1]} == {found}
    assert statistics[0].low < 0.05 and statistics[1].low > 0.45
