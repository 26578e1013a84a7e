"""A head is put on a body where CUDA is."""

import copy
from dataclasses import replace

import numpy as np
import pytest
import torch

from ico3d.avatar.avatar import Placement, TrainedAvatar
from ico3d.avatar.joining.assemble import assemble
from ico3d.avatar.joining.checking import write_checks
from ico3d.avatar.joining.face_views import face_views
from ico3d.avatar.joining.finding.drawn_head import DrawnHead
from ico3d.avatar.joining.finding.found_placement import OverRecording, head_poses
from ico3d.avatar.joining.relight import color_difference, relit
from ico3d.avatar.joining.seam_quality import seam_scores
from ico3d.capture.face.region import HeadRegion
from support.avatars.planted_person import FRAMES, PlantedPerson, face, planted_head
from support.avatars.tiny_joining import assembly_of, parts_of
from support.pretended_cuda import drawn, is_on_cuda
from support.settings import changed

pytestmark = pytest.mark.slow


def test_colours_are_matched(cuda, head, abroad):
    """To the same as on the CPU."""
    placement, expressions, views, tested = parts_of(abroad, head)
    other = copy.deepcopy(head.model).requires_grad_(False).to(cuda)
    head.model.requires_grad_(False)
    relight = relit(head.model, face(), placement, expressions, views)
    other = relit(other, face(), placement, expressions, views)
    assert is_on_cuda(other.light)
    here = color_difference(relight, placement, expressions, tested)
    there = color_difference(other, placement, expressions, tested)
    assert there == pytest.approx(here, rel=0.02)


def test_an_avatar_is_assembled_and_measured(cuda, tmp_path, monkeypatch):
    """Head, windows, pictures to check, and the seam."""
    capture, said = PlantedPerson.elsewhere(tmp_path / "capture"), []
    (tmp_path / "head").mkdir()
    planted_head().save(tmp_path / "head")
    assembly = assembly_of(tmp_path / "head")
    small = changed(assembly.body, {"steps_per_frame": 2, "warmup_steps": 2, "checkpoint_every": 9})
    assembly = replace(assembly, body=small, device="cuda")
    with drawn(monkeypatch) as pictures:
        avatar = assemble(capture, tmp_path / "out", assembly, said.append)
        assert len(pictures) > 2 * FRAMES + 10
        before = len(pictures)
        write_checks(tmp_path / "out", capture, tmp_path / "check", cuda)
        assert len(pictures) > before
    assert is_on_cuda(avatar.head.model.means) and is_on_cuda(avatar.gaussians(0.0).means)
    assert np.isfinite(avatar.summary["psnr_face"]) and "gap_mm" in avatar.summary
    _same_scores(TrainedAvatar.load(tmp_path / "out"), avatar, capture)


def test_a_head_without_landmarks_is_drawn(cuda, tmp_path):
    """For the search of its face: alone, and into recorded pictures."""
    capture = PlantedPerson.elsewhere(tmp_path)
    model = planted_head().model
    neutral = model(torch.zeros(10))
    placement = Placement(capture.canonical_from_head, head_poses(capture))
    pictures = {}
    for place in (torch.device("cpu"), cuda):
        there = neutral.to(place)
        alone = DrawnHead(there, capture.cameras[:1]).image(0, 0)
        pictures[place.type] = alone, OverRecording(capture, there, placement).image(0, 1)
    for here, there in zip(*pictures.values(), strict=True):
        np.testing.assert_allclose(there, here, atol=1e-5)


def _same_scores(here: TrainedAvatar, there: TrainedAvatar, capture) -> None:
    """Of the seam, on either device."""
    region = HeadRegion.around(face())
    views = face_views(capture, here.placement, region, face(), most=2)
    ours, theirs = (seam_scores(avatar, views) for avatar in (there, here))
    assert ours.psnr_face == pytest.approx(theirs.psnr_face, abs=1e-2)
