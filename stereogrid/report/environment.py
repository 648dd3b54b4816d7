"""On what a run ran, and when."""

import os
import platform
from datetime import datetime
from pathlib import Path

from ..runs import begun
from ..versions import package_version

PACKAGES = (
    *("stereogrid", "numpy", "scipy", "numba", "opencv-python-headless", "trimesh", "embreex", "pybullet"),
    "onnxruntime",
)


def environment() -> dict[str, str]:
    """Versions of what the numbers depend on, and the kind of machine."""
    versions = {name: package_version(name) for name in PACKAGES}
    return {
        "versions": ", ".join(f"{name} {version}" for name, version in versions.items() if version),
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores",
    }


def times(folder: Path) -> dict[str, str]:
    """When the run of this folder began, as its name says, and how long it took up to now; else the date of now."""
    now, start = datetime.now(), begun(folder)
    if start is None:
        return {"date": f"{now:%Y-%m-%d %H:%M}"}
    return {"date": f"{start:%Y-%m-%d %H:%M:%S}", "duration": duration_text((now - start).total_seconds())}


def duration_text(seconds: float) -> str:
    """A duration as a person says it."""
    whole = round(seconds)
    if whole < 120:
        return f"{whole} s"
    return f"{whole // 60} min {whole % 60} s" if whole < 7200 else f"{whole // 3600} h {whole % 3600 // 60} min"
