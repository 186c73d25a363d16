"""Every way in which a worker or a window can die, and what the client makes of it."""

import itertools
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from app.messages.worker_messages import OpenScene, Progress, RequestFailed, SceneOpened, ViewTraced, WorkerRestarted
from app.modes.placement.placement_messages import LayerPicture, StageDone
from app.worker.client import Client
from app.worker.shared_arrays import Method
from tests.app.worker.answers import collect, kill, of, open_scene, seen, wait_until_idle
from tests.app.worker.faulty_tasks import HANDLERS, compute

pytestmark = pytest.mark.usefixtures("state_folder")


# ----------------------------------------------------------------------------------------------- the worker dies


def test_killed_while_starting() -> None:
    with Client(HANDLERS) as client:
        client.send(OpenScene("open scene"))
        kill(client)
        answers = collect(client, seen(SceneOpened))
    assert answers[0] == WorkerRestarted("it was ended by SIGKILL")


def test_killed_while_idle(client: Client) -> None:
    open_scene(client)
    wait_until_idle(client)
    before = client.pid
    kill(client)
    answers = collect(client, seen(WorkerRestarted))
    assert answers == [WorkerRestarted("it was ended by SIGKILL")]  # seen, not waited for in vain
    assert client.pid != before
    answers = collect(client, seen(ViewTraced))  # the standing requests were sent again, unasked
    assert len(answers) == 2


def test_killed_within_a_step(client: Client) -> None:
    open_scene(client)
    light = client.send(compute("sleep 60"))
    collect(client, seen(Progress))
    kill(client)
    answers = collect(client, seen(WorkerRestarted))
    (restarted,) = of(WorkerRestarted, answers)
    # The system may close what a process held before it tells how that ended, and the window does not wait for it.
    assert restarted.reason in ("it was ended by SIGKILL", "it closed its connection")
    answers += collect(client, seen(Progress))
    assert [type(answer) for answer in answers] == [WorkerRestarted, SceneOpened, ViewTraced, Progress]
    assert answers[-1].id == light


def test_killed_in_the_middle_of_a_message(client: Client) -> None:
    client.send(compute("flood"))
    collect(client, seen(Progress))
    time.sleep(0.1)  # the socket is full; the worker is within a send and holds its lock
    kill(client)
    answers = collect(client, lambda answers: seen(WorkerRestarted)(answers) and seen(Progress)(answers[-1:]))
    texts = {len(answer.text) for answer in answers if isinstance(answer, Progress)}
    assert texts == {50_000}  # whole messages only


def test_killed_while_publishing_pictures_never_shows_a_partial_one(client: Client) -> None:
    client.send(compute("pictures 100000"))
    for n_seen in (3, 17, 40):
        answers = collect(client, seen(LayerPicture, n_seen))
        kill(client)
        answers += collect(client, seen(WorkerRestarted))
        for answer in of(LayerPicture, answers):
            assert isinstance(answer, LayerPicture)
            assert np.ptp(answer.radiance) == 0  # one number throughout, see picture()
        client.send(compute("pictures 100000"))


def test_killed_between_tiles_resumes_after_the_last_complete_one(client: Client) -> None:
    client.send(compute("tiles key"))
    before = collect(client, seen(Progress, 3))
    kill(client)
    after = of(Progress, collect(client, seen(StageDone)))
    computed = [int(8 * answer.fraction) for answer in before + after if isinstance(answer, Progress)]
    assert computed == [0, 1, 2, 3, 4, 5, 6, 7]  # none twice


def test_stopped_worker_is_replaced() -> None:
    with Client(HANDLERS, heartbeat=0.05, hang_timeout=1) as client:
        open_scene(client)
        stopped = client.pid
        kill(client, signal.SIGSTOP)
        answers = collect(client, seen(ViewTraced))
        assert answers[0] == WorkerRestarted("it did not answer for 1 s")
        assert client.pid != stopped
    assert stopped is not None
    with pytest.raises(ProcessLookupError):
        os.kill(stopped, 0)  # killed and reaped


