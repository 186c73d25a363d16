"""Waiting for a worker's answers, and killing it."""

import os
import signal
import time
from collections.abc import Callable

from app.messages.worker_messages import OpenScene, Response, SetCamera, ViewTraced
from app.worker.client import Client

Answers = list[Response]
# Long enough for a machine that does much else; only a worker that hangs is waited for so long.
PATIENCE_SECONDS = 90.0


def collect(client: Client, until: Callable[[Answers], bool], timeout_s: float = PATIENCE_SECONDS) -> Answers:
    """Answers until the condition holds for them."""
    answers: Answers = []
    deadline = time.monotonic() + timeout_s
    while not until(answers):
        assert time.monotonic() < deadline, f"no more after {[type(answer).__name__ for answer in answers]}"
        client.wait(0.05)
        answers += client.poll()
    return answers


def seen(kind: type[Response], n: int = 1) -> Callable[[Answers], bool]:
    return lambda answers: sum(isinstance(answer, kind) for answer in answers) >= n


def of(kind: type[Response], answers: Answers) -> Answers:
    return [answer for answer in answers if isinstance(answer, kind)]


def open_scene(client: Client) -> None:
    client.send(SetCamera(client.send(OpenScene("open scene"))))
    collect(client, seen(ViewTraced))


def wait_until_idle(client: Client) -> None:
    deadline = time.monotonic() + PATIENCE_SECONDS
    while client.busy:
        assert time.monotonic() < deadline
        client.wait(0.05)
        client.poll()


def kill(client: Client, number: int = signal.SIGKILL) -> float:
    assert client.pid is not None
    os.kill(client.pid, number)
    return time.monotonic()
