"""Digests tell files and results apart by what they hold, and by nothing else."""

import hashlib
import json
import os
import re
from pathlib import Path

import pytest

from stereogrid import digests
from stereogrid.digests import digest_of, results_of
from stereogrid.errors import RecordingError
from stereogrid.grid import OccupancyGrid


def sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def test_a_files_digest_is_that_of_sha256sum_and_a_folders_that_of_its_list(tmp_path):
    (tmp_path / "b").mkdir()
    (tmp_path / "a.txt").write_bytes(b"one")
    (tmp_path / "b" / "c.txt").write_bytes(b"two")
    assert digest_of(tmp_path / "a.txt") == sha256(b"one")
    lines = f"{sha256(b'one')}  a.txt\n{sha256(b'two')}  b/c.txt\n"
    assert digest_of(tmp_path) == sha256(lines.encode())


def test_run_folders_hidden_files_and_times_are_no_part_of_a_folder(tmp_path):
    (tmp_path / "a.txt").write_bytes(b"one")
    before = digest_of(tmp_path)
    (tmp_path / "runs" / "1-map").mkdir(parents=True)
    (tmp_path / "runs" / "1-map" / "run.toml").write_text("")
    (tmp_path / "runs" / "latest").symlink_to("1-map")
    (tmp_path / ".hidden").write_text("x")
    os.utime(tmp_path / "a.txt", (0, 0))
    assert digest_of(tmp_path) == before
    (tmp_path / "a.txt").rename(tmp_path / "other.txt")
    assert digest_of(tmp_path) != before


def test_of_a_large_file_every_nth_block_and_the_size_count(tmp_path, monkeypatch):
    monkeypatch.setattr(digests, "WHOLE_BYTES", 40)
    monkeypatch.setattr(digests, "BLOCK_BYTES", 10)
    path = tmp_path / "large"
    content = bytearray(range(100))
    found = {}
    for changed in (None, 0, 9, 10, 29, 30, 39, 95):
        varied = bytearray(content)
        if changed is not None:
            varied[changed] ^= 255
        path.write_bytes(varied)
        found[changed] = digest_of(path)
    same = {at for at, digest in found.items() if digest == found[None]}
    assert same == {None, 10, 29}  # blocks 1, 2, 4, 5, 7, 8 of ten are not read
    path.write_bytes(content + b"x")
    assert digest_of(path) != found[None]


def test_what_is_not_there_is_named(tmp_path):
    with pytest.raises(RecordingError, match=r"none: cannot be read \(No such file or directory\)"):
        digest_of(tmp_path / "none")


METRICS = {
    "facts": {"command": "python -m experiments corridor", "recording": "/a/b.mcap"},
    "command": "stereogrid map a",
    "arms": {"ideal": {"auc": {"value": 0.9, "unit": "1", "n": 3}, "time": {"value": 1.2, "unit": "s", "n": 1}}},
}


def written(folder, metrics=METRICS, table="score,value,unit\nauc,.9,1\ntime,1.2,s\n", p=0.9):
    folder.mkdir()
    (folder / "metrics.json").write_text(json.dumps(metrics))
    (folder / "scores.csv").write_text(table)
    OccupancyGrid.from_cells(0.1, [[1, 2, 3]], [p]).save(folder / "map.sgrid")
    return results_of(folder)


def test_results_are_maps_and_numbers_without_times_commands_and_places(tmp_path):
    results = written(tmp_path / "a")
    assert list(results) == ["map.sgrid", "metrics.json", "scores.csv"]
    assert results["map.sgrid"] == OccupancyGrid.load(tmp_path / "a" / "map.sgrid").sha256()
    scores = {"ideal": {"auc": METRICS["arms"]["ideal"]["auc"], "time": {"value": 9.0, "unit": "s", "n": 1}}}
    later = {"facts": {"command": "another"}, "command": "stereogrid map b", "arms": scores}
    table = "score,value,unit\nauc,.9,1\ntime,3.4,s\n"
    assert written(tmp_path / "b", later, table) == results


def test_any_other_number_makes_another_result(tmp_path):
    results = written(tmp_path / "a")
    scores = {"ideal": {"auc": {"value": 0.91, "unit": "1", "n": 3}}}
    other = written(tmp_path / "b", {"arms": scores}, "score,value,unit\nauc,.91,1\n", p=0.8)
    assert all(other[name] != results[name] for name in results)


def test_no_program_makes_a_run_folder_that_does_not_tell_what_made_it():
    root = Path(digests.__file__).parents[1]
    sources = [
        path for folder in ("stereogrid", "experiments", "hardware", "sim") for path in (root / folder).rglob("*.py")
    ]
    making = {path.name for path in sources if re.search(r"\brun_folder\(", path.read_text(encoding="utf-8"))}
    assert making == {"runs.py", "recorded_run.py"}


def test_what_is_linked_is_part_of_a_folder_and_links_that_lead_back_end(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "a.txt").write_bytes(b"one")
    drive = tmp_path / "drive"
    drive.mkdir()
    (drive / "b.txt").write_bytes(b"two")
    (drive / "images").symlink_to(tmp_path / "elsewhere")
    (drive / "again").symlink_to(drive)
    (tmp_path / "elsewhere" / "back").symlink_to(drive)
    lines = f"{sha256(b'two')}  b.txt\n{sha256(b'one')}  images/a.txt\n"
    assert digest_of(drive) == sha256(lines.encode())
