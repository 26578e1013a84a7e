"""Heads whose recording had no landmarks: their face is found in pictures, and they are joined."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from ico3d.avatar.avatar import HEAD
from ico3d.avatar.joining.assemble import place_head
from ico3d.avatar.joining.finding import found_face
from ico3d.avatar.joining.similarity import canonical_from_head, moved, scale_of
from ico3d.avatar.render_bundle import baked_gaussians
from ico3d.errors import CaptureError, MissingModelError, ModelError
from ico3d.head.model_folder import TrainedHead
from ico3d.splat.gaussians import Gaussians
from support.avatars.filmed_demo import ABROAD, FilmedDemo, away, demo, head_abroad, saved
from support.avatars.planted_person import PlantedPerson, planted_head

pytestmark = pytest.mark.slow

FOUND = {}
"""Places of Gaussians (as bytes) to the face that was found there."""


@pytest.fixture
def looked_at_once(monkeypatch):
    """The face of a head that an earlier test of this file has found is not looked for again."""
    look = found_face.FaceSeeker.of_head

    def of_head(self, gaussians, folder):
        places = gaussians.means.numpy().tobytes()
        if places not in FOUND:
            FOUND[places] = look(self, gaussians, folder)
        return FOUND[places]

    monkeypatch.setattr(found_face.FaceSeeker, "of_head", of_head)


def resting() -> Gaussians:
    """The demo's head in its own space."""
    baked = demo().head
    return baked_gaussians(baked, np.zeros(baked.expression_size, np.float32))


def test_any_turn_and_unit(face_model, looked_at_once, packaged_demo):
    """What is found turns, moves and grows with the head, to a tenth of a millimetre."""
    head = head_abroad()
    with found_face.face_seeker() as seeker, torch.no_grad():
        usual = seeker.of_head(resting(), Path("a"))
        other = seeker.of_head(head.model(torch.from_numpy(head.neutral())), Path("a"))
    matrix, _ = canonical_from_head(moved(ABROAD, usual.landmarks), other.landmarks)
    placed = moved(matrix, other.landmarks)
    scale = scale_of(ABROAD)
    apart = np.linalg.norm(placed - other.landmarks, axis=1).mean() / scale
    assert apart < 1e-4 and other.apart == pytest.approx(scale * usual.apart, rel=0.05)
    # the person's left is +x, the brows are above the chin, the nose is in front
    marks = usual.landmarks
    assert marks[45, 0] > 0.02 > -0.02 > marks[36, 0] and marks[27, 1] > marks[8, 1] + 0.05


def test_a_body_whose_pictures_show_no_face(
    face_model, looked_at_once, packaged_demo, tmp_path, monkeypatch
):
    """Seen from behind: what the recording says of it stands in, and that is said."""
    capture, said = FilmedDemo(tmp_path / "capture", (170, 190)), []
    with found_face.face_seeker() as seeker:
        marks = seeker.of_head(resting(), tmp_path).landmarks
    own = moved(np.linalg.inv(_posed(capture)), marks)
    monkeypatch.setattr(capture, "landmarks_3d", lambda frame: own)
    place_head(capture, tmp_path / "out", saved(head_abroad(), tmp_path / "head"), said.append)
    assert away(capture, tmp_path / "out") < 0.001
    assert "do not show it well enough: its recording's landmarks stand in." in said[0]


def _posed(capture: FilmedDemo) -> np.ndarray:
    """(4, 4) from the space of the recording's head poses to that of the demo's head."""
    return np.linalg.inv(capture.true_world_from_head(0)) @ capture.world_from_head(0)


def test_views_that_do_not_agree_are_refused(face_model, packaged_demo, tmp_path, monkeypatch):
    """With figures."""
    monkeypatch.setattr(found_face, "MOST_APART", 1e-5)
    monkeypatch.setattr(found_face, "CANDIDATES", 1)
    monkeypatch.setattr(found_face, "ROUNDS", 1)
    with found_face.face_seeker() as seeker:
        words = r"head: of 15 views drawn of this head 15 show one face, within \d\.\d mm; that is"
        with pytest.raises(ModelError, match=words):
            seeker.of_head(resting(), tmp_path / "head")


def test_a_head_without_landmarks_is_joined(
    face_model, looked_at_once, packaged_demo, tmp_path, monkeypatch
):
    """In another studio, whose axes are others: within 6 mm; the avatar's head knows its face.

    The recording's own landmarks are of another kind, and nowhere near.
    """
    capture, said = FilmedDemo(tmp_path / "capture"), []
    monkeypatch.setattr(capture, "landmarks_3d", lambda frame: np.zeros((68, 3)))
    place_head(capture, tmp_path / "out", saved(head_abroad(), tmp_path / "head"), said.append)
    assert away(capture, tmp_path / "out") < 0.006
    assert TrainedHead.load(tmp_path / "out" / HEAD).landmarks is not None
    line = next(line for line in said if line.startswith("face: "))
    assert "found in 15 of 15 views drawn of it, which agree within" in line
    assert re.search(r"the body's in (9|1[0-2]) pictures of 3 moments, within", line)


def test_head_poses_that_are_not_the_heads(
    face_model, looked_at_once, packaged_demo, tmp_path, monkeypatch
):
    """The face must move as they do."""
    capture, pose = FilmedDemo(tmp_path / "capture"), FilmedDemo.world_from_head
    shift = np.eye(4)
    shift[0, 3] = 0.05
    strayed = [np.linalg.matrix_power(shift, f) @ pose(capture, f) for f in range(3)]
    monkeypatch.setattr(capture, "world_from_head", strayed.__getitem__)
    with pytest.raises(CaptureError, match="mm from where the head poses take it: find them anew"):
        place_head(capture, tmp_path / "out", saved(head_abroad(), tmp_path / "head"), print)


def test_no_face_at_all(face_model, monkeypatch, tmp_path):
    """A ball of many colours is no head."""
    monkeypatch.setattr("ico3d.avatar.joining.finding.first_look.DIRECTIONS", 5)
    person = PlantedPerson(tmp_path / "capture")
    assembly = saved(replace(planted_head(), landmarks=None), tmp_path / "head")
    with pytest.raises(ModelError, match="no view drawn of this head, from all sides, shows a fac"):
        place_head(person, tmp_path / "out", assembly, print)


def test_without_the_face_model(monkeypatch, tmp_path):
    """One sentence says how to get it."""
    monkeypatch.setenv("ICO3D_MODELS", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path))
    person = PlantedPerson(tmp_path / "capture")
    assembly = saved(replace(planted_head(), landmarks=None), tmp_path / "head")
    with pytest.raises(MissingModelError) as refused:
        place_head(person, tmp_path / "out", assembly, print)
    assert "ico3d weights fetch face-landmarker" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_known_landmarks_are_used_as_they_are(tmp_path, monkeypatch):
    """Nothing is looked for, so nothing is needed; one line says so."""
    monkeypatch.setenv("ICO3D_MODELS", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path))
    said = []
    assembly = saved(planted_head(), tmp_path / "head")
    place_head(PlantedPerson(tmp_path / "capture"), tmp_path / "out", assembly, said.append)
    assert said[0] == "face: where the landmarks of both recordings have it."
    assert said[1].startswith("head on body: landmarks agree within")
