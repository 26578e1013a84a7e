"""Eyeballs are found behind lids and turn by the gaze; what is no ball keeps still."""

import tracemalloc

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ico3d.avatar.baking.eyes import eyeballs
from ico3d.avatar.baking.eyes.eyeballs import RADIUS, with_still_eyes, with_turning_eyes
from ico3d.avatar.poseable import poseable_of
from ico3d.avatar.render_bundle import gaze_at
from ico3d.bundle.evaluate import centres
from ico3d.bundle.format import Bundle
from ico3d.bundle.head import BakedHead, no_displacements
from ico3d.bundle.manifest import GazeInfo
from ico3d.bundle.packaged import NAME, bundle_path

CENTRES = np.array([[-0.031, 0.004, 0.05], [0.031, 0.004, 0.05]])
IDLE = np.zeros(39, np.float32)


def face(noise: float = 0.0, radius: float = RADIUS) -> tuple[BakedHead, np.ndarray, np.ndarray]:
    """A head of balls behind a wall of lids with a hole for each eye, its landmarks, and which
    Gaussians are of balls."""
    rng = np.random.default_rng(0)
    marks = np.zeros((68, 3))
    places, kinds = [], []
    for centre, lids in zip(CENTRES, eyeballs.LIDS, strict=True):
        across = rng.uniform(-0.9, 0.9, 500)
        up = rng.uniform(-0.5, 0.5, 500)
        ball = np.stack([across, up, np.sqrt(1 - across**2 * 0.9 - up**2 * 0.9)], 1)
        ball *= radius / np.linalg.norm(ball, axis=1, keepdims=True)
        ball += rng.normal(0, 1, ball.shape) * (0.0001, 0.0001, 0.0001 + noise)
        wall = rng.uniform(-1, 1, (900, 3)) * (0.02, 0.012, 0.0005)
        wall = wall[(wall[:, 0] / 0.011) ** 2 + (wall[:, 1] / 0.004) ** 2 > 1]
        wall[:, 2] += 0.016 - 0.2 * np.abs(wall[:, 0])
        places += [centre + ball, centre + wall]
        kinds += [np.ones(len(ball), bool), np.zeros(len(wall), bool)]
        angles = np.pi + np.arange(6) * np.pi / 3
        lid = np.stack([0.0115 * np.cos(angles), 0.0045 * np.sin(angles), np.full(6, 0.012)], 1)
        marks[lids] = centre + lid + (0.001, -0.0015, 0.0)  # trackers are off by a millimetre
    means = np.concatenate(places).astype(np.float32)
    return head_of(means), marks, np.concatenate(kinds)


def head_of(means: np.ndarray) -> BakedHead:
    count = len(means)
    return BakedHead(
        means=means,
        quats=np.tile(np.float16([1, 0, 0, 0]), (count, 1)),
        scales=np.full((count, 3), np.log(0.0005), np.float16),
        mean_logits=np.full((count, 4), 2.0, np.float16),
        basis=np.zeros((1, count, 4), np.int8),
        basis_scale=np.ones(count, np.float32),
        **no_displacements(count, 39),
        w1=np.zeros((39, 8), np.float32),
        b1=np.zeros(8, np.float32),
        w2=np.zeros((8, 1), np.float32),
        b2=np.zeros(1, np.float32),
    )


def test_balls_turn_and_lids_do_not():
    head, marks, of_balls = face()
    turning, gaze = with_turning_eyes(head, IDLE, marks)
    assert gaze is not None and gaze.most == eyeballs.MOST_TURN
    np.testing.assert_allclose(gaze.eyes, CENTRES.mean(0), atol=0.0006)
    assert (centres(turning, IDLE) == head.means).all()
    moved = np.abs(centres(turning, IDLE, (0.2, 0.1)) - head.means).max(axis=1) > 1e-4
    assert not moved[~of_balls].any()
    left = head.means[:, 0] > 0
    for side, centre in zip((~left, left), CENTRES, strict=True):
        arms = head.means - centre  # what is seen between the lids turns whole
        seen = side & of_balls & ((arms[:, 0] / 0.0105) ** 2 + (arms[:, 1] / 0.0038) ** 2 < 1)
        assert seen.sum() > 100 and moved[seen].mean() > 0.95


