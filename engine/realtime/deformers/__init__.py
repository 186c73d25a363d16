"""The available deformers by name: each is a small module with a `KIND`."""

from engine.realtime.deformers import bend, bulge, taper, twist, wave

KINDS = {module.KIND.name: module.KIND for module in (bend, twist, taper, bulge, wave)}
