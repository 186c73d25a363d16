"""How much memory there is, and refusing what would not fit before anything is computed."""

from __future__ import annotations

from pathlib import Path

from engine.errors import InsituError

# Of one pixel: its visibility (5,120 bits and the finest lights'), its hit, its directions, the picture.
BYTES_A_PIXEL = 1200


def memory_bytes() -> tuple[int | None, int]:
    """Bytes available and in all; None where the system does not tell."""
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
    except OSError:
        return None, 0
    values = {name: int(rest.split()[0]) * 1024 for name, _, rest in (line.partition(":") for line in lines)}
    return values.get("MemAvailable"), values.get("MemTotal", 0)


def bytes_for(resolution: tuple[int, int]) -> int:
    """About what a picture of (width, height) pixels needs of the memory."""
    return resolution[0] * resolution[1] * BYTES_A_PIXEL


def require_memory_for(resolution: tuple[int, int], mend: str = "give a smaller --resolution") -> None:
    """InsituError when a picture of (width, height) pixels would need more memory than there is; mend: what to do."""
    needed, (free, _) = bytes_for(resolution), memory_bytes()
    if free is not None and needed > free:
        size = f"{resolution[0]} x {resolution[1]} pixels"
        raise InsituError(f"{size} need about {gib(needed)}, {gib(free)} are free; {mend}")


def gib(n_bytes: int) -> str:
    """A size in GiB or MiB."""
    return f"{n_bytes / 2**30:.1f} GiB" if n_bytes >= 1 << 30 else f"{n_bytes / 2**20:.0f} MiB"
