"""Deform's moving pictures on a graphics card: lobes in a compute shader, then triangles between points."""
