"""The pictures that a body is trained on."""

import numpy as np
import pytest
import torch

from ico3d.body.training.views import MARGIN, BodyViews, without_background
from ico3d.errors import CaptureError
from support.bodies.moving_capture import MovingCapture

CPU = torch.device("cpu")


@pytest.fixture
def capture(tmp_path):
    """The swinging arm."""
    return MovingCapture(tmp_path)


def test_training_cameras_only(capture):
    """Every frame by every camera that is not held out."""
    views = BodyViews(capture, range(2, 5), 0.1).views
    assert {view.frame for view in views} == {2, 3, 4}
    assert {view.camera_index for view in views} == set(range(7)) - set(capture.split.test_cameras)


@pytest.mark.parametrize("cache_gib", [0.0, 0.1])
def test_the_person_stands_before_a_color(capture, cache_gib):
    """What the plate shows is taken out exactly, as far as bytes go."""
    pictures = BodyViews(capture, [0, 8], cache_gib)
    color = np.array([0.9, 0.1, 0.4])
    for view in [view for view in pictures.views if view.frame == 8][:3]:
        example = pictures.example(view, color, CPU)
        mask, image = (part(view.camera_index, 8) for part in (capture.mask, capture.image))
        ever = mask + capture.mask(view.camera_index, 0)
        rows, columns = np.flatnonzero(ever.any(1)), np.flatnonzero(ever.any(0))
        top, left = max(rows[0] - MARGIN, 0), max(columns[0] - MARGIN, 0)
        cut = np.s_[top : top + view.camera.height, left : left + view.camera.width]
        plate = capture.background(view.camera_index)
        expected = image + (1 - mask[..., None]) * (color - plate)
        np.testing.assert_allclose(example.target, expected[cut], atol=2.1 / 255)
        np.testing.assert_allclose(example.mask, mask[cut], atol=0.51 / 255)
        whole = capture.cameras[view.camera_index]
        moved = whole.intrinsics[:2, 2] - view.camera.intrinsics[:2, 2]
        np.testing.assert_array_equal(moved, (left, top))


def test_a_capture_without_masks_is_refused(capture):
    """Named are frame and camera."""
    capture.mask = lambda camera, frame: None
    with pytest.raises(CaptureError, match="frame 0 of camera c0 has no mask"):
        BodyViews(capture, [0], 0.1)


def test_few_cameras_without_masks_are_left_out(capture, caplog):
    """One warning names them."""
    seen = capture.mask
    capture.mask = lambda camera, frame: None if camera == 2 else seen(camera, frame)
    views = BodyViews(capture, [0, 1], 0.1).views
    assert 2 not in {view.camera_index for view in views} and len(views) >= 6
    assert "2 of 12 pictures have no mask and are left out (camera c2)" in caplog.text


def test_a_damaged_mask_is_left_out(capture, caplog):
    """Too many end the training."""
    seen, damaged = capture.mask, {(2, 1)}

    def mask(camera, frame):
        if (camera, frame) in damaged:
            raise CaptureError(f"mask {frame} of camera {camera} is damaged.")
        return seen(camera, frame)

    capture.mask = mask
    views = BodyViews(capture, [0, 1], 0.1).views
    assert (2, 1) not in {(view.camera_index, view.frame) for view in views}
    assert "mask 1 of camera 2 is damaged. Training goes on" in caplog.text
    damaged |= {(c, 0) for c in range(7)}
    with pytest.raises(CaptureError, match="too many to train without"):
        BodyViews(capture, [0, 1], 0.1)


@pytest.mark.parametrize("plate", [False, True])
def test_the_background_is_taken_out_exactly(plate):
    """Bytes are computed with as the formula says, rounded."""
    rng = np.random.default_rng(0)
    image, behind = rng.integers(0, 256, (2, 9, 7, 3), dtype=np.uint8)
    mask = rng.choice(np.array([0, 1, 100, 254, 255], np.uint8), (9, 7))
    share = mask[..., None] / 255
    expected = (image - (1 - share) * behind).clip(0, 255) if plate else image * share
    found = without_background(image, mask, behind if plate else None)
    assert found.dtype == np.uint8
    np.testing.assert_allclose(found, expected, atol=0.5001)


def test_views_without_anybody_are_left_out(capture):
    """Where the person is outside of the picture, nothing is learned."""
    seen = capture.mask
    capture.mask = lambda c, f: seen(c, f) * (c != 2)
    assert 2 not in {view.camera_index for view in BodyViews(capture, [0], 0.1).views}
    capture.mask = lambda c, f: 0 * seen(c, f)
    with pytest.raises(CaptureError, match="no picture of the person"):
        BodyViews(capture, [0], 0.1)
