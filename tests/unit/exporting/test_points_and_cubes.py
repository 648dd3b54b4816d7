"""PLY, PCD and GLB: other readers find the occupied cells where they are."""

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from stereogrid.errors import InvalidInputError
from stereogrid.exporting import export
from stereogrid.exporting.cubes import outer_faces
from stereogrid.exporting.glb import T_GLTF_WORLD
from stereogrid.grid import OccupancyGrid

from .maps import random_map

PCD_TYPES = {("F", 4): "<f4", ("F", 8): "<f8", ("U", 1): "u1", ("U", 4): "<u4", ("I", 4): "<i4"}


def read_pcd(path):
    """Fields of a PCD file by name, after the definition of version 0.7."""
    lines, content = {}, path.read_bytes()
    while "DATA" not in lines:
        line, _, content = content.partition(b"\n")
        if not line.startswith(b"#"):
            key, *values = line.decode().split()
            lines[key] = values
    assert " ".join(lines) == "VERSION FIELDS SIZE TYPE COUNT WIDTH HEIGHT VIEWPOINT POINTS DATA"
    assert (lines["VERSION"], lines["COUNT"]) == (["0.7"], ["1"] * len(lines["FIELDS"]))
    kinds = [PCD_TYPES[kind, int(size)] for kind, size in zip(lines["TYPE"], lines["SIZE"], strict=True)]
    dtype = np.dtype(list(zip(lines["FIELDS"], kinds, strict=True)))
    n = int(lines["POINTS"][0])
    assert int(lines["WIDTH"][0]) * int(lines["HEIGHT"][0]) == n
    if lines["DATA"] == ["binary"]:
        assert len(content) == n * dtype.itemsize
        return np.frombuffer(content, dtype)
    rows = [tuple(map(float, row.split())) for row in content.decode().splitlines()]
    assert len(rows) == n
    return np.array(rows, dtype)


def expected(grid, threshold=0.5):
    """Occupied centres (N, 3) and probabilities (N,), in lexical order of the cells."""
    cells, p = grid.known_cells()
    kept = p > threshold
    order = np.lexsort(cells[kept].T[::-1])
    return (cells[kept][order] + 0.5) * grid.cell_m, p[kept][order]


def sorted_points(points, values):
    order = np.lexsort(np.rint(points / 0.05).T[::-1])
    return points[order], values[order]


@pytest.mark.parametrize("options", [{}, {"ascii": True}, {"threshold": 0.7}])
def test_a_pcd_file_holds_the_occupied_centres_and_their_probabilities(tmp_path, options):
    grid = random_map(1)
    records = read_pcd(export(grid, tmp_path / "map.pcd", **options))
    points = np.stack([records[name] for name in "xyz"], axis=-1)
    points, p = sorted_points(points, records["probability"])
    centres, probabilities = expected(grid, options.get("threshold", 0.5))
    np.testing.assert_allclose(points, centres, atol=1e-6)
    np.testing.assert_allclose(p, probabilities, atol=1e-6)


def test_text_and_binary_pcd_files_hold_the_same_numbers(tmp_path):
    grid = random_map(2)
    text = read_pcd(export(grid, tmp_path / "text.pcd", ascii=True))
    np.testing.assert_array_equal(text, read_pcd(export(grid, tmp_path / "binary.pcd")))


def test_trimesh_reads_the_points_of_a_ply_file_with_probability_and_colour(tmp_path):
    grid = random_map(3)
    cloud = trimesh.load(export(grid, tmp_path / "map.ply"))
    raw = cloud.metadata["_ply_raw"]["vertex"]["data"]
    points, p = sorted_points(np.asarray(cloud.vertices), raw["probability"].ravel())
    centres, probabilities = expected(grid)
    np.testing.assert_allclose(points, centres, atol=1e-6)
    np.testing.assert_allclose(p, probabilities, atol=1e-6)
    low, high = (cloud.colors[each(cloud.vertices[:, 2])][:3] for each in (np.argmin, np.argmax))
    assert (low.tolist(), high.tolist()) == ([68, 1, 84], [253, 231, 37])


