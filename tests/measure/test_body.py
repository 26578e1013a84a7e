"""Evaluation of bodies whose distance from the truth is known."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch

from ico3d.body.planning.windows import Window
from ico3d.errors import CaptureError
from ico3d.measure.body import Truth, evaluate_body, picture_scores
from ico3d.measure.flicker import border_flicker, masked_difference, novel_cameras
from ico3d.measure.part_metrics import moving_pixels, psnr_moving
from support.bodies.moving_capture import FRAMES, POINTS, MovingCapture
from support.bodies.true_body import true_body


@pytest.fixture(scope="module")
def capture():
    return MovingCapture(Path("moving"))


@pytest.fixture(scope="module")
def truth_scores(capture):
    return evaluate_body(true_body(capture), capture)


def test_the_truth_scores_highest(truth_scores):
    for key in ("psnr", "psnr_mask", "psnr_moving"):
        assert truth_scores[key] > 100
    assert truth_scores["ssim"] == pytest.approx(1, abs=1e-5)
    assert truth_scores["temporal_flicker"] == pytest.approx(0, abs=1e-5)
    assert truth_scores["fps"] == pytest.approx(1000 / truth_scores["ms_per_frame"])
    assert truth_scores["num_gaussians"] == 2 * POINTS
    assert truth_scores["train_seconds"] == 7.0 and truth_scores["ms_per_frame"] > 0
    json.dumps(truth_scores, allow_nan=False)


def test_through_which_colours_test_cameras_look_is_said(capture, truth_scores):
    """Their own are not known; training cameras' would say nothing of them."""
    assert "camera_colors" not in truth_scores
    body = true_body(capture)
    body.models[0].camera_colors = torch.full((len(capture.cameras), 3, 4), 0.3)
    scores = evaluate_body(body, capture, capture.split.test_cameras[:1], frames=[0])
    assert scores["camera_colors"] == "identity" and scores["psnr"] > 100


def test_what_is_reported_on(capture, truth_scores):
    names = [capture.cameras[i].name for i in capture.split.test_cameras]
    assert [entry["camera"] for entry in truth_scores["per_camera"]] == names
    assert [entry["frame"] for entry in truth_scores["per_frame"]] == list(range(FRAMES))
    assert [(w["first"], w["last"]) for w in truth_scores["per_window"]] == [(0, 4), (4, 8)]


def test_where_next_to_nothing_moves_nothing_is_measured(truth_scores):
    moving = [entry["psnr_moving"] for entry in truth_scores["per_frame"]]
    assert moving[:4] == [None] * 4 and None not in moving[5:]
    first, second = truth_scores["per_window"]
    assert first["psnr_moving"] is None and second["psnr_moving"] > 100


def test_an_error_is_found_in_its_window_alone(capture):
    scores = evaluate_body(true_body(capture, (0.0, 0.1)), capture)
    first, second = scores["per_window"]
    assert first["psnr_mask"] > 100
    # Colours lighter by 0.1 make a picture lighter by 0.1·α, and the mask is α: √(Σα³ / Σα) < 1.
    expected = []
    for camera in capture.split.test_cameras:
        for frame in range(5, 9):
            alpha = capture.mask(camera, frame).astype(np.float64)
            expected.append(-10 * np.log10(0.01 * (alpha**3).sum() / alpha.sum()))
    assert second["psnr_mask"] == pytest.approx(np.mean(expected), abs=1e-3)
    # Between frames 4 and 5 the person becomes lighter by 0.1·α; later the error moves with it.
    changes = [entry["temporal_flicker"] for entry in scores["per_frame"]]
    assert changes[0] is None and max(changes[1:5]) < 1e-5
    assert 0.05 < changes[5] < 0.1 and 0.001 < max(changes[6:]) < changes[5]
    frames = [entry["psnr_mask"] for entry in scores["per_frame"]]
    assert scores["psnr_mask"] == pytest.approx(np.mean(frames))
    cameras = [entry["psnr_mask"] for entry in scores["per_camera"]]
    assert scores["psnr_mask"] == pytest.approx(np.mean(cameras))


def test_other_spans_and_frames(capture):
    body = true_body(capture, (0.0, 0.1))
    spans = (Window(0, 2), Window(2, 6), Window(6, 8))
    scores = evaluate_body(body, capture, cameras=(0,), frames=(2, 5, 7), spans=spans)
    assert [w["psnr_mask"] > 100 for w in scores["per_window"]] == [True, False, False]
    assert scores["per_window"][1]["psnr"] == scores["per_frame"][1]["psnr"]
    assert [entry["camera"] for entry in scores["per_camera"]] == ["c0"]


