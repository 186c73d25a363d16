#!/usr/bin/env bash
# Open the editor, on the scene that is given or on the built-in tea tray. Where there is no display to open it on and
# nothing else was asked for, take pictures of a scripted session instead, so that there is something to see.
set -u
cd "$(dirname "$0")/.."
python=.venv/bin/python

"$python" -m app "$@"
status=$?
if [ "$status" -ne 2 ] || [ "$#" -ne 0 ]; then
  exit "$status"
fi
echo "run: no display here; taking pictures of a scripted session in out/tour instead (a minute or two)"
mkdir -p out/tour
exec "$python" -m app screenshot teatray --resolution 320 320 --script assets/scripts/tour.toml -o out/tour/end.png
