"""Baking a person that swings its arms, from every moment of it to the bundle."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from ico3d.avatar.baked_body import window_gaussians
from ico3d.avatar.baking import body_bundle, body_cost
from ico3d.avatar.baking.shader_body import Shape, WindowBaker, aligned
from ico3d.avatar.render_bundle import body_gaussians, render_body, visitor_camera
from ico3d.body.model_folder import TrainedBody, save_window
from ico3d.body.motion.formulas import SPACETIME
from ico3d.body.motion.window_model import WindowModel
from ico3d.body.planning.windows import Window
from ico3d.bundle.format import Bundle
from ico3d.bundle.manifest import Loss, Persona
from ico3d.cli import main
from ico3d.errors import BundleError
from ico3d.splat.render import render
from support.avatars.filmed_person import NOISE, SIZE, FilmedPerson
from support.avatars.moving_body import FPS, MovingPerson
from support.avatars.origins import MADE, about

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def person() -> MovingPerson:
    return MovingPerson(300)


@pytest.fixture(scope="module")
def filmed(person, tmp_path_factory):
    """Person, capture, results and the opened bundle."""
    folder = tmp_path_factory.mktemp("body")
    capture = FilmedPerson(person, folder / "capture")
    results = list(body_bundle.bake(person, capture))
    parts = body_bundle.parts_of(results, person)
    told = about(Persona("Swinger"), capture.provenance, notices="A notice.")
    body_bundle.write(folder / "a.ico3d", parts, capture, told)
    return person, capture, results, Bundle.open(folder / "a.ico3d")


def test_signs_do_not_jump():
    rng = np.random.default_rng(0)
    angles = np.linspace(0, 6, 40)[:, None]
    axis = rng.normal(size=(5, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    smooth = np.concatenate(
        [np.cos(angles / 2)[..., None].repeat(5, 1), np.sin(angles / 2)[..., None] * axis], -1
    )
    signs = rng.choice([-1, 1], (40, 5, 1))
    straight = aligned(3.7 * smooth * signs)
    assert np.abs(np.diff(straight, axis=0)).max() < 0.1
    np.testing.assert_allclose(straight * signs[0], smooth, atol=1e-6)


@pytest.mark.parametrize("index", [0, 1, 2])
def test_the_baked_window_is_the_exact_one_also_between_sampled_times(person, index):
    window = WindowBaker(person, index).baked(Shape(1, (16, 16, 6)))
    for tau in (0.0, 0.21, 0.5, 0.83, 1.0):
        exact, baked = person.window_gaussians(index, tau), window_gaussians(window, tau)
        assert (exact.means - baked.means).norm(dim=1).max() < 4e-4  # m
        unit = torch.nn.functional.normalize(exact.quats)
        assert (unit * baked.quats).sum(1).abs().min() > 1 - 1e-5
        assert (exact.scales - baked.scales).abs().max() < 1e-5  # m
        assert (exact.colors - baked.colors).abs().max() <= 0.5 / 255 + 1e-6
        assert (exact.opacities - baked.opacities).abs().max() <= 0.5 / 255 + 1e-6


def test_a_higher_rank_is_better_and_larger(person):
    baker = WindowBaker(person, 1)
    probes = body_cost.probe_views(
        body_cost.ring_of_cameras(np.array([-0.5, 0, -0.5]), np.array([0.5, 1.8, 0.5])),
        person.windows[1],
        6,
    )
    windows = [baker.baked(Shape(1, ranks)) for ranks in ((1, 1, 1), (3, 2, 1), (5, 3, 2))]
    losses = [body_cost.measure_window(person, 1, w, [], probes) for w in windows]
    likeness = [loss.psnr_baked_vs_exact or 0.0 for loss in losses]
    assert likeness[0] + 3 < likeness[1] < likeness[2] - 1
    sizes = [len(window.to_bytes("w")) for window in windows]
    assert sizes == sorted(sizes)


def test_one_body_gives_one_file(person):
    first, second = (WindowBaker(person, 0).baked(Shape(2, (5, 3, 2))).to_bytes("w") for _ in "ab")
    assert first == second


def test_gaussians_that_are_never_seen_are_dropped():
    person = MovingPerson(50)
    person.opacities[:20] = 0.003
    assert WindowBaker(person, 0).baked(Shape(2, (5, 3, 2))).num_gaussians == 30
    person.opacities[:] = 0.003
    with pytest.raises(BundleError, match="window 0 has no Gaussian"):
        WindowBaker(person, 0)


def test_measured_pictures_are_the_noise_apart(filmed):
    """The exact body made the pictures, so its PSNR on the mask is that of the noise."""
    for result in filmed[2]:
        assert result.loss.psnr_exact == pytest.approx(-20 * np.log10(NOISE), abs=0.3)
        assert result.acceptable and result.drop <= 0.1 and result.bytes_per_gaussian <= 110
        assert result.loss.psnr_baked_vs_exact > 35


def test_a_strip_shows_recorded_exact_and_baked(filmed):
    person, capture, results, _ = filmed
    assert body_bundle.strip(
        person, body_bundle.parts_of(results, person).baked, capture
    ).shape == (3 * SIZE, 3 * SIZE, 3)


def test_the_bundle_holds_the_body(filmed):
    _, _, results, bundle = filmed
    manifest = bundle.manifest
    assert manifest.head is None and manifest.speech is None and manifest.name == "Swinger"
    assert manifest.body.fps == FPS
    assert [(w.first, w.last) for w in manifest.body.windows] == [(0, 7), (7, 16), (16, 22)]
    assert manifest.provenance.kind == "filmed" and bundle.read("LICENSES.txt") == b"A notice."
    assert manifest.loss.psnr_baked == pytest.approx(
        np.mean([result.loss.psnr_baked for result in results]), abs=1e-3
    )
    np.testing.assert_allclose(manifest.background, (0.3, 0.4, 0.5), atol=1e-4)
    low, high = np.array(manifest.body.low), np.array(manifest.body.high)
    assert ((low < (0, 0.1, 0)) & (high > (0, 1.65, 0)) & (high - low < 2.2)).all()
    np.testing.assert_allclose(manifest.camera.target, (low + high) / 2, atol=0.3)
    expected = 8e-6 * sum(len(r.data) for r in results) / (22 / FPS)
    assert body_bundle.megabits_per_second(results) == pytest.approx(expected)


def test_the_visitor_sees_all_of_the_body_upright(filmed):
    _, _, _, bundle = filmed
    camera = visitor_camera(bundle.manifest.camera, 64, 64)
    for point, row in (((0, 1.75, 0), (2, 24)), ((0, 0.0, 0), (40, 62))):
        (column, found), _ = camera.project(np.array(point, float))
        assert row[0] < found < row[1] and 8 < column < 56
    picture = render_body(bundle, 0.4, camera)
    assert np.abs(picture[0] - bundle.manifest.background).max() < 0.02
    assert np.abs(picture[32] - bundle.manifest.background).max() > 0.1


def test_neighbours_agree_at_the_shared_frame(filmed):
    _, _, _, bundle = filmed
    camera = visitor_camera(bundle.manifest.camera, 96, 96)
    pictures = [
        render(window_gaussians(bundle.window(i), tau), [camera]).rgb[0].numpy()
        for i, tau in ((0, 1.0), (1, 0.0))
    ]
    assert np.square(pictures[0] - pictures[1]).mean() < 10**-3.5


def test_time_beyond_the_ends_stands_still(filmed):
    _, _, _, bundle = filmed
    for inside, outside in ((0.0, -3.0), (22 / FPS, 99.0)):
        a, b = body_gaussians(bundle, inside), body_gaussians(bundle, outside)
        assert torch.equal(a.means, b.means)


def test_without_a_capture_it_is_measured_against_itself():
    short = MovingPerson(300, (0, 4))
    results = list(body_bundle.bake(short, None))
    assert results[0].drop is None and results[0].acceptable
    assert body_bundle.strip(short, body_bundle.parts_of(results, short).baked, None).shape == (
        1024,
        512,
        3,
    )


@pytest.mark.parametrize(("largest", "shapes"), [(322_638, 5), (322_639, 3), (599_186, 1)])
def test_many_gaussians_are_baked_in_shapes_that_a_page_can_hold(largest, shapes):
    assert body_bundle._fitting(largest) == body_bundle.SHAPES[:shapes]


def test_more_gaussians_than_a_page_can_hold_are_refused_before_they_are_baked():
    with pytest.raises(BundleError, match=r"599187 Gaussians, more than .* \(599186\): train with"):
        body_bundle._fitting(599_187)


def test_what_costs_too_much_is_refused(filmed):
    good = filmed[2][0]
    body_bundle.check([good])
    lossy = replace(good, loss=Loss(30.0, 29.85, 40.0))
    unlike = replace(good, loss=Loss(None, None, 40.0))
    large = replace(good, data=b"x" * 111 * good.window.num_gaussians)
    for bad in (lossy, unlike, large):
        with pytest.raises(BundleError, match="window 1 costs too much"):
            body_bundle.check([good, bad])


def trained_body(folder: Path, log_duration: float) -> None:
    """A model folder: two windows of Gaussians that fly along parabolas and turn."""
    generator = torch.Generator().manual_seed(0)
    sizes = {"means": (3,), "quats": (4,), "path": (3, 3), "turn": (4,), "color_logits": (3,)}
    values = {n: torch.randn(40, *s, generator=generator) * 0.2 for n, s in sizes.items()}
    values["quats"][:, 0] += 1
    values["log_scales"] = torch.full((40, 3), -3.0)
    values["opacity_logits"] = torch.full((40,), 2.0)
    values["center"] = torch.full((40,), 0.5)
    values["log_duration"] = torch.full((40,), log_duration)
    windows = (Window(0, 4), Window(4, 7))
    models = [WindowModel(SPACETIME, dict(values), {}) for _ in windows]
    summary = {"capture": FilmedPerson.provenance.fget(None)}
    files = [f"{i}.safetensors" for i in range(2)]
    for file, model in zip(files, models, strict=True):
        save_window(folder / file, model)
    TrainedBody(models, windows, FPS, "spacetime", summary).save(folder, files)


def test_a_model_folder_becomes_a_bundle_at_the_command_line(tmp_path, capsys):
    trained_body(tmp_path / "model", 8.0)
    out, strip = tmp_path / "flying.ico3d", tmp_path / "strip.png"
    assert main(["bake", str(tmp_path / "model"), str(out), "--strip", str(strip), *MADE]) == 0
    bundle = Bundle.open(out)
    assert bundle.manifest.name == "flying" and bundle.manifest.provenance.kind == "filmed"
    assert [w.num_gaussians for w in bundle.manifest.body.windows] == [40, 40]
    assert strip.is_file()
    printed = capsys.readouterr().out
    assert "window 1: 40 Gaussians" in printed and "Mbit/s" in printed


def test_gaussians_that_come_and_go_are_refused(tmp_path, capsys):
    trained_body(tmp_path, -1.0)
    assert main(["bake", str(tmp_path), str(tmp_path / "a.ico3d"), *MADE]) == 1
    assert "come and go" in capsys.readouterr().err
    assert not (tmp_path / "a.ico3d").exists()


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["one", "two", "three"], "needs HEAD CAPTURE OUT"),
        (["out.ico3d", "--rank", "20"], "--rank is for heads"),
    ],
)
def test_arguments_that_do_not_fit_a_body_are_refused(tmp_path, capsys, arguments, sentence):
    trained_body(tmp_path, 8.0)
    assert main(["bake", str(tmp_path), *arguments]) == 1
    assert sentence in capsys.readouterr().err
