"""On what machine, with what versions and under what load figures were measured."""

from __future__ import annotations

import importlib.metadata
import platform
import re
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import psutil

from app.system.memory import memory_bytes
from engine.core.threads import n_cores

PACKAGES = ("numpy", "scipy", "numba", "embreex", "OpenEXR", "moderngl", "glfw", "imgui-bundle")


def machine_facts() -> dict[str, Any]:
    """CPU, cores, memory, system, versions, date (UTC) and load as they are now."""
    return {
        "cpu": _first_match(Path("/proc/cpuinfo"), r"model name\s*:\s*(.+)") or platform.processor(),
        "cores": n_cores(),
        "ram_gib": round(memory_bytes()[1] / 2**30, 2),
        "system": platform.platform(),
        "python": platform.python_version(),
        "versions": {name: version for name in PACKAGES if (version := _version(name))},
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "load_average": load_average(),
    }


def load_average() -> list[float] | None:
    """Runnable processes over 1, 5 and 15 minutes; None where the system does not tell."""
    try:
        return list(psutil.getloadavg())
    except OSError:
        return None


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def _first_match(file: Path, pattern: str) -> str | None:
    try:
        found = re.search(pattern, file.read_text(encoding="utf-8", errors="replace"))
    except OSError:
        return None
    return found.group(1).strip() if found else None
