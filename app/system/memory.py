"""The machine's memory, and refusing what would not fit before anything is computed."""

from __future__ import annotations

from app.system.system import resident_bytes
from engine.core.errors import InsituError

# For one pixel: its visibility (5,120 bits and the finest lights'), its hit, its directions, the picture.
BYTES_A_PIXEL = 1200


def memory_bytes() -> tuple[int, int]:
    """Bytes that the system can still give without swapping, and in all."""
    import psutil  # late: the window must not wait for it

    memory = psutil.virtual_memory()
    return memory.available, memory.total


def available_memory() -> int:
    """Bytes that the system can still give without swapping."""
    return memory_bytes()[0]


def orbit_bytes() -> int:
    """Memory limit of Orbit's points: a third of all memory, and no less than the engine's default."""
    from engine.realtime.triple_product.orbit_engine import MOST_BYTES

    return max(MOST_BYTES, memory_bytes()[1] // 3)


def orbit_slice_bytes() -> int:
    """Memory limit of the slices of Orbit's layers: a 32nd of all memory, and no less than the engine's default."""
    from engine.realtime.triple_product.orbit_engine import MOST_SLICE_BYTES

    return max(MOST_SLICE_BYTES, memory_bytes()[1] // 32)


def resident_megabytes(*pids: int | None) -> float:
    """Memory that these processes hold in RAM, together, in MB; those that have ended hold none."""
    return sum(resident_bytes(pid) for pid in pids if pid is not None) / 1e6


def bytes_for(resolution: tuple[int, int]) -> int:
    """About the memory that a picture of (width, height) pixels needs."""
    return resolution[0] * resolution[1] * BYTES_A_PIXEL


def require_memory_for(resolution: tuple[int, int], mend: str = "give a smaller --resolution") -> None:
    """Raise InsituError when a picture of (width, height) pixels would need more memory than there is; mend: what to
    do."""
    needed, (free, _) = bytes_for(resolution), memory_bytes()
    if needed > free:
        size = f"{resolution[0]} x {resolution[1]} pixels"
        raise InsituError(f"{size} need about {gib(needed)}, {gib(free)} are free; {mend}")


def gib(n_bytes: int) -> str:
    """A size in GiB or MiB."""
    return f"{n_bytes / 2**30:.1f} GiB" if n_bytes >= 1 << 30 else f"{n_bytes / 2**20:.0f} MiB"
