import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ico3d.capture.portrait import rigid_head

pytestmark = pytest.mark.slow

SIZE = (512, 512)


def _shape(count=200):
    """Points on the front of an ellipsoid the size of a head."""
    random = np.random.default_rng(0)
    sphere = random.normal(size=(count, 3))
    sphere /= np.linalg.norm(sphere, axis=1, keepdims=True)
    sphere[:, 2] = np.abs(sphere[:, 2])
    return sphere * [0.07, 0.09, 0.07]


def _poses(frames, swing=0.25):
    time = np.arange(frames)
    turns = np.stack([np.sin(0.3 * time), np.sin(0.23 * time + 1), 0.4 * np.sin(0.4 * time)], 1)
    poses = np.tile(np.eye(4), (frames, 1, 1))
    poses[:, :3, :3] = Rotation.from_rotvec(swing * turns).as_matrix()
    move = np.stack([0.03 * np.sin(0.2 * time), 0.02 * np.cos(0.17 * time), -0.7 + 0 * time], 1)
    poses[:, :3, 3] = move
    return poses


def _pixels(poses, shape, focal):
    x, y, z = np.moveaxis(
        shape @ poses[:, :3, :3].transpose(0, 2, 1) + poses[:, None, :3, 3], -1, 0
    )
    return 256 + focal * np.stack([-x / z, y / z], -1)


def _degrees(first, second):
    return np.degrees(Rotation.from_matrix(first @ second.transpose(0, 2, 1)).magnitude())


def _rough(poses, focal):
    """As MediaPipe gives them: noisy turns, depth for a lens of 63 degrees."""
    random = np.random.default_rng(1)
    rough = poses.copy()
    noise = Rotation.from_rotvec(random.normal(0, 0.05, (len(poses), 3))).as_matrix()
    rough[:, :3, :3] = noise @ poses[:, :3, :3]
    rough[:, 2, 3] *= 256 / np.tan(np.radians(31.5)) / focal * 1.05
    return rough


def test_poses_are_exact_where_the_shape_is_known():
    shape, poses = _shape(), _poses(40)
    pixels = _pixels(poses, shape, 1000.0)
    ones = np.ones(len(shape))
    track = rigid_head.Track(
        1000.0, np.array([256.0, 256]), shape, poses[:, :3, :3], poses[:, :3, 3], ones
    )
    start = poses.copy()
    start[:, :3, 3] += [0.01, -0.02, 0.05]
    placed = rigid_head.place(track, pixels, start)
    np.testing.assert_allclose(placed.poses(), poses, atol=1e-8)
    np.testing.assert_allclose(placed.project(), pixels, atol=1e-5)


def test_fit_finds_pose_and_shape_of_a_person_who_differs_from_the_canonical_face():
    canonical, poses = _shape(), _poses(60)
    random = np.random.default_rng(2)
    person = canonical + random.normal(0, 0.003, canonical.shape)
    pixels = _pixels(poses, person, 1177.6) + random.normal(0, 0.5, (60, 200, 2))
    moving = random.random(200) < 0.3  # a third of the landmarks follow the expression
    swing = random.normal(0, 6, (60, 1, 1)) * random.normal(0, 1, (1, 200, 2))
    pixels += np.where(moving[:, None], swing, 0.0)
    track = rigid_head.fit(pixels, _rough(poses, 1177.6), canonical, np.ones(200), SIZE)
    still = ~moving
    error = np.linalg.norm(track.project() - _pixels(poses, person, 1177.6), axis=-1)
    assert np.sqrt((error[:, still] ** 2).mean()) < 0.35
    assert np.median(track.sigmas[moving]) > 4 * np.median(track.sigmas[still])
    turned = Rotation.from_matrix(track.rotations.transpose(0, 2, 1) @ poses[:, :3, :3])
    away = turned * turned.mean().inv()  # the canonical frame itself is only agreed on roughly
    assert np.degrees(away.magnitude()).mean() < 0.5


@pytest.mark.parametrize("focal", [800.0, 1700.0])
def test_focal_length_is_estimated_from_perspective(focal):
    canonical, poses = _shape(), _poses(60, swing=0.5)
    poses[:, 2, 3] = -0.0006 * focal
    pixels = _pixels(poses, canonical, focal)
    track = rigid_head.fit(pixels, _rough(poses, focal), canonical, np.ones(200), SIZE)
    assert track.focal == pytest.approx(focal, rel=0.15)


def test_a_given_focal_length_stays():
    canonical, poses = _shape(), _poses(10)
    pixels = _pixels(poses, canonical, 900.0)
    track = rigid_head.fit(pixels, _rough(poses, 900.0), canonical, np.ones(200), SIZE, 900.0)
    assert track.focal == 900.0
    assert _degrees(track.rotations, poses[:, :3, :3]).max() < 0.1


def _textured_frames(poses, focal):
    """Pictures of a textured plane 6 cm before the head's centre, warped exactly."""
    cv2 = pytest.importorskip("cv2")
    random = np.random.default_rng(3)
    noise = random.integers(0, 255, (64, 64), np.uint8)
    texture = cv2.GaussianBlur(
        cv2.resize(noise, (512, 512), interpolation=cv2.INTER_CUBIC), (0, 0), 2
    )
    lens = np.array([[focal, 0, 256], [0, focal, 256], [0, 0, 1.0]]) @ np.diag([1, -1, -1])
    place = np.array([[0.16 / 512, 0, -0.08], [0, -0.16 / 512, 0.08], [0, 0, 0.06], [0, 0, 1]])
    images = []
    for pose in poses:
        warp = lens @ pose[:3] @ place  # pixels from texels, edges at whole numbers
        half = np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1]])
        warp = np.linalg.inv(half) @ warp @ half
        images.append(cv2.warpPerspective(texture, warp, SIZE, flags=cv2.INTER_CUBIC))
    return images


def test_alignment_removes_the_jitter_of_landmarks():
    from ico3d.capture.portrait.picture_poses import align, smoothed

    random = np.random.default_rng(4)
    poses, focal = _poses(24, swing=0.12), 1100.0
    images = _textured_frames(poses, focal)
    points = np.append(random.uniform(-0.045, 0.045, (80, 2)), np.full((80, 1), 0.06), 1)
    jittered = Rotation.from_rotvec(random.normal(0, 0.006, (24, 3))).as_matrix() @ poses[:, :3, :3]
    track = rigid_head.Track(
        focal, np.array([256.0, 256]), points, jittered, poses[:, :3, 3], np.ones(80)
    )
    truth = _pixels(poses, points, focal)

    def spread(found):
        away = found.project() - truth
        return np.sqrt(((away - away.mean(0)) ** 2).sum(-1).mean())

    aligned = align(smoothed(track), np.ones(80, bool), lambda frame: images[frame])
    assert spread(track) > 0.5
    assert spread(aligned) < 0.25 * spread(track)
