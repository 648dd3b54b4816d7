"""Disparity from a rectified pair. Each matcher is one file; MATCHERS is the whole list."""

import inspect
from collections.abc import Callable
from typing import Any

from ..errors import InvalidInputError, StereogridError, unknown_name
from ..observation import Matcher
from .block import BlockMatcher
from .graphcut import GraphCutMatcher
from .kz2 import KolmogorovZabihMatcher
from .onnx import OnnxMatcher
from .semiglobal import SemiGlobalMatcher

MATCHERS: dict[str, Callable[..., Matcher]] = {
    "bm": BlockMatcher,
    "gc": GraphCutMatcher,
    "kz2": KolmogorovZabihMatcher,
    "onnx": OnnxMatcher,
    "sgbm": SemiGlobalMatcher,
}


def matcher(name: str, **options: Any) -> Matcher:
    """The matcher called name, e.g. matcher("bm", num_disparities=64). Unknown names and options are refused."""
    if name not in MATCHERS:
        raise unknown_name("matcher", name, MATCHERS)
    known = inspect.signature(MATCHERS[name]).parameters
    for option in options:
        if option not in known:
            raise InvalidInputError(f"matcher {name!r} has no option {option!r}; choose from: {', '.join(known)}")
    try:
        return MATCHERS[name](**options)
    except StereogridError:
        raise
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidInputError(f"matcher {name!r} cannot be made with {options}: {error}") from error


__all__ = [
    "MATCHERS",
    "BlockMatcher",
    "GraphCutMatcher",
    "KolmogorovZabihMatcher",
    "OnnxMatcher",
    "SemiGlobalMatcher",
    "matcher",
]
