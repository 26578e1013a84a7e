"""Which pictures train and test a scene, and what they ask of it."""

import numpy as np
import pytest
import torch

from ico3d.errors import CaptureError
from ico3d.scene.views import SceneViews

RED = np.array([1.0, 0, 0])


def _places(views):
    return [(view.frame, view.camera_index) for view in views]


def test_of_one_moment_every_eighth_picture_is_for_testing(still):
    views = SceneViews(still(17), "all", "all", 1)
    assert _places(views.test) == [(0, 0), (0, 8), (0, 16)]
    assert _places(views.train) == [(0, c) for c in range(17) if c % 8]


def test_of_few_cameras_all_train(still):
    views = SceneViews(still(7), "all", 0, 1)
    assert len(views.train) == 7 and views.test == ()


def test_recordings_keep_their_split_and_one_frame_is_a_moment(still):
    capture = still(8, 3, test=1)
    views = SceneViews(capture, "all", "all", 1)
    assert {view.frame for view in views.train} == {0, 1}
    assert {view.frame for view in views.test} == {2}
    views = SceneViews(capture, "all", 1, 1)
    assert _places(views.test) == [(1, 0)] and _places(views.train)[0] == (1, 1)


def test_only_a_person_follows_its_head(still):
    capture = still(2, 3, test=1)
    person = SceneViews(capture, "person", "all", 1)
    assert person.space == "head"
    moved = capture.cameras[0].moved(capture.world_from_head(1)).world_to_camera
    np.testing.assert_array_equal(person.train[2].camera.world_to_camera, moved)
    for only in ("all", "background"):
        views = SceneViews(capture, only, "all", 1)
        assert views.space == "world" and views.train[0].camera is capture.cameras[0]


def test_a_person_is_cut_out_over_any_colour(still):
    capture = still()
    views = SceneViews(capture, "person", "all", 1)
    example = views.example(views.train[0], RED)
    alpha = torch.from_numpy(capture.mask(0, 0))[..., None]
    person = torch.from_numpy(capture.image(0, 0)) - (1 - alpha) * 0.25
    expected = person + (1 - alpha) * torch.tensor([1.0, 0, 0])
    assert (example.target - expected).abs().max() < 2 / 255
    assert example.behind.tolist() == [1, 0, 0] and example.weight is None


def test_without_plates_the_mask_alone_cuts(still, monkeypatch):
    capture = still()
    monkeypatch.setattr(type(capture), "background", lambda *_: None)
    views = SceneViews(capture, "person", "all", 1)
    image, mask = views.layers(views.train[0])
    example = views.example(views.train[0], RED)
    expected = image * mask[..., None] + (1 - mask[..., None]) * torch.tensor([1.0, 0, 0])
    torch.testing.assert_close(example.target, expected)


def test_a_background_is_its_plate_or_what_the_mask_leaves(still, monkeypatch):
    capture = still(2, 3, test=1)
    views = SceneViews(capture, "background", "all", 1)
    assert _places(views.train) == [(0, 0), (0, 1)]
    example = views.example(views.train[0], RED)
    assert (example.target - 0.25).abs().max() < 1 / 255 and example.weight is None
    monkeypatch.setattr(type(capture), "background", lambda *_: None)
    views = SceneViews(capture, "background", "all", 1)
    assert len(views.train) == 4 and len(views.test) == 2
    example = views.example(views.train[0], RED)
    image, mask = views.layers(views.train[0])
    assert torch.equal(example.weight, 1 - mask) and torch.equal(example.target, image)
    assert example.behind is None


def test_what_a_capture_lacks_is_one_sentence(still, monkeypatch):
    capture = still(2, 3)
    with pytest.raises(CaptureError, match="has frames 0 to 2, not 3"):
        SceneViews(capture, "all", 3, 1)
    monkeypatch.setattr(type(capture), "mask", lambda *_: None)
    views = SceneViews(capture, "person", 0, 1)
    with pytest.raises(CaptureError, match=r"frame 0 by camera c1 has no mask.*--only all"):
        views.example(views.train[1], RED)
    monkeypatch.setattr(type(capture), "image", lambda *_: np.zeros((32, 32, 3), np.float32))
    monkeypatch.setattr(type(capture), "world_from_head", lambda *_: np.eye(4) * np.nan)
    with pytest.raises(CaptureError, match="frame 0 has no finite head pose"):
        SceneViews(capture, "person", 0, 1)
    monkeypatch.setattr(type(capture), "image", lambda *_: None)
    with pytest.raises(CaptureError, match="no picture among its training frames"):
        SceneViews(capture, "all", 0, 1)
