"""Portraits whose shoulders stay where they are while the head turns."""

import dataclasses

import numpy as np
import pytest
import torch
from scipy import ndimage
from scipy.spatial.transform import Rotation

from ico3d.head.learning_rows import LearningRows
from ico3d.head.model import HeadModel
from ico3d.head.portrait.neck import BELOW, BENDS, Neck, bent
from ico3d.head.portrait.shift import Seen, shift
from ico3d.head.portrait.shoulders import Shoulders, neck_of, resting_place, shoulders_of
from ico3d.head.settings import PRESETS
from ico3d.head.train_head import HeadJob, train_head
from ico3d.head.views import PictureCache, head_pose
from ico3d.measure.head import evaluate_head
from support.heads.shapes import head_shape
from support.recordings.two_balls import TwoBalls, ball_points, seen_by
from support.settings import changed

NECK = Neck((0.0, 0.0, 0.0), 0.1, 0.16)


class Portrait(TwoBalls):
    """The two balls by one camera, with a head that moves a lot and landmarks on it."""

    tells_head = True

    def __init__(self, path, size=48):
        super().__init__(path, size)
        self.cameras = self.cameras[2:3]

    def head_points(self, frame=0):
        return np.concatenate([ball_points(0, 400), ball_points(1, 400)])

    def head_mask(self, camera, frame):
        shown, _ = seen_by(self.cameras[camera], self.world_from_head(frame))
        return (shown == 0).astype(np.float32)

    def landmarks_3d(self, frame):
        points = np.zeros((68, 3))
        points[[0, 16]] = [[-0.08, 0, 0], [0.08, 0, 0]]
        points[8] = [0, -0.09, 0.03]
        return points

    def world_from_head(self, frame):
        pose = super().world_from_head(frame)
        pose[:3, :3] = Rotation.from_rotvec([0, 0.3 * np.sin(0.5 * frame), 0]).as_matrix()
        pose[0, 3] *= 4
        return pose


def test_what_follows_the_shoulders():
    far, near, below = BENDS[1] * 0.1, BENDS[0] * 0.1, -BELOW[1] * 0.1
    points = [
        *([0, -0.2, 0], [0.2, below, 0], [0, -far, 0]),  # all of it
        *([0, 0.3, 0], [0, -near, 0], [0.3, -BELOW[0] * 0.1, 0], [0, 0, 0.09]),  # nothing
        [0, -(far + near) / 2, 0],  # half
    ]
    share = NECK.follows(torch.tensor(points))
    np.testing.assert_allclose(share, [1, 1, 1, 0, 0, 0, 0, 0.5], atol=1e-5)


def test_each_gaussian_makes_its_share_of_the_motion():
    torch.manual_seed(0)
    model = HeadModel(head_shape(1, box_size=0.2), 3)
    model.means.data = torch.randn(3, 3)
    model.quats.data = torch.randn(3, 4)
    gaussians = model(torch.zeros(1))
    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_rotvec([0.1, -0.2, 0.05]).as_matrix()
    motion[:3, 3] = [0.1, 0, -0.3]
    moved = bent(gaussians, torch.tensor([0.0, 1.0, 0.5]), torch.from_numpy(motion))
    whole = gaussians.transform(motion)
    for name in ("means", "quats"):
        np.testing.assert_array_equal(*(getattr(g, name)[0].detach() for g in (moved, gaussians)))
    np.testing.assert_allclose(moved.means[1].detach(), whole.means[1].detach(), atol=1e-6)
    turns = [Rotation.from_quat(g.quats[1].detach(), scalar_first=True) for g in (moved, whole)]
    assert (turns[0].inv() * turns[1]).magnitude() < 1e-5
    middle = (gaussians.means[2] + whole.means[2]) / 2
    np.testing.assert_allclose(moved.means[2].detach(), middle.detach(), atol=1e-6)
    moved.means.sum().backward()
    assert model.means.grad is not None and bool(model.means.grad.isfinite().all())


def picture(of_shoulders, of_neck):
    """Shoulders and a neck between them, each with its own texture and (right, down) shift."""
    random = np.random.default_rng(0)
    textures = [ndimage.gaussian_filter(random.normal(size=(96, 128)), 4) for _ in range(2)]
    shifts = of_shoulders, of_neck
    moved = [
        ndimage.shift(t, s[::-1], order=3, mode="wrap")
        for t, s in zip(textures, shifts, strict=True)
    ]
    neck = np.zeros((96, 128))
    neck[:, 48:80] = 1
    mask = np.zeros((96, 128))
    mask[30:] = 1
    return Seen(0.5 + 4 * np.where(neck > 0, moved[1], moved[0]), mask, neck)


