"""The generators of the built-in meshes and environments: deterministic, in metres.

What they write is committed, so that nobody has to run them; run them to change an asset.
"""
