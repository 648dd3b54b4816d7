"""Whether this computer can run stereogrid, and what to do where it cannot."""

import importlib
import importlib.util
import locale
import os
import shutil
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from .checks import NOT_THERE, OK, PROBLEM, WARNING, Check
from .kernel_cache import PREFIX
from .versions import package_version

NEWEST_TRIED = (3, 13)
REQUIRED = {
    "numpy": "numpy",
    "scipy": "scipy",
    "numba": "numba",
    "cv2": "opencv-python-headless",
    "matplotlib": "matplotlib",
    "trimesh": "trimesh",
    "mcap": "mcap",
    "rosbags": "rosbags",
}
EXTRAS = {
    "score": (("embreex",), "scores against a true mesh"),
    "sim": (("pybullet", "PIL"), "the simulator, in a clone"),
    "view": (("viser",), "maps in the browser"),
    "onnx": (("onnxruntime",), "learned matchers"),
    "hardware": (("serial",), "the real robot, in a clone"),
    "sweep": (("distributed", "pyarrow"), "sweeps over parameters, in a clone"),
}
NO_PYBULLET = (3, 12)
"""From this Python on there is no binary wheel of pybullet."""
OPENCVS = ("opencv-python", "opencv-python-headless", "opencv-contrib-python", "opencv-contrib-python-headless")
LITTLE_MEMORY_GB, LITTLE_DISK_GB = 2.0, 1.0
CHAIN = "images to map"
DISPARITY_PX, SIZE_PX = 12, (160, 120)


def examine(runs: Path) -> Iterator[Check]:
    """One check after the other; runs: where results will be written."""
    yield check_python(sys.version_info[:2])
    packages = [check_package(module, package) for module, package in REQUIRED.items()]
    yield from packages
    yield check_opencv(_versions(OPENCVS))
    for extra in EXTRAS:
        yield check_extra(extra)
    yield whatever_comes("processor", check_processor)
    yield check_memory(_memory_gb())
    yield whatever_comes("results", lambda: check_folder(runs))
    yield whatever_comes("compiled kernels", check_kernel_cache)
    yield check_terminal(locale.getpreferredencoding(False))
    broken = [each.name for each in packages if each.state == PROBLEM]
    if broken:
        names = " ".join(broken)
        yield Check(CHAIN, PROBLEM, f"not tried without {names}", f"pip install --force-reinstall {names}")
    else:
        yield whatever_comes(CHAIN, check_chain)


def whatever_comes(name: str, check: Callable[[], Check]) -> Check:
    """A check of this name; a problem where it ends with an exception: what is looked for may be broken in any way."""
    try:
        return check()
    except Exception as error:
        return Check(name, PROBLEM, f"ended with {_told(error)}", "pip install --force-reinstall stereogrid")


def check_python(version: tuple[int, int]) -> Check:
    """The interpreter."""
    found = f"{version[0]}.{version[1]} in {sys.prefix}"
    if version <= NEWEST_TRIED:
        return Check("python", OK, found)
    tried = ".".join(map(str, NEWEST_TRIED))
    return Check("python", WARNING, f"{found}: newer than what was tried", f"use Python 3.10 to {tried}")


def check_package(module: str, package: str) -> Check:
    """A package that every command needs, by importing it."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            importlib.import_module(module)
    except Exception as error:  # whatever a broken installation raises
        return Check(
            package, PROBLEM, f"cannot be imported: {_told(error)}", f"pip install --force-reinstall {package}"
        )
    return Check(package, OK, _versions([package]).get(package, "installed"))


def check_opencv(installed: dict[str, str]) -> Check:
    """Several packages bring the module cv2, and the files of one overwrite another's."""
    if len(installed) == 1:
        return Check("one OpenCV", OK, " ".join(next(iter(installed.items()))))
    return Check(
        "one OpenCV",
        WARNING,
        f"{len(installed)} packages bring cv2: {', '.join(installed) or 'none of those that are known'}",
        f"pip uninstall {' '.join(installed)} && pip install opencv-python-headless",
    )


def check_extra(extra: str) -> Check:
    """What some commands need."""
    modules, purpose = EXTRAS[extra]
    name = f"extra {extra}"
    missing = [module for module in modules if not _can_import(module)]
    if not missing:
        return Check(name, OK, f"installed, for {purpose}")
    if "pybullet" in missing and sys.version_info[:2] >= NO_PYBULLET:
        return Check(name, NOT_THERE, f"for {purpose}: pybullet has no wheels for this Python", "Python 3.10 or 3.11")
    return Check(name, NOT_THERE, f"for {purpose}: lacks {', '.join(missing)}", f'pip install "stereogrid[{extra}]"')


