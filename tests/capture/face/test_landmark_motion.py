"""How landmarks move: told in space, seen by several cameras, by one, or by none."""

import numpy as np
import pytest

from ico3d.capture.capture import Capture
from ico3d.capture.face.landmark_motion import STEADY, landmark_motion
from ico3d.common.camera import Camera, look_at

RNG = np.random.default_rng(0)
REST = RNG.normal(size=(68, 3)) * 0.05
MOVED = REST + RNG.normal(size=(4, 68, 3)) * 0.004
MOVED[:, list(STEADY)] = REST[list(STEADY)]


def _camera(eye, name) -> Camera:
    intrinsics = np.array([[800.0, 0, 256], [0, 800.0, 256], [0, 0, 1]])
    return Camera(512, 512, intrinsics, look_at(np.array(eye), np.zeros(3)), name)


class Seen(Capture):
    """Four frames of landmarks that cameras see; the head is turned and moved in the world."""

    def __init__(self, eyes, given=None, blind=()):
        self.cameras = tuple(_camera(eye, str(i)) for i, eye in enumerate(eyes))
        self._given, self._blind = given, blind

    def image(self, camera, frame):
        return None

    def world_from_head(self, frame):
        pose = np.eye(4)
        pose[:3, :3] = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]
        pose[:3, 3] = 0.01 * frame, 0.02, 0.0
        return pose

    def landmarks_3d(self, frame):
        return None if self._given is None else self._given[frame]

    def landmarks(self, camera, frame):
        if frame in self._blind:
            return None
        return self.cameras[camera].moved(self.world_from_head(frame)).project(MOVED[frame])[0]


def test_landmarks_in_space_are_taken_as_they_are():
    found = landmark_motion(Seen([], MOVED), [3, 1], REST)
    np.testing.assert_allclose(found, MOVED[[3, 1]] - REST, atol=2e-5)


def test_several_cameras_tell_all_of_a_movement():
    capture = Seen([(1.0, 0, 0), (0.8, 0.1, 0.5), (0.8, -0.2, -0.5)])
    found = landmark_motion(capture, range(4), REST)
    np.testing.assert_allclose(found, MOVED - REST, atol=2e-5)


def test_one_camera_tells_what_is_across_its_view():
    capture = Seen([(1.0, 0, 0)])
    found = landmark_motion(capture, range(4), REST)
    for frame in range(4):
        seen = capture.cameras[0].moved(capture.world_from_head(frame))
        ways = MOVED[frame] - seen.camera_to_world[:3, 3]
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        wanted = MOVED[frame] - REST
        across = wanted - (wanted * ways).sum(1, keepdims=True) * ways
        np.testing.assert_allclose(found[frame], across, atol=2e-5)


@pytest.mark.parametrize("eyes", [[], [(1.0, 0, 0), (0.8, 0.1, 0.5)]])
def test_an_error_of_the_pose_moves_no_skin(eyes):
    """What all landmarks do together is not of the face: here 3 mm, and 2 degrees about y."""
    turn = np.array([[1, 0, 0.035], [0, 1, 0], [-0.035, 0, 1]])
    wrong = MOVED @ turn.T + (0.003, 0.0, -0.001)

    class Wrong(Seen):
        def landmarks_3d(self, frame):
            return None if eyes else wrong[frame]

        def landmarks(self, camera, frame):
            pose = self.world_from_head(frame)
            return self.cameras[camera].moved(pose).project(wrong[frame])[0]

    found = landmark_motion(Wrong(eyes), range(4), REST)
    off = np.linalg.norm(found - (MOVED - REST), axis=-1)
    assert np.linalg.norm(wrong - MOVED, axis=-1).mean() > 0.003
    assert np.median(off) < 0.0004 and off.max() < 0.0012


@pytest.mark.parametrize("eyes", [[(1.0, 0, 0)], []])
def test_frames_that_nobody_saw_are_unknown(eyes):
    found = landmark_motion(Seen(eyes, blind=(2,)), range(4), REST)
    unknown = np.isnan(found).any((1, 2))
    assert unknown.tolist() == ([False, False, True, False] if eyes else [True] * 4)
