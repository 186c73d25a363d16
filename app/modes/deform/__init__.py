"""Deform in the window's process: requests for pictures of a deforming mesh, and Placement's picture once it is
idle."""
