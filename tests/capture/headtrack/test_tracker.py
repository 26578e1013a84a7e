"""From heads of single frames to one motion, exactly."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ico3d.capture.face.landmarks import MULTI_PIE
from ico3d.capture.face.mediapipe_face import Face
from ico3d.capture.formats import open_capture
from ico3d.capture.headtrack.faces import Head
from ico3d.capture.headtrack.tracker import assemble, report
from ico3d.errors import CaptureError
from support.recordings import multiview_folders

FRAMES = 8


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """Five cameras all around, eight frames."""
    return open_capture(
        multiview_folders.write_folder(tmp_path_factory.mktemp("many") / "five", 5, FRAMES)
    )


def _canonical():
    """468 points on the front of an ellipsoid."""
    points = np.random.default_rng(0).normal(size=(468, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    points[:, 2] = np.abs(points[:, 2])
    return points * [0.07, 0.09, 0.07]


def _poses():
    """A head that turns slowly from camera to camera, and moves evenly."""
    poses = np.tile(np.eye(4), (FRAMES, 1, 1))
    turns = np.outer(np.linspace(0, 1.4, FRAMES), [0, 1, 0])
    poses[:, :3, :3] = Rotation.from_rotvec(turns).as_matrix()
    poses[:, :3, 3] = np.array([0, 1.0, 0]) + np.outer(np.arange(FRAMES), [0.01, 0, 0.005])
    return poses


def _heads(capture, face, skipped=()):
    """What every camera but the fourth would show; blendshapes tell the camera's number."""
    heads = {}
    for frame, pose in enumerate(_poses()):
        if frame in skipped:
            continue
        points = face @ pose[:3, :3].T + pose[:3, 3]
        faces = {
            number: Face(
                np.concatenate([camera.project(points)[0], np.zeros((10, 2))]),
                np.full(52, number / 8, np.float32),
                np.eye(4),
            )
            for number, camera in enumerate(capture.cameras)
            if number != 3
        }
        heads[frame] = Head(points, pose[:3, 3], pose[:3, 2], faces)
    return heads


def test_what_cameras_see_of_a_rigid_head_is_tracked_exactly(capture):
    canonical = _canonical()
    heads = _heads(capture, canonical)
    track = assemble(capture, heads, canonical)
    np.testing.assert_allclose(track.world_from_head, _poses(), atol=1e-8)
    np.testing.assert_allclose(
        track.landmarks, np.tile(canonical[MULTI_PIE], (FRAMES, 1, 1)), atol=1e-6
    )
    assert track.views.tolist() == [[1, 1, 1, 0, 1]] * FRAMES
    found = report(capture, heads, track)
    assert (found.num_frames, found.tracked, found.views, found.gaps) == (FRAMES, FRAMES, 4.0, [])
    assert found.reprojection < 1e-3


def test_expressions_come_from_the_camera_that_the_head_faces(capture):
    """Cameras stand at 0.2 + 1.26 n radians about +y; the head turns from 0 to 1.4."""
    track = assemble(capture, _heads(capture, _canonical()), _canonical())
    expected = np.where(np.linspace(0, 1.4, FRAMES) < 0.2 + np.pi / 5, 0, 1) / 8
    np.testing.assert_allclose(track.blendshapes[:, 0], expected)
    assert track.eyes.shape == (FRAMES, 7) and track.eyes[0, 0] == pytest.approx(0, abs=1e-6)


def test_frames_without_a_head_lie_between_their_neighbours(capture):
    track = assemble(capture, _heads(capture, _canonical(), skipped=(3, 4)), _canonical())
    np.testing.assert_allclose(track.world_from_head, _poses(), atol=1e-8)  # an even motion
    assert track.gaps == [(3, 4)] and not track.views[3].any()


@pytest.mark.parametrize("size", [0.3, 2.5])
def test_heads_that_no_human_has_mean_another_unit(capture, size):
    heads = _heads(capture, size * _canonical())
    with pytest.raises(CaptureError, match="cameras are not in metres"):
        assemble(capture, heads, _canonical())
