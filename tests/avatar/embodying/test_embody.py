"""The packaged head, darker, of another size and from another place, on the packaged body."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from ico3d.avatar.baking.person_bundle import moved_head
from ico3d.avatar.embodying import embody as room
from ico3d.avatar.embodying.look import Look
from ico3d.avatar.joining.similarity import moved
from ico3d.avatar.poseable import poseable_of
from ico3d.bundle.format import LICENSES, SPEECH, THUMBNAIL, Bundle, write_bundle
from ico3d.bundle.head import HEAD, POSES, poses_to_bytes
from ico3d.bundle.packaged import FILE
from ico3d.bundle.people.provenance import OPENVOICE, ClonedVoice, Part, Provenance
from ico3d.bundle.people.voice import SIZE, VOICE, voice_to_bytes
from ico3d.cli import main
from ico3d.errors import BundleError
from ico3d.motion.gestures.library import library
from support.avatars.filmed_demo import ABROAD
from support.bundles.random_whole import write_random_whole
from support.needs import needs
from support.shared import MODELS

pytestmark = [pytest.mark.slow, needs("mediapipe")]

DARKER = np.array([-0.8, -0.9, -1.0])
"""By how much the colours of the head alone differ, in logits."""
VOICE_OF_ADA = ClonedVoice(OPENVOICE, "ada.mp4", "agreed to the voice, too")
ADA = Provenance(
    "portrait", ("ada.mp4",), "agreed", "ours", "Ada", "Bob", "2026-11-24", voice=VOICE_OF_ADA
)


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """The packaged head alone, as Ada's: moved, enlarged and darkened."""
    demo = Bundle.open(FILE)
    head, _ = demo.require_head()
    logits = head.mean_logits.astype(np.float32)
    logits[:, :3] += DARKER
    abroad = replace(moved_head(head, ABROAD), mean_logits=logits.astype(np.float16))
    files = {name: demo.read(name) for name in (THUMBNAIL, SPEECH, LICENSES)}
    files[VOICE] = voice_to_bytes(np.ones(SIZE, np.float32))
    files |= {HEAD: abroad.to_bytes(), POSES: poses_to_bytes(np.eye(4)[None])}
    info = demo.manifest.head
    assert info is not None
    manifest = replace(
        demo.manifest,
        name="Ada",
        head=replace(info, fps=25.0, num_poses=1, num_rest=0),
        skinned=None,
        provenance=ADA,
    )
    path = tmp_path_factory.mktemp("alone") / "ada.ico3d"
    write_bundle(path, manifest, files)
    return path


@pytest.fixture(scope="module")
def landmarks():
    """(68, 3) landmarks of the packaged head, as its face is found."""
    if not (MODELS / "face_landmarker.task").is_file():
        pytest.skip("face_landmarker.task is not here: set ICO3D_MODELS")
    demo = Bundle.open(FILE)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ICO3D_MODELS", str(MODELS))
        return room._landmarks(demo, demo.require_head()[0])


@pytest.fixture(scope="module")
def whole(alone, landmarks, tmp_path_factory):
    """The whole person, and what the verb said."""
    out = tmp_path_factory.mktemp("whole") / "ada.ico3d"
    known = {"Iris": landmarks, "Ada": moved(ABROAD, landmarks)}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(room, "_landmarks", lambda bundle, head: known[bundle.manifest.name])
        assert main(["embody", str(alone), str(out)]) == 0
    return Bundle.open(out)


@pytest.fixture(scope="module")
def demo():
    return Bundle.open(FILE)


def test_the_head_sits_where_the_other_one_sat_and_is_as_large(whole, demo):
    placed, own = whole.require_head()[0].means, demo.require_head()[0].means
    nearest = np.linalg.norm(placed[::40, None] - own, axis=2).min(1)  # (M,)
    assert nearest.max() < 1e-4 and len(placed) > 0.8 * len(own)
    assert np.array_equal(whole.world_from_head, demo.world_from_head)


def test_skin_and_hair_take_the_heads_colours_and_clothes_keep_theirs(whole, demo):
    before, after = demo.skinned, whole.skinned
    places = {tuple(place): row for row, place in enumerate(before.means)}
    rows = np.array([places[tuple(place)] for place in after.means])
    change = after.color_logits.astype(float) - before.color_logits[rows]  # (N, 3)
    mainly = np.take_along_axis(after.joints, after.weights.argmax(1)[:, None], 1)[:, 0]
    names = np.array(after.rig.names)[mainly]
    solid = after.opacities > 127

    def median(*starts):
        there = np.array([name.startswith(starts) for name in names])
        return np.median(change[there & solid], axis=0)

    assert np.abs(median("finger") - DARKER).max() < 0.1
    assert np.abs(median("head") - DARKER).max() < 0.35  # in the head's hair, light differs
    assert np.abs(median("spine")).max() < 0.02
    assert np.abs(median("upperleg", "lowerleg", "foot")).max() == 0