def test_worker_in_a_long_step_does_not_count_as_stopped() -> None:
    with Client(HANDLERS, heartbeat=0.05, hang_timeout=1) as client:
        client.send(compute("sleep 2"))
        collect(client, lambda _: not client.busy)
        assert not of(WorkerRestarted, client.poll())


def test_window_that_was_stopped_itself_does_not_blame_the_worker() -> None:
    """Both stopped by Ctrl-Z: at the first poll the worker has not had time to speak."""
    with Client(HANDLERS, heartbeat=0.05, hang_timeout=1) as client:
        open_scene(client)
        wait_until_idle(client)
        pid = client.pid
        kill(client, signal.SIGSTOP)
        while client.poll():
            pass
        time.sleep(1.2)
        assert client.poll() == []
        kill(client, signal.SIGCONT)
        open_scene(client)
        assert client.pid == pid


def test_damaged_block_is_never_shown_and_the_worker_replaced(client: Client, tmp_path: Path) -> None:
    client.send(compute(f"damaged {tmp_path / 'note'}"))
    answers = collect(client, seen(LayerPicture))
    assert [type(answer) for answer in answers] == [WorkerRestarted, LayerPicture]
    assert "generation 2 where 1" in answers[0].reason  # type: ignore[attr-defined]


def test_request_that_kills_the_worker_again_and_again_is_given_up(client: Client) -> None:
    open_scene(client)
    deadly = client.send(compute("die", revision=8))
    answers = collect(client, seen(RequestFailed))
    (failed,) = of(RequestFailed, answers)
    assert isinstance(failed, RequestFailed)
    assert (failed.id, failed.revision) == (deadly, 8)
    how = r"\(it (was ended by SIGKILL|closed its connection)\)"  # as fast as the system takes the process down
    assert re.fullmatch(f"computing failed 3 times in succession {how}; not tried again", failed.line)
    collect(client, seen(ViewTraced))  # the scene stands, and a worker has it
    assert client.alive
    client.send(compute("pictures 1"))
    collect(client, seen(StageDone))


def test_scene_that_kills_the_worker_leaves_the_one_before_open(client: Client) -> None:
    open_scene(client)
    deadly = client.send(OpenScene("die"))
    answers = collect(client, seen(ViewTraced))
    assert [type(answer) for answer in answers if not isinstance(answer, (Progress, WorkerRestarted))] == [
        RequestFailed,
        SceneOpened,
        ViewTraced,
    ]
    assert of(RequestFailed, answers)[0].id == deadly


def test_scene_that_fails_in_a_new_worker_leaves_the_one_before_open(client: Client) -> None:
    open_scene(client)
    wait_until_idle(client)
    client.send(OpenScene("load_error"))
    kill(client)  # before or after it answered: the new worker has opened neither scene
    answers = collect(client, lambda answers: seen(WorkerRestarted)(answers) and seen(ViewTraced)(answers))
    assert isinstance(answers[-2], SceneOpened)
    assert answers[-2].description == "scene"


def test_kills_from_outside_are_not_held_against_finished_requests(client: Client) -> None:
    open_scene(client)
    for _ in range(4):
        wait_until_idle(client)
        kill(client)
        answers = collect(client, seen(ViewTraced))
        assert not of(RequestFailed, answers)


def test_worker_that_cannot_load_its_tasks_says_why_and_is_not_tried_again() -> None:
    with Client("tests.app.worker.faulty_tasks:Unimportable") as client:
        answers = collect(client, lambda _: not client.alive)
        (failed,) = answers
        assert isinstance(failed, RequestFailed)
        assert failed.line.startswith("computing could not be started: a bug in Insitu (for a report: ")
        client.send(OpenScene("open scene"))  # a new wish, a new try
        assert client.alive
        collect(client, seen(RequestFailed))


