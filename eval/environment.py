"""What a measurement ran on, so that it can be made again."""

from __future__ import annotations

import json
import os
import platform
import re
import sys
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from tracker.whole_file import write_whole

CPUINFO = Path("/proc/cpuinfo")
PACKAGES = ("conceptrack", "torch", "numpy", "scipy", "open3d", "opencv-python-headless", "small_gicp", "filterpy")


def package_versions() -> dict[str, str]:
    """Of the packages that numbers come out of."""
    versions = {}
    for package in PACKAGES:
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            versions[package] = "not installed as a package"
    return versions


def processor() -> str:
    """Its name, or its architecture where the system tells no name, and how many of its cores this process may use."""
    name = platform.processor() or platform.machine()
    if CPUINFO.is_file():  # Linux, where Python tells the architecture alone
        named = re.search(r"^model name\s*:\s*(.+)$", CPUINFO.read_text(), re.MULTILINE)
        name = named[1] if named else name
    cores = len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count()
    return f"{name}, {cores} cores"


def environment() -> dict[str, str]:
    """Machine and versions."""
    machine = f"{platform.system()} {platform.machine()}"
    return {
        "python": platform.python_version(), "machine": machine, "processor": processor(), **package_versions(),
    }  # fmt: skip


def write_figures(path: Path, figures: Mapping[str, object]) -> None:
    """Figures of a measurement as JSON, with what it ran on; whole or not at all. Raises OutputError."""
    write_whole(path, json.dumps({**figures, "environment": environment()}, indent=1, allow_nan=False) + "\n")
