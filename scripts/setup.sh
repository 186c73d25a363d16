#!/usr/bin/env bash
# Make .venv with the system's Python (3.11 or newer) and install Insitu into it, in the versions of constraints.txt.
set -euo pipefail
cd "$(dirname "$0")/.."

find_python() {
  local name
  for name in python3 python3.13 python3.12 python3.11; do
    if command -v "$name" >/dev/null && "$name" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
      echo "$name"
      return
    fi
  done
  echo "setup: Python 3.11 or newer is needed and was not found" >&2
  exit 1
}

# A .venv that cannot run pip is one that was cut off half-way, or one whose Python has gone: make it anew.
if ! .venv/bin/python -m pip --version >/dev/null 2>&1; then
  python=$(find_python)
  rm -rf .venv
  "$python" -m venv .venv
fi
.venv/bin/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]' --constraint constraints.txt </dev/null

# What pictures need is compiled while nobody waits for it yet, and kept in .venv as well: else the first start, or that
# of another user, would have to.
echo "setup: compiling in the background what a first picture needs, half a minute; the editor can be started meanwhile"
nohup .venv/bin/python -P -m app.worker.kernels </dev/null >/dev/null 2>&1 &
