"""What is wanted after the first picture is compiled before that: each part calls the kernels that it is for."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
# A fresh process: what other tests have called counts for nothing there.
PROGRAM = """
from app.system.kernel_cache import use_kernel_cache

use_kernel_cache()
from app.worker.kernels import LATER
from app.worker.kernel_warm_up import warm_up_later

called = {}
for part in warm_up_later():
    from engine.realtime.zonal_harmonics._zonal_kernels import fit_range
    from engine.precompute.indirect._second_bounce_kernels import second_bounce_light
    from engine.realtime.triple_product._pixel_kernels import add_answers
    from engine.texture._kernels import cover
    from engine.precompute.direct._relight_kernels import fill_rows

    kernels = {
        "painting": cover, "indirect": second_bounce_light, "relighting": fill_rows, "orbit": add_answers,
        "deform": fit_range
    }
    called[part] = {name for name, kernel in kernels.items() if kernel.signatures}
assert tuple(called) == LATER
for part, found in called.items():
    assert part in found or part == "estimate", (part, found)
"""


@pytest.mark.sweep
def test_each_part_calls_its_kernels() -> None:
    done = subprocess.run([sys.executable, "-c", PROGRAM], cwd=ROOT, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr


# A scene of another shape and light, bent: an object with each kind of surface, drawn in each way.
DEFORM_PROGRAM = """
import gc
import sys
from dataclasses import replace
from pathlib import Path

from app.system.kernel_cache import use_kernel_cache

use_kernel_cache()
from numba.core.dispatcher import Dispatcher

from app.modes.deform.deform_messages import DrawDeform, PrepareDeform
from app.worker.cache import ArrayCache
from app.worker.schedule import InProcessClient
from app.worker.kernel_warm_up import warm_up_deform
from app.messages.worker_messages import RequestFailed
from engine.realtime.core.gpu_parts import NO_PARTS
from engine.scene.surface_kinds import DeformSurface, Membrane, Subsurface
from tests.app.worker.small_modes import POSES, SCENE, SIZE, shown_by, small_tasks
from tests.opened import ask_for_scene


def compiled():
    return {
        (each.py_func.__module__, each.__name__, str(signature))
        for each in gc.get_objects() if isinstance(each, Dispatcher) and each.py_func.__module__.startswith("engine.")
        for signature in each.signatures
    }


warm_up_deform()
before = compiled()
scene = Path(sys.argv[1], "scene.toml")
scene.write_text(SCENE)
for _ in range(2):  # fitted, and read from the disk
    client = InProcessClient(small_tasks(ArrayCache(Path(sys.argv[1], "cache"))))
    ask_for_scene(client, str(scene), resolution=SIZE)
    answers = client.poll(budget_s=float("inf"))
    shown = shown_by("deform", str(scene))
    prepare, draw = shown.prepare, shown.draw
    kinds = {"membrane": Membrane()}, {"subsurface": Subsurface(scattering=5.0)}
    for says in (DeformSurface(), *(DeformSurface(**kind) for kind in kinds)):
        for request in (
            replace(prepare, surfaces=(("ball", says),)), draw, replace(draw, quality="moving"),
            replace(draw, poses=()), replace(draw, fit_error=True), replace(draw, sent_parts=NO_PARTS),
        ):
            client.send(request)
            answers += client.poll(budget_s=float("inf"))
    assert not [answer for answer in answers if isinstance(answer, RequestFailed)]
assert any("zonal_harmonics" in module for module, *_ in before)
further = compiled() - before
assert not further, sorted(further)
"""


def test_a_bent_scene_compiles_nothing_that_was_not_compiled_for_deform(tmp_path: Path) -> None:
    program = [sys.executable, "-c", DEFORM_PROGRAM, str(tmp_path)]
    done = subprocess.run(program, cwd=ROOT, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
