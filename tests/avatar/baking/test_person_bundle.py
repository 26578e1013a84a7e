"""Baking a whole person, from its folder to the bundle that is opened again."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image

from ico3d.avatar.baking import head_bundle, person_bundle
from ico3d.avatar.baking.persona import load_persona
from ico3d.avatar.baking.shader_head import BakeSettings
from ico3d.avatar.baking.skinned import skinned_bundle
from ico3d.avatar.render_bundle import avatar_gaussians, baked_gaussians, visitor_camera
from ico3d.body.model_folder import TrainedBody
from ico3d.body.planning.windows import Window
from ico3d.bundle.animation import Animation, Rest
from ico3d.bundle.format import Bundle
from ico3d.bundle.manifest import Loss
from ico3d.cli import main
from ico3d.common.psnr import psnr
from ico3d.errors import BundleError
from ico3d.splat.render import render
from support.avatars.filmed_person import NOISE, SIZE
from support.avatars.origins import MADE, about, origin
from support.avatars.planted import driving
from support.avatars.whole_person import (
    FPS,
    FRAMES,
    NECK,
    WholeFilmed,
    head_recording,
    write_whole_person,
)
from support.bodies.skinned_model import trained_like
from support.bundles.random_bundle import random_head
from support.bundles.skinned_person import capsule_person
from support.captures import open_with

pytestmark = pytest.mark.slow

QUICK = BakeSettings(hidden=64, augmented=100, steps=300)


@pytest.fixture(scope="module")
def avatar(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole") / "avatar"
    return folder, write_whole_person(folder)


@pytest.fixture(scope="module")
def baked(avatar, tmp_path_factory):
    """What the command line prints, the bundle and the strip."""
    folder, person = avatar
    out = tmp_path_factory.mktemp("baked")
    recordings = {"head": head_recording(out / "head"), "body": WholeFilmed(person, out / "body")}
    with pytest.MonkeyPatch.context() as patch:
        open_with(patch, lambda path: recordings[Path(path).name])
        patch.setattr(head_bundle, "BakeSettings", lambda: QUICK)
        words = [folder, "head", "body", out / "a.ico3d", "--strip", out / "strip.png", *MADE]
        assert main(["bake", *map(str, words), "--rank", "16", "--name", "Both", "--force"]) == 0
    return Bundle.open(out / "a.ico3d"), out / "strip.png", person, recordings["body"]


def test_the_bundle_says_what_it_is(baked):
    bundle, _, person, _ = baked
    manifest = bundle.manifest
    assert (manifest.name, manifest.persona.name) == ("Both", "Iris")
    assert (manifest.head.fps, manifest.head.num_poses) == (FPS, FRAMES)
    assert [(w.first, w.last) for w in manifest.body.windows] == [(0, 8), (8, 14)]
    assert manifest.speech.encoder == "builtin" and bundle.read("speech.onnx")
    assert manifest.provenance.kind == "planted, filmed"
    assert manifest.provenance.sources == ("a seed",)
    assert manifest.provenance.licence == "CC0-1.0; CC-BY-4.0"
    assert bundle.animation.num_frames == FRAMES
    assert len(bundle.animation.quality) == FRAMES  # looked at beside the recording
    np.testing.assert_allclose(manifest.background, (0.3, 0.4, 0.5), atol=1e-4)
    np.testing.assert_allclose(
        bundle.world_from_head, person.placement.world_from_canonical, atol=1e-6
    )


def test_the_baked_person_stands_and_looks_as_the_exact_one(baked):
    bundle, _, person, capture = baked
    for frame in (0, 5.5, 8, 14):
        expression = driving(person.head, person.expression(frame / FPS))
        exact = person.gaussians(frame / FPS)
        ours = avatar_gaussians(bundle, frame / FPS, expression)
        behind = torch.tensor((0.3, 0.4, 0.5))
        pictures = [render(g, [capture.cameras[0]], behind).rgb[0].numpy() for g in (exact, ours)]
        assert psnr(*pictures) > 35
    centre = ours.means[-290:].mean(0).numpy()
    expected = exact.means[-300:].mean(0).numpy()
    np.testing.assert_allclose(centre, expected, atol=0.01)


def test_the_loss_is_that_of_the_whole_person(baked):
    loss = baked[0].manifest.loss
    assert loss.psnr_exact == pytest.approx(-20 * np.log10(NOISE), abs=0.4)
    assert loss.psnr_exact - loss.psnr_baked < 0.3 and loss.psnr_baked_vs_exact > 32


def test_the_visitor_sees_all_of_the_person_from_its_front(baked):
    bundle, _, person, _ = baked
    camera = visitor_camera(bundle.manifest.camera, 64, 64)
    seen = person.gaussians(0.0).means.numpy()
    pixels, depths = camera.project(seen.astype(float))
    assert (depths > 0).all() and np.mean((pixels > 2) & (pixels < 62)) > 0.99
    assert np.ptp(pixels[:, 1]) > 30
    face = person.placement.world_from_head(0)[:3, :3] @ (0, 0, 1)
    toward = camera.camera_to_world[:3, 3] - NECK
    cosine = face @ toward / np.linalg.norm(face) / np.linalg.norm(toward)
    assert cosine > 0.95


def test_the_strip_shows_recorded_exact_and_baked(baked):
    picture, capture = np.asarray(Image.open(baked[1])) / 255, baked[3]
    assert picture.shape == (4 * SIZE, 3 * SIZE, 3)
    tiles = picture.reshape(4, SIZE, 3, SIZE, 3).swapaxes(1, 2)  # (rows, columns, H, W, 3)
    known = [
        np.clip(capture.image(camera, frame), 0, 1)
        for frame in range(FRAMES)
        for camera in range(len(capture.cameras))
    ]
    shown = set()
    for recorded, exact, cheap in tiles:
        differences = [np.abs(recorded - one).max() for one in known]
        shown.add(int(np.argmin(differences)))
        assert min(differences) < 1 / 255
        assert psnr(recorded, exact) == pytest.approx(-20 * np.log10(NOISE), abs=0.6)
        assert psnr(exact, cheap) > 32 and not np.array_equal(exact, cheap)
    assert len(shown) == 4  # each row shows another moment


def test_a_head_moves_as_gaussians_do(avatar):
    head, similarity = random_head(40), avatar[1].placement.canonical_from_head
    face = np.linspace(-1, 1, 39)
    moved = baked_gaussians(person_bundle.moved_head(head, similarity), face)
    expected = baked_gaussians(head, face).transform(similarity)
    torch.testing.assert_close(moved.means, expected.means, rtol=0, atol=1e-4)  # of 8 mm
    torch.testing.assert_close(moved.scales, expected.scales, rtol=4e-3, atol=0)
    units = [torch.nn.functional.normalize(g.quats) for g in (expected, moved)]
    assert (units[0] * units[1]).sum(1).abs().min() > 1 - 1e-5
    assert torch.equal(moved.colors, expected.colors)


def test_without_a_recording_voices_say_how_the_face_moves(avatar):
    person = avatar[1]
    persona = load_persona(None)
    few = type(persona)(persona.name, persona.greeting, persona.notes[:2])
    samples, views = person_bundle.head_samples(person, None, few)
    assert samples.expressions.shape[1] == 39 and len(samples.expressions) > FRAMES + 50
    lids = samples.expressions[FRAMES:, 32 + 5]
    assert lids.max() > 0.9  # somebody blinks, but not farther than the person ever did
    assert lids.max() <= person.head.eyes.most[5] + 1e-6
    assert lids.min() == pytest.approx(person.head.eyes.rest[5], abs=1e-5)
    assert samples.importance.shape == (300, 4) and views[0].truth is None
    assert all(view.exact.std() > 0.02 for view in views)


def test_a_body_on_a_skeleton_carries_the_head(baked, tmp_path):
    """The baked head goes to its recorded poses, the body is the one on the skeleton."""
    bundle, _, person, _ = baked
    model, summary = trained_like(capsule_person(300, FRAMES)), person.body.summary
    body = TrainedBody([model], (Window(0, FRAMES - 1),), FPS, "skinned", summary)
    whole = replace(person, body=body)
    parts = skinned_bundle.bake(body, None, person_bundle.head_at(whole)).parts
    result = person_bundle.put_together(whole, bundle.head, parts, whole.expressions, None)
    out = tmp_path / "a.ico3d"
    animation = Animation(FPS, FRAMES, Rest(2, 5), ())
    told = about(load_persona(None), origin("planted"))
    person_bundle.write(out, whole, result, animation, None, told)
    found = Bundle.open(out)
    assert found.manifest.is_whole and found.manifest.body is None and found.skinned is not None
    drawn = avatar_gaussians(found, 4 / FPS, np.zeros(39))
    assert len(drawn) == 300 + bundle.head.num_gaussians
    exact = body.gaussians(4 / FPS)
    places = [np.sort(g.means.detach().numpy(), 0) for g in (drawn[:300], exact)]
    np.testing.assert_allclose(*places, atol=2e-3)
    poses = person.placement.world_from_canonical
    head = baked_gaussians(found.head, np.zeros(39)).transform(poses[4])
    torch.testing.assert_close(drawn.means[300:], head.means, atol=1e-5, rtol=0)


def test_an_edited_animation_is_taken(avatar, tmp_path):
    folder, person = avatar
    found = person_bundle.animation_of(folder, person)
    assert (found.num_frames, found.fps) == (FRAMES, FPS)
    edited = Animation(FPS, FRAMES, Rest(2, 5), ())
    shutil.copytree(folder, tmp_path / "avatar")
    (tmp_path / "avatar" / "animation.json").write_bytes(edited.to_bytes())
    assert person_bundle.animation_of(tmp_path / "avatar", person) == edited
    (tmp_path / "avatar" / "animation.json").write_text(json.dumps({"version": 1}))
    with pytest.raises(BundleError, match=r"animation\.json"):
        person_bundle.animation_of(tmp_path / "avatar", person)


def test_what_costs_too_much_is_refused(baked):
    result = person_bundle.WholeResult(None, [], np.zeros(39), Loss(30.0, 29.8, 40.0))
    person_bundle.check(result)
    bad = person_bundle.WholeResult(None, [], np.zeros(39), Loss(30.0, 29.6, 40.0))
    with pytest.raises(BundleError, match="whole person too much"):
        person_bundle.check(bad)


def test_too_many_files_are_refused(avatar, capsys):
    assert main(["bake", str(avatar[0]), "a", "b", "c", "d"]) == 1
    assert "AVATAR [HEAD_CAPTURE [BODY_CAPTURE]] OUT" in capsys.readouterr().err
