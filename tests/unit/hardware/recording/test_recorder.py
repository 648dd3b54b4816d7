"""A recorder takes all that comes at once; what the disk does is its own affair, and told."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from recorded_rig import CAMERA, RIG, pair, report

from hardware.clock import to_epoch_s
from hardware.recording import RawRecorder
from hardware.recording import recorder as recorder_module
from stereogrid.errors import InvalidInputError, RecordingError
from stereogrid.recording import RawMcapRecording, open_recording

ROOT = Path(__file__).parents[4]
PAIR_BYTES = 2 * CAMERA.width_px * CAMERA.height_px


def record(recorder: RawRecorder, seconds: int) -> None:
    """So much of a drive, as fast as it goes."""
    for k in range(10 * seconds):
        recorder.write_report(report(k))
        for n in range(3 * k, 3 * k + 3):
            recorder.write_pair(pair(n))


def test_all_that_was_taken_is_in_the_file_with_its_own_stamps(tmp_path: Path) -> None:
    with RawRecorder(tmp_path / "a.mcap", RIG, metadata={"command": "test"}) as recorder:
        record(recorder, 2)
    counts = recorder.counts
    assert (counts.pairs, counts.reports, counts.dropped_pairs, counts.dropped_reports) == (60, 20, 0, 0)
    assert counts.n_bytes == (tmp_path / "a.mcap").stat().st_size and recorder.problem() == ""
    recording = open_recording(tmp_path / "a.mcap")
    assert isinstance(recording, RawMcapRecording) and recording.is_complete
    assert recording.metadata["command"] == "test"
    # The last three pairs come after the last report.
    assert len(recording) == 57 and recording.left_out == {"pairs where the odometry does not reach": 3}
    for k, each in enumerate(recording):
        np.testing.assert_array_equal(each.left, pair(k).left)
        np.testing.assert_array_equal(each.right, pair(k).right)
        assert each.stamp_s == pytest.approx(to_epoch_s(pair(k).stamp_s), abs=1e-6)
        assert each.odometry.travelled_m == pytest.approx(0.2 * (0.012 + k / 30), abs=1e-6)


def messages(path: Path, topic: str) -> list[Any]:
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        return [message for *_, message in reader.iter_decoded_messages([topic])]


def test_bumpers_faults_and_lost_odometry_are_kept(tmp_path: Path) -> None:
    with RawRecorder(tmp_path / "a.mcap", RIG) as recorder:
        recorder.write_report(report(0))
        recorder.write_report(report(1, front_bumpers=0b00101, stalled=(True, False), fault="front bumper 1, 3"))
        recorder.write_report(report(2, odometry_lost=1, e_stopped=True))
        recorder.write_pair(pair(0))
    good, bumped, lost = (message.status[0] for message in messages(tmp_path / "a.mcap", "/diagnostics"))
    assert (good.level, good.message) == (0, "") and (bumped.level, bumped.message) == (2, "front bumper 1, 3")
    values = {each.key: each.value for each in bumped.values}
    assert values["front bumpers"] == "1 3" and values["rear bumpers"] == "" and values["stalled"] == "left"
    assert {each.key: each.value for each in lost.values}["odometry lost"] == "1"
    odometry = messages(tmp_path / "a.mcap", "/odom")
    assert [each.header.frame_id for each in odometry] == ["odom", "odom", "odom_1"]
    recording = RawMcapRecording(tmp_path / "a.mcap")
    assert recording.metadata["odometry lost 1"].startswith("before the report at ")


def test_a_recorder_killed_while_it_writes_leaves_all_that_it_had_written(tmp_path: Path) -> None:
    path = tmp_path / "killed.mcap"
    with running("endless", path) as run:
        told = next(said(run, lambda words: int(words[0]) >= 40))
        os.kill(run.pid, signal.SIGKILL)
    recording = RawMcapRecording(path)
    assert not recording.is_complete
    n_pairs, n_reports = map(int, told[:2])
    assert len(recording) + sum(recording.left_out.values()) >= n_pairs
    assert len(recording) > n_pairs - 8 and n_reports > 10
    assert [each.left[0, 0] for each in recording] == [k % 256 for k in range(len(recording))]


def test_a_full_disk_ends_the_recording_tells_why_and_stops_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "full.mcap"
    with running("full", path) as run:
        told = next(said(run, lambda words: words[0] == "end"))
        assert run.wait(20) == 0
    reason, size = " ".join(told[4:]), path.stat().st_size
    assert reason == f"{path}: cannot be written: File too large"
    recording = RawMcapRecording(path)
    n_pairs, dropped, asked = map(int, told[1:4])
    assert 3 < n_pairs < asked and n_pairs + dropped == asked
    assert len(recording) + sum(recording.left_out.values()) == n_pairs and len(recording) > n_pairs - 5
    assert [each.left[0, 0] for each in recording] == list(range(len(recording)))
    # What did not fit was cut off again: the file ends with a whole message.
    assert size <= 400_000 and recording.damage is not None and f"byte {size}" in recording.damage


def test_a_disk_that_is_full_from_the_start_is_one_error() -> None:
    with pytest.raises(RecordingError, match="/dev/full: cannot be written: No space left on device"):
        RawRecorder("/dev/full", RIG, overwrite=True)


def test_a_disk_without_room_for_a_beginning_keeps_no_empty_file(tmp_path: Path) -> None:
    with running("no room", tmp_path / "a.mcap") as run:
        told = next(said(run, lambda words: words[0] == "refused"))
        assert run.wait(20) == 0
    assert " ".join(told[1:]) == f"{tmp_path / 'a.mcap'}: cannot be written: File too large"
    assert not (tmp_path / "a.mcap").exists()


def test_a_power_cut_takes_two_seconds_of_a_recording_for_its_own_thread_has_the_disk_keep_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[tuple[str, int]] = []
    fsync = os.fsync

    def watched(file: int) -> None:
        fsync(file)
        synced.append((threading.current_thread().name, os.fstat(file).st_size))

    monkeypatch.setattr(os, "fsync", watched)
    monkeypatch.setattr(recorder_module, "SYNC_EVERY_S", 0.2)
    with RawRecorder(tmp_path / "a.mcap", RIG) as recorder:
        start_s = time.monotonic()
        while len(synced) < 3 and time.monotonic() < start_s + 20:
            recorder.write_pair(pair(0))
            time.sleep(0.02)
        assert len(synced) == 3 and time.monotonic() - start_s >= 0.6, "once in a while, not with each message"
    assert {name for name, _ in synced} == {"recorder"}
    assert len(synced) >= 4, "its end is kept too"
    sizes = [size for _, size in synced]
    assert sizes == sorted(sizes) and sizes[0] > 1000


def test_a_disk_that_takes_long_to_keep_things_costs_pictures_and_no_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    go_on, entered = threading.Event(), threading.Event()
    monkeypatch.setattr(os, "fsync", lambda _: (entered.set(), go_on.wait(30)))
    monkeypatch.setattr(recorder_module, "SYNC_EVERY_S", 0.0)
    recorder = RawRecorder(tmp_path / "a.mcap", RIG, pairs_bytes=5 * PAIR_BYTES)
    recorder.write_pair(pair(0))
    assert entered.wait(20)
    start_s = time.monotonic()
    for k in range(1, 31):
        recorder.write_pair(pair(k))
        recorder.write_report(report(k))
    assert time.monotonic() - start_s < 1.0, "who gives pictures to the recorder waits for the disk"
    assert recorder.counts.dropped_pairs == 25 and recorder.counts.dropped_reports == 0
    go_on.set()
    recorder.close()
    assert recorder.problem() == "" and recorder.counts.pairs == 6


@contextmanager
def slow_disk(path: Path, go_on: threading.Event) -> Iterator[list[bytes]]:
    """A file whose writer waits, after its first bytes, until it may go on: a pipe. What is written to it."""
    os.mkfifo(path)
    taken: list[bytes] = []

    def take() -> None:
        with path.open("rb", buffering=0) as file:
            taken.append(file.read(50_000))
            go_on.wait()
            while data := file.read(1 << 20):
                taken.append(data)

    reader = threading.Thread(target=take)
    reader.start()
    try:
        yield taken
    finally:
        go_on.set()
        reader.join()


def test_where_the_disk_is_too_slow_pictures_are_dropped_before_reports_and_nobody_waits(tmp_path: Path) -> None:
    go_on = threading.Event()
    with slow_disk(tmp_path / "slow", go_on) as taken:
        recorder = RawRecorder(tmp_path / "slow", RIG, pairs_bytes=20 * PAIR_BYTES, overwrite=True)
        pairs, reports = [pair(k) for k in range(90)], [report(k) for k in range(30)]
        start_s = time.monotonic()
        for k, each in enumerate(reports):
            recorder.write_report(each)
            for one in pairs[3 * k : 3 * k + 3]:
                recorder.write_pair(one)
        assert time.monotonic() - start_s < 1.0, "who gives pictures to the recorder waits for the disk"
        counts = recorder.counts
        assert counts.dropped_pairs >= 60 and counts.dropped_reports == 0 and recorder.problem() == ""
        go_on.set()
        recorder.close()
        assert recorder.problem() == ""
    counts = recorder.counts
    assert counts.reports == 30 and counts.pairs + counts.dropped_pairs == 90 and counts.dropped_reports == 0
    (tmp_path / "a.mcap").write_bytes(b"".join(taken))
    recording = RawMcapRecording(tmp_path / "a.mcap")
    assert recording.is_complete and len(recording) == counts.pairs


def test_closing_does_not_wait_for_a_disk_that_takes_nothing(tmp_path: Path) -> None:
    with slow_disk(tmp_path / "slow", threading.Event()):
        recorder = RawRecorder(tmp_path / "slow", RIG, overwrite=True)
        record(recorder, 1)
        start_s = time.monotonic()
        recorder.close(timeout_s=0.3)
        assert time.monotonic() - start_s < 3.0, "close must return 1.3 s after it was called"
        assert "the disk took nothing for 1.3 s" in recorder.problem()
        counts = recorder.counts
        assert counts.pairs + counts.dropped_pairs == 30 and counts.reports + counts.dropped_reports == 10
        recorder.close(timeout_s=0.0)


def test_a_disk_too_slow_for_the_end_of_the_drive_still_gets_whole_messages(tmp_path: Path) -> None:
    go_on = threading.Event()
    with slow_disk(tmp_path / "slow", go_on) as taken:
        recorder = RawRecorder(tmp_path / "slow", RIG, overwrite=True)
        record(recorder, 1)
        threading.Timer(0.5, go_on.set).start()
        recorder.close(timeout_s=0.2)
        assert "too slow for the end of the drive" in recorder.problem()
    (tmp_path / "a.mcap").write_bytes(b"".join(taken))
    recording = RawMcapRecording(tmp_path / "a.mcap", standing=True)
    counts = recorder.counts
    assert recording.is_complete and 0 < counts.pairs < 30 and counts.pairs + counts.dropped_pairs == 30
    assert len(recording) == counts.pairs
    assert recording.metadata["dropped"] == f"{counts.dropped_pairs} pairs, {counts.dropped_reports} reports"


def test_what_comes_after_the_end_is_dropped_and_counted(tmp_path: Path) -> None:
    recorder = RawRecorder(tmp_path / "a.mcap", RIG)
    recorder.close()
    recorder.write_pair(pair(0))
    recorder.write_report(report(0))
    recorder.close()
    assert recorder.counts.dropped_pairs == recorder.counts.dropped_reports == 1


def test_a_pair_of_another_size_ends_the_recording_and_says_so(tmp_path: Path) -> None:
    good, other = pair(0), pair(1)
    with RawRecorder(tmp_path / "a.mcap", RIG) as recorder:
        recorder.write_pair(good)
        recorder.write_pair(type(other)(other.left[:60], other.right[:60], other.left_stamp_s, other.right_stamp_s))
    assert recorder.problem() == "the pictures are of (160, 60) px, the calibration of (160, 120)"
    assert (recorder.counts.pairs, recorder.counts.dropped_pairs) == (1, 1)


def test_a_file_that_exists_stays_and_bounds_are_checked(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_text("mine")
    with pytest.raises(RecordingError, match=r"a\.mcap: exists already"):
        RawRecorder(tmp_path / "a.mcap", RIG)
    assert (tmp_path / "a.mcap").read_text() == "mine"
    with pytest.raises(InvalidInputError, match="pairs_bytes"):
        RawRecorder(tmp_path / "b.mcap", RIG, pairs_bytes=0)
    assert not (tmp_path / "b.mcap").exists()


SCRIPT = """
import itertools, resource, sys, time
from recorded_rig import RIG, pair, report
from hardware.recording import RawRecorder
from stereogrid.errors import RecordingError
what, path = sys.argv[1:]
before = resource.getrlimit(resource.RLIMIT_FSIZE)
limit = {"no room": 100, "full": 400_000}.get(what, before[0])
resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
try:
    recorder = RawRecorder(path, RIG)
except RecordingError as error:
    sys.exit(print("refused", error))
with recorder:
    for k in itertools.count() if what == "endless" else range(30):
        recorder.write_report(report(k))
        for n in range(3 * k, 3 * k + 3):
            recorder.write_pair(pair(n))
        time.sleep(0.01)
        if what == "endless":
            print(recorder.counts.pairs, recorder.counts.reports, flush=True)
counts = recorder.counts
print("end", counts.pairs, counts.dropped_pairs, 90, recorder.problem(), flush=True)
"""


@contextmanager
def running(what: str, path: Path) -> Iterator["subprocess.Popen[str]"]:
    environment = {**os.environ, "PYTHONPATH": f"{ROOT}:{ROOT / 'tests' / 'helpers'}"}
    command = [sys.executable, "-c", SCRIPT, what, str(path)]
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as run:
        try:
            yield run
        finally:
            with suppress(ProcessLookupError):
                run.kill()


def said(run: "subprocess.Popen[str]", wanted: Callable[[list[str]], bool]) -> Iterator[list[str]]:
    """The lines that a process prints, as words, from the first one wanted on."""
    assert run.stdout is not None
    for line in run.stdout:
        if wanted(line.split()):
            yield line.split()
    pytest.fail("it ended before it said so")
