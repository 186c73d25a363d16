"""The oracles: direct light by brute force, and path tracing."""
