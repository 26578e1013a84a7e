"""Light of the studio: shadows as wide as lamps make them, surroundings, film."""

from types import SimpleNamespace

import numpy as np
import pytest

from ico3d.studio.person.subject import Material
from ico3d.studio.picture.lamps import STUDIOS, Lamps
from ico3d.studio.picture.lighting import ambient, lights_on
from ico3d.studio.picture.occlusion import Sky
from ico3d.studio.picture.shadows import Covered, cast, seen
from ico3d.studio.picture.tones import developed, display

DOWN = np.array([0.0, 1.0, 0.0])
SIZE, GAP = 0.2, 0.1
"""Tangent of half the angle of a lamp, and metres from the edge of a roof to the floor."""


@pytest.fixture(scope="module")
def roof():
    """The shadow of a roof over all x < 0 under a lamp straight above."""
    corners = np.array([[-9, 0, -9], [0, 0, -9], [0, 0, 9], [-9, 0, 9]], np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    covered = Covered(512, 0.3, np.zeros(3), False)
    return cast(corners, faces, np.arange(2, dtype=np.int32), DOWN, SIZE, covered, np.zeros(3))


def test_a_penumbra_is_as_wide_as_lamp_and_distance_make_it(roof):
    at = np.linspace(-0.06, 0.06, 49)
    share = np.array([seen(roof, x, -GAP, 0.01, 0.0, 1.0, 0.0) for x in at])
    # A disc that an edge covers up to t, of its radius, shows this share.
    t = np.clip(at / (SIZE * GAP), -1, 1)
    expected = 0.5 + (t * np.sqrt(1 - t**2) + np.arcsin(t)) / np.pi
    assert np.abs(share - expected).max() < 0.08
    np.testing.assert_allclose(share[[0, -1]], [0, 1], atol=1e-6)


def test_the_shadow_of_a_small_thing_close_by_ends_softly():
    side = 0.008
    corners = side * np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]], np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    covered = Covered(512, 0.4, np.zeros(3), False)
    solid = np.arange(2, dtype=np.int32)
    small = cast(corners, faces, solid, DOWN, 0.3, covered, np.zeros(3))
    at = np.linspace(-0.02, 0.02, 161)
    share = np.array([seen(small, x, -0.02, 0.001, 0.0, 1.0, 0.0) for x in at])
    assert share.min() < 0.1 and share.max() == 1.0
    assert np.abs(np.diff(share)).max() < 0.1


def test_a_lit_surface_throws_no_shadow_on_itself(roof):
    for tilt in (0.0, 0.8, -0.8):
        n = np.array([np.sin(tilt), np.cos(tilt), 0.0])
        assert seen(roof, -0.1, 0.003, 0.0, *n) == 1.0


def test_vertices_under_a_roof_see_the_part_of_a_lamp_that_its_edge_leaves():
    at = np.linspace(-0.06, 0.06, 25)
    floor = np.array([[x, -GAP, z] for x in at for z in (0.0, 0.01)])
    roof = [[-0.28, 0, -0.2], [0, 0, -0.2], [0, 0, 0.2], [-0.28, 0, 0.2]]
    vertices = np.concatenate([floor, roof]).astype(np.float32)
    first = 2 * np.arange(len(at) - 1)[:, None]
    ground = np.concatenate([first + np.array(corners) for corners in ((0, 1, 2), (1, 3, 2))])
    count = len(floor)
    faces = np.concatenate([ground, [[count, count + 2, count + 1], [count, count + 3, count + 2]]])
    cloth = np.full(len(faces), Material.CLOTH, np.uint8)
    scene = SimpleNamespace(faces=faces.astype(np.int32), materials=cloth)
    share = Sky(scene, 512, 0.3, 1).lamp(vertices, DOWN, SIZE)[:count:2]
    t = np.clip(at / (SIZE * GAP), -1, 1)
    expected = 0.5 + (t * np.sqrt(1 - t**2) + np.arcsin(t)) / np.pi
    assert np.abs(share - expected).max() < 0.08
    np.testing.assert_allclose(share[[0, -1]], [0, 1], atol=1e-4)


def test_vertices_that_face_away_from_a_lamp_are_not_in_its_shade_twice():
    vertices = np.array([[0, 0, 0], [0, 0, 0.1], [0.1, 0, 0]], np.float32)
    down = np.array([[0, 2, 1]], np.int32)
    scene = SimpleNamespace(faces=down, materials=np.full(1, Material.CLOTH, np.uint8))
    np.testing.assert_array_equal(Sky(scene, 64, 0.3, 1).lamp(vertices, DOWN, SIZE), 1)


def test_surroundings_of_one_colour_light_every_side_alike():
    even = np.full(3, 0.3)
    lamps = Lamps(np.eye(3), np.zeros((3, 3)), np.full(3, 0.2), even, 0 * even, even, even)

    class White(Lamps):
        def surroundings(self, directions):
            return np.full((len(directions), 3), 0.3)

    harmonics = White(**{k: getattr(lamps, k) for k in lamps.__dataclass_fields__}).harmonics()
    np.testing.assert_allclose(harmonics[1:], 0, atol=1e-3)
    np.testing.assert_allclose(0.282095 * harmonics[0], 0.3, atol=1e-3)


def test_light_turns_with_the_world_not_with_the_head():
    turn = np.eye(4)
    turn[:3, :3] = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]
    triangle = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]], np.float32)
    faces, one = np.array([[0, 1, 2]], np.int32), np.zeros(1, np.int32)
    small = Covered(16, 0.4, np.zeros(3), False)
    straight, turned = (
        lights_on(triangle, faces, one, pose, STUDIOS["warm"], small) for pose in (np.eye(4), turn)
    )
    n = np.array([0.6, 0.0, 0.8])
    there = turn[:3, :3].T @ n  # the same direction of the world in a turned head's space
    np.testing.assert_allclose(ambient(straight, n), ambient(turned, there), rtol=1e-5)
    np.testing.assert_allclose(turned.directions @ turn[:3, :3].T, straight.directions, atol=1e-6)


def test_film_keeps_black_and_order_and_a_pixel_keeps_its_share():
    light = np.linspace(0, 6, 200)
    shown = np.array([display(x) for x in light])
    assert shown[0] == 0 and shown[-1] <= 1 and (np.diff(shown) >= 0).all()
    picture = np.array([[[0.2, 0.1, 0.05, 0.5], [0, 0, 0, 0]]], np.float32)
    out = developed(picture)
    np.testing.assert_allclose(out[0, 0, :3], 0.5 * np.array([display(x) for x in (0.4, 0.2, 0.1)]))
    assert out[0, 0, 3] == 0.5 and (out[0, 1] == 0).all()
