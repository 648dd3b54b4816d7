"""Jobs side by side: all their results, or the first exception and soon."""

import threading
import time
from concurrent.futures import CancelledError

import pytest

from experiments.parallel import in_parallel, until
from stereogrid.mapping_run import untracked


def test_results_stand_under_the_names_of_their_jobs_in_their_order():
    jobs = {("b", 1): lambda: time.sleep(0.05) or "slow", ("a", 2): lambda: "quick"}
    done = []
    assert list(in_parallel(jobs, lambda: done.append(1)).items()) == [(("b", 1), "slow"), (("a", 2), "quick")]
    assert len(done) == 2


def test_items_pass_until_stop_is_set():
    stop = threading.Event()
    seen = []
    with pytest.raises(CancelledError):
        for item in until(stop, untracked)(range(10), "", 10):
            seen.append(item)
            if item == 3:
                stop.set()
    assert seen == [0, 1, 2, 3]


def test_an_exception_ends_the_other_jobs_at_their_next_item():
    stop, begun = threading.Event(), threading.Event()
    seen = []

    def long():
        for item in until(stop, untracked)(range(1000), "", 1000):
            seen.append(item)
            begun.set()
            time.sleep(0.01)

    def failing():
        begun.wait()
        raise KeyboardInterrupt

    start = time.perf_counter()
    with pytest.raises(KeyboardInterrupt):
        in_parallel({"long": long, "failing": failing, "never": long}, stop=stop)
    assert time.perf_counter() - start < 5
    assert 0 < len(seen) < 500
