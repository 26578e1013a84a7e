"""Training a head whose skin moves: it is learnt to move, where it would else fade."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from ico3d.capture.face.landmark_motion import STEADY
from ico3d.head.model_folder import TrainedHead
from ico3d.head.settings import PRESETS
from ico3d.head.train_head import HeadJob, train_head, trainer_of
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render
from support.heads.tiny_capture import POINTS, SIZE, TinyCapture
from support.photograph import photograph
from support.settings import changed

pytestmark = pytest.mark.slow

SHRINK = 0.3
"""The shell is as small as a head; landmarks lie as near to one another as on a face."""
FALL = 0.015
"""Metres by which the lower half falls."""
SETTINGS = changed(
    PRESETS["cpu"],
    {
        "steps": 150,
        "initial.gaussians": 300,
        "density.until": 0,
        "close_ups": 2,
        "rates.basis_weight_decay": 0.0,
    },
)


class Falling(TinyCapture):
    """The lower half of the shell falls with the first blendshape, and so do its landmarks."""

    def __init__(self, path):
        super().__init__(path)
        rng = np.random.default_rng(1)
        self._points *= SHRINK
        self._colors = rng.random((POINTS, 3))  # so that one sees where skin is
        ways = rng.normal(size=(68, 3))
        ways[list(STEADY), 1] = abs(ways[list(STEADY), 1])  # the upper half stays on the skull
        self._rest = SHRINK * 0.2 * ways / np.linalg.norm(ways, axis=1, keepdims=True)
        nearer = np.diag([1 / SHRINK, 1 / SHRINK, 1])
        nearer[:2, 2] = (1 - 1 / SHRINK) * SIZE / 2
        self.cameras = tuple(
            replace(camera, intrinsics=nearer @ camera.intrinsics) for camera in self.cameras
        )

    def _pose(self, frame):
        pose = np.eye(4)
        pose[0, 3] = 0.006 * np.sin(frame)
        return pose

    def _moved(self, points, frame):
        falls = FALL * self._weights[frame, 0] * np.clip(-points[:, 1] / 0.03, 0, 1)  # (P,)
        return points - falls[:, None] * (0, 1, 0)

    def landmarks_3d(self, frame):
        return self._moved(self._rest, frame)

    def _render(self, camera, frame, background):
        gaussians = Gaussians(
            means=torch.from_numpy(self._moved(self._points, frame)).float(),
            quats=torch.tensor([1.0, 0, 0, 0]).repeat(POINTS, 1),
            scales=torch.full((POINTS, 3), 0.004),
            opacities=torch.full((POINTS,), 0.9),
            colors=torch.from_numpy(self._colors).float(),
        )
        behind = None if background is None else torch.from_numpy(background)
        return photograph(gaussians, self.cameras[camera].moved(self._pose(frame)), behind)


def _job(displacements, variant="full") -> HeadJob:
    return HeadJob(
        "blendshapes", variant, "builtin", 0, changed(SETTINGS, {"displacements": displacements})
    )


def _score(head: TrainedHead, capture) -> float:
    track, errors = head.track(capture), []
    for frame in capture.split.test:
        view = capture.cameras[frame % 2].moved(capture.world_from_head(frame))
        behind = torch.from_numpy(capture.background(frame % 2))
        with torch.no_grad():
            picture = render(head.model(track.at(frame)), [view], behind).rgb[0].numpy()
        errors.append(((picture - capture.image(frame % 2, frame)) ** 2).mean())
    return float(-10 * np.log10(np.mean(errors)))


def test_skin_that_moves_is_learnt_better_by_a_head_that_moves(tmp_path):
    capture = Falling(tmp_path / "falling")
    moving, still = (train_head(capture, tmp_path / str(n), _job(n)) for n in (4, 0))
    assert _score(moving, capture) > _score(still, capture) + 1
    loaded = TrainedHead.load(tmp_path / "4")
    assert _score(loaded, capture) == _score(moving, capture)


def test_gaussians_begin_to_move_as_the_landmarks_do(tmp_path):
    capture = Falling(tmp_path / "falling")
    trainer, _ = trainer_of(capture, _job(4), "cpu")
    model = trainer.model
    assert model.shape.displacements == 1  # of four: the landmarks know one
    falls = np.diff([capture._weights[frame, 0] for frame in (0, 5)]).item() * FALL
    with torch.no_grad():
        places = [model.displaced(trainer.seen_moves[f]).numpy() for f in (0, 5)]
        told = [model(trainer.track.at(frame)).means.numpy() for frame in (0, 5)]
    np.testing.assert_allclose(told, places, atol=0.1 * abs(falls))  # blendshapes tell it all
    moved = (places[1] - places[0])[:, 1]  # (N,)
    low, high = (np.abs(places[0][:, 1] - y) < 0.015 for y in (-0.045, 0.045))
    assert moved[low].mean() == pytest.approx(-falls, rel=0.35)
    assert abs(moved[high].mean()) < 0.1 * abs(falls)


@pytest.mark.parametrize("job", [_job(4, "static"), _job(0)], ids=["static", "none"])
def test_heads_that_stand_still(tmp_path, job):
    trainer, _ = trainer_of(Falling(tmp_path / "falling"), job, "cpu")
    assert "displacement_basis" not in dict(trainer.model.named_parameters())


def test_a_recording_without_landmarks_moves_nothing(tmp_path):
    trainer, _ = trainer_of(TinyCapture(tmp_path / "tiny"), _job(4), "cpu")
    assert trainer.model.shape.displacements == 0
