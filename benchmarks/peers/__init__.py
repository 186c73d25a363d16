"""Edits here and in path tracers with denoisers: `python -m benchmarks.peers`, which writes docs/peers.md.

    edits (script, states) ─► scenes (what all read) ─► programs.{window,mitsuba,cycles}_edits ─► timelines ─► page

A peer runs in the interpreter that an environment variable names; nothing here imports it.
"""
