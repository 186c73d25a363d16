"""Fixtures shared by all tests: data beside the checkout, a cache of its own, NumPy's float errors raised."""

import gc
import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

from app.system.kernel_cache import use_kernel_cache
from app.worker.kernels import compile_all

use_kernel_cache()
# The same examples each time, and no failure for a slow machine: time is measured elsewhere.
settings.register_profile("insitu", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("insitu")

# What tests and libraries brought stays: looking through it again and again takes half of collecting.
gc.set_threshold(10_000)

UNCOMPILED = os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")


def pytest_configure(config: pytest.Config) -> None:
    """Kernels that are not compiled count bits and hash by NumPy's integers, which tell where they wrap around."""
    if UNCOMPILED:
        config.addinivalue_line("filterwarnings", "ignore:overflow encountered in scalar:RuntimeWarning")


def pytest_sessionstart(session: pytest.Session) -> None:
    """Before several processes run the tests, compile what they need: else each worker that a test starts would start
    a process that compiles."""
    if getattr(session.config.option, "numprocesses", None) and not UNCOMPILED:
        compile_all()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files with long tests first: where several processes take the next file each, none has a long one at the end."""
    long = {item.path for item in items if item.get_closest_marker("slow") or item.get_closest_marker("window")}
    items.sort(key=lambda item: item.path not in long)


def pytest_collection_finish(session: pytest.Session) -> None:
    """From here on memory is looked through for what tests leave alone."""
    gc.freeze()


ROOT = Path(__file__).resolve().parents[1]


def _folder_beside_checkout(name: str) -> Path:
    folder = ROOT.parent / "shared" / name
    if not folder.is_dir():
        pytest.skip(f"the folder ../shared/{name} is not beside this checkout")
    return folder


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Meshes, light probes and measured BRDFs by others, kept beside the checkout; skips where absent."""
    return _folder_beside_checkout("data")


@pytest.fixture(scope="session")
def shared_reference() -> Path:
    """Scenes with path-traced reference pictures, kept beside the checkout; skips where absent."""
    return _folder_beside_checkout("reference")


@pytest.fixture(scope="session", autouse=True)
def cache_folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The transport cache of this run: tests never read or fill the user's own."""
    folder = tmp_path_factory.mktemp("insitu-cache")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("INSITU_CACHE", str(folder))
        yield folder


@pytest.fixture(autouse=True)
def raised_float_errors() -> Iterator[None]:
    """NumPy raises on overflow, division by zero and invalid operations; underflow to 0 is wanted."""
    with np.errstate(all="raise", under="ignore", over="warn" if UNCOMPILED else "raise"):
        yield


@pytest.fixture(scope="session")
def measured_samples() -> np.ndarray:
    """A made up measurement (90, 90, 180, 3), with noise of 5 % and gaps."""
    from tests.naive.measured import analytic_samples

    return analytic_samples(noise=0.05, gaps=0.02)


@pytest.fixture(scope="session")
def merl_file(measured_samples: np.ndarray, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """It as a file."""
    from engine.measured.sample_files import merl_bytes

    path = tmp_path_factory.mktemp("measured") / "gloss.binary"
    path.write_bytes(merl_bytes(measured_samples))
    return path
