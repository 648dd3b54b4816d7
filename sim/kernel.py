"""How the kernels of the renderer and of the tyres are compiled: cached, and free of the interpreter's lock."""

from collections.abc import Callable
from typing import Any, TypeVar

from numba import njit

_Function = TypeVar("_Function", bound=Callable[..., Any])

# IEEE arithmetic throughout. Were products and sums allowed to contract, results would hang on what the compiler
# happens to inline, and the first run on a machine, which compiles, would differ from those that read its cache.
_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy"}


def kernel(function: _Function) -> _Function:
    """Compile a function of arrays and numbers, once a machine."""
    compiled: _Function = njit(cache=True, **_OPTIONS)(function)
    return compiled


def inner(function: _Function) -> _Function:
    """Compile as a part of one kernel's innermost loop, where a call would cost a third of the time."""
    compiled: _Function = njit(inline="always", **_OPTIONS)(function)
    return compiled
