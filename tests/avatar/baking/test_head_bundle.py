"""Baking a planted head, from its pictures to the bundle that is opened again."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from ico3d.avatar.baking import head_bundle, head_cost
from ico3d.avatar.baking.persona import load_persona
from ico3d.avatar.baking.shader_head import CLIP, BakeSettings, HeadBaker
from ico3d.avatar.render_bundle import render_bundle
from ico3d.bundle.evaluate import centres, logits
from ico3d.bundle.manifest import Loss
from ico3d.errors import BundleError
from support.avatars.planted import driving, planted_blendshape_head
from support.bundles.random_bundle import random_head

pytestmark = pytest.mark.slow

QUICK = BakeSettings(hidden=64, augmented=100, steps=300)


def expressions(head, capture, frames):
    track = head.track(capture)
    return np.stack([track.at(frame).detach().numpy() for frame in frames])


def baker(head, capture, rank=16):
    recorded = expressions(head, capture, capture.split.train)
    return HeadBaker(head.model, recorded, np.ones((len(head.model), 4), np.float32), rank, QUICK)


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """A head that is driven by blendshapes, its capture, and its baker."""
    head, capture = planted_blendshape_head(tmp_path_factory.mktemp("fitted"))
    return head, capture, baker(head, capture)


def test_baked_logits_are_the_exact_ones(fitted):
    head, capture, maker = fitted
    baked = maker.baked(16)
    for e in expressions(head, capture, capture.split.test):
        exact = head.model.logits(torch.from_numpy(e)).detach().clamp(-CLIP, CLIP).numpy()
        error = logits(baked, e) - exact
        assert np.sqrt(np.square(error).mean()) < 0.1 * exact.std()


def test_baked_centres_are_the_exact_ones(fitted):
    head, capture, maker = fitted
    baked = maker.baked(16)
    rest = head.model.means.detach().numpy()
    for e in expressions(head, capture, capture.split.test):
        exact = head.model(torch.from_numpy(e)).means.detach().numpy()
        found = centres(baked, e)  # by importance
        nearest = np.linalg.norm(found[:, None] - exact, axis=-1).min(1)
        assert nearest.max() < 1e-4 and np.abs(exact - rest).max() > 1e-3


def test_a_higher_rank_is_better_and_larger(fitted):
    head, capture, maker = fitted
    views = head_cost.references(head, capture, (0.5, 0.5, 0.5), 6)
    losses = [head_cost.measure(maker.baked(rank), views) for rank in (1, 4, 16)]
    likeness = [loss.psnr_baked_vs_exact or 0.0 for loss in losses]
    assert likeness[0] + 2 < likeness[1] < likeness[2]


def test_what_matters_most_comes_first(fitted):
    head, capture, plain = fitted
    importance = np.random.default_rng(0).uniform(0.1, 1, (len(head.model), 4)).astype(np.float32)
    recorded = expressions(head, capture, capture.split.train)
    baked = HeadBaker(head.model, recorded, importance, 2, replace(QUICK, steps=1)).baked(2)
    means = head.model.means.detach().numpy().astype(np.float32)  # (N, 3)
    order = np.argsort(-importance.sum(1))
    kept = {tuple(mean) for mean in plain.baked(1).means}
    expected = [mean for mean in means[order] if tuple(mean) in kept]
    np.testing.assert_array_equal(baked.means, expected)


def test_brows_eyes_and_lips_come_before_what_is_as_important(fitted):
    head, capture, _ = fitted
    recorded = expressions(head, capture, capture.split.train)
    means = head.model.means.detach().numpy()
    landmarks = np.tile(means[:1] + 1.0, (68, 1))  # a metre away
    landmarks[17:27], landmarks[36:48], landmarks[48:68] = means[200], means[100], means[50]
    landmarks[27] = means[150]  # the nose is no such feature
    one = np.ones((len(means), 4), np.float32)
    baked = HeadBaker(head.model, recorded, one, 2, replace(QUICK, steps=1), landmarks).baked(2)
    first = np.linalg.norm(means[:, None] - baked.means[:3], axis=-1).argmin(0)
    assert set(first.tolist()) == {50, 100, 200}


def test_gaussians_that_are_never_drawn_are_dropped(blendshape_head):
    head, capture = blendshape_head
    with torch.no_grad():
        head.model.opacity_branch.weight.zero_()
        head.model.opacity_branch.bias.fill_(-7.0)  # alpha 0.0009 < 1/255
    with pytest.raises(BundleError, match="no Gaussian"):
        baker(head, capture)


def test_one_seed_gives_one_bundle(fitted, blendshape_head):
    first, second = (maker.baked(8).to_bytes() for maker in (fitted[2], baker(*blendshape_head)))
    assert first == second


def test_measured_pictures_are_the_noise_apart(fitted):
    """The exact model made the pictures, so its PSNR is that of the noise: −20·log10 σ."""
    head, capture, maker = fitted
    views = head_cost.references(head, capture, (0.5, 0.5, 0.5), 6)
    loss = head_cost.measure(maker.baked(16), views)
    assert loss.psnr_exact == pytest.approx(-20 * np.log10(0.03), abs=0.3)
    assert loss.psnr_baked == pytest.approx(loss.psnr_exact, abs=0.3)
    assert head_cost.strip(maker.baked(2), views, 2).shape == (96, 144, 3)


@pytest.mark.parametrize(
    ("loss", "megabytes", "good"),
    [
        (Loss(34.0, 33.8, 46.0), 1.2, True),
        (Loss(34.0, 33.6, 46.0), 1.2, False),
        (Loss(34.0, 33.8, 44.0), 1.2, False),
        (Loss(34.0, 33.8, 46.0), 1.8, False),
    ],
)
def test_bounds(loss, megabytes, good):
    result = head_bundle.BakedResult(random_head(5, rank=2), loss, megabytes)
    assert result.acceptable is good
    if not good:
        with pytest.raises(BundleError, match="--force"):
            head_bundle.check(result)


def speaks(baked):
    head, capture, bundle = baked
    if head.adaptor is None:
        pytest.skip("driven by blendshapes")
    return head, capture, bundle


def test_a_bundle_says_what_it_is(baked):
    head, capture, bundle = baked
    manifest = bundle.manifest
    assert (manifest.name, manifest.persona.name) == ("Planted", "Iris")
    assert manifest.head.inputs == head.inputs and manifest.head.fps == 3.0
    assert manifest.head.expression_names == tuple(capture.blendshape_names or ())
    assert manifest.background == pytest.approx((0.3, 0.4, 0.5), abs=2e-5)
    assert manifest.provenance.sources == ("a seed",)
    assert bundle.read("LICENSES.txt") == b"A notice."
    assert manifest.loss.psnr_baked_vs_exact > 30
    assert (manifest.speech is None) == (head.adaptor is None)


def test_a_rendered_bundle_looks_like_the_exact_head(baked):
    head, capture, bundle = baked
    frame = capture.split.test[1]
    camera = frame % 2
    picture = render_bundle(
        bundle,
        driving(head, expressions(head, capture, [frame])[0]),
        capture.cameras[camera],
        capture.background(camera),
        capture.world_from_head(frame),
    )
    assert head_cost.psnr(picture, capture.image(camera, frame)) > 27  # the noise is 30 dB


def test_the_bundles_speech_graph_speaks_the_adaptors_language(baked):
    from ico3d.speech.runtime import SpeechModel

    head, capture, bundle = speaks(baked)
    sound = capture.audio()
    rows = SpeechModel(bundle.read("speech.onnx")).expressions(sound.samples, sound.rate)
    for frame in (3, 30, 51):  # at 3 frames/s, every third frame is a row of 25/s
        expected = expressions(head, capture, [frame])[0, :32]
        np.testing.assert_allclose(rows[frame // 3 * 25], expected, atol=2e-3)


def test_idle_is_silence_with_open_eyes(baked):
    from ico3d.speech.runtime import SpeechModel

    head, _, bundle = speaks(baked)
    silence = np.zeros(32_000, np.float32)
    rows = SpeechModel(bundle.read("speech.onnx")).expressions(silence, 16_000)
    idle = bundle.manifest.head.idle_expression
    np.testing.assert_allclose(rows[len(rows) // 2], idle[:32], atol=2e-3)
    assert idle[32:] == (0.0,) * 7
    idle = head.recorded(np.array(idle))
    assert max(idle[32 + 5], idle[32 + 6]) < 0.1  # tracked lids go from 0 to 1


def test_what_drives_an_avatar_stays_within_what_was_recorded(baked):
    """Brows that hardly moved would turn the face to rags if they were raised by half."""
    head, capture, _ = speaks(baked)
    recorded = expressions(head, capture, capture.split.train)
    exact = baker(head, capture).baked(8)
    driven = head_bundle.driven(exact, head)
    for row in recorded[::9]:
        np.testing.assert_allclose(
            logits(driven, driving(head, row)), logits(exact, row), atol=1e-4
        )
    lively, calm = recorded[0].copy(), recorded[0].copy()
    lively[32:], calm[32:] = 1, 0
    assert (head.recorded(lively)[32:] <= recorded[:, 32:].max(0) + 1e-6).all()
    np.testing.assert_allclose(
        head.recorded(calm)[32:37], np.median(recorded[:, 32:37], 0), atol=1e-6
    )
    np.testing.assert_array_equal(head.recorded(lively)[:32], recorded[0, :32])


def test_idle_of_blendshapes_is_the_most_neutral_face(baked):
    head, capture, bundle = baked
    if head.adaptor is not None:
        pytest.skip("driven by speech")
    sums = np.abs(expressions(head, capture, capture.split.train)).sum(1)
    assert sum(bundle.manifest.head.idle_expression) == pytest.approx(sums.min(), abs=1e-4)


def test_personas(tmp_path):
    persona = load_persona(None)
    assert persona.name and persona.greeting and len(persona.notes) >= 25
    path = tmp_path / "persona.json"
    path.write_text('{"name": "A", "greeting": "B", "notes": ["a question => "]}')
    with pytest.raises(BundleError, match="note 1"):
        load_persona(path)
    with pytest.raises(BundleError, match=r"nothing\.json"):
        load_persona(tmp_path / "nothing.json")


def test_rows_of_a_strip_may_be_of_cameras_of_any_size():
    wide, narrow = np.zeros((4, 6, 3)), np.full((2, 3, 3), 0.5)
    found = head_cost.stacked([wide, narrow])
    assert found.shape == (6, 6, 3) and found.dtype == np.uint8
    assert (found[:4] == 0).all() and (found[4:, :3] == 128).all() and (found[4:, 3:] == 255).all()
