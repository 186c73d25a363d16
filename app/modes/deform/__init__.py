"""Deform in the window's process: what to ask of the worker for a bending mesh, and Placement for one that rests."""
