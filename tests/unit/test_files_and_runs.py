"""Files and run folders appear whole or not at all, and earlier results stay as they were."""

import errno
import stat
import threading
from datetime import datetime

import pytest

from stereogrid import runs
from stereogrid.errors import InvalidInputError
from stereogrid.files import check_writable, written_beside
from stereogrid.runs import check_runs, finished_path, run_folder

FAILURES = [ValueError, KeyboardInterrupt, SystemExit]


@pytest.fixture(autouse=True)
def stopped_clock(monkeypatch):
    """Every run of a test starts within one second."""

    class Clock(datetime):
        @classmethod
        def now(cls, tz=None):
            return cls(2024, 5, 6, 7, 8, 9)

    monkeypatch.setattr(runs, "datetime", Clock)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def write(path, text):
    with written_beside(path) as temporary:
        temporary.write_text(text)


def test_a_file_is_replaced_only_when_its_writer_is_done(tmp_path):
    path = tmp_path / "map.sgrid"
    path.write_text("old")
    with written_beside(path) as temporary:
        temporary.write_text("new")
        assert path.read_text() == "old"
        assert (temporary.parent, temporary.suffix) == (tmp_path, ".sgrid")
    assert path.read_text() == "new"
    assert names(tmp_path) == ["map.sgrid"]


@pytest.mark.parametrize("failure", FAILURES)
def test_a_writer_that_fails_leaves_the_old_file_and_nothing_else(tmp_path, failure):
    path = tmp_path / "map.sgrid"
    path.write_text("old")
    with pytest.raises(failure), written_beside(path) as temporary:
        temporary.write_text("half of the n")
        raise failure
    assert path.read_text() == "old"
    assert names(tmp_path) == ["map.sgrid"]


def test_a_file_can_be_read_by_others(tmp_path):
    write(tmp_path / "report.html", "x")
    assert stat.S_IMODE((tmp_path / "report.html").stat().st_mode) == 0o644


def test_a_file_cannot_be_written_into_a_folder_that_is_not_there(tmp_path):
    with pytest.raises(InvalidInputError, match=r"none: no such folder, so a\.toml cannot be written there"):
        write(tmp_path / "none" / "a.toml", "x")
    assert names(tmp_path) == []


def test_a_full_disk_is_one_line_that_names_the_file_and_the_old_one_stays(tmp_path):
    path = tmp_path / "map.sgrid"
    path.write_text("old")
    with pytest.raises(InvalidInputError, match=r"map\.sgrid: cannot be written \(No space left"), written_beside(path):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert path.read_text() == "old"
    assert names(tmp_path) == ["map.sgrid"]


def test_a_folder_is_not_replaced_by_a_file(tmp_path):
    (tmp_path / "map.sgrid").mkdir()
    with pytest.raises(InvalidInputError, match=r"map\.sgrid: cannot be written \(Is a directory\)"):
        write(tmp_path / "map.sgrid", "x")
    with pytest.raises(InvalidInputError, match=r"map\.sgrid: is a folder"):
        check_writable(tmp_path / "map.sgrid")
    assert names(tmp_path) == ["map.sgrid"]
    assert (tmp_path / "map.sgrid").is_dir()


def test_asking_whether_a_file_could_be_written_changes_nothing(tmp_path):
    path = tmp_path / "map.sgrid"
    check_writable(path)
    assert names(tmp_path) == []
    path.write_text("old")
    check_writable(path)
    assert path.read_text() == "old"
    assert names(tmp_path) == ["map.sgrid"]
    with pytest.raises(InvalidInputError, match="none: no such folder"):
        check_writable(tmp_path / "none" / "map.sgrid")


def run(root, name="corridor", text="done"):
    with run_folder(root, name) as folder:
        (folder / "metrics.json").write_text(text)
    return finished_path(folder)


def test_a_run_appears_whole_under_its_stamp_and_name(tmp_path):
    root = tmp_path / "deep" / "runs"
    with run_folder(root, "corridor") as folder:
        (folder / "metrics.json").write_text("{}")
        (folder / "figures").mkdir()
        assert [name for name in names(root) if not name.startswith(".")] == []
        promised = finished_path(folder)
    assert names(root) == ["20240506-070809-corridor", "latest"]
    assert promised == root / "20240506-070809-corridor"
    assert names(promised) == ["figures", "metrics.json"]


@pytest.mark.parametrize("failure", FAILURES)
def test_a_run_that_fails_leaves_nothing_and_the_earlier_run_stays(tmp_path, failure):
    earlier = run(tmp_path)
    before = names(tmp_path)
    with pytest.raises(failure), run_folder(tmp_path, "corridor") as folder:
        (folder / "map.sgrid").write_text("half")
        raise failure
    assert names(tmp_path) == before
    assert (tmp_path / "latest").resolve() == earlier.resolve()
    assert (earlier / "metrics.json").read_text() == "done"


def test_a_first_run_that_fails_leaves_no_latest(tmp_path):
    with pytest.raises(ValueError, match="no"), run_folder(tmp_path, "corridor"):
        raise ValueError("no")
    assert names(tmp_path) == []


def test_latest_points_at_the_newest_run_and_still_does_when_all_are_moved(tmp_path):
    run(tmp_path / "runs", text="first")
    run(tmp_path / "runs", text="second")
    latest = tmp_path / "runs" / "latest"
    assert latest.is_symlink()
    assert (latest / "metrics.json").read_text() == "second"
    (tmp_path / "runs").rename(tmp_path / "kept")
    assert (tmp_path / "kept" / "latest" / "metrics.json").read_text() == "second"


def test_a_latest_that_points_nowhere_is_put_right(tmp_path):
    (tmp_path / "latest").symlink_to("a run that was deleted")
    assert (tmp_path / "latest").resolve() != run(tmp_path)
    assert (tmp_path / "latest" / "metrics.json").read_text() == "done"


def test_two_runs_in_the_same_second_stand_side_by_side(tmp_path):
    with run_folder(tmp_path, "corridor") as outer:
        inner = run(tmp_path, text="inner")
        (outer / "metrics.json").write_text("outer")
    assert finished_path(outer) != inner
    assert (inner / "metrics.json").read_text() == "inner"
    assert (finished_path(outer) / "metrics.json").read_text() == "outer"
    assert len(names(tmp_path)) == 3


def test_many_runs_at_once_never_share_a_folder(tmp_path):
    at_once = threading.Barrier(8)
    finished = []

    def drive(n):
        at_once.wait()
        finished.extend((run(tmp_path, text=f"{n}-{i}"), f"{n}-{i}") for i in range(10))

    threads = [threading.Thread(target=drive, args=(n,)) for n in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(finished) == len({path for path, _ in finished}) == 80
    assert all((path / "metrics.json").read_text() == text for path, text in finished)
    assert len(names(tmp_path)) == 81


def test_asking_whether_results_could_be_written_leaves_nothing_but_their_folder(tmp_path):
    check_runs(tmp_path / "runs")
    assert list(tmp_path.rglob("*")) == [tmp_path / "runs"]
    (tmp_path / "file").touch()
    with pytest.raises(InvalidInputError, match="file/runs: results cannot be written there"):
        check_runs(tmp_path / "file" / "runs")


def test_results_that_cannot_be_written_are_refused_by_place(tmp_path):
    (tmp_path / "runs").write_text("a file, not a folder")
    with pytest.raises(InvalidInputError, match=r"runs: results cannot be written there \(File exists\)"):
        run(tmp_path / "runs")
    with pytest.raises(InvalidInputError, match=r"cannot be written there \(No such file"):
        run(tmp_path / "other", name="a/b")
