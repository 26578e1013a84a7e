"""Crops of recorded pictures about the mouth, and what learns from them."""

import numpy as np
import pytest
import torch

from ico3d.head.closeups import CloseUp, CloseUps
from ico3d.head.expressions import (
    FASTEST,
    USUAL,
    BlendshapeTrack,
    SpeechTrack,
    evening_rates,
    is_of_eyes,
)
from ico3d.head.initial_gaussians import initial_head
from ico3d.head.settings import PRESETS
from ico3d.head.train_head import HeadJob, trainer_of
from ico3d.head.views import View, view_of
from ico3d.speech.network import SpeechAdaptor
from support.heads.tiny_capture import SIZE, TinyCapture
from support.settings import changed

WIDTH = 0.2


class Mouthed(TinyCapture):
    """A capture with a mouth 0.2 m wide about (0, −0.05, 0.2), which camera 0 sees from 0.8 m."""

    def landmarks_3d(self, frame):
        points = np.zeros((68, 3))
        points[48:] = (0, -0.05, 0.2)
        points[48, 0], points[54, 0] = -WIDTH / 2, WIDTH / 2
        return points

    def _pose(self, frame):
        return np.eye(4)


def _views(capture, camera=0) -> list[View]:
    return [view_of(capture, camera, frame) for frame in range(3)]


def _close_up(capture) -> CloseUp:
    views = _views(capture)
    return CloseUps(capture, views, 0).about(views[0])


def test_a_close_up_is_a_square_about_the_mouth(tmp_path):
    capture = Mouthed(tmp_path)
    found = CloseUps(capture, _views(capture), 0)
    assert len(found) == 3
    box = found.about(found.views[0]).box
    half = 0.75 * WIDTH * 1.25 * SIZE / 0.8  # 11.25 pixels
    place = np.array([SIZE / 2, SIZE / 2 + 0.05 * 1.25 * SIZE / 0.8])
    np.testing.assert_array_equal([box.left, box.top], np.floor(place - half))
    np.testing.assert_array_equal([box.width, box.height], [24, 23])


def test_the_part_of_a_view_shows_the_same_places_as_the_whole(tmp_path):
    capture = Mouthed(tmp_path)
    close = _close_up(capture)
    point = np.array([[0.03, -0.06, 0.2]])
    whole, part = (view.camera.project(point)[0] for view in (close.view, close.part))
    np.testing.assert_allclose(part, whole - [[close.box.left, close.box.top]])
    assert (close.part.camera.width, close.part.camera.height) == close.box.place[2:]


def test_only_gaussians_at_the_mouth_or_near_it_are_shown(tmp_path):
    capture = Mouthed(tmp_path)
    close = _close_up(capture)
    edge = WIDTH * 0.75
    beside = [[0, -0.05, 0.2], [1.1 * edge, -0.05, 0.2], [1.5 * edge, -0.05, 0.2]]
    beside += [[0, -0.05, -0.1], [0, 0, 1.5]]  # the back of the head, and behind the camera
    assert close.shown(torch.tensor(beside)).tolist() == [0, 1]


def test_there_is_none_without_landmarks_from_behind_or_of_a_few_pixels(tmp_path):
    capture, far = Mouthed(tmp_path), Mouthed(tmp_path, 24)
    assert not CloseUps(TinyCapture(tmp_path), _views(capture), 0)
    assert not CloseUps(far, _views(far), 0)
    turned = np.diag([-1.0, 1.0, -1.0, 1.0])
    behind = [View(0, 0, view.camera.moved(turned)) for view in _views(capture)]
    assert not CloseUps(capture, behind, 0)


