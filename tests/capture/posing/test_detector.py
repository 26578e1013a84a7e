"""Where a detector sees the template's landmarks."""

import numpy as np
import pytest

from ico3d.capture.posing.model.detector import mediapipe_detector
from ico3d.capture.posing.model.naming import hand, opposite
from ico3d.capture.posing.model.template import load_template
from support.needs import needs

pytestmark = needs("anny")


@pytest.fixture(scope="module")
def template():
    return load_template()


def test_what_it_sees_is_mirrored_and_possible(template):
    detector = mediapipe_detector(template.num_shapes)
    other = [template.landmarks.index(opposite(name)) for name in template.landmarks]
    mirror = np.array([-1, 1, 1])
    away_from_middle = [i for i, j in enumerate(other) if i != j]
    np.testing.assert_array_equal(
        detector.beside[:, away_from_middle],
        (detector.beside[:, other] * mirror)[:, away_from_middle],
    )
    np.testing.assert_array_equal(detector.spread, detector.spread[other])
    assert np.linalg.norm(detector.beside[0], axis=-1).max() < 0.06
    assert (detector.spread >= 0.004).all()


def test_landmarks_move_with_the_shape_and_hands_stay(template):
    detector = mediapipe_detector(template.num_shapes)
    seen = detector.seen(template)
    np.testing.assert_allclose(seen.places - template.places, detector.beside, atol=1e-12)
    fingers = [template.landmarks.index(name) for name in hand("L")[1:]]
    np.testing.assert_array_equal(seen.places[:, fingers], template.places[:, fingers])
    assert np.abs(detector.beside[1:, template.landmarks.index("shoulder.L")]).max() > 0.003
