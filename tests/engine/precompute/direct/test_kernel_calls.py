"""Kernels made ready ahead: with the very types that the first picture calls them with."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[4]
# Signatures count by process, so a fresh one asks them: each kernel has as many after a first picture as before it.
PROGRAM = """
import sys
from pathlib import Path

import numba

from app.system.kernel_cache import use_kernel_cache

use_kernel_cache()
from app.worker.cache import ArrayCache
from app.worker.schedule import InProcessClient
from tests.opened import ask_for_scene
from app.modes.placement.placement_messages import StageDone
from app.worker.tasks import RequestDispatcher
from engine.precompute.direct import kernel_calls
from tests.app.worker.ball_and_lamp import SCENE, compute


def signatures():
    return {
        f"{name}.{kernel}": set(map(str, found.signatures))
        for name, module in list(sys.modules.items()) if name.startswith("engine.") and name.endswith("_kernels")
        for kernel, found in vars(module).items() if isinstance(found, numba.core.dispatcher.Dispatcher)
    }


kernel_calls.warm_up_projection_details()
details = signatures()
kernel_calls.warm_up_projection()
rehearsed = signatures()
for name, known in details.items():
    if name.endswith(("._deposit_split", "._make_scratch", ".encode_bands")) and "relight" not in name:
        assert known and known == rehearsed[name], name
kernel_calls.warm_up_light()
kernel_calls.warm_up_contraction()
kernel_calls.warm_up_footprint()
rehearsed = signatures()

folder = Path(sys.argv[1])
(folder / "scene.toml").write_text(SCENE)
client = InProcessClient(RequestDispatcher(ArrayCache(folder / "cache")))
ask_for_scene(client, str(folder / "scene.toml"))
client.poll(budget_s=float("inf"))
client.send(compute())
answers = []
while not any(isinstance(answer, StageDone) for answer in answers):
    answers = client.poll(budget_s=0.0)
used = signatures()
new = {name: kinds - rehearsed.get(name, set()) for name, kinds in used.items()}
new = {name: kinds for name, kinds in new.items() if kinds}
assert not new, new
assert sum(map(len, used.values())) > 15
"""


def test_a_first_picture_compiles_nothing_that_was_not_warmed_up(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(tmp_path)], cwd=ROOT, capture_output=True, text=True, timeout=240
    )
    assert done.returncode == 0, done.stderr