def test_a_close_up_teaches_the_basis_of_the_gaussians_it_shows_alone(tmp_path):
    capture = Mouthed(tmp_path)
    settings = changed(PRESETS["cpu"], {"close_ups": 1, "initial.gaussians": 200})
    trainer, _ = trainer_of(capture, HeadJob("blendshapes", "full", "builtin", 0, settings), "cpu")
    before = {name: value.detach().clone() for name, value in trainer.model.named_parameters()}
    close = _close_up(capture)
    trainer.look_closer(close, 0)
    after = dict(trainer.model.named_parameters())
    moved = (after["basis"] != before["basis"]).any(2).any(0)  # (N,)
    shown = close.shown(trainer.model.means)
    assert 0 < moved.sum() <= len(shown) < len(trainer.model)
    assert set(torch.nonzero(moved)[:, 0].tolist()) <= set(shown.tolist())
    assert all(torch.equal(after[name], before[name]) for name in before if name != "basis")
    assert all(value.grad is None for value in after.values())


def test_small_blendshapes_learn_faster_and_unused_ones_as_usual(tmp_path):
    capture = TinyCapture(tmp_path)
    capture._weights[:] = [0.6, 0.001, 0.0]
    track = BlendshapeTrack(capture, ("redden", "pale", "unused"))
    assert evening_rates(track, range(5)).tolist() == pytest.approx([USUAL / 0.6, FASTEST, 1.0])


def test_gaussians_begin_in_the_order_of_their_distance_from_the_mouth(tmp_path):
    capture, rng = Mouthed(tmp_path), np.random.default_rng(0)
    settings = changed(PRESETS["cpu"], {"initial.gaussians": 60})
    means = initial_head(capture, settings, "full", 3, rng).means.detach()
    mouth = torch.from_numpy(capture.landmarks_3d(0)[48:].mean(0)).float()
    away = (means - mouth).norm(dim=1)
    assert len(away) == 60 and (away.diff() >= -1e-6).all()


class Browed(Mouthed):
    """A capture whose last blendshape moves a brow."""

    blendshape_names = ("redden", "pale", "browInnerUp")

    def __init__(self, path):
        super().__init__(path)
        self._weights[:] = [0.5, 0.2, 0.7]


def test_the_rows_of_eyes_and_brows_are_known_by_name_and_in_speech_by_place(tmp_path):
    capture = Browed(tmp_path)
    named = BlendshapeTrack(capture, ("redden", "browInnerUp", "pale"))
    assert is_of_eyes(named).tolist() == [False, True, False]
    spoken = SpeechTrack(capture, np.zeros((40, 64), np.float32), SpeechAdaptor(64))
    assert is_of_eyes(spoken).nonzero()[:, 0].tolist() == list(range(32, 39))


def test_gaussians_at_the_mouth_learn_nothing_from_eyes_and_brows(tmp_path):
    capture = Browed(tmp_path)
    settings = changed(PRESETS["cpu"], {"close_ups": 2, "initial.gaussians": 200})
    trainer, _ = trainer_of(capture, HeadJob("blendshapes", "full", "builtin", 0, settings), "cpu")
    mouth = torch.tensor([0, -0.05, 0.2])
    at_mouth = (trainer.model.means.detach() - mouth).norm(dim=1) < 0.75 * WIDTH  # (N,)
    trainer.step(0)
    learnt = (trainer.model.basis != 0).any(2)  # (R, N)
    assert 0 < at_mouth.sum() < len(at_mouth)
    assert not learnt[2, at_mouth].any()
    assert learnt[:2, at_mouth].any(1).all() and learnt[:3, ~at_mouth].any(1).all()


def test_without_close_ups_all_gaussians_learn_from_all_rows(tmp_path):
    settings = changed(PRESETS["cpu"], {"close_ups": 0, "initial.gaussians": 200})
    job = HeadJob("blendshapes", "full", "builtin", 0, settings)
    trainer, _ = trainer_of(Browed(tmp_path), job, "cpu")
    trainer.step(0)
    learnt = (trainer.model.basis != 0).any(2)  # (R, N)
    assert torch.equal(learnt[2], learnt[0])
