"""Identity: faces of a known shape in any pose, and distances that rise at a known rate."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ico3d.capture.face.mediapipe_face import Face
from ico3d.measure.faces.comparison import METRICS, FaceComparison
from ico3d.measure.faces.identity import (
    LEFT_EYE,
    RIGHT_EYE,
    identity_distances,
    identity_of,
    mean_face,
)

WEIGHTS = np.where(np.arange(468) % 14 == 5, 1.0, 0.0)


def _posed(shapes, seed=0):
    """Shapes (T, 468, 3), each at another place, size and pose."""
    rng = np.random.default_rng(seed)
    turns = Rotation.from_rotvec(rng.uniform(-0.6, 0.6, (len(shapes), 3))).as_matrix()
    sizes = rng.uniform(0.5, 2, (len(shapes), 1, 1))
    return sizes * shapes @ turns + rng.uniform(-50, 50, (len(shapes), 1, 3))


@pytest.fixture
def shape():
    points = np.random.default_rng(1).normal(0, 40, (468, 3))
    points[LEFT_EYE] = points[RIGHT_EYE] + (100, 0, 0)
    return points


def test_pose_place_size_and_expression_do_not_count(shape):
    talking = np.tile(shape, (5, 1, 1))
    talking[:, WEIGHTS == 0] += np.random.default_rng(2).normal(0, 9, (5, 434, 3))
    found = identity_distances(_posed(talking), np.tile(shape, (5, 1, 1)), WEIGHTS)
    np.testing.assert_allclose(found, 0, atol=1e-9)


def test_the_unit_is_the_distance_of_the_eyes(shape):
    other = shape.copy()
    other[[5, 19], 0] += (6, -6)  # 2 of 34 rigid points; hardly turns or moves the whole
    found = identity_distances(_posed(other[None]), shape, WEIGHTS)
    assert found[0] == pytest.approx(6 * np.sqrt(2 / 34), rel=0.15)
    doubled = identity_distances(other[None], 2 * shape, WEIGHTS)
    assert doubled[0] == pytest.approx(found[0])


def test_frames_without_a_face_are_left_out_and_the_drift_is_the_slope_of_the_rest(shape):
    distances = 1 + 0.02 * np.arange(101)
    distances[[3, 40]] = np.nan
    found = identity_of(distances)
    assert found is not None
    assert found.drift == pytest.approx(2) and found.frames == 99
    assert identity_of(distances[:5]).drift is None
    assert identity_of(np.full(9, np.nan)) is None
    missing = np.stack([shape, np.full_like(shape, np.nan)])
    assert np.isnan(identity_distances(missing, shape, WEIGHTS)).tolist() == [False, True]


def test_the_mean_face_is_that_of_all_poses(shape):
    poses = _posed(np.tile(shape, (6, 1, 1)))
    poses[2] = np.nan
    found = mean_face(poses, WEIGHTS)
    np.testing.assert_allclose(identity_distances(found[None], shape, WEIGHTS), 0, atol=1e-9)
    with pytest.raises(ValueError, match="no face"):
        mean_face(poses[2:3], WEIGHTS)


def test_a_comparison_leaves_out_what_was_not_seen(shape):
    def face(open_by, at):
        points = shape[np.arange(478) % 468] + (at, 0, 0)
        points[13, 1] = points[14, 1] = 0.0
        points[14, 1] += open_by
        weights = np.array([0.0, open_by / 10], np.float32)
        return Face(points[:, :2], weights, np.eye(4), points[:, 2])

    opens = 3 + 2 * np.sin(np.arange(40) / 3)
    found = FaceComparison(WEIGHTS)
    for k, by in enumerate(opens):
        found.add(None if k == 7 else face(by + 1, 5), None if k == 9 else face(by, 0))
    figures = found.figures(25, ("_neutral", "jawOpen"))
    assert set(figures) == set(METRICS)
    assert figures["lip_correlation"] > 0.95 and abs(figures["lip_lag_ms"]) < 10
    assert figures["blendshape_error_lower"] == pytest.approx(0.01, rel=1e-5)
    assert figures["blendshape_error_upper"] == 0
    assert figures["identity_distance"] == pytest.approx(0, abs=1e-6)
    assert figures["lmd"] == pytest.approx(2 * 19 / 400, rel=1e-3)  # one of 20 moves by 1
    nothing = FaceComparison(WEIGHTS)
    nothing.add(None, face(1, 0))
    assert set(nothing.figures(25, ()).values()) == {None}
