"""Light: environments resampled to the directions of the sphere, and emitters as triangles."""