def test_worker_that_dies_before_it_can_speak_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", "/bin/false")
    with Client(HANDLERS) as client:
        answers = collect(client, lambda _: not client.alive)
    assert [type(answer) for answer in answers] == [WorkerRestarted, WorkerRestarted, RequestFailed]


def test_worker_that_cannot_be_started_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", "/nowhere/python")
    with Client(HANDLERS) as client:
        assert client.poll() == [RequestFailed("computing could not be started: No such file or directory")]
        assert not client.alive


def test_restarts_leave_no_descriptor_and_no_process(client: Client) -> None:
    open_scene(client)
    wait_until_idle(client)
    before, others = len(os.listdir("/proc/self/fd")), own_children() - {client.pid}
    for _ in range(3):
        kill(client)
        collect(client, seen(ViewTraced))
        wait_until_idle(client)
    assert len(os.listdir("/proc/self/fd")) == before
    assert own_children() == others | {client.pid}


def own_children() -> set[int]:
    """The processes that this one has started."""
    return set(map(int, Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()))


# ----------------------------------------------------------------------------------------------- the window dies

WINDOW = """
import sys, time
from app.worker.client import Client
from tests.app.worker.faulty_tasks import HANDLERS, compute
client = Client(HANDLERS, heartbeat=0.05, method=sys.argv[2])
client.send(compute(sys.argv[1]))
answers = []
while not answers:
    client.wait(1)
    answers = client.poll()
print(client.pid, flush=True)
time.sleep(60)
"""


def gone(pid: int, timeout_s: float = 60) -> bool:
    """Whether the process ends; a zombie that nobody has reaped yet has ended."""
    deadline = time.monotonic() + timeout_s
    while time.monotonic() < deadline:
        try:
            if Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] == "Z":
                return True
        except (FileNotFoundError, ProcessLookupError):
            return True
        time.sleep(0.01)
    return False


def left_in_memory(*pids: int) -> list[str]:
    """Names in shared memory that carry one of the processes' numbers; other programs may run beside the tests."""
    return [name for name in os.listdir("/dev/shm") if any(f"-{pid}-" in name for pid in pids)]


# Each work, kind of kill and method once or more; the other combinations are the sweep's.
KILLS: list[tuple[str, bool, Method]] = [
    ("sleep 60", False, "memfd"), ("pictures 1000000", True, "named"), ("pictures 1000000", False, "kept"),
]  # fmt: skip
WORKS, METHODS = ("sleep 60", "pictures 1000000"), ("memfd", "named", "kept")
OTHER_KILLS = [kill for kill in itertools.product(WORKS, (False, True), METHODS) if kill not in KILLS]


@pytest.mark.parametrize(
    ("work", "whole_group", "method"), [*KILLS, *(pytest.param(*kill, marks=pytest.mark.sweep) for kill in OTHER_KILLS)]
)
def test_killed_window_leaves_no_orphan_and_no_memory(work: str, whole_group: bool, method: Method) -> None:
    command = [sys.executable, "-c", WINDOW, work, method]
    with subprocess.Popen(command, stdout=subprocess.PIPE, start_new_session=True) as window:
        assert window.stdout is not None
        worker = int(window.stdout.readline())
        if whole_group:
            os.killpg(window.pid, signal.SIGKILL)
        else:
            window.kill()
        window.wait()
    assert gone(worker)
    if method == "memfd":
        assert left_in_memory(window.pid, worker) == []
    else:  # a name lives for microseconds; one that was caught is swept at the next start
        with Client(HANDLERS) as client:
            open_scene(client)
        assert left_in_memory(window.pid, worker) == []


def test_worker_ends_when_the_connection_closes_although_it_is_within_a_step() -> None:
    """The way out where the kernel does not end the worker with its parent."""
    with Client(HANDLERS, heartbeat=0.05) as client:
        client.send(compute("sleep 60"))
        collect(client, seen(Progress))
        process = client._process
        assert process is not None
        process.channel.close()
        process.wait_until_gone(timeout_s=90)
        assert process.reaped()
