"""Baking a body on a skeleton: what is kept is what was trained, in few bits and in order."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from ico3d.avatar.baked_body import skinned_gaussians
from ico3d.avatar.baking.importance import gaussian_importance
from ico3d.avatar.baking.skinned import skinned_bundle
from ico3d.avatar.baking.skinned.quantised import Clip, quantised
from ico3d.avatar.poseable import poseable_of
from ico3d.avatar.render_bundle import render_body, visitor_camera
from ico3d.body.model_folder import TrainedBody, save_window
from ico3d.body.planning.windows import Window
from ico3d.body.skinning.skinned import Skinned
from ico3d.bundle.format import Bundle
from ico3d.bundle.manifest import Loss
from ico3d.bundle.skinned.info import SKINNED
from ico3d.bundle.skinned.posing import any_pose, recorded_pose
from ico3d.cli import main
from ico3d.common.camera import Camera, look_at
from ico3d.common.psnr import psnr
from ico3d.errors import BundleError
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render
from support.avatars.origins import MADE, origin
from support.bodies.skinned_model import trained_like
from support.bundles.skinned_person import CASTERS, FPS, FRAMES, capsule_person, unseen_pose

pytestmark = pytest.mark.slow

CLIP = Clip(FPS, (-1.0, 0.0, -1.0), (1.0, 2.0, 1.0))
EYE, TARGET = np.array([0.6, 1.2, 4.0]), np.array([0.0, 0.95, 0.0])
CAMERA = Camera(
    90, 120, np.array([[230.0, 0, 45], [0, 230.0, 60], [0, 0, 1]]), look_at(EYE, TARGET), "front"
)
GREY = torch.full((3,), 0.8)
ROOT = np.array([0.1, 0.0, 0.0])


@pytest.fixture(scope="module")
def person():
    """A trained body of 400 Gaussians, of which some are invisible."""
    model = trained_like(capsule_person(400))
    model.gaussians["opacity_logits"][:7] = -9.0
    about = origin("computed")
    windows = (Window(0, FRAMES - 1),)
    return TrainedBody([model], windows, FPS, "skinned", {"capture": about})


def picture(gaussians: Gaussians) -> np.ndarray:
    return render(gaussians, [CAMERA], GREY).rgb[0].numpy()


@pytest.mark.parametrize(("shapes", "light"), [(True, True), (False, False), (False, True)])
def test_recorded_poses_are_as_they_were_trained(shapes, light):
    """With residual and light, and without either, also between two frames."""
    model = trained_like(capsule_person(400), shapes, light)
    baked = quantised(model, CLIP, np.arange(400.0))
    assert baked.info.num_gaussians == 400 and baked.info.num_moving == 9  # all but the jaw
    for frame in (0.0, 12.4, 30.0):
        exact = model.at(frame / (FRAMES - 1))
        found = skinned_gaussians(baked, recorded_pose(baked, frame))
        assert (found.means - exact.means.flip(0)).abs().max() < 2e-3
        assert psnr(picture(found), picture(exact)) > 50


def test_any_other_pose_is_what_training_makes_of_it(person):
    model = person.models[0]
    motion = model.motion
    assert isinstance(motion, Skinned)
    baked = quantised(model, CLIP, np.ones(400))
    turns = (torch.from_numpy(unseen_pose()).float(), torch.from_numpy(ROOT).float())
    exact = motion.posed({**model.gaussians, **model.shared}, *turns)
    found = skinned_gaussians(baked, any_pose(baked, unseen_pose(), ROOT))
    assert psnr(picture(found), picture(exact)) > 50


def test_the_most_important_come_first_and_the_invisible_not_at_all(person):
    """Half of them, drawn alone, lack less than the other half."""
    result = skinned_bundle.bake(person, None)
    baked = result.baked
    assert baked.info.num_gaussians == 393 and baked.opacities.min() > 0
    body = skinned_gaussians(baked, recorded_pose(baked, 9.0))
    everything = picture(body)
    first, last = (psnr(picture(part), everything) for part in (body[:196], body[196:]))
    assert first is not None and last is not None and first > last + 3
    assert result.loss.psnr_baked_vs_exact is not None and result.loss.psnr_baked_vs_exact > 50


def test_more_of_what_pages_show_comes_first(person, monkeypatch):
    shares = []
    for upper in (1.0, skinned_bundle.UPPER):
        monkeypatch.setattr(skinned_bundle, "UPPER", upper)
        heights = skinned_bundle.bake(person, None).baked.means[:, 1]
        shares.append((heights[:196] > 0.55 * heights.max()).mean())
    assert shares[1] > shares[0] + 0.05


def test_somebody_who_stands_still_counts_as_well(person):
    """A body with the joints of a person is drawn with hanging arms, where pages show it so."""
    found = skinned_bundle._at_rest(person)
    known = poseable_of(person, None)
    assert len(found) == (known is not None)
    for drawn in found:
        assert len(drawn) == 400 and drawn.means.isfinite().all()


def test_importance_is_what_a_picture_lacks_without_a_gaussian():
    """Estimated by random signs, against leaving out a little of each."""
    gaussians = skinned_gaussians(baked := capsule_person(30), recorded_pose(baked, 0))
    gaussians = replace(gaussians, scales=gaussians.scales * 1.5)
    small = CAMERA.resized(24, 32)
    estimate = gaussian_importance([(gaussians, small)] * 400, GREY, 0)
    whole, step = render(gaussians, [small], GREY).rgb[0], 1e-2
    exact = np.zeros(30)
    for i in range(30):
        opacities = gaussians.opacities.clone()
        opacities[i] *= 1 - step
        less = render(replace(gaussians, opacities=opacities), [small], GREY).rgb[0]
        exact[i] = float((whole - less).norm()) / step
    seen = exact > 0.1 * exact.max()
    assert seen.sum() > 10
    np.testing.assert_allclose(estimate[seen], exact[seen], rtol=0.3)


def test_a_body_that_loses_too_much_is_refused(person):
    baked = quantised(person.models[0], CLIP, np.ones(400))
    good = skinned_bundle.SkinnedResult(baked, b"", Loss(30.0, 29.95, 40.0))
    skinned_bundle.check(good)
    for loss in (Loss(30.0, 29.8, 60.0), Loss(None, None, 42.0)):
        with pytest.raises(BundleError, match=r"costs too much .* or use --force\.$") as caught:
            skinned_bundle.check(replace(good, loss=loss))
        assert "\n" not in str(caught.value)


def test_the_command_writes_what_the_page_plays(person, tmp_path, capsys):
    save_window(tmp_path / "window.safetensors", person.models[0])
    person.save(tmp_path, ["window.safetensors"])
    out, strip = tmp_path / "a.ico3d", tmp_path / "strip.png"
    words = ["bake", str(tmp_path), str(out), "--strip", str(strip), "--device", "cpu", *MADE]
    assert main(words) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "393 Gaussians on 10 joints, 8 shapes, 31 poses of 9 joints" in said
    bundle = Bundle.open(out)
    manifest = bundle.manifest
    assert bundle.skinned is not None and manifest.body is None and manifest.name == "a"
    assert manifest.loss.psnr_baked_vs_exact is not None and strip.is_file()
    assert (
        manifest.files[SKINNED].size < 393 * 96 + 14 * CASTERS + FRAMES * (9 * 8 + 12 + 32) + 4000
    )
    camera = visitor_camera(manifest.camera, 90, 120)
    behind = torch.tensor(manifest.background)
    exact = render(person.gaussians(1.1), [camera], behind).rgb[0].detach().numpy()
    assert psnr(render_body(bundle, 1.1, camera), exact) > 50
