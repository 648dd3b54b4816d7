"""What every format obeys."""

import inspect
import subprocess
import sys

import pytest

import stereogrid as sg
from stereogrid.errors import InvalidInputError
from stereogrid.exporting import EXPORTS

from .maps import random_map

SUFFIXES = list(EXPORTS)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_the_same_map_is_exported_as_the_same_bytes_and_nothing_else_is_left(tmp_path, suffix):
    for folder in ("first", "second"):
        (tmp_path / folder).mkdir()
        path = sg.export(random_map(1), tmp_path / folder / f"map{suffix}")
        assert path == tmp_path / folder / f"map{suffix}"
    first, second = (
        {each.name: each.read_bytes() for each in (tmp_path / folder).iterdir()} for folder in ("first", "second")
    )
    assert first == second
    assert set(first) == ({"map.pgm", "map.yaml"} if suffix in (".pgm", ".yaml") else {f"map{suffix}"})


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_an_export_is_put_in_the_place_of_an_earlier_file(tmp_path, suffix):
    path = tmp_path / f"map{suffix}"
    path.write_bytes(b"an earlier result")
    sg.export(random_map(1), str(path))
    assert path.read_bytes() != b"an earlier result"


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_folder_and_a_path_in_no_folder_are_refused(tmp_path, suffix):
    (tmp_path / f"folder{suffix}").mkdir()
    with pytest.raises(InvalidInputError, match=rf"folder\{suffix}: is a folder"):
        sg.export(random_map(1), tmp_path / f"folder{suffix}")
    with pytest.raises(InvalidInputError, match="nowhere: no such folder"):
        sg.export(random_map(1), tmp_path / "nowhere" / f"map{suffix}")


@pytest.mark.parametrize("name", ["map.obj", "map", "map.sgrid", "map.BT"])
def test_another_suffix_is_refused_with_the_choices(tmp_path, name):
    with pytest.raises(InvalidInputError, match=r"choose from: \.bt, \.glb, \.ot, \.pcd, \.pgm, \.ply, \.yaml"):
        sg.export(random_map(1), tmp_path / name)


def test_an_option_that_a_format_lacks_is_refused_with_those_that_it_has(tmp_path):
    with pytest.raises(InvalidInputError, match=r"\.ply has no option 'low_m'; choose from: cubes, threshold"):
        sg.export(random_map(1), tmp_path / "map.ply", low_m=0.1)
    with pytest.raises(InvalidInputError, match=r"\.bt has no option 'threshold'; it has none"):
        sg.export(random_map(1), tmp_path / "map.bt", threshold=0.6)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_the_options_told_of_are_those_that_the_format_takes(suffix):
    parameters = inspect.signature(EXPORTS[suffix].write).parameters.values()
    takes = {each.name for each in parameters if each.kind is each.KEYWORD_ONLY}
    assert set(EXPORTS[suffix].options) == takes


def test_export_is_a_function_however_its_home_was_imported():
    code = "import stereogrid as sg; from stereogrid.exporting import EXPORTS; sg.export; assert callable(sg.export)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_export_costs_nothing_until_it_is_asked_for():
    code = "import sys, stereogrid; assert not {'numba', 'trimesh', 'stereogrid.exporting'} & set(sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
