"""The editor where nothing can be kept: it works all the same, and says so once."""

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from app.document.commands.layers import SetParameter
from app.document.view_state import SetView
from app.editor.editor import Editor
from app.worker.cache import ArrayCache
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from tests.app.limits import small_disk
from tests.ui.small_scene import write_small_scene

SWEPT = [pytest.param(name, marks=pytest.mark.sweep) for name in ("below a file", "system", "full")]


@pytest.fixture(params=["file", "almost full", *SWEPT])
def folder(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Path]:
    """A folder for the cache that is none."""

    file = tmp_path / "file"
    file.touch()
    places = {"file": file, "below a file": file / "cache", "system": Path("/proc/self/cache")}
    with ExitStack() as stack:
        if request.param in places:
            yield places[request.param]
        else:
            disk = stack.enter_context(small_disk(tmp_path / "disk", 1 << 16))
            if request.param == "full":
                (disk / "filling").write_bytes(bytes(1 << 16))
            yield disk


def messages(editor: Editor, client: InProcessClient) -> list[str]:
    """What is said until the worker has nothing left to do."""
    said = [editor.status.message]
    idle = 0
    for step in range(100_000):
        editor.tick(10.0 * step)  # a hand that rests
        if editor.status.message != said[-1]:
            said.append(editor.status.message)
        idle = 0 if client.wait(0.0) else idle + 1
        if idle == 5:
            return said
    raise AssertionError(editor.status)


def test_the_editor_works_without_a_cache_and_says_so_once(folder: Path, tmp_path: Path) -> None:
    scene = str(write_small_scene(tmp_path))
    client = InProcessClient(RequestDispatcher(ArrayCache(folder)))
    editor = Editor(client, scene, resolution=(12, 8))
    editor.do(SetView.of(n_lights=500, n_bounces=1))
    said = messages(editor, client)
    assert editor.controller._transport.delivered_final
    about = [line for line in said if "cache" in line]
    assert len(about) == 1 and about[0].startswith(f"the cache in {folder} ") and editor.status.is_error
    assert about[0].endswith("results stay in memory only")
    # Other transport, and another scene: nothing new is to be said.
    editor.do(SetParameter("ball.coat", "alpha", 0.37))
    editor.notify("")
    said = messages(editor, client)
    editor.open(scene)
    said += messages(editor, client)
    assert "opened small" in said and not [line for line in said if "cache" in line]
    editor.close()
