"""What the equations of a fit say about changes is what changes."""

import numpy as np
import pytest

from ico3d.capture.posing.fitting.body import Body, Kinematics
from ico3d.capture.posing.fitting.rows import LandmarkTerm
from ico3d.capture.posing.model.anatomy import anatomy_of
from ico3d.capture.posing.model.template import load_template
from ico3d.rig.quaternions import from_matrix, from_rotvec, to_matrix
from ico3d.rig.rig import Rig
from support.needs import needs

pytestmark = needs("anny")
STEP = 1e-6


@pytest.fixture(scope="module")
def posed_body():
    """Kinematics, and a body in a pose and shape like no other."""
    template, random = load_template(), np.random.default_rng(3)
    turns = to_matrix(from_rotvec(np.array([[0.3, 1.2, -0.2]])))
    body = Body.at_rest(template, np.zeros(0), turns, np.array([[0.1, 0.2, 0.3]]))
    body.angles = random.normal(0, 0.4, body.angles.shape)
    body.shape = random.normal(size=body.shape.shape)
    body.offsets = random.normal(0, 0.01, body.offsets.shape)
    return Kinematics(template, anatomy_of(template)), body


@pytest.fixture(scope="module")
def term(posed_body):
    kinematics, body = posed_body
    count = len(body.offsets)
    return LandmarkTerm(kinematics, np.zeros((1, count, 3)), np.tile(np.eye(3), (1, count, 1, 1)))


def test_the_body_is_posed_as_its_rig_is(posed_body):
    kinematics, body = posed_body
    posed = kinematics.posed(body, 0)
    template = kinematics.template
    rig = Rig(template.names, template.parents, posed.joints)
    rotations = from_rotvec(np.einsum("jab,jb->ja", kinematics.anatomy.axes, body.angles[0]))
    rotations[0] = from_matrix(posed.turns[0])
    turns, places = rig.posed(rotations, body.roots[0])
    np.testing.assert_allclose(places, posed.places, atol=1e-9)
    np.testing.assert_allclose(to_matrix(turns), posed.turns, atol=1e-9)


def test_points_follow_angles_and_root_as_finite_differences(posed_body, term):
    kinematics, body = posed_body
    posed = kinematics.posed(body, 0)
    rows = term.rows(body, posed, 0)
    said = posed.changes(rows.points, rows.ways, term.carried[rows.numbers])
    for unknown in (0, 2, *range(30, 216, 17)):
        joint, axis = divmod(unknown, 3)
        body.angles[0, joint, axis] += STEP
        there = term.marks(body, kinematics.posed(body, 0))
        body.angles[0, joint, axis] -= STEP
        moved = ((there[rows.numbers] - rows.points) * rows.ways).sum(1) / STEP
        np.testing.assert_allclose(said[:, unknown], moved, atol=1e-5)
    np.testing.assert_allclose(said[:, -3:], rows.ways)


def test_points_follow_shape_and_their_own_offsets_as_finite_differences(posed_body, term):
    kinematics, body = posed_body
    posed = kinematics.posed(body, 0)
    marks = term.marks(body, posed)
    change = term.reshaped(posed, kinematics.reshaped(posed))
    for shape in range(0, len(body.shape), 4):
        body.shape[shape] += STEP
        there = term.marks(body, kinematics.posed(body, 0))
        body.shape[shape] -= STEP
        np.testing.assert_allclose(change[..., shape], (there - marks) / STEP, atol=1e-5)
    body.offsets[:, 1] += STEP
    moved = (term.marks(body, posed) - marks) / STEP  # (P, 3)
    body.offsets[:, 1] -= STEP
    rows = term.rows(body, posed, 0)
    said = term.own(posed, rows).reshape(len(rows.ways), len(marks), 3)[..., 1].sum(1)
    np.testing.assert_allclose(said, (rows.ways * moved[rows.numbers]).sum(1), atol=1e-5)
