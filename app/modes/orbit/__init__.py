"""Orbit in the window's process: what to ask of the worker for a moving camera, and Placement for one that rests."""
