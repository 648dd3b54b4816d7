"""Skinned bodies: closed, outward, and with textures where they were wanted."""

import numpy as np
import pytest

from sim.scene.skin import Skin, blob, hull, prism, skinned, tube
from sim.scene.solids import Solid
from sim.worlds.vegetation import coat, tufts
from stereogrid.geometry import FloatArray


def bodies() -> list[Solid]:
    rng = np.random.default_rng(3)
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 2, 0], [0, 2, 0]])
    core = blob(rng, "blob", np.array([1.0, 2.0, 0.5]), np.array([0.6, 0.4, 0.5]), "x", boxy=0.7)
    return [
        core,
        blob(rng, "spiky", np.zeros(3), np.ones(3), "x", rough=(0.3, 0.3)),
        tube("bent", np.array([[0.0, 0, 0], [0.1, 0, 1], [0.6, 0.2, 1.6]]), np.array([0.2, 0.15, 0.05]), "x"),
        tube("lying", np.array([[0.0, 0, 0], [1.0, 0, 0]]), np.array([0.3, 0.3]), "x", sides=18),
        prism("prism", square, square + np.array([0.1, 0, 0.4]), ("x", square[:, :2] * [1, -1])),
        hull("hull", rng.normal(size=(20, 3)), "x"),
        coat(rng, "leaves", core, 40, (0.05, 0.1), above_m=0.3),
        tufts(rng, "grass", np.array([[0.0, 0, 0], [1.0, 1, 0.2]]), 9),
    ]


@pytest.mark.parametrize("solid", bodies(), ids=lambda solid: solid.name)
def test_every_kind_of_body_is_closed_outward_and_has_upright_textures(solid: Solid) -> None:
    mesh = solid.mesh()
    assert mesh.is_watertight and mesh.volume > 0
    for face, normal in zip(solid.faces, mesh.face_normals, strict=True):
        s, t = np.array(face.s_axis), np.array(face.t_axis)
        # Right and down, seen from outside: their cross product points inwards.
        assert np.cross(s, t) == pytest.approx(-normal, abs=1e-6)


def test_a_texture_lies_where_it_was_wanted_on_a_flat_face() -> None:
    vertices = np.array([[0.0, 0, 1], [2, 0, 1], [0, 2, 1], [0.0, 0, 0]])
    triangles = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
    wanted = np.zeros((4, 3, 2))
    turn = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    wanted[0] = (vertices[[0, 1, 2], :2] * [1, -1]) @ turn + [0.4, 0.7]
    face = skinned("x", vertices, triangles, Skin(["x"] * 4, wanted)).faces[0]
    assert _texture_at(face.s_axis, face.t_axis, face.origin_m, vertices[[0, 1, 2]]) == pytest.approx(wanted[0])


def test_bark_goes_on_from_face_to_face_round_a_trunk() -> None:
    trunk = tube("trunk", np.array([[0.0, 0, 0], [0, 0, 1.0]]), np.array([0.2, 0.2]), "bark", sides=12)
    walls = trunk.faces[:24]
    # The two triangles of one side, then those of the next, meet at the upper corner of the first side's second.
    for here, after in zip(walls[0:20:2], walls[2:22:2], strict=True):
        shared = trunk.vertices_m[[here.corners[1]]]
        one, other = (_texture_at(f.s_axis, f.t_axis, f.origin_m, shared) for f in (here, after))
        assert one == pytest.approx(other, abs=2e-3)


def test_leaves_grow_from_their_core_and_not_below_the_height_given() -> None:
    core, leaves = bodies()[0], bodies()[6]
    size = core.vertices_m.max(axis=0) - core.vertices_m.min(axis=0)
    low, high = core.vertices_m.min(axis=0) - 0.13, core.vertices_m.max(axis=0) + 0.13
    assert ((leaves.vertices_m > low) & (leaves.vertices_m < high)).all()
    assert leaves.vertices_m[:, 2].min() > 0.3 - 0.13
    assert (np.ptp(leaves.vertices_m, axis=0) > 0.5 * size).all()


def _texture_at(s: tuple[float, ...], t: tuple[float, ...], origin: tuple[float, float], at: FloatArray) -> FloatArray:
    return at @ np.array([s, t]).T - origin
