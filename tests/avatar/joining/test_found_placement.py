"""Heads whose recording had no landmarks are joined to a body all the same."""

from dataclasses import replace

import numpy as np
import pytest

from ico3d.avatar.avatar import HEAD
from ico3d.avatar.joining.assemble import place_head
from ico3d.errors import CaptureError, MissingModelError, ModelError
from ico3d.head.model_folder import TrainedHead
from support.avatars.filmed_demo import FilmedDemo, away, head_abroad, saved
from support.avatars.planted_person import PlantedPerson, planted_head

pytestmark = pytest.mark.slow


def test_a_head_without_landmarks_is_joined(face_model, packaged_demo, tmp_path, monkeypatch):
    """In another studio, whose axes are others: within 2 mm; the avatar's head knows its face.

    The recording's own landmarks are of another kind, and nowhere near.
    """
    capture, said = FilmedDemo(tmp_path / "capture"), []
    monkeypatch.setattr(capture, "landmarks_3d", lambda frame: np.zeros((68, 3)))
    place_head(capture, tmp_path / "out", saved(head_abroad(), tmp_path / "head"), said.append)
    assert away(capture, tmp_path / "out") < 0.002
    assert TrainedHead.load(tmp_path / "out" / HEAD).landmarks is not None
    line = next(line for line in said if line.startswith("face: "))
    assert "found in 15 of 15 views drawn of it, which agree within" in line
    assert "the body's in 15 pictures of 3 moments, within" in line


def test_head_poses_that_are_not_the_heads(face_model, packaged_demo, tmp_path, monkeypatch):
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
