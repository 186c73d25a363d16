"""The engine: scenes, materials, light, precomputed transport and rendering. It knows no processes, windows or
sessions.
"""
