"""Processor seconds of tests, with the processes that they start, by test and by file: `pytest -p tests.cpu_seconds`.

Durations say little on a machine that does other work as well. A process that a test leaves running counts until the
test ends, and what a fixture of a module does is the first test's.
"""

from __future__ import annotations

import collections
import contextlib
import resource
from collections.abc import Iterator

import psutil
import pytest

N_SHOWN = 30
KEY = pytest.StashKey[float]()
_seconds: dict[str, float] = {}


def used_seconds() -> float:
    """Of this process, of its children that have ended, and of those that run."""
    ended = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    total = sum(usage.ru_utime + usage.ru_stime for usage in ended)
    for child in psutil.Process().children(recursive=True):
        with contextlib.suppress(psutil.Error):
            times = child.cpu_times()
            total += times.user + times.system
    return total


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> Iterator[None]:
    item.stash[KEY] = used_seconds()
    return (yield)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_teardown(item: pytest.Item) -> Iterator[None]:
    try:
        return (yield)
    finally:
        item.user_properties.append(("cpu_seconds", used_seconds() - item.stash[KEY]))


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """In the process that sums up, also where others run the tests."""
    if report.when == "teardown":
        _seconds[report.nodeid] = sum(value for name, value in report.user_properties if name == "cpu_seconds")


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    files = collections.Counter[str]()
    for test, seconds in _seconds.items():
        files[test.partition("::")[0]] += seconds
    for title, counted in (("tests", collections.Counter(_seconds)), ("files", files)):
        terminalreporter.section(f"processor seconds of {title}, {sum(counted.values()):.0f} in all")
        for name, seconds in counted.most_common(N_SHOWN):
            terminalreporter.write_line(f"{seconds:8.2f}  {name}")
