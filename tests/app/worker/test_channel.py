"""Messages arrive whole, in order and within the time given, or not at all."""

import os
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from app.messages.worker_messages import Message, Progress, ViewTraced
from app.modes.placement.placement_messages import LayerPicture
from app.system import system
from app.worker.channel import Channel, ChannelClosed, ChannelError
from app.worker.shared_arrays import Method

LATER = float("inf")


@pytest.fixture(params=["memfd", "named", "kept"])
def pair(request: pytest.FixtureRequest) -> Iterator[tuple[Channel, Channel]]:
    method: Method = request.param
    ours, theirs = socket.socketpair()
    channels = Channel(ours, method), Channel(theirs, method)
    yield channels
    for channel in channels:
        channel.close()


def through(pair: tuple[Channel, Channel], message: Message) -> Message:
    pair[0].send(message)
    received = pair[1].receive(LATER)
    assert received is not None
    return received


def test_plain_message_comes_back_equal(pair: tuple[Channel, Channel]) -> None:
    message = Progress("visibility", 0.25, None, "a text", id=3, revision=9)
    assert through(pair, message) == message
    assert pair[1].receive(LATER) is None


ARRAYS = {
    "small": np.arange(6, dtype=np.float32).reshape(2, 3),
    "large": np.arange(30_000, dtype=np.float64).reshape(100, 300),
    "half": np.ones((7, 1000, 3), np.float16),
    "fortran": np.asfortranarray(np.arange(9000, dtype=np.int32).reshape(90, 100)),
    "slice": np.arange(40_000).reshape(200, 200)[::2, 5:100],
    "reversed": np.arange(5000)[::-1],
    "big-endian": np.arange(2000, dtype=">f8"),
    "booleans": np.arange(9999) % 3 == 0,
    "empty": np.empty((0, 3), np.float32),
    "scalar": np.array(2.5),
}


def test_arrays_come_back_equal_with_their_dtypes(pair: tuple[Channel, Channel]) -> None:
    received = through(pair, ViewTraced(ARRAYS))
    assert isinstance(received, ViewTraced)
    assert received.frame.keys() == ARRAYS.keys()
    for name, array in received.frame.items():
        assert array.dtype == ARRAYS[name].dtype
        np.testing.assert_array_equal(array, ARRAYS[name])


def test_large_arrays_travel_beside_the_message(pair: tuple[Channel, Channel]) -> None:
    """4096 bytes are shared and read-only; 4095 are inside the message."""
    received = through(pair, ViewTraced({"in": np.ones(4095, np.uint8), "out": np.ones(4096, np.uint8)}))
    assert isinstance(received, ViewTraced)
    assert received.frame["in"].flags.writeable
    assert not received.frame["out"].flags.writeable


def test_memory_map_travels_beside_the_message(pair: tuple[Channel, Channel], tmp_path: os.PathLike[str]) -> None:
    np.arange(5000).tofile(os.path.join(tmp_path, "a"))
    mapped = np.memmap(os.path.join(tmp_path, "a"), dtype=np.int64, mode="r")
    received = through(pair, ViewTraced({"a": mapped}))
    assert isinstance(received, ViewTraced)
    assert type(received.frame["a"]) is np.ndarray
    assert not received.frame["a"].flags.writeable
    np.testing.assert_array_equal(received.frame["a"], np.arange(5000))


def test_arrays_outlive_message_and_channel_and_leave_no_descriptor(pair: tuple[Channel, Channel]) -> None:
    before = len(os.listdir("/proc/self/fd"))
    arrays = []
    for index in range(20):
        received = through(pair, LayerPicture("a.0", "exact", np.full((2000, 3), index, np.float32), ()))
        assert isinstance(received, LayerPicture)
        arrays.append(received.radiance[5:10])
    del received
    assert [array[0, 0] for array in arrays] == list(range(20))
    arrays.clear()
    assert len(os.listdir("/proc/self/fd")) == before


def test_message_in_pieces_is_handed_out_once_whole() -> None:
    sender, wire = socket.socketpair()
    with sender:
        channel = Channel(wire)
        source, sink = socket.socketpair()
        Channel(source).send(Progress("a", 0.5))
        data = sink.recv(1 << 16)
        source.close(), sink.close()
        for place in range(len(data) - 1):
            sender.send(data[place : place + 1])
            assert channel.receive(LATER) is None
        sender.send(data[-1:])
        assert channel.receive(LATER) == Progress("a", 0.5)
        channel.close()


def test_a_kept_block_that_is_not_sent_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(system, "memory_folder", lambda: tmp_path)
    ours, theirs = socket.socketpair()
    channel = Channel(ours, "kept")
    channel.post(LayerPicture("a.0", "exact", np.zeros((2000, 3)), ()))
    assert len(os.listdir(tmp_path)) == 1
    channel.close()
    theirs.close()
    assert os.listdir(tmp_path) == []