class Plateless(MovingCapture):
    """Pictures before a backdrop that nobody knows."""

    def background(self, camera):
        return None

    def image(self, camera, frame):
        return MovingCapture(self.path).image(camera, frame)

    def mask(self, camera, frame):
        return MovingCapture(self.path).mask(camera, frame)


def test_without_a_plate_the_person_is_cut_out(capture):
    scores = evaluate_body(
        true_body(capture), Plateless(Path("plateless")), frames=(0,), cameras=(1,)
    )
    alpha = capture.mask(1, 0).astype(np.float64)
    picture = capture.image(1, 0).astype(np.float64)
    plate = capture.background(1)
    drawn = picture - (1 - alpha)[..., None] * plate
    error = ((drawn - picture * alpha[..., None]) ** 2).mean()
    assert scores["psnr"] == pytest.approx(-10 * np.log10(error), abs=1e-2)


def test_without_plate_and_mask_nothing_is_known(capture):
    truth = Truth(capture.image(0, 0), None, np.zeros((40, 36), bool), whole=False)
    assert set(picture_scores(capture.image(0, 0), truth).values()) == {None}


def test_a_capture_without_test_cameras_says_so(capture):
    small = MovingCapture(Path("small"))
    small.split = type(small.split)(small.split.train, (), ())
    with pytest.raises(CaptureError, match="no test cameras"):
        evaluate_body(true_body(capture), small)
    assert evaluate_body(true_body(capture), small, cameras=(0,), frames=(0,))["psnr"] > 100


def test_shared_frames_are_shown_by_the_earlier_window_at_every_rate(capture):
    for fps in (15.0, 24.0, 25.0, 30.0):
        body = true_body(capture)
        body.fps = fps
        body.windows = (Window(0, 31), Window(31, 62), Window(62, 125), Window(125, 400))
        found = [body.window_at(frame / fps) for frame in (0, 31, 32, 62, 125, 126)]
        assert found == [0, 0, 1, 1, 2, 3]


def test_moving_pixels_in_closed_form():
    still = np.full((20, 30, 3), 0.5, np.float32)
    after = still.copy()
    after[5, 10, 1] += 26 / 255
    after[15, 25] += 25 / 255 - 1e-4  # not enough
    after[0, 0, 2] -= 26 / 255
    found = moving_pixels(still, [still, after])
    expected = np.zeros((20, 30), bool)
    expected[2:9, 7:14] = True
    expected[:4, :4] = True
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(moving_pixels(after, [still]), expected)
    assert not moving_pixels(still, []).any()


def test_psnr_on_moving_pixels_counts_no_others():
    truth = np.full((20, 30, 3), 0.5, np.float32)
    weight = np.zeros((20, 30), np.float32)
    weight[2:9, 7:14] = 1.0
    weight[9, 7:14] = 0.5
    predicted = truth + 0.3
    predicted[weight > 0] = 0.6
    assert psnr_moving(predicted, truth, weight) == pytest.approx(20, abs=1e-4)
    weight[8:10] = 0
    assert psnr_moving(predicted, truth, weight) is None  # 42 pixels


def test_windows_that_agree_do_not_flicker(truth_scores):
    assert truth_scores["flicker"] == 0
    assert truth_scores["per_border"] == [{"frame": 4, "flicker": 0.0}]


def test_flicker_is_the_constant_difference_of_two_windows(capture):
    cameras = novel_cameras(capture.cameras)
    (found,) = border_flicker(true_body(capture, (0.02, 0.1)), cameras)
    assert len(cameras) == 20
    assert found == pytest.approx(0.08, abs=1e-4)
    assert novel_cameras(capture.cameras)[7].world_to_camera == pytest.approx(
        cameras[7].world_to_camera
    )


def test_difference_on_the_person_in_closed_form():
    first, second = np.zeros((4, 5, 3)), np.zeros((4, 5, 3))
    alphas = np.zeros((2, 4, 5))
    second[1, 1:3] = (0.1, 0.2, 0.3)
    alphas[0, 1, 0:2] = 0.5
    alphas[1, 1, 1:3] = 1.0
    assert masked_difference(first, second, *alphas) == pytest.approx(1.2 / (3 * 2.5))
    assert masked_difference(first, first, alphas[0] * 0, alphas[0] * 0) == 0


def test_one_window_has_no_border(capture):
    body = true_body(capture)
    body.windows, body.models = body.windows[:1], body.models[:1]
    scores = evaluate_body(body, capture, cameras=(0,))
    assert scores["flicker"] is None and scores["per_border"] == []
    assert len(scores["per_frame"]) == 5