def as_cells(mesh, cell_m):
    """The cells inside a watertight mesh of cubes."""
    lower, upper = np.rint(mesh.bounds / cell_m).astype(int)
    cells = np.argwhere(np.ones(upper - lower)) + lower
    # A ray along x from outside crosses as many faces as it must to be where it is.
    crossings = np.zeros(len(cells))
    flat = np.abs(mesh.face_normals[:, 0]) > 0.5
    for corners, normal in zip(mesh.triangles[flat], mesh.face_normals[flat], strict=True):
        at = np.rint(corners[0, 0] / cell_m)
        j, k = np.floor(corners[:, 1:].min(axis=0) / cell_m + 0.5)
        # Two triangles a face, half a crossing each.
        crossings += np.where((cells[:, 1] == j) & (cells[:, 2] == k) & (cells[:, 0] >= at), -0.5 * normal[0], 0)
    return {tuple(cell) for cell in cells[crossings > 0.5].tolist()}


@pytest.mark.parametrize("name", ["cubes.ply", "map.glb"])
def test_trimesh_reads_a_closed_surface_around_the_occupied_cells(tmp_path, name):
    grid = random_map(4, n=60, spread=6)
    options = {"cubes": True} if name == "cubes.ply" else {}
    mesh = trimesh.load(export(grid, tmp_path / name, **options), force="mesh")
    if name == "map.glb":
        mesh.apply_transform(np.linalg.inv(T_GLTF_WORLD))
    cells, p = grid.known_cells()
    occupied = {tuple(cell) for cell in cells[p > 0.5].tolist()}
    assert mesh.volume == pytest.approx(len(occupied) * grid.cell_m**3, rel=1e-4)
    assert as_cells(mesh, grid.cell_m) == occupied
    assert len(np.unique(mesh.visual.vertex_colors, axis=0)) > 5


def test_up_in_a_glb_file_is_y(tmp_path):
    tower = OccupancyGrid.from_cells(0.1, np.array([[0, 0, k] for k in range(30)]), np.full(30, 2.0))
    scene = trimesh.load(export(tower, tmp_path / "tower.glb"))
    np.testing.assert_allclose(scene.bounds, [[0, 0, -0.1], [0.1, 3.0, 0]], atol=1e-6)


@given(seed=st.integers(0, 2**32 - 1))
def test_a_face_is_drawn_once_exactly_where_an_occupied_cell_meets_one_that_is_not(seed):
    rng = np.random.default_rng(seed)
    cells = np.unique(rng.integers(-3, 3, (40, 3)), axis=0)
    corners, quads = outer_faces(cells)
    held = set(map(tuple, cells.tolist()))
    wanted = {
        (tuple(cell), axis, side)
        for cell in held
        for axis in range(3)
        for side in (-1, 1)
        if tuple(np.add(cell, side * np.eye(3, dtype=int)[axis]).tolist()) not in held
    }
    found = set()
    for quad in corners[quads]:
        normal = np.cross(quad[1] - quad[0], quad[2] - quad[1])
        np.testing.assert_array_equal(quad[0] + quad[2], quad[1] + quad[3])
        axis, side = int(np.argmax(np.abs(normal))), int(normal.sum())
        inside = quad.mean(axis=0) - 0.5 * normal
        found.add((tuple(np.floor(inside).astype(int).tolist()), axis, side))
    assert len(found) == len(quads)
    assert found == wanted


@pytest.mark.parametrize("name", ["map.ply", "map.pcd", "map.glb"])
def test_a_map_without_an_occupied_cell_is_refused_and_nothing_is_written(tmp_path, name):
    free = OccupancyGrid.from_cells(0.1, np.zeros((1, 3), int), [-1.0])
    for grid in (OccupancyGrid(0.1), free):
        with pytest.raises(InvalidInputError, match=r"no cell with p > 0\.5"):
            export(grid, tmp_path / name)
    with pytest.raises(InvalidInputError, match="threshold must be a probability below 1, not 1"):
        export(random_map(0), tmp_path / name, threshold=1)
    assert list(tmp_path.iterdir()) == []


def test_cells_too_far_apart_to_be_drawn_as_cubes_are_refused(tmp_path):
    far = np.array([[0, 0, 0], [2**40, 2**40, 2**40]])
    grid = OccupancyGrid.from_cells(0.1, far, [1.0, 1.0])
    with pytest.raises(InvalidInputError, match="too wide to be drawn"):
        export(grid, tmp_path / "far.glb")
