"""Tracks of faces and their crops, against what can be told by hand."""

import numpy as np
import pytest

from ico3d.measure.sync.tracks import Crops, Track, overlap, resized, tracks_of


def _box(column, row, side=120.0):
    return np.array([column, row, column + side, row + side])


def test_overlap_is_intersection_over_union():
    assert overlap(_box(0, 0, 10), _box(5, 0, 10)) == pytest.approx(50 / 150)
    assert overlap(_box(0, 0, 10), _box(0, 0, 10)) == pytest.approx(1)
    assert overlap(_box(0, 0, 10), _box(20, 20, 10)) == 0


def test_two_faces_are_followed_apart_and_gaps_are_filled():
    faces = [np.stack([_box(k, 0), _box(400 - k, 50)][:: 1 if k % 2 else -1]) for k in range(130)]
    faces[60] = faces[60][:0]  # nobody is found
    tracks = tracks_of(faces)
    assert [(track.first, track.stop) for track in tracks] == [(0, 130)] * 2
    by_side = sorted(tracks, key=lambda track: track.boxes[0, 0])
    np.testing.assert_allclose(by_side[0].boxes, [_box(k, 0) for k in range(130)])
    np.testing.assert_allclose(by_side[1].boxes[60], _box(340, 50))


@pytest.mark.parametrize(
    ("count", "side", "gap", "found"),
    [(101, 101.0, 0, 1), (100, 101.0, 0, 0), (101, 100.0, 0, 0), (120, 101.0, 26, 0)],
)
def test_a_track_has_more_than_a_hundred_detections_and_pixels(count, side, gap, found):
    faces = [_box(7, 9, side)[None] for _ in range(count)]
    faces[60:60] = [np.zeros((0, 4))] * gap
    assert len(tracks_of(faces)) == found


def test_a_crop_goes_from_the_top_of_the_box_to_half_as_much_below_and_wide_enough():
    # Rows and columns of a picture whose colours tell where a pixel is.
    rows, columns = np.mgrid[:250, :250]
    picture = np.stack([rows, columns, 0 * rows], -1).astype(np.uint8)
    boxes = np.tile([100.0, 60.0, 160.0, 140.0], (30, 1))
    boxes[15] = (0, 0, 200, 200)  # one detection is wrong: the median does not see it
    crop = Crops(Track(0, boxes)).cut(picture, 15).astype(float)
    assert crop.shape == (224, 224, 3)
    top, left, side = 100 - 40, 130 - 56, 112  # rows 60 to 172, columns 74 to 186
    places = (np.arange(224) + 0.5) * side / 224 - 0.5
    inside = slice(1, -1)
    expected = np.clip(places, 0, side - 1)
    np.testing.assert_allclose(crop[inside, 100, 0], top + expected[inside], atol=0.51)
    np.testing.assert_allclose(crop[100, inside, 1], left + expected[inside], atol=0.51)


def test_what_lies_outside_of_the_picture_is_grey():
    picture = np.zeros((100, 100, 3), np.uint8)
    crop = Crops(Track(0, np.tile([0.0, 0.0, 80.0, 80.0], (13, 1)))).cut(picture, 6)
    assert (crop[:, 0] == 110).all() and (crop[-1] == 110).all() and (crop[100, 100] == 0).all()


def test_resizing_is_linear_between_pixel_centres():
    picture = np.array([[[0], [100], [200], [60]]], np.uint8)
    assert resized(picture, 1, 2)[0, :, 0].tolist() == [50, 130]
    assert resized(picture, 1, 8)[0, :, 0].tolist() == [0, 25, 75, 125, 175, 165, 95, 60]
    assert resized(picture, 3, 4)[:, :, 0].tolist() == [[0, 100, 200, 60]] * 3
