"""Orbit in the window's process: requests for pictures under a moving camera, and Placement's picture once it is
idle."""
