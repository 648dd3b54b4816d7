"""What all the tests share: reproducible property tests, and the real data that some of them need."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import settings

# The same examples on every run; and a slow, shared machine is no failure.
settings.register_profile("stereogrid", deadline=None, derandomize=True)
settings.load_profile("stereogrid")


@pytest.fixture(scope="session")
def real_data() -> Callable[[str], Path]:
    """real_data("stereo/teddy"): that folder of the real data; skips the test, naming it, where it is missing."""

    def folder(name: str) -> Path:
        root = os.environ.get("STEREOGRID_DATA")
        if not root:
            pytest.skip(f"needs the data set {name}: set STEREOGRID_DATA to shared/data")
        path = Path(root) / name
        if not path.is_dir():
            pytest.skip(f"needs the data set {name}, which is not in STEREOGRID_DATA={root}")
        return path

    return folder
