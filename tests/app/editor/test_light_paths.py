"""The ways of placed lights: any order of requests, late answers, failures and deaths of the worker."""

from __future__ import annotations

import random

import pytest

from app.document.document import Document
from app.editor.light_paths import LightPaths
from app.messages.light_path_messages import LightPathTraced, TraceLightPath
from app.messages.worker_messages import Request, RequestFailed
from engine.scene.light_paths import LightPath


class Host:
    """Takes down what is said."""

    def __init__(self) -> None:
        self.said: list[tuple[str, bool]] = []
        self.document = Document("shelf")

    def notify(self, text: str, is_error: bool = False) -> None:
        self.said.append((text, is_error))


def path(x: float) -> LightPath:
    return LightPath("key", (x, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 1.0, 0.0))


@pytest.mark.parametrize("seed", range(20))
def test_only_the_newest_answer_is_shown_and_a_line_stands_as_long_as_it_is_true(seed: int) -> None:
    """The last line says what the newest answer does: it is hidden, or it was said to be before and no longer is."""
    host, sent, rng = Host(), list[Request](), random.Random(seed)

    def send(request: Request) -> int:
        sent.append(request)
        return len(sent)

    paths, newest, shown, placed_in = LightPaths(host, send), 0, "", host.document
    for _ in range(200):
        what, n_said = rng.choice(("trace", "answer", "late", "fail", "restart", "view", "edit")), len(host.said)
        if what == "trace":
            n_sent, of, again = len(sent), path(rng.randrange(3)), rng.random() < 0.5
            last = sent[-1] if sent else None
            paths.trace(of, again)
            is_same = isinstance(last, TraceLightPath) and last.path == of
            assert len(sent) == n_sent + (again or not is_same)
            if len(sent) > n_sent:
                newest, placed_in = len(sent), host.document
        elif what == "answer":
            line = rng.choice(("", "wall hides it", "post hides it"))
            paths.receive(LightPathTraced(line, id=newest))
            if newest and line != shown:
                assert host.said[-1] == (line or "key is placed, and nothing hides it there", False)
                shown = line
            else:
                assert len(host.said) == n_said
            newest = 0
        elif what == "late":
            paths.receive(LightPathTraced("late", id=newest - 1))
            assert len(host.said) == n_said
        elif what == "fail":
            assert paths.receive_failure(RequestFailed("no scene is open", id=newest)) == bool(newest)
            assert len(host.said) == n_said + bool(newest)
            newest = 0
        elif what == "edit":
            host.document = Document("shelf")
        elif what == "view":
            paths.view_traced()
            is_of_it = bool(shown) and host.document is placed_in
            assert host.said[n_said:] == ([(shown, False)] if is_of_it else [])
        else:
            paths.worker_restarted()
            newest = 0
        assert paths.is_tracing == bool(newest)
