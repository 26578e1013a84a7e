"""A recording's SMPL-X parameters and a model file give the body of the published equations."""

import io
import pickle
import zipfile
from functools import cache

import h5py
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from ico3d.capture.checking.check import examine
from ico3d.capture.checking.contact_sheet import contact_sheet
from ico3d.capture.formats import open_capture
from ico3d.capture.importing.resized import ResizedCapture
from ico3d.capture.importing.resizing import resize_capture
from ico3d.capture.posing.command import Pose
from ico3d.capture.posing.smplx import model_file
from ico3d.capture.posing.smplx.choosing import chosen_model
from ico3d.capture.posing.smplx.joints import MARKED, NAMES
from ico3d.capture.posing.smplx.model_file import SHAPES, read_model
from ico3d.capture.posing.smplx.track import LICENCE, track_from_parameters
from ico3d.errors import CaptureError, MissingModelError, SettingsError
from ico3d.motion.retarget import DOWN, retarget
from ico3d.motion.roles import ROLES, cast
from ico3d.rig.quaternions import IDENTITY
from support.recordings import dna_files, smplx_files

FRAMES = 3
UPRIGHT = np.diag([1.0, -1.0, -1.0])
"""From the files' world, which has -y up, to that of captures."""


@pytest.fixture(scope="module")
def models(tmp_path_factory):
    """A folder with the women's model."""
    folder = tmp_path_factory.mktemp("models")
    smplx_files.write_model(folder / "SMPLX_FEMALE.npz")
    return folder


@pytest.fixture
def main(tmp_path):
    """A recording of a woman with SMPL-X parameters and no key points that fit."""
    rig = dna_files.Rig(cameras=(0, 20, 48), frames=FRAMES)
    main = dna_files.write_recording(tmp_path / "dna", rig, same_picture=True)
    smplx_files.write_parameters(main, smplx_files.parameters(FRAMES))
    return main