def test_half_a_message_is_dropped_when_the_sender_dies() -> None:
    sender, wire = socket.socketpair()
    source, sink = socket.socketpair()
    before = len(os.listdir("/proc/self/fd"))
    Channel(source).send(LayerPicture("a.0", "exact", np.zeros((2000, 3)), ()))
    data, descriptors, _, _ = socket.recv_fds(sink, 1 << 16, 4)
    channel = Channel(wire)
    socket.send_fds(sender, [data[:-10]], descriptors)
    os.close(descriptors[0])
    sender.close()
    with pytest.raises(ChannelClosed):
        while channel.receive(LATER) is None:
            pass
    channel.close()
    source.close(), sink.close()
    assert len(os.listdir("/proc/self/fd")) == before - 4  # the four sockets; the block's descriptor is closed too


def test_whole_messages_are_handed_out_although_the_sender_died(pair: tuple[Channel, Channel]) -> None:
    for fraction in (0.25, 0.5):
        pair[0].send(LayerPicture("a", "exact", np.full(2000, fraction), ()))
    pair[0].close()
    for fraction in (0.25, 0.5):
        received = pair[1].receive(LATER)
        assert isinstance(received, LayerPicture)
        assert received.radiance[0] == fraction
    with pytest.raises(ChannelClosed):
        pair[1].receive(LATER)


@pytest.mark.parametrize(
    "junk", [b"GET / HTTP/1.1\r\n\r\n" * 4, b"INSF" + b"\xff" * 60, b"INSF\4" + bytes(35) + b"junk"]
)
def test_foreign_bytes_are_refused(junk: bytes) -> None:
    """Another protocol; an absurd length; a message that is no pickle."""
    sender, wire = socket.socketpair()
    channel = Channel(wire)
    with sender:
        sender.send(junk)
        with pytest.raises(ChannelError):
            channel.receive(LATER)
    channel.close()


def test_message_without_its_block_is_refused() -> None:
    source, sink = socket.socketpair()
    sender, wire = socket.socketpair()
    channel = Channel(wire)
    Channel(source).send(LayerPicture("a.0", "exact", np.zeros((2000, 3)), ()))
    sender.send(sink.recv(1 << 16))  # the bytes alone
    with pytest.raises(ChannelError, match="without its block"):
        channel.receive(LATER)
    for end in (source, sink, sender):
        end.close()
    channel.close()


def test_receiving_keeps_to_its_time(pair: tuple[Channel, Channel]) -> None:
    """64 MiB take about 20 ms to check: in turns of 1 ms each, none of which is long."""
    pair[0].send(LayerPicture("a.0", "exact", np.zeros(64 << 20, np.uint8), ()))
    turns = []
    received = None
    while received is None:
        start = time.monotonic()
        received = pair[1].receive(start + 0.001)
        if received is None and not pair[1].is_checking:
            continue  # the message is still on its way, as the sender waits for the processor
        turns.append(time.monotonic() - start)
    assert not pair[1].is_checking
    assert len(turns) >= 4
    assert np.median(turns) < 0.01
    assert isinstance(received, LayerPicture)
    assert received.radiance.nbytes == 64 << 20


def wait_until_sender_waits(channel: Channel) -> None:
    """Until a send has held the lock for 50 ms."""
    while channel.lock.acquire(timeout=0.05):
        channel.lock.release()
        time.sleep(0.001)


def test_sender_waits_while_the_receiver_is_behind_and_nothing_is_lost(pair: tuple[Channel, Channel]) -> None:
    n_messages, sent = 400, []

    def produce() -> None:
        for index in range(n_messages):
            pair[0].send(LayerPicture(str(index), "exact", np.full(2000, index), ()))
            sent.append(index)

    producer = threading.Thread(target=produce)
    producer.start()
    wait_until_sender_waits(pair[0])
    assert len(sent) < n_messages  # it was held back: few blocks are on the way at any time
    for index in range(n_messages):
        while (received := pair[1].receive(LATER)) is None:
            pair[1].wait(1)
        assert isinstance(received, LayerPicture)
        assert received.radiance[-1] == index
    producer.join()


def test_waiting_sender_notices_that_the_receiver_died(pair: tuple[Channel, Channel]) -> None:
    ended = threading.Event()

    def produce() -> None:
        with pytest.raises(ChannelClosed):
            while True:
                pair[0].send(LayerPicture("a", "exact", np.zeros(2000), ()))
        ended.set()

    producer = threading.Thread(target=produce)
    producer.start()
    wait_until_sender_waits(pair[0])
    pair[1].close()
    assert ended.wait(5)
    producer.join()


def test_sign_of_life_is_dropped_rather_than_waited_for(pair: tuple[Channel, Channel]) -> None:
    with pair[0].lock:
        pair[0].send_if_free(Progress("a", 0.0))
    for _ in range(2000):  # more than the socket takes
        pair[0].send_if_free(Progress("b", 0.0))
    n_received = 0
    while (received := pair[1].receive(LATER)) is not None:
        assert received == Progress("b", 0.0)
        n_received += 1
    assert 0 < n_received < 2000
