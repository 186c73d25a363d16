"""Scenes and environments that this project made itself; `python -m assets.generate` makes them anew."""