def test_nothing_of_the_other_head_is_left(whole, demo, landmarks):
    face = room.Face.of(landmarks)
    body, pose = whole.skinned, np.linalg.inv(whole.world_from_head[0].astype(float))
    there = room.SkinnedBody(body).window_gaussians(0, 0.0).transform(pose)
    means = there.means.numpy().astype(float)
    mainly = np.take_along_axis(body.joints, body.weights.argmax(1)[:, None], 1)[:, 0]
    on_head = mainly == body.rig.names.index("head")
    assert not (on_head & (face.region.depth(means) > 0)).any()
    assert not (on_head & face.beyond(means)).any()
    assert 0.9 * demo.skinned.info.num_gaussians < body.info.num_gaussians


def test_the_person_speaks_as_the_head_and_moves_as_the_body(whole, demo):
    manifest = whole.manifest
    assert (manifest.name, manifest.is_whole) == ("Ada", True)
    assert whole.read(SPEECH) == demo.read(SPEECH)
    assert whole.read(LICENSES) == demo.read(LICENSES)  # said once
    person = poseable_of(whole, None)
    assert person is not None and {"wave", "nod"} <= person.clips.keys()


def test_the_voice_of_the_head_comes_along(whole):
    assert whole.manifest.provenance.voice == VOICE_OF_ADA
    assert whole.voice is not None and (whole.voice == 1).all()


def test_it_is_told_which_part_is_recorded(whole):
    told = whole.manifest.provenance
    nobody = "nobody: no such person exists"
    assert told.parts == (Part("head", "portrait", "Ada"), Part("body", "synthetic", nobody))
    assert (told.kind, told.likeness, told.consent) == ("portrait, synthetic", "Ada", "agreed")
    assert told.sources[0] == "ada.mp4" and len(told.sources) > 1
    assert not told.is_synthetic and told.has_consent


def test_the_bundle_says_which_build_and_outfit_were_chosen(alone, landmarks, whole, tmp_path):
    out, known = tmp_path / "ada.ico3d", {"Iris": landmarks, "Ada": moved(ABROAD, landmarks)}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(room, "_landmarks", lambda bundle, head: known[bundle.manifest.name])
        some = partial(library, names=("wave", "nod"))
        patch.setattr("ico3d.bundle.skinned.gestures.library", some)
        words = ["embody", str(alone), str(out), "--build", "sturdy", "--outfit", "navy"]
        assert main(words) == 0
    other, nobody = Bundle.open(out), "nobody: no such person exists"
    told = other.manifest.provenance.parts
    assert told[1] == Part("body", "synthetic", nobody, "sturdy", "navy")
    assert told[0] == whole.manifest.provenance.parts[0]
    for name in (HEAD, POSES, SPEECH):  # the same head in the same place
        assert other.read(name) == whole.read(name)
    assert other.skinned.info.num_gaussians == whole.skinned.info.num_gaussians
    person = poseable_of(other, None)
    assert person is not None and {"wave", "nod"} <= person.clips.keys()


def test_a_body_that_cannot_look_so_is_refused_at_once(alone, demo):
    strange = Bundle.open(FILE)
    names = tuple(name.replace("upperleg", "thigh") for name in demo.skinned.rig.names)
    body = replace(demo.skinned, info=replace(demo.skinned.info, names=names))
    strange.skinned = body
    with pytest.raises(BundleError, match="only bodies on MakeHuman's skeleton"):
        room.body_in(strange, Look("slender"))
    left = np.flatnonzero(body.means[:, 1] > 0.3)
    strange.skinned = demo.skinned.chosen(left)
    with pytest.raises(BundleError, match="no shoes are found"):
        room.body_in(strange, Look(outfit="wine"))
    assert room.body_in(strange) is strange.skinned


def test_a_body_without_a_skeleton_is_refused(alone, tmp_path):
    write_random_whole(tmp_path / "windows.ico3d")
    with pytest.raises(BundleError, match=r"'random person' has no body on a skeleton"):
        room.embody(
            Bundle.open(alone), Bundle.open(tmp_path / "windows.ico3d"), tmp_path / "a", print
        )
