"""Whatever bytes come: an answer or one error of ours, soon, in little memory, and nothing else is touched.

A short seeded run; `make fuzz` runs each reader for minutes.
"""

import sys
import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from mutation import mutated
from target import RuleBrokenError, Target, Watch, attempt
from targets import TARGETS

N = 60


@pytest.fixture(scope="module")
def watch() -> Iterator[Watch]:
    yield Watch()
    # It slows whatever comes after.
    tracemalloc.stop()


@pytest.mark.parametrize("name", TARGETS)
def test_a_reader_answers_or_refuses_whatever_comes(name: str, tmp_path: Path, watch: Watch) -> None:
    target, rng = TARGETS[name], np.random.default_rng([0, *name.encode()])
    samples = target.samples(tmp_path)
    for sample in samples:
        target.read(sample, tmp_path)  # compiles and imports what is needed
        assert attempt(target, sample, tmp_path, watch)
    for _ in range(N):
        attempt(target, mutated(samples, rng), tmp_path, watch)


def test_a_reader_that_breaks_a_rule_is_caught(tmp_path: Path, watch: Watch) -> None:
    def elsewhere(data: bytes, folder: Path) -> None:
        Path("/etc/hostname").read_text()

    def large(data: bytes, folder: Path) -> None:
        bytearray(1 << 29)

    for read in (elsewhere, large):
        with pytest.raises(RuleBrokenError):
            attempt(Target(lambda _: [], read), b"", tmp_path, watch)
    with pytest.raises(ZeroDivisionError):
        attempt(Target(lambda _: [], lambda *_: 1 // 0), b"", tmp_path, watch)
