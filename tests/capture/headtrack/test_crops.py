import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ico3d.capture.headtrack.crops import READ_AT, Part, around, search
from ico3d.common.camera import Camera, look_at

LENS = np.array([[900.0, 0, 300], [0, 900, 410], [0, 0, 1]])


def test_pixels_of_a_part_are_those_of_the_picture():
    """A white square of the picture lies where `whole` says that it is."""
    image = np.zeros((200, 300, 3), np.float32)
    image[60:72, 210:222] = 1
    for part in (Part(180, 40, 64), Part(200, 50, 24), Part(150, -60, 260)):
        rows, columns = np.nonzero(part.cut(image)[..., 0] > 127)
        middle = np.array([[columns.mean() + 0.5, rows.mean() + 0.5]])
        np.testing.assert_allclose(part.whole(middle), [[216, 66]], atol=0.3)


@settings(max_examples=20)
@given(st.integers(-90, 90), st.integers(-90, 90), st.integers(8, 120))
def test_what_lies_outside_the_picture_is_black(left, top, side):
    shown = Part(left, top, side).cut(np.ones((50, 40, 3), np.float32))
    assert shown.shape == (READ_AT, READ_AT, 3)
    inside = max(0, min(left + side, 40) - max(left, 0)) * max(0, min(top + side, 50) - max(top, 0))
    assert shown.mean() / 255 == pytest.approx(inside / side**2, abs=0.02)


def test_a_part_around_a_head_shows_so_many_metres():
    camera = Camera(600, 800, LENS, look_at((0, 1.5, 3), (0, 1.5, 0)))
    part = around(camera, np.array([0.1, 1.6, 0]), 0.5)
    assert part == Part(300 + 30 - 75, 410 - 30 - 75, 150)
    assert around(camera, np.array([0, 1.5, 4.0])) is None  # behind
    assert around(camera, np.array([2.0, 1.5, 0])) is None  # beside the picture


@settings(max_examples=40)
@given(
    st.tuples(st.integers(0, 120), st.integers(0, 150), st.integers(20, 80)),
    st.tuples(st.floats(0, 1), st.floats(0, 1)),
    st.booleans(),
)
def test_a_search_shows_every_face_of_a_person_large_enough(person, place, known):
    """A head of an eighth of the height fills at least a quarter of some part, uncut."""
    left, top, width = person
    height = min(3 * width, 240 - top)
    mask = np.zeros((240, 200), np.float32)
    mask[top : top + height, left : left + width] = 1
    parts = search(240, 200, mask if known else None)
    if not known:
        left, top, width, height = 0, 0, 200, 240
    head = max(height, width) / 8
    x, y = left + place[0] * (width - head), top + place[1] * (height - head)
    shown = [
        part.side
        for part in parts
        if part.left <= x + 1
        and x + head <= part.left + part.side + 1
        and part.top <= y + 1
        and y + head <= part.top + part.side + 1
    ]
    assert min(shown) <= 4 * head + 2
    assert len(parts) < 80


def test_nobody_there_means_nothing_to_look_at():
    assert search(80, 60, np.zeros((80, 60), np.float32)) == []


@pytest.mark.parametrize("depth", [0.05, 0.008, 1e-9, 1e-300])
def test_a_camera_within_the_head_shows_no_part_of_it(depth):
    """Its part would have a side of 36,000 pixels at 8 mm, and took 5 GB."""
    lens = np.array([[600.0, 0, 320], [0, 600, 240], [0, 0, 1]])
    near = Camera(640, 480, lens, np.eye(4))
    assert around(near, np.array([0, 0, depth])) is None
    assert around(near, np.array([0, 0, 0.3])) == Part(-160, -240, 960)
