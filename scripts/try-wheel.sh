#!/usr/bin/env bash
# Install the wheel of dist/ into a fresh environment outside the checkout, and use it as a new user does.
set -euo pipefail
cd "$(dirname "$0")/.."
checkout=$PWD
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT

.venv/bin/python -m venv "$place/venv"
"$place/venv/bin/python" -m pip install --quiet --disable-pip-version-check --constraint constraints.txt dist/insitu-*.whl
cd "$place"
venv/bin/python - "$checkout" <<'END'
import importlib.util
import sys
from pathlib import Path

import insitu

assert not Path(insitu.__file__).is_relative_to(sys.argv[1]), insitu.__file__
for name in ("app", "assets", "engine", "shaders", "ui"):
    assert importlib.util.find_spec(name) is None, f"the wheel installs a package called {name}"
assert insitu.open("shapes", resolution=(48, 32)).image(bounces=1).shape == (32, 48, 3)
END
venv/bin/insitu screenshot shapes --resolution 96 64 -o picture.png
test -s picture.png
echo "wheel: installed, imported and used"