def check_processor() -> Check:
    """How many cores may be used, and how many threads Numba will start."""
    from numba import get_num_threads

    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return Check("processor", OK, f"{usable} cores, {get_num_threads()} threads a kernel", values={"cores": usable})


def check_memory(total_gb: float | None) -> Check:
    """Of the machine."""
    if total_gb is None:
        return Check("memory", OK, "not told by this system")
    found, values = f"{total_gb:.1f} GB", {"gb": total_gb}
    if total_gb >= LITTLE_MEMORY_GB:
        return Check("memory", OK, found, values=values)
    return Check("memory", WARNING, found, "larger cells (--cell), or a lower [grid] memory_limit_gb", values)


def check_folder(folder: Path) -> Check:
    """Room for results, and leave to write them."""
    near = next(place for place in (folder.absolute(), *folder.absolute().parents) if place.exists())
    try:
        with tempfile.NamedTemporaryFile(dir=near):
            free_gb = shutil.disk_usage(near).free / 1e9
    except OSError as error:
        return Check(
            "results", PROBLEM, f"{near}: cannot be written ({error.strerror})", "choose another folder: --runs"
        )
    found = f"{free_gb:.1f} GB free in {near}"
    if free_gb >= LITTLE_DISK_GB:
        return Check("results", OK, found)
    return Check("results", WARNING, found, "delete old runs, or choose another folder: --runs")


def check_kernel_cache() -> Check:
    """Where Numba keeps compiled kernels: without a place they are compiled in every run."""
    from .grid import walk

    kernel = next(value for value in vars(walk).values() if hasattr(value, "_cache"))
    try:
        place = Path(kernel._cache.cache_path)
        if any(each.name.startswith(PREFIX) for each in place.parents):
            raise OSError("neither this installation nor the home can be written")
        place.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=place):
            return Check("compiled kernels", OK, f"kept in {place}; the first run of a command compiles, half a minute")
    except (OSError, AttributeError) as error:
        return Check(
            "compiled kernels",
            WARNING,
            f"cannot be kept: {error}; every run compiles them anew",
            "set NUMBA_CACHE_DIR to a folder that can be written",
        )


def check_terminal(encoding: str) -> Check:
    """Whether the terminal shows every letter."""
    if encoding.lower().replace("-", "") == "utf8":
        return Check("terminal", OK, encoding)
    return Check("terminal", WARNING, f"{encoding}: names in other letters may fail", "export PYTHONUTF8=1")


def check_chain() -> Check:
    """From two images to a map: a wall of random dots must stand where it is."""
    import numpy as np

    from .camera import StereoCamera
    from .geometry import R_BASE_OPTICAL, from_rotation
    from .grid import OccupancyGrid
    from .matching import matcher

    width, height = SIZE_PX
    camera = StereoCamera(100.0, (width - 1) / 2, (height - 1) / 2, 0.12, width, height)
    dots = np.random.default_rng(0).integers(0, 256, (height, width + DISPARITY_PX), dtype=np.uint8)
    left, right = dots[:, :width], dots[:, DISPARITY_PX:]
    grid, find = OccupancyGrid(cell_m=0.05), matcher("bm", num_disparities=32)
    T_world_cam = from_rotation(R_BASE_OPTICAL, [0.0, 0.0, 1.0])
    for _ in range(2):  # the first time compiles
        start_s = time.perf_counter()
        disparity = find.match(left, right)
        grid.integrate(camera, disparity, T_world_cam)
        took_ms = 1e3 * (time.perf_counter() - start_s)
    wall_m = float(camera.depth_m(DISPARITY_PX))
    nearest_m = grid.first_hit([[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]], max_range_m=5.0).range_m[0]
    found = f"a wall {wall_m:.2f} m away stands at {nearest_m:.2f} m in the map; {took_ms:.0f} ms a pair"
    if abs(nearest_m - wall_m) < 2 * grid.cell_m:
        return Check(CHAIN, OK, found, values={"ms": took_ms})
    return Check(CHAIN, PROBLEM, found, "pip install --force-reinstall stereogrid", {"ms": took_ms})


def _told(error: Exception) -> str:
    """On one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())


def _can_import(module: str) -> bool:
    try:
        return importlib.util.find_spec(module) is not None
    except (ImportError, ValueError):
        return False


def _versions(packages: Iterable[str]) -> dict[str, str]:
    """Of those that are installed."""
    versions = {package: package_version(package) for package in packages}
    return {package: version for package, version in versions.items() if version}


def _memory_gb() -> float | None:
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9
    except (ValueError, OSError, AttributeError):
        return None
