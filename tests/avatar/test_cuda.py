"""Baking, films and animations of exact models that are on CUDA."""

import copy
from pathlib import Path

import numpy as np
import pytest

from ico3d.avatar.animation.keyframes import Motion
from ico3d.avatar.baking import body_bundle, head_bundle, head_cost, person_bundle
from ico3d.avatar.baking.samples import recorded_samples
from ico3d.avatar.baking.shader_head import BakeSettings
from ico3d.avatar.camera_path import orbit, ring_around
from ico3d.avatar.film.film import pictures
from ico3d.avatar.moving import extent
from ico3d.body.model_folder import TrainedBody
from ico3d.body.training.train_clip import train_body
from ico3d.bundle.format import Bundle
from ico3d.cli import main
from support.avatars.origins import MADE
from support.avatars.whole_person import WholeFilmed, head_recording, write_whole_person
from support.bodies.tiny_training import job
from support.bodies.tracked_capture import TrackedCapture
from support.captures import open_with
from support.pretended_cuda import drawn

pytestmark = pytest.mark.slow

QUICK = BakeSettings(hidden=32, augmented=20, steps=40)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """An avatar's folder."""
    folder = tmp_path_factory.mktemp("whole") / "avatar"
    write_whole_person(folder)
    return folder


def test_a_head_is_baked(cuda, blendshape_head):
    """From the same samples, to the same loss."""
    head, capture = blendshape_head
    capture.head = copy.deepcopy(head)

    def baked():
        views = head_cost.references(head, capture, (0.5, 0.5, 0.5), 3)
        samples = recorded_samples(head, capture)
        return samples, head_bundle.bake(head, views, samples, 4, [].append, QUICK)

    here, there = baked(), (head.model.to(cuda), baked())[1]
    np.testing.assert_allclose(there[0].importance, here[0].importance, rtol=1e-3)
    assert there[1].head.num_gaussians == here[1].head.num_gaussians
    assert there[1].loss.psnr_exact == pytest.approx(here[1].loss.psnr_exact, abs=1e-2)
    assert there[1].loss.psnr_baked == pytest.approx(here[1].loss.psnr_baked, abs=1e-2)


def test_a_body_is_baked(cuda, folder, tmp_path, monkeypatch):
    monkeypatch.setattr(body_bundle, "SHAPES", body_bundle.SHAPES[:1])
    body = TrainedBody.load(folder / "body")
    here = list(body_bundle.bake(body, None))
    for model in body.models:
        model.to(cuda)
    there = list(body_bundle.bake(body, None))
    for ours, theirs in zip(there, here, strict=True):
        wanted = theirs.loss.psnr_baked_vs_exact
        assert ours.loss.psnr_baked_vs_exact == pytest.approx(wanted, abs=1e-2)
    baked = body_bundle.parts_of(there, body).baked
    assert body_bundle.strip(body, baked, None).shape[1] == 512


def test_a_body_is_filmed_and_animated(cuda, folder):
    body = TrainedBody.load(folder / "body")
    cameras = orbit(ring_around(extent(body)), extent(body), 3, 32, 48)
    here, speeds = list(pictures(body, cameras, 10, (1, 1, 1))), Motion.of(body).speeds
    for model in body.models:
        model.to(cuda)
    np.testing.assert_allclose(Motion.of(body).speeds, speeds, rtol=1e-3)
    for one, other in zip(pictures(body, cameras, 10, (1, 1, 1)), here, strict=True):
        np.testing.assert_allclose(one, other, atol=1)


def _run_there(monkeypatch, *words) -> None:
    """Runs a verb, which draws where CUDA is."""
    with drawn(monkeypatch) as there:
        assert main([*map(str, words), "--device", "cuda"]) == 0
    assert there, words[0]


def test_the_verbs_bake_film_and_animate_there(cuda, folder, tmp_path, monkeypatch):
    """Also what is a bundle already."""
    person = person_bundle.TrainedAvatar.load(folder)
    recordings = {"head": head_recording(tmp_path), "body": WholeFilmed(person, tmp_path)}
    open_with(monkeypatch, lambda path: recordings[Path(path).name])
    monkeypatch.setattr(head_bundle, "BakeSettings", lambda: QUICK)
    monkeypatch.setattr(head_bundle, "MEASURED_VIEWS", 4)
    monkeypatch.setattr(person_bundle, "VIEWS", 4)
    monkeypatch.setattr(body_bundle, "SHAPES", body_bundle.SHAPES[:1])
    bundle, film = tmp_path / "a.ico3d", tmp_path / "a.mp4"
    bake = ("bake", folder, "head", "body", bundle, "--rank", 4, "--force", *MADE)
    small = ("--size", 32, "--seconds", 0.1)
    _run_there(monkeypatch, *bake, "--strip", tmp_path / "strip.png")
    for avatar in (folder, bundle):
        _run_there(monkeypatch, "render", avatar, film, *small)
        _run_there(monkeypatch, "animate", avatar, "--contact-sheet", tmp_path / "a.png")
    assert Bundle.open(bundle).manifest.is_whole


def test_the_verbs_do_so_for_a_body_on_a_skeleton(cuda, tmp_path, monkeypatch):
    capture = TrackedCapture(tmp_path / "capture")
    open_with(monkeypatch, lambda path: capture)
    body, bundle = tmp_path / "body", tmp_path / "a.ico3d"
    train_body(capture, body, job("skinned"))
    _run_there(monkeypatch, "evaluate", body, "capture", "--json", tmp_path / "figures.json")
    agreed = ("--likeness", "Ada", "--consent", "tests", "--licence", "tests")
    _run_there(monkeypatch, "bake", body, "capture", bundle, *agreed, *MADE)
    for avatar in (body, bundle):
        film = ("render", avatar, tmp_path / "a.mp4", "--size", 32, "--seconds", 0.1)
        _run_there(monkeypatch, *film)
    _run_there(monkeypatch, "animate", body, "--contact-sheet", tmp_path / "a.png")
