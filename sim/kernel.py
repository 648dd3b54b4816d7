"""How the kernels of the renderer and of the tyres are compiled: cached, and free of the interpreter's lock."""

from collections.abc import Callable
from typing import Any, TypeVar

from numba import njit

_Function = TypeVar("_Function", bound=Callable[..., Any])

# No sum is reordered: results are the same on every run.
_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "fastmath": {"contract", "arcp", "nsz"}}


def kernel(function: _Function) -> _Function:
    """Compile a function of arrays and numbers, once a machine."""
    compiled: _Function = njit(cache=True, **_OPTIONS)(function)
    return compiled


def inner(function: _Function) -> _Function:
    """Compile as a part of one kernel's innermost loop, where a call would cost a third of the time."""
    compiled: _Function = njit(inline="always", **_OPTIONS)(function)
    return compiled
