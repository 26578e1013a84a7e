"""Strands of hair: they move with their triangles and are drawn where they are."""

import numpy as np
import pytest

from ico3d.studio.person.growing.skull import Skull
from ico3d.studio.person.strands import bound, joined
from ico3d.studio.person.subject import Material
from ico3d.studio.picture.fibres import draw_strands, far_to_near, lit_strands, shown, strand_colors
from ico3d.studio.picture.lamps import STUDIOS
from ico3d.studio.picture.lighting import lights_on
from ico3d.studio.picture.shadows import BUST
from ico3d.studio.picture.textures import noise, slope

TRIANGLE = np.array([[0.0, 0, 0], [0.01, 0, 0], [0.003, 0.012, 0]], np.float32)


def _some(random, count=5, length=4):
    return bound(
        TRIANGLE,
        np.tile([0, 1, 2], (count, 1)),
        random.dirichlet(np.ones(3), count),
        random.normal(0, 0.02, (count, length, 3)),
        np.ones(length),
        np.full(length, 1e-4),
        np.ones(count),
        int(Material.HAIR),
    )


def test_strands_at_rest_are_where_they_grew():
    random = np.random.default_rng(0)
    points = random.normal(0, 0.02, (3, 4, 3))
    corners, parts = np.tile([0, 1, 2], (3, 1)), random.dirichlet(np.ones(3), 3)
    grown = bound(TRIANGLE, corners, parts, points, np.ones(4), np.ones(4), np.ones(3), 6)
    np.testing.assert_allclose(grown.on(TRIANGLE), points.reshape(-1, 3), atol=1e-7)


@pytest.mark.parametrize("seed", range(3))
def test_strands_turn_and_shift_with_their_triangle(seed):
    random = np.random.default_rng(seed)
    grown = _some(random)
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    shift = random.normal(0, 0.1, 3)
    moved = grown.on((TRIANGLE @ turn.T + shift).astype(np.float32))
    np.testing.assert_allclose(moved, grown.on(TRIANGLE) @ turn.T + shift, atol=1e-6)


def test_joined_groups_keep_their_points():
    random = np.random.default_rng(1)
    one, other = _some(random, 2, 3), _some(random, 3, 5)
    both = joined([one, other])
    assert both.first.tolist() == [0, 3, 6, 11, 16, 21]
    expected = np.concatenate([one.on(TRIANGLE), other.on(TRIANGLE)])
    np.testing.assert_array_equal(both.on(TRIANGLE), expected)


def _drawn(start, end, width, hidden=0.0, size=16):
    screen = np.array([[*start, 1.0], [*end, 1.0]], np.float32)
    picture = np.zeros((size, size, 4), np.float32)
    nearest = np.full((3 * size, 3 * size), hidden, np.float32)
    order = far_to_near(screen[:, 2], shown(screen, np.array([0, 2], np.int32), nearest, 3))
    light = np.array([[0.2, 0.4, 0.6]] * 2, np.float32)
    draw_strands(order, screen, np.full(2, width, np.float32), light, nearest, 3, picture)
    return picture


@pytest.mark.parametrize("width", [0.05, 0.3, 1.4])
@pytest.mark.parametrize("row", [7.5, 7.9])
def test_a_strand_covers_its_area(width, row):
    picture = _drawn((2.0, row), (12.0, row), width)
    assert picture[..., 3].sum() == pytest.approx(10 * 2 * width, rel=1e-4)
    np.testing.assert_allclose(
        picture[..., :3], picture[..., 3:] * np.array([0.2, 0.4, 0.6]), atol=1e-6
    )


def test_what_lies_behind_a_surface_is_hidden():
    assert _drawn((2.0, 7.5), (12.0, 9.5), 0.5, hidden=2.0).max() == 0
    assert _drawn((2.0, 7.5), (12.0, 9.5), 0.5, hidden=0.5).max() > 0.5


def _screen(*nearness):
    """Points in the middle of a picture of 16 × 16 pixels."""
    return np.array([(8.0, 8.0, near) for near in nearness], np.float32)


def test_segments_come_from_far_to_near_and_never_join_two_strands():
    screen, first = _screen(3.0, 3.0, 1.0, 1.0, 2.0, 0.0), np.array([0, 2, 4, 6], np.int32)
    begins = shown(screen, first, np.zeros((48, 48), np.float32), 3)
    assert far_to_near(screen[:, 2], begins).tolist() == [2, 0]


def test_segments_well_behind_a_surface_are_left_out():
    screen, surface = _screen(1.0, 1.0, 2.1, 2.1, 1.0, 1.0, 1.0), np.full((48, 48), 2.0, np.float32)
    begins = shown(screen, np.array([0, 7], np.int32), surface, 3)
    assert np.flatnonzero(begins).tolist() == [1, 2, 3]


def test_what_is_left_out_changes_no_light_of_the_rest():
    random = np.random.default_rng(4)
    points = random.normal(0, 0.1, (40, 3)).astype(np.float32)
    first, even = np.array([0, 20, 40], np.int32), np.ones(40, np.float32)
    lights = lights_on(
        points, np.arange(39, dtype=np.int32).reshape(-1, 3), np.arange(13, dtype=np.int32),
        np.eye(4), STUDIOS["studio"], BUST,
    )  # fmt: skip
    colors, eye = np.full((2, 3), 0.3, np.float32), np.array([0, 0, 1.0], np.float32)

    def lit(begins):
        return lit_strands(points, first, begins, even, even[:2], colors, eye * 0, eye, lights)

    some = random.uniform(size=40) < 0.3
    some[[19, 39]] = False
    used = some | np.roll(some, 1)
    whole, part = lit(np.ones(40, bool)), lit(some)
    np.testing.assert_array_equal(part[used], whole[used])
    assert used.any() and whole[used].min() > 0


def test_brows_and_lashes_are_darker_than_hair():
    random = np.random.default_rng(2)
    grown = _some(random, 2)
    grown.material[1] = Material.LASH
    colors = strand_colors(grown, np.array([0.4, 0.2, 0.1]))
    np.testing.assert_allclose(colors[0], [0.4, 0.2, 0.1], rtol=1e-6)
    assert (colors[1] < 0.5 * colors[0]).all()


def test_the_slope_of_noise_is_its_derivative():
    for place in np.random.default_rng(3).uniform(-5, 5, (20, 3)):
        value, *slopes = slope(*place)
        assert value == pytest.approx(noise(*place), abs=1e-9)
        for axis, along in enumerate(slopes):
            step = 1e-5 * np.eye(3)[axis]
            finite = (noise(*(place + step)) - noise(*(place - step))) / 2e-5
            assert along == pytest.approx(finite, abs=1e-4)


def test_a_ball_for_a_skull_has_its_radius_everywhere():
    random = np.random.default_rng(4)
    ball = Skull(np.zeros(3), np.full((90, 180), 0.09), 1.0)
    ways = random.normal(size=(50, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    np.testing.assert_allclose(
        np.linalg.norm(ball.on(ways, np.full(50, 0.01)), axis=1), 0.10, rtol=1e-9
    )


def test_hair_grows_on_the_crown_and_not_on_the_face():
    head = Skull(np.zeros(3), np.full((90, 180), 0.09), 1.0)
    crown, face, neck = [0, 0.1, 0], [0, -0.02, 0.09], [0, -0.12, -0.06]
    inside = head.inside_hairline(np.array([crown, face, neck], float))
    assert inside[0] > 0.02 and (inside[1:] < -0.01).all()