@pytest.mark.parametrize(("yaw", "pitch"), [(0.1, 0.0), (0.0, 0.08), (-0.15, -0.05)])
def test_eyes_turn_to_the_left_and_down_about_their_centres(yaw: float, pitch: float):
    head, marks, _ = face()
    turning, _ = with_turning_eyes(head, IDLE, marks)
    moved = centres(turning, IDLE, (yaw, pitch)) - head.means
    for centre in CENTRES:
        arms = head.means - centre
        front = np.linalg.norm(arms - (0, 0, RADIUS), axis=1) < 0.001  # the pupil
        by = moved[front].mean(axis=0)
        np.testing.assert_allclose(by[:2], (RADIUS * yaw, -RADIUS * pitch), atol=0.00015)


def test_children_and_large_eyes_are_found():
    for radius in (0.0115, 0.0135):
        head, marks, of_balls = face(radius=radius)
        turning, gaze = with_turning_eyes(head, IDLE, marks)
        assert gaze is not None
        moved = np.abs(centres(turning, IDLE, (0.2, 0.0)) - head.means).max(axis=1) > 1e-4
        assert not moved[~of_balls].any() and moved[of_balls].mean() > 0.6


def test_a_crowd_between_the_lids_takes_little_memory():
    head, marks, _ = face()
    rng = np.random.default_rng(1)
    crowd = marks[36:42].mean(0) + rng.uniform(-1, 1, (50_000, 3)) * (0.008, 0.003, 0.004)
    crowded = head_of(np.concatenate([head.means, crowd]).astype(np.float32))
    tracemalloc.start()
    with_turning_eyes(crowded, IDLE, marks)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 100e6  # bytes; 8 GB where each is compared with each place


def test_what_is_no_ball_keeps_still():
    head, marks, _ = face(noise=0.003)  # as depth from one camera
    assert with_turning_eyes(head, IDLE, marks) == (head, None)
    assert with_turning_eyes(head, IDLE, None) == (head, None)
    assert with_turning_eyes(head, IDLE, marks + np.array([0, 0.03, 0])) == (head, None)
    for odd in (0 * marks, marks * (1, 0, 1), marks + 1.0, marks * 1e300):
        assert with_turning_eyes(head, IDLE, odd) == (head, None)


def test_still_eyes_are_as_before():
    head, marks, _ = face()
    turning, _ = with_turning_eyes(head, IDLE, marks)
    still = with_still_eyes(turning)
    assert still.num_displacements == 0
    again, gaze = with_turning_eyes(with_still_eyes(turning), IDLE, marks)
    assert isinstance(gaze, GazeInfo)
    assert (again.displacement_basis == turning.displacement_basis).all()


@pytest.mark.parametrize("turned", [0.0, 0.6])
def test_eyes_look_at_a_point_as_far_as_they_turn(turned: float):
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec([0.0, turned, 0.0]).as_matrix()
    pose[:3, 3] = 1.0, 1.5, -2.0
    info = GazeInfo((0.0, 0.01, 0.06), (0.2, 0.1))

    def seen(*local: float) -> tuple[float, float]:
        point = pose[:3, :3] @ (np.array(info.eyes) + local) + pose[:3, 3]
        return gaze_at(info, np.linalg.inv(pose), point)

    assert seen(0.1, 0.0, 1.0) == pytest.approx((np.arctan(0.1), 0.0))
    assert seen(0.0, -0.05, 1.0) == pytest.approx((0.0, np.arctan(0.05)))
    assert seen(-3.0, 2.0, 1.0) == pytest.approx((-0.2, -0.1))


def test_the_packaged_person_looks_at_who_films_her():
    bundle = Bundle.open(bundle_path(NAME))
    info = bundle.manifest.head
    assert info is not None and info.gaze is not None
    idle = np.array(info.idle_expression, np.float32)
    poses = {}
    for side in (-1.0, 1.0):
        person = poseable_of(bundle, 0, visitor=np.array([side, 1.5, 2.0]))
        assert person is not None and person.head is not None
        poses[side] = person.head(np.eye(4), idle).means.numpy()
    apart = poses[1.0] - poses[-1.0]
    eyes = np.linalg.norm(apart, axis=1) > 0.003
    assert 100 < eyes.sum() < 600  # of 16,000
    assert np.median(apart[eyes, 0]) > 0.004  # to her left where the visitor is
