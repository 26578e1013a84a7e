"""Head poses of a body from the face among its 133 keypoints."""

import numpy as np
import pytest

from ico3d.capture.checking.check import examine
from ico3d.capture.formats import open_capture
from ico3d.capture.importing.resized import ResizedCapture
from support.recordings import dna_files, faces

FLIP = np.diag([1.0, -1.0, -1.0, 1.0])
"""The world of these files has -y up."""


def whole_body(poses, noise=0.0):
    """(T, 133, 3) keypoints of a person whose head moves, in the world of the files."""
    random = np.random.default_rng(6)
    points = random.uniform(-0.8, 0.8, (len(poses), 133, 3))
    points[:, 23:91] = faces.moved(poses, faces.face())
    return (points + noise * random.normal(size=points.shape)) @ FLIP[:3, :3].T


@pytest.fixture(scope="module")
def poses():
    return faces.motion(30, 15, at=(0.1, 0.6, 0.0))


@pytest.fixture
def record(tmp_path):
    def write(points):
        rig = dna_files.Rig(cameras=(0, 20, 40), frames=30, keypoints=points)
        return open_capture(dna_files.write_recording(tmp_path, rig, same_picture=True))

    return write


def test_the_head_moves_as_its_keypoints(record, poses):
    capture = record(whole_body(poses))
    found = np.stack([capture.world_from_head(frame) for frame in range(30)])
    assert max(faces.errors(found, poses)) < 1e-6
    for frame in (0, 17, 29):
        local, pose = capture.landmarks_3d(frame), found[frame]
        world = faces.moved(poses[frame : frame + 1], faces.face())[0]
        np.testing.assert_allclose(faces.moved(pose[None], local)[0], world, atol=1e-9)
        assert local[45, 0] > 0.04 > local[36, 0] and local[27, 1] > local[8, 1]
        for camera in range(3):
            pixels = capture.cameras[camera].project(world)[0]
            np.testing.assert_allclose(capture.landmarks(camera, frame), pixels, atol=1e-6)


def test_noise_is_smoothed(record, poses):
    capture = record(whole_body(poses, noise=0.002))
    found = np.stack([capture.world_from_head(frame) for frame in range(30)])
    degrees, millimetres = faces.errors(found, poses)
    assert degrees < 0.7 and millimetres < 1.5


def test_keypoints_that_were_not_found(record, poses):
    points = whole_body(poses)
    points[3, 23:60] = np.nan
    points[5, 40] = 0.0
    points[12:20, 23:91] = np.nan
    capture = record(points)
    assert np.isnan(capture.keypoints_3d(3)[23:60]).all()
    lost = [frame for frame in range(30) if capture.world_from_head(frame) is None]
    assert lost == list(range(12, 20))
    assert capture.landmarks(0, 13) is None and capture.landmarks_3d(13) is None
    kept = [frame for frame in range(30) if frame not in lost]
    found = np.stack([capture.world_from_head(frame) for frame in kept])
    assert max(faces.errors(found, poses[kept])) < 1e-6
    (finding,) = (f for f in examine(capture) if f.what == "poses")
    assert (finding.level, finding.text) == ("ok", "22 of 30 frames")


def test_tables_that_end_early(record, poses):
    capture = record(whole_body(poses)[:25])
    assert capture.world_from_head(24) is not None and capture.world_from_head(25) is None


def test_other_sets_of_keypoints_have_no_face(record, poses):
    capture = record(whole_body(poses)[:, :25])
    assert capture.world_from_head(0) is None and capture.landmarks(0, 0) is None
    assert capture.landmarks_3d(0) is None


def test_smaller_pictures_have_the_same_head(record, poses):
    capture = record(whole_body(poses))
    small = ResizedCapture(capture, 24)
    np.testing.assert_array_equal(small.landmarks_3d(4), capture.landmarks_3d(4))
    np.testing.assert_array_equal(small.world_from_head(4), capture.world_from_head(4))
    scale = np.array([20 / 40, 24 / 48])
    np.testing.assert_allclose(small.landmarks(0, 4), capture.landmarks(0, 4) * scale)