@pytest.fixture(autouse=True)
def nothing_of_the_users(monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("ICO3D_MODELS", raising=False)


def published(frame: int, scale: float) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and joints in the capture's world by SMPL-X's equations, without `posedirs`."""
    model, parts = smplx_files.model_arrays(), smplx_files.parameters(FRAMES)
    directions = np.concatenate([model["shapedirs"][..., :10], model["shapedirs"][..., 300:310]], 2)
    shape = np.concatenate([parts["betas"][frame], parts["expression"][frame]])
    vertices = model["v_template"] + directions @ shape
    joints = model["J_regressor"] @ vertices
    pose = parts["fullpose"][frame].copy()
    pose[25:40] += model["hands_meanl"].reshape(15, 3)
    pose[40:55] += model["hands_meanr"].reshape(15, 3)
    world = []
    for joint, parent in enumerate(smplx_files.PARENTS):
        local = np.eye(4)
        local[:3, :3] = Rotation.from_rotvec(pose[joint]).as_matrix()
        local[:3, 3] = joints[joint] - (joints[parent] if joint else 0)
        world.append(world[parent] @ local if joint else local)
    chain = np.stack(world)  # (55, 4, 4)
    places = chain[:, :3, 3].copy()
    chain[:, :3, 3] -= np.einsum("jab,jb->ja", chain[:, :3, :3], joints)
    mixed = np.einsum("vj,jab->vab", model["weights"], chain)
    posed = np.einsum("vab,vb->va", mixed[:, :3, :3], vertices) + mixed[:, :3, 3]
    return tuple((scale * x + parts["transl"][frame]) @ UPRIGHT.T for x in (posed, places))


def annotate(main, points: np.ndarray) -> None:
    """Writes key points (F, 133, 3) of the capture's world into a recording."""
    with h5py.File(main.with_stem(f"{main.stem}_annots"), "a") as file:
        del file["Keypoints_3D/keypoints3d"]
        file["Keypoints_3D/keypoints3d"] = points @ UPRIGHT


def key_points(scale: float) -> np.ndarray:
    points = np.zeros((FRAMES, 133, 3))
    for frame in range(FRAMES):
        points[frame, list(MARKED)] = published(frame, scale)[1][list(MARKED.values())]
    return points


def test_the_body_is_that_of_the_published_equations(main, models, monkeypatch, capsys):
    monkeypatch.setenv("ICO3D_MODELS", str(models))
    capture = open_capture(main)
    before = np.asarray(contact_sheet(capture, [(0, 0)]))
    Pose(main, workers=1).run()
    track = capture.body_track()
    assert track is not None and track.fitted.all()
    assert track.rig.names == smplx_files.NAMES == NAMES
    assert track.rig.parents == smplx_files.PARENTS
    for frame in range(FRAMES):
        vertices, joints = published(frame, 1.02)
        np.testing.assert_allclose(track.surface(frame), vertices, atol=1e-5)
        np.testing.assert_allclose(track.joints()[frame], joints, atol=1e-5)
    assert track.vertices[:, 1].min() == pytest.approx(0, abs=1e-6)
    np.testing.assert_array_equal(track.faces, smplx_files.model_arrays()["f"])
    assert track.licence == LICENCE and "female" in track.source
    assert track.credited(capture.provenance)["licence"].endswith(f"agreement; {LICENCE}")
    said = capsys.readouterr().err
    assert "non-commercial" in said and "3 of 3 frames fitted" in said and "mm off" not in said
    (finding,) = (f for f in examine(capture) if f.what == "skeleton")
    assert finding.text.startswith("55 joints in 3 frames, 0 of them")
    assert (np.asarray(contact_sheet(capture, [(0, 0)])) != before).any()


def test_a_smaller_copy_keeps_the_track(main, models, tmp_path):
    Pose(main, 1, models / "SMPLX_FEMALE.npz").run()
    track = open_capture(main).body_track()
    resize_capture(main, tmp_path / "small", 20, 1)
    copy = open_capture(tmp_path / "small").body_track()
    assert track and copy and copy.to_bytes() == track.to_bytes()
    smaller = ResizedCapture(open_capture(main), 20).smplx(1)
    assert smaller is not None
    np.testing.assert_array_equal(smaller.fullpose, smplx_files.parameters(FRAMES)["fullpose"][1])


def test_gestures_find_every_joint_and_arms_hang(main, models):
    track = track_from_parameters(open_capture(main), models / "SMPLX_FEMALE.npz").track
    known = cast(track.rig)
    assert known.naming == "SMPL-X" and set(known.joints) == set(ROLES)
    assert known.eyes() is not None and all(known.has_fingers(s) for s in ("left", "right"))
    fitted = retarget(track.rig)
    pose = np.tile(IDENTITY, (len(ROLES), 1))
    places = track.rig.posed(fitted.pose(pose), np.zeros(3))[1]
    arm = places[known.joints["left_elbow"][0]] - places[known.joints["left_shoulder"][0]]
    np.testing.assert_allclose(arm / np.linalg.norm(arm), DOWN, atol=1e-6)


@pytest.mark.parametrize("true", (1.0, 1.02))
def test_key_points_tell_whether_the_stated_scale_holds(main, models, true, caplog):
    annotate(main, key_points(true))
    found = track_from_parameters(open_capture(main), models / "SMPLX_FEMALE.npz")
    np.testing.assert_allclose(found.track.surface(1), published(1, true)[0], atol=1e-5)
    assert found.off.max() < 1e-6 and np.isnan(found.outside).all()
    assert [("scale 1.02" in said) for said in caplog.messages] == ([True] if true == 1 else [])


def test_frames_without_parameters_are_interpolated_and_said_so(main, models, capsys):
    smplx_files.write_parameters(main, {"fullpose": smplx_files.parameters(FRAMES)["fullpose"][:2]})
    Pose(main, 1, models / "SMPLX_FEMALE.npz").run()
    track = open_capture(main).body_track()
    assert track is not None and track.fitted.tolist() == [True, True, False]
    np.testing.assert_array_equal(track.rotations[2], track.rotations[1])
    assert "frames 2 are interpolated" in capsys.readouterr().err


def test_without_the_model_a_line_says_what_it_takes(main, monkeypatch, tmp_path, capsys, models):
    smplx_files.write_model(tmp_path / "m" / "SMPLX_MALE.npz")
    monkeypatch.setenv("ICO3D_MODELS", str(tmp_path / "m"))
    assert chosen_model(open_capture(main), None) is None
    said = capsys.readouterr().err.strip()
    for word in ("female", "SMPLX_FEMALE.npz", "non-commercial", "--smplx-model", "ICO3D_MODELS"):
        assert word in said and "\n" not in said
    bare = dna_files.Rig(cameras=(0, 1), frames=1, annotated=False)
    other = open_capture(dna_files.write_recording(tmp_path / "bare", bare))
    assert chosen_model(other, None) is None and not capsys.readouterr().err
    with pytest.raises(SettingsError, match="brings no SMPL-X parameters"):
        chosen_model(other, models / "SMPLX_FEMALE.npz")


def test_a_model_of_the_other_sex_or_none_is_refused(main, models, tmp_path):
    capture = open_capture(main)
    for name in ("SMPLX_MALE.npz", "smplx-neutral.npz"):
        with pytest.raises(SettingsError, match=r"name SMPLX_FEMALE\.npz"):
            chosen_model(capture, smplx_files.write_model(tmp_path / name))
    with pytest.raises(MissingModelError, match="there is no SMPL-X model"):
        chosen_model(capture, tmp_path / "none.npz")
    renamed = smplx_files.write_model(tmp_path / "mine.npz")
    assert chosen_model(capture, renamed) == renamed


def refused(file, *words):
    with pytest.raises(CaptureError) as error:
        read_model(file)
    said = str(error.value)
    assert all(word in said for word in words) and "\n" not in said and said[-1] == ".", said


def test_every_wrong_array_is_one_sentence(tmp_path):
    sound = smplx_files.model_arrays()
    for name in SHAPES:
        refused(smplx_files.write_model(tmp_path / "a", sound | {name: np.zeros((2, 7))}), name)
        lacking = {key: value for key, value in sound.items() if key != name}
        refused(smplx_files.write_model(tmp_path / "b", lacking), f"lacks {name}")
        holes = sound[name].astype(float)
        holes.flat[0] = np.nan
        refused(smplx_files.write_model(tmp_path / "c", sound | {name: holes}), name, "finite")
        pickled = np.array({"a": 1}, object)
        refused(smplx_files.write_model(tmp_path / "d", sound | {name: pickled}), "pickled")
    few = {"shapedirs": sound["shapedirs"][..., :15]}
    refused(smplx_files.write_model(tmp_path / "e", sound | few), "15 directions")
    refused(smplx_files.write_model(tmp_path / "f", sound | {"f": sound["f"] + 79}), "'f'")
    nothing = {"f": sound["f"][:0]} | {n: sound[n][:0] for n in ("v_template", "weights")}
    nothing |= {"shapedirs": sound["shapedirs"][:0], "J_regressor": sound["J_regressor"][:, :0]}
    refused(smplx_files.write_model(tmp_path / "n", sound | nothing), "'f' is empty")
    for weights in (sound["weights"] * 2, sound["weights"] - 0.1):
        refused(smplx_files.write_model(tmp_path / "g", sound | {"weights": weights}), "'weights'")
    table = sound["kintree_table"].copy()
    table[0, 5] = 9
    refused(smplx_files.write_model(tmp_path / "h", sound | {"kintree_table": table}), "no tree")
    (tmp_path / "model.pkl").write_bytes(pickle.dumps(sound))
    refused(tmp_path / "model.pkl", "pickled")
    refused(tmp_path / "nowhere.npz", "there is no SMPL-X model")


def test_what_is_read_is_what_was_measured(tmp_path, monkeypatch):
    """Numpy takes a member without the ending .npy before the one with it."""
    sound = smplx_files.model_arrays()
    file = smplx_files.write_model(tmp_path / "two.npz", sound)
    other = io.BytesIO()
    np.save(other, sound["v_template"] + 1)
    with zipfile.ZipFile(file, "a") as archive:
        archive.writestr("v_template", other.getvalue())
    np.testing.assert_array_equal(read_model(file).vertices, sound["v_template"])
    monkeypatch.setattr(model_file, "LARGEST", sum(sound[name].nbytes for name in SHAPES))
    refused(file, "larger than those of SMPL-X")  # by the headers of the arrays


def test_version_1_0_has_its_expressions_after_ten_shapes(tmp_path):
    sound = smplx_files.model_arrays()
    few = sound | {"shapedirs": sound["shapedirs"][..., :20]}
    model = read_model(smplx_files.write_model(tmp_path / "old.npz", few))
    np.testing.assert_array_equal(model.expressions, sound["shapedirs"][..., 10:20])


@cache
def content() -> tuple[bytes, list[int]]:
    """A small model file, and where its arrays begin."""
    stream = io.BytesIO()
    arrays = smplx_files.model_arrays()
    arrays["shapedirs"] = arrays["shapedirs"][..., :20]
    np.savez(stream, allow_pickle=False, **{name: arrays[name] for name in SHAPES})
    with zipfile.ZipFile(stream) as archive:
        heads = [entry.header_offset for entry in archive.infolist()]
    return stream.getvalue(), heads


@settings(max_examples=30)
@given(st.integers(0, 7), st.integers(0, 200), st.integers(1, 255), st.floats(0.2, 2))
@example(1, 133, 1, 2.0)  # brackets of an array's header that do not match
def test_damaged_files_are_one_sentence_or_a_model(tmp_path_factory, array, place, flip, part):
    whole, heads = content()
    broken = bytearray(whole)
    broken[heads[array] + place] ^= flip
    file = tmp_path_factory.getbasetemp() / "broken.npz"
    file.write_bytes(bytes(broken[: round(part * len(whole))]))
    try:
        assert len(read_model(file).parents) == 55
    except CaptureError as error:
        assert "\n" not in str(error)


@pytest.mark.parametrize(
    ("part", "value", "words"),
    (
        ("betas", np.full((3, 10), 1e4), "make no body"),
        ("scale", np.float64(-1), "make no body"),
        ("scale", np.float64(1000), "make no body"),
        ("fullpose", np.full((3, 55, 3), 1e200), "make no body"),
        ("transl", np.full((3, 3), 2000.0), "more than 1000 m away"),
        ("transl", np.full((3, 3), np.nan), "no finite numbers"),
        ("fullpose", np.zeros((3, 24, 3)), "expected at most 100000 x 55 x 3"),
    ),
)
def test_parameters_that_make_no_body_are_refused(main, models, part, value, words):
    smplx_files.write_parameters(main, {part: value})
    track = open_capture(main).path.with_suffix(".body_track.safetensors")
    track.write_bytes(b"what was there")
    with pytest.raises(CaptureError, match=words) as error:
        Pose(main, 1, models / "SMPLX_FEMALE.npz").run()
    assert "\n" not in str(error.value) and track.read_bytes() == b"what was there"


def test_a_vertex_keeps_its_four_strongest_joints(main, tmp_path):
    arrays = smplx_files.model_arrays(influences=6)
    file = smplx_files.write_model(tmp_path / "six.npz", arrays)
    found = track_from_parameters(open_capture(main), file).track.binding
    order = np.sort(arrays["weights"], 1)[:, :-5:-1]
    np.testing.assert_allclose(found.weights, order / order.sum(1, keepdims=True), atol=1e-6)
