"""Mesa's shader cache on a full disk ends the process; ours does without it there."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.app.limits import small_disk

pytestmark = pytest.mark.gl

PROGRAM = """
from ui.gl.context import create_headless_context
context = create_headless_context()
program = context.program(
    vertex_shader="#version 410\\nvoid main() { gl_Position = vec4(0.0); }",
    fragment_shader="#version 410\\nout vec4 colour; void main() { colour = vec4(1.0); }",
)
print("drawn")
"""


@pytest.mark.parametrize("folder", ["", "made/anew"])
def test_a_context_opens_where_the_cache_is_on_a_full_disk(tmp_path: Path, folder: str) -> None:
    with small_disk(tmp_path / "disk", 1 << 16) as disk:
        (disk / "filling").write_bytes(bytes(os.statvfs(disk).f_bavail * 4096))
        environment = {**os.environ, "XDG_CACHE_HOME": str(disk / folder)}
        environment.pop("MESA_SHADER_CACHE_DISABLE", None)
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, timeout=120
        )
        assert (done.returncode, done.stdout) == (0, "drawn\n"), done.stderr