def test_shoulders_are_followed_and_a_neck_that_slides_does_not_matter():
    still = picture((0, 0), (0, 0))
    np.testing.assert_array_equal(shift(still, still), [0, 0])
    found = shift(still, picture((5.3, -2.6), (5.3, 4.0)))
    np.testing.assert_allclose(found, [5.3, -2.6], atol=0.35)


def test_what_is_hardly_seen_or_far_away_is_not_believed():
    still, moved = picture((0, 0), (0, 0)), picture((5, 0), (5, 0))
    nothing = dataclasses.replace(moved, mask=np.zeros_like(moved.mask))
    np.testing.assert_array_equal(shift(still, nothing), [0, 0])
    plain = dataclasses.replace(still, grey=np.full_like(still.grey, 0.5))
    np.testing.assert_array_equal(shift(plain, plain), [0, 0])


def test_whose_necks_bend(tmp_path, monkeypatch):
    portrait = Portrait(tmp_path)
    neck = neck_of(portrait)
    assert neck == Neck((0, 0, 0), round(float(np.hypot(0.09, 0.03)), 6), 0.16)
    assert neck_of(TwoBalls(tmp_path)) is None, "several cameras"
    for name, value in (("tells_head", False), ("moves_behind", True), ("shows", "body")):
        with monkeypatch.context() as patch:
            patch.setattr(Portrait, name, value)
            assert neck_of(portrait) is None, name
    monkeypatch.setattr(Portrait, "landmarks_3d", lambda *_: None)
    assert neck_of(portrait) is None


def test_shoulders_stay_in_the_world(tmp_path):
    portrait = Portrait(tmp_path)
    unseen = Shoulders(portrait, NECK, lambda _: None)
    point = torch.tensor([[0.0, -0.25, 0.1]])
    places = [
        head_pose(portrait, f) @ unseen.motion(f).double().numpy() @ [*point[0], 1] for f in (0, 7)
    ]
    np.testing.assert_allclose(places[0], places[1], atol=1e-7)
    np.testing.assert_allclose(places[0], resting_place(portrait) @ [*point[0], 1], atol=1e-7)
    seen = shoulders_of(portrait, NECK, PictureCache(portrait, 0))
    assert seen is not None and shoulders_of(portrait, None, PictureCache(portrait, 0)) is None
    assert np.abs(seen.place(7) - unseen.place(7)).max() < 0.01, "the trunk does not move"


def test_shoulders_learn_no_expression():
    shape = dataclasses.replace(head_shape(2, box_size=0.2), neck=NECK)
    track = type("Track", (), {"size": 2, "names": ("jawOpen", "browDown")})()
    rows = LearningRows(shape, track, (), even=False)
    means = torch.tensor([[0, -0.3, 0], [0, 0.05, 0.0]])
    parts = [(r.tolist(), None if n is None else n.tolist()) for r, n in rows.parts(means, ())]
    assert parts == [
        ([False, False, True], None),
        ([True, True, False], [False, True]),
        ([False, False, False], [False, True]),
    ]
    plain = LearningRows(dataclasses.replace(shape, neck=None), track, (), even=False)
    assert [(r.tolist(), n) for r, n in plain.parts(means, ())] == [([True] * 3, None)]


@pytest.mark.slow
def test_a_portrait_with_shoulders_is_drawn_better(tmp_path, monkeypatch):
    monkeypatch.setattr("ico3d.measure.head.landmark_reader", lambda: None)  # balls have no lips
    settings = changed(PRESETS["cpu"], {"steps": 120, "initial.gaussians": 700, "density.until": 0})
    job = HeadJob("blendshapes", "full", "builtin", 0, settings)
    portrait, scores = Portrait(tmp_path), {}
    for bends in (True, False):
        with monkeypatch.context() as patch:
            if not bends:
                patch.setattr("ico3d.head.initial_gaussians.neck_of", lambda _: None)
            head = train_head(portrait, tmp_path / str(bends), job)
        assert (head.model.shape.neck is None) is not bends
        loaded = type(head).load(tmp_path / str(bends))
        assert loaded.model.shape == head.model.shape
        scores[bends] = evaluate_head(loaded, portrait, portrait.split.test, None)["psnr"]
    assert scores[True] > scores[False] + 1.5, scores
