"""From a head and a capture of the body with a skeleton to somebody who gestures."""

from dataclasses import replace
from functools import partial

import av
import numpy as np
import pytest
import torch

from ico3d.avatar.avatar import PLACEMENT, TrainedAvatar, load_placement
from ico3d.avatar.head_joint import rig_of, trained_poses
from ico3d.avatar.joining.assemble import assemble
from ico3d.avatar.joining.companion import HeadSource
from ico3d.avatar.poseable import poseable_of
from ico3d.body.companion import Pruning
from ico3d.cli import main
from ico3d.motion.composing.in_turn import in_turn
from ico3d.motion.gestures.library import library
from support.avatars.planted_person import FRAMES, planted_head
from support.avatars.skeletal_person import SkeletalPerson
from support.avatars.tiny_joining import assembly_of
from support.settings import changed

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Capture, folder, avatar and what was said."""
    folder = tmp_path_factory.mktemp("made")
    capture, said = SkeletalPerson(folder / "capture"), []
    (folder / "head").mkdir()
    planted_head().save(folder / "head")
    assembly = assembly_of(folder / "head", match_colors=False)
    body = changed(assembly.body, {"steps_per_frame": 12})
    assembly = replace(assembly, body=body, method="skinned")
    return capture, folder / "out", assemble(capture, folder / "out", assembly, said.append), said


def test_the_head_hangs_on_its_joint(made):
    """One pose of it in the joint's frame for all of the clip, near to what was recorded."""
    _, folder, avatar, said = made
    rig = rig_of(avatar.body)
    joints = rig.matrices(*trained_poses(avatar.body))[:, rig.index("head")]
    local = np.linalg.inv(joints) @ avatar.placement.world_from_canonical
    np.testing.assert_allclose(local, np.broadcast_to(local[0], local.shape), atol=1e-9)
    recorded, _ = load_placement(folder / PLACEMENT)
    away = avatar.placement.world_from_canonical - recorded.world_from_canonical
    assert 0 < np.abs(away).max() < 0.05
    assert avatar.summary["sway_mm"] <= avatar.summary["sway_most_mm"] < 4
    assert any(line.startswith("the head hangs on its joint") for line in said)


def test_the_body_keeps_clear_and_closes_the_neck(made):
    """Pruned, with Gaussians about the border, as windows are; the folder opens again."""
    _, folder, avatar, _ = made
    companion = HeadSource(folder, 60, True).open(torch.device("cpu"))
    (model,), (window,) = avatar.body.models, avatar.body.windows
    assert not Pruning(companion, window).trespassing(model).any()
    assert avatar.summary["gap_mm"] < 30 and avatar.summary["psnr_border"] > 18
    again = TrainedAvatar.load(folder)
    for seconds in (0.0, 0.2):
        assert torch.equal(again.gaussians(seconds).means, avatar.gaussians(seconds).means)


def test_recorded_poses_are_a_gesture_like_any(made):
    """A recorded pose that is asked for puts body and head where the clip has them."""
    *_, avatar, _ = made
    person = poseable_of(avatar, 1)
    rotations, roots = trained_poses(avatar.body)
    for frame in range(FRAMES):
        expression = avatar.expressions[frame]
        head = person.head_in(rotations[frame], roots[frame], expression)
        expected = avatar.head_gaussians(frame / avatar.fps, expression)
        torch.testing.assert_close(head.means, expected.means, atol=1e-5, rtol=0)


def test_the_head_nods_with_the_neck(made):
    """A gesture that nobody recorded carries head and body alike."""
    *_, avatar, _ = made
    person = poseable_of(avatar, 0)
    person = replace(person, known=library(person.living.person, ("nod",)))
    performer = person.performer(3)
    directions, seconds = in_turn(person.clips, ["nod"])
    performer.follow(directions)
    expression, count = avatar.head.neutral(), len(avatar.head.model)
    tips = []
    for time in (0.0, directions[0].stroke):
        by_role, root = performer.at(time)
        drawn = person.gaussians(by_role[0], root[0], expression)
        assert torch.isfinite(drawn.means).all()
        head, body = drawn.means[-count:], drawn.means[:-count]
        tips.append(head.mean(0) - body.mean(0))
    assert seconds > directions[0].stroke
    assert float(tips[1][2] - tips[0][2]) > 0.005  # forwards


def test_it_is_filmed(made, tmp_path, capsys, monkeypatch):
    """As long as the gesture takes."""
    _, folder, *_ = made
    monkeypatch.setattr("ico3d.avatar.poseable.library", partial(library, names=("wave",)))
    out = tmp_path / "film.mp4"
    words = ["render", str(folder), str(out), "--gestures", "wave", "--fps", "1", "--size", "60"]
    assert main([*words, "--path", "start"]) == 0
    with av.open(str(out)) as film:
        pictures = [frame.to_ndarray(format="gray").astype(float) for frame in film.decode(video=0)]
    assert len(pictures) == 4
    printed = " ".join(capsys.readouterr().out.split())
    assert f"{len(pictures)} pictures at 1 per second" in printed
    assert np.ptp(pictures[0]) > 60
