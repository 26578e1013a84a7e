"""A head recorded with points on the head alone: neck and shoulders are modelled all the same."""

import dataclasses

import numpy as np
import pytest
import torch

from ico3d.common.camera import look_at
from ico3d.errors import CaptureError
from ico3d.head.initial_gaussians import initial_head
from ico3d.head.model import HeadModel
from ico3d.head.settings import PRESETS
from ico3d.head.train_head import HeadJob, train_head
from ico3d.head.views import PictureCache
from ico3d.measure.head import evaluate_head
from ico3d.splat.render import render
from support.heads.shapes import head_shape
from support.recordings.two_balls import HEAD, TRUNK, TwoBalls, seen_by
from support.settings import changed

pytestmark = pytest.mark.slow

SETTINGS = changed(
    PRESETS["cpu"],
    {
        "steps": 200,
        "initial.gaussians": 700,
        "density.max_gaussians": 1100,
        "density.begin": 40,
        "density.every": 40,
        "density.until": 140,
    },
)


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    return TwoBalls(tmp_path_factory.mktemp("capture"))


@pytest.fixture(scope="module")
def head(capture, tmp_path_factory):
    folder = tmp_path_factory.mktemp("model") / "head"
    return train_head(capture, folder, HeadJob("blendshapes", "full", "builtin", 0, SETTINGS))


def test_all_of_the_person_is_learnt(head, capture, monkeypatch):
    monkeypatch.setattr("ico3d.measure.head.landmark_reader", lambda: None)  # balls have no lips
    scores = evaluate_head(head, capture, capture.split.test, None)
    assert scores["psnr_mask"] > 24
    assert scores["psnr"] > 22  # the curtain is no part of the comparison


def test_no_side_shows_beams(head, capture):
    """What is rendered outside of the person, from where no camera stood, and the largest splat."""
    frame = capture.split.test[0]
    pose, middle = capture.world_from_head(frame), np.array([0, -0.11, 0])
    spilt = []
    for turn in np.radians([75, -75, 100, -100, 150]):
        eye = middle + 1.35 * np.array([np.sin(turn), 0.2, np.cos(turn)])
        camera = dataclasses.replace(capture.cameras[0], world_to_camera=look_at(eye, middle))
        with torch.no_grad():
            gaussians = head.model(torch.from_numpy(capture.blendshapes(frame)))
            alpha = render(gaussians, [camera.moved(pose)]).alpha[0].numpy()
        person = seen_by(camera, pose)[0] >= 0
        spilt.append((alpha * ~person).sum() / person.sum())
    assert max(spilt) < 0.2, spilt
    largest = float(head.model.log_scales.detach().exp().max())
    assert largest < 0.15 * TRUNK


def test_gaussians_begin_on_the_whole_person(capture, caplog):
    with caplog.at_level("INFO"):
        model = initial_head(capture, SETTINGS, "full", 1, np.random.default_rng(0))
    means = model.means.detach().numpy()
    on_trunk = float((np.linalg.norm(means, axis=1) > 1.2 * HEAD).mean())
    assert len(means) == SETTINGS.initial.gaussians and 0.4 < on_trunk < 0.8
    assert model.shape.box_size > 0.15  # positions are encoded, and sizes bounded, for all of it
    assert "leave out" in caplog.text


def test_without_masks_the_points_are_all_there_is(capture, monkeypatch):
    monkeypatch.setattr(TwoBalls, "mask", lambda *_: None)
    model = initial_head(capture, SETTINGS, "full", 1, np.random.default_rng(0))
    assert float(model.means.detach().norm(dim=1).max()) < 0.101


def test_pictures_without_a_mask_do_not_teach_the_curtain(capture, monkeypatch, caplog):
    whole = TwoBalls.mask
    monkeypatch.setattr(
        TwoBalls, "mask", lambda self, c, f: None if c == 2 or f == 5 else whole(self, c, f)
    )
    views = PictureCache(capture, 0).views(range(4, 7))
    assert [(v.frame, v.camera_index) for v in views] == [
        (frame, camera) for frame in (4, 6) for camera in (0, 1, 3, 4, 5)
    ]
    assert "8 of 18 pictures are left out" in caplog.text
    monkeypatch.setattr(TwoBalls, "mask", lambda *_: None)
    assert len(PictureCache(capture, 0).views(range(4, 7))) == 18


def test_masks_that_begin_late_are_found_all_the_same(capture, monkeypatch):
    whole = TwoBalls.mask
    late = lambda self, c, f: whole(self, c, f) if f >= 20 else None  # noqa: E731
    monkeypatch.setattr(TwoBalls, "mask", late)
    model = initial_head(capture, SETTINGS, "full", 1, np.random.default_rng(0))
    assert float((model.means.detach().norm(dim=1) > 1.2 * HEAD).float().mean()) > 0.4


def test_masks_that_contradict_each_other_are_said(capture, monkeypatch, caplog):
    def mask(self, camera, frame):  # half of the cameras were masked for the head alone
        shown, _ = seen_by(self.cameras[camera], self.world_from_head(frame))
        return ((shown == 0) if camera % 2 else (shown >= 0)).astype(np.float32)

    monkeypatch.setattr(TwoBalls, "mask", mask)
    initial_head(capture, SETTINGS, "full", 1, np.random.default_rng(0))
    assert "and the masks do not agree on where that is" in caplog.text


def test_a_training_on_few_masked_pictures_is_refused(capture, tmp_path, monkeypatch):
    whole = TwoBalls.mask
    monkeypatch.setattr(
        TwoBalls, "mask", lambda self, c, f: whole(self, c, f) if (c, f) == (0, 0) else None
    )
    job = HeadJob("blendshapes", "full", "builtin", 0, SETTINGS)
    with pytest.raises(CaptureError, match="only 1 of 180 pictures have a mask"):
        train_head(capture, tmp_path, job)


def test_no_gaussian_outgrows_what_density_control_allows():
    from ico3d.head.density import bound_scales

    model = HeadModel(head_shape(1, box_size=0.2), 3)
    model.log_scales.data = torch.tensor([[0.001] * 3, [0.02] * 3, [0.5, 0.01, 0.001]]).log()
    bound_scales(model)
    expected = [[0.001] * 3, [0.02] * 3, [0.02, 0.01, 0.001]]
    np.testing.assert_allclose(model.log_scales.detach().exp(), expected, rtol=1e-5)
