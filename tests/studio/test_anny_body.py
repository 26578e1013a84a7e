"""The whole default person: dressed, on a skeleton, with the face of the bust."""

import numpy as np
import pytest

from ico3d.studio.choice import load_subject
from ico3d.studio.person.skeleton import about
from ico3d.studio.person.subject import Material, Subject
from support.needs import needs

pytestmark = needs("anny")


@pytest.fixture(scope="module")
def whole() -> Subject:
    return load_subject("anny", whole=True)


def _of(person: Subject, material: Material) -> np.ndarray:
    """(N, 3) vertices of a material's faces, metres."""
    return person.vertices[np.unique(person.faces[person.materials == material])]


def test_she_has_the_face_of_the_bust(whole):
    bust = load_subject("anny")
    np.testing.assert_array_equal(whole.landmarks(whole.vertices), bust.landmarks(bust.vertices))
    assert whole.blendshape_names == bust.blendshape_names
    assert whole.vertices[whole.delta_vertices, 1].min() > -0.2  # faces move heads only


def test_she_stands_on_her_soles_in_clothes_that_follow_one_another(whole):
    shoe, trousers, jumper = (
        _of(whole, m)[:, 1] + whole.head_in_world[1]
        for m in (Material.SHOE, Material.TROUSERS, Material.CLOTH)
    )
    assert shoe.min() == pytest.approx(0, abs=1e-6)
    assert 0 <= shoe.max() - trousers.min() < 0.03
    assert 0 <= trousers.max() - jumper.min() < 0.03
    assert 1.5 < whole.vertices[:, 1].max() + whole.head_in_world[1] < 1.75


def test_of_her_skin_only_head_and_hands_are_there(whole):
    skin = _of(whole, Material.SKIN)
    wrist = whole.skeleton.at[whole.skeleton.index("wrist.L")]
    mirrored = skin * np.where(skin[:, :1] < 0, [-1, 1, 1], 1)
    on_hand = np.linalg.norm(mirrored - wrist, axis=1) < 0.25
    assert on_hand.any()
    assert skin[~on_hand, 1].min() > -0.25


def test_an_arm_carries_its_hand_and_nothing_else(whole):
    bones = whole.skeleton
    np.testing.assert_allclose(bones.weights.sum(axis=1), 1, atol=1e-5)
    elbow = bones.index("lowerarm01.L")
    turns = np.tile(np.eye(3), (1, len(bones.names), 1, 1))
    turns[0, elbow] = about(np.array([0.0, 0.0, 1.0]), 0.5)
    moved = bones.skinned(whole.vertices, bones.matrices(turns, np.zeros((1, 3)))[0])
    away = np.linalg.norm(moved - whole.vertices, axis=1)
    tip = whole.vertices[:, 0].argmax()
    far = np.linalg.norm(whole.vertices[tip, :2] - bones.at[elbow, :2])
    assert away[tip] == pytest.approx(2 * np.sin(0.25) * far, rel=1e-3)
    assert away[whole.vertices[:, 0] < 0.1].max() < 1e-6
