"""Native decoders in a process of their own: what it returns, and what may befall it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from app.system.decoder_process import MEMORY, DecoderProcess
from app.system.system import HAS_PROC, process_lives
from engine.core.native_decoders import Arrays, DecoderError
from engine.texture.basis import decode_basis

ROOT = Path(__file__).parents[3]
KTX2 = Path(__file__).parents[2] / "engine" / "texture" / "ktx2" / "uastc.ktx2"


def reverse(data: bytes) -> Arrays:
    return {"bytes": np.frombuffer(data, np.uint8)[::-1], "pid": np.array(os.getpid())}


def misbehave(data: bytes) -> Arrays:
    if data == b"abort":
        os.abort()
    if data == b"hang":
        time.sleep(600.0)
    if data == b"print":
        os.write(1, b"library says hello" * 100)
    if data == b"eat":
        return {"zeros": np.ones(MEMORY, np.uint8)}
    if data == b"raise":
        raise ValueError("no such mesh")
    return {}


@pytest.fixture
def process() -> Iterator[DecoderProcess]:
    found = DecoderProcess(base_seconds=8.0)
    yield found
    found.close()


def test_arrays_come_back(process: DecoderProcess) -> None:
    found = process(reverse, bytes(range(200)) * 1000)
    assert found["bytes"].tolist() == (list(range(200)) * 1000)[::-1]
    assert int(found["pid"]) != os.getpid()
    assert int(process(reverse, b"")["pid"]) == int(found["pid"])  # it goes on
    pixels = process(decode_basis, KTX2.read_bytes())["pixels"]
    assert pixels.shape == (12, 20, 4)


@pytest.mark.parametrize(
    ("data", "said"),
    [(b"abort", "ends the decoder"), (b"raise", "no such mesh"), (b"eat", "needs too much memory")],
)
def test_what_goes_wrong_is_said_and_the_next_one_works(process: DecoderProcess, data: bytes, said: str) -> None:
    if data == b"eat" and not HAS_PROC:
        pytest.skip("memory is limited on Linux alone")
    with pytest.raises(DecoderError, match=said):
        process(misbehave, data)
    assert process(reverse, b"ab")["bytes"].tolist() == [98, 97]


def test_one_that_takes_too_long_is_ended() -> None:
    process = DecoderProcess(base_seconds=1.5)
    with pytest.raises(DecoderError, match="takes longer than"):
        process(misbehave, b"hang")
    process.close()


def test_a_reply_that_cannot_be_read_is_not_taken_for_the_next(
    process: DecoderProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = process(reverse, b"ab")

    def read(*_: object) -> bytes:
        raise MemoryError

    with monkeypatch.context() as full:
        full.setattr("app.system.decoder_process._read", read)
        with pytest.raises(DecoderError, match="needs its memory"):
            process(reverse, b"old")
    second = process(reverse, b"new")
    assert bytes(second["bytes"]) == b"wen" and int(second["pid"]) != int(first["pid"])


def test_it_says_when_it_cannot_be_started(process: DecoderProcess, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **more: object) -> None:
        raise OSError("no more processes")

    with monkeypatch.context() as full:
        full.setattr("subprocess.Popen", refuse)
        with pytest.raises(DecoderError, match="ends the decoder"):
            process(reverse, b"ab")
    assert process(reverse, b"ab")["bytes"].tolist() == [98, 97]


@pytest.mark.skipif(sys.platform == "win32", reason="no timer there")
def test_it_ends_by_itself_where_who_asked_was_killed(tmp_path: Path) -> None:
    asks = (
        "import sys, app.system.decoder_process as d, tests.app.system.test_decoder_process as t\n"
        "d._MORE_SECONDS = 0.0\n"
        "process = d.DecoderProcess(base_seconds=60.0)\n"
        "print(int(process(t.reverse, b'')['pid']), flush=True)\n"
        "process._base_seconds = 3.0\n"
        "process(t.misbehave, b'hang')\n"
    )
    asking = subprocess.Popen([sys.executable, "-c", asks], cwd=ROOT, stdout=subprocess.PIPE, text=True)
    assert asking.stdout is not None
    decoder = int(asking.stdout.readline())
    time.sleep(0.5)  # until it hangs
    asking.kill()
    asking.wait()
    asking.stdout.close()
    end = time.monotonic() + 60.0
    while process_lives(decoder) and time.monotonic() < end:
        time.sleep(0.1)
    assert not process_lives(decoder)


def test_a_library_that_prints_does_not_spoil_replies(process: DecoderProcess) -> None:
    assert process(misbehave, b"print") == {}


def test_it_ends_when_idle_and_is_started_again() -> None:
    process = DecoderProcess(idle_seconds=0.2)
    first = int(process(reverse, b"")["pid"])
    end = time.monotonic() + 10.0
    while process_lives(first) and time.monotonic() < end:
        time.sleep(0.05)
    assert not process_lives(first)
    second = int(process(reverse, b"")["pid"])
    os.kill(second, signal.SIGKILL)
    with pytest.raises(DecoderError, match="ends the decoder"):
        process(reverse, b"")
    assert int(process(reverse, b"")["pid"]) not in (first, second)
    process.close()


def test_projects_are_read_with_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A scene whose texture needs the decoder; in this process it is never called."""
    from app.project.project import open_project
    from tests.scene_text import camera, material, placed

    monkeypatch.setattr("opengl_basisu.open", None)
    (tmp_path / "wood.png").write_bytes(KTX2.read_bytes())  # the content says what it is
    wood = material('model = "lambert", albedo = 0.5, texture = "wood.png"')
    (tmp_path / "scene.toml").write_text(camera((0, 0, 3), 40, (8, 8)) + placed("card", "quad", more=wood))
    scene = open_project(str(tmp_path / "scene.toml")).scene
    pyramid = scene.textures.texture(scene.description.objects[0].layers[0].maps.images)
    assert pyramid is not None and 0.0 < pyramid.mean.min()
