import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from ico3d.capture.headpose.shape import (
    inverse,
    moved,
    rigid_fit,
    rigid_head,
    similarity_fit,
)


def _poses(count, random):
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3, :3] = Rotation.random(count, random).as_matrix()
    poses[:, :3, 3] = random.normal(0, 2, (count, 3))
    return poses


def _face(random, count=40):
    return random.normal(0, [0.05, 0.07, 0.03], (count, 3))


@settings(max_examples=25)
@given(st.integers(0, 999))
def test_fits_are_exact(seed):
    random = np.random.default_rng(seed)
    face, poses = _face(random), _poses(5, random)
    weights = random.uniform(0.1, 1, len(face))
    np.testing.assert_allclose(rigid_fit(face, moved(poses, face), weights), poses, atol=1e-10)
    scales = random.uniform(0.5, 2, 5)
    grown = moved(poses, face) * scales[:, None, None]
    expected = poses.copy()
    expected[:, :3] *= scales[:, None, None]
    np.testing.assert_allclose(similarity_fit(face, grown, weights), expected, atol=1e-9)
    np.testing.assert_allclose(inverse(poses) @ poses, np.tile(np.eye(4), (5, 1, 1)), atol=1e-12)


def test_a_mirrored_face_is_met_by_a_rotation():
    random = np.random.default_rng(0)
    face = _face(random)
    turn = rigid_fit(face, face[None] * [-1, 1, 1], np.ones(len(face)))[0, :3, :3]
    assert np.linalg.det(turn) > 0.99


def test_landmarks_without_weight_have_no_say():
    random = np.random.default_rng(1)
    face, poses = _face(random), _poses(3, random)
    weights = (np.arange(len(face)) % 2).astype(float)
    points = moved(poses, face)
    points[:, ::2] += random.normal(0, 0.1, points[:, ::2].shape)
    np.testing.assert_allclose(rigid_fit(face, points, weights), poses, atol=1e-10)


def test_a_talking_head_is_found_by_what_does_not_move():
    random = np.random.default_rng(2)
    canonical = _face(random, 60)
    person = 1.1 * canonical + random.normal(0, 0.002, canonical.shape)
    poses, steady = _poses(50, random), np.arange(60) < 20
    talking = random.normal(0, 0.012, (50, 1, 1)) * [0, 1, 0] * (np.arange(60) >= 45)[:, None]
    points = moved(poses, person + talking) + random.normal(0, 2e-4, (50, 60, 3))
    head = rigid_head(points, canonical, steady)
    constant = inverse(head.poses) @ poses  # one and the same shift and turn in all frames
    away = Rotation.from_matrix(constant[:, :3, :3])
    assert np.degrees((away * away.mean().inv()).magnitude()).max() < 0.2
    assert np.ptp(constant[:, :3, 3], axis=0).max() < 1e-3
    assert head.spreads[45:].min() > 2 * head.spreads[:45].max()
    # Canonical space: turned and placed like the canonical face, in the person's own size.
    fit = similarity_fit(canonical, head.shape[None], steady.astype(float))[0]
    scale = np.cbrt(np.linalg.det(fit[:3, :3]))
    np.testing.assert_allclose(fit, np.diag([scale] * 3 + [1]), atol=1e-9)
    assert abs(scale - 1.1) < 0.03


def test_one_frame_is_a_head_too():
    random = np.random.default_rng(3)
    canonical, pose = _face(random), _poses(1, random)
    head = rigid_head(moved(pose, canonical), canonical, np.ones(len(canonical), bool))
    np.testing.assert_allclose(head.poses, pose, atol=1e-9)
