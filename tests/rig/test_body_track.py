"""The file of a body track: round trip, and what is refused."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from safetensors import safe_open
from safetensors.numpy import load_file, save_file

from ico3d.errors import CaptureError
from ico3d.rig import body_track
from ico3d.rig.binding import Binding
from ico3d.rig.body_track import NAME, BodyTrack, read_body_track, track_file, write_body_track
from ico3d.rig.quaternions import from_rotvec
from ico3d.rig.rig import Rig
from support.strangers.claimed import write_claim

RIG = Rig(("root", "arm"), (-1, 0), np.array([[0, 1, 0], [0.2, 1, 0.0]]))


@pytest.fixture
def track():
    rng = np.random.default_rng(0)
    return BodyTrack(
        rig=RIG,
        fps=15.0,
        rotations=from_rotvec(rng.normal(size=(5, 2, 3))).astype(np.float32),
        roots=rng.normal(size=(5, 3)).astype(np.float32),
        fitted=np.array([True, True, False, True, True]),
        vertices=rng.normal(size=(4, 3)).astype(np.float32),
        faces=np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        binding=Binding.strongest(rng.random((4, 2))),
        source="made for a test",
    )


def test_it_comes_back(track, tmp_path):
    file = write_body_track(track, tmp_path)
    assert file == tmp_path / NAME
    found = read_body_track(tmp_path, 5, 15.0)
    assert found.to_bytes() == track.to_bytes()
    np.testing.assert_array_equal(found.fitted, track.fitted)
    assert (found.rig.names, found.rig.parents) == (RIG.names, RIG.parents)
    np.testing.assert_allclose(found.surface(3), track.surface(3))
    assert found.joints().shape == (5, 2, 3)


def test_a_templates_licence_is_passed_on_and_may_be_missing(track, tmp_path):
    known = {"kind": "film", "sources": ["a film"], "licence": "CC0"}
    assert track.credited(known) == known
    bound = replace(track, licence="for research")
    passed = {"sources": ["a film", track.source], "licence": "CC0; for research"}
    assert bound.credited(known) == known | passed
    assert bound.credited(known | {"licence": ""})["licence"] == "for research"
    file = write_body_track(bound, tmp_path)
    found = read_body_track(tmp_path, 5, 15.0)
    assert found and found.licence == bound.licence
    with safe_open(file, "numpy") as content:
        about = json.loads(content.metadata()["body_track"])
        arrays = {name: content.get_tensor(name) for name in content.keys()}  # noqa: SIM118
    del about["licence"]  # as earlier versions wrote it
    save_file(arrays, file, {"body_track": json.dumps(about)})
    found = read_body_track(tmp_path, 5, 15.0)
    assert found and found.licence == ""


def test_it_lies_beside_a_recording_that_is_a_file(tmp_path):
    assert track_file(tmp_path / "0012_03.smc") == tmp_path / f"0012_03.{NAME}"
    assert read_body_track(tmp_path, 5, 15.0) is None


def test_the_track_of_another_recording_is_refused(track, tmp_path):
    write_body_track(track, tmp_path)
    for frames, fps in ((6, 15.0), (5, 30.0)):
        with pytest.raises(CaptureError, match="run ico3d capture pose again"):
            read_body_track(tmp_path, frames, fps)


def damaged(track, tmp_path, arrays=(), **about):
    """The track's file with other values in it."""
    file = write_body_track(track, tmp_path)
    with safe_open(file, "numpy") as content:
        kept = {name: content.get_tensor(name) for name in content.keys()}  # noqa: SIM118
        known = json.loads(content.metadata()["body_track"])
    save_file(kept | dict(arrays), file, {"body_track": json.dumps(known | about)})


@pytest.mark.parametrize(
    ("name", "value", "why"),
    [
        ("rotations", np.ones((5, 2, 4), np.float32), "length 1"),
        ("rotations", np.full((5, 2, 4), np.nan, np.float32), "NaN"),
        ("rotations", np.zeros((5, 3, 4), np.float32), r"\(5, 2, 4\)"),
        ("roots", np.full((5, 3), 1e6, np.float32), "farther than"),
        ("faces", np.array([[0, 1, 4]], np.int32), "vertex that is not there"),
        ("rotations", np.zeros((5, 2, 4), np.uint8), "must be float32"),
        ("roots", np.zeros((5, 3), np.float16), "must be float32"),
        ("vertex_joints", np.full((4, 4), 2, np.uint8), "joint that is not there"),
        ("vertex_joints", np.full((4, 4), -(2**30)), "must be uint8"),
        ("faces", np.full((1, 3), 0.5), "must be int32"),
        ("vertex_weights", np.full((4, 4), 0.5, np.float32), "sum to 1"),
        ("joints", np.full((2, 3), 50.0), "more than 10 m"),
    ],
)
def test_impossible_values_are_refused(track, tmp_path, name, value, why):
    damaged(track, tmp_path, {name: value})
    with pytest.raises(CaptureError, match=why):
        read_body_track(tmp_path, 5, 15.0)


@pytest.mark.parametrize(
    "about",
    [
        {"parents": [0, 0]},
        {"parents": [math.inf, 0]},
        {"names": ["a", "a"]},
        {"names": 5},
        {"version": 2},
        {"fps": "fast"},
        {"fps": []},
        {"fps": 10**400},
    ],
    ids=lambda about: f"{about}"[:20],
)
def test_wrong_rigs_are_refused(track, tmp_path, about):
    damaged(track, tmp_path, **about)
    with pytest.raises(CaptureError, match="is damaged"):
        read_body_track(tmp_path, 5, 15.0)


def test_a_description_that_is_none_is_refused(track, tmp_path):
    file = write_body_track(track, tmp_path)
    for about in ("[]", "5", "[" * 100_000, '{"version": 1, "names": ["a"], "parents": [1e400]}'):
        save_file(load_file(file), file, {"body_track": about})
        with pytest.raises(CaptureError, match="is damaged"):
            read_body_track(tmp_path, 5, 15.0)


def test_what_is_no_such_file_is_refused(tmp_path):
    for content in (b"", b"\x08\0\0\0\0\0\0\0{}      ", b"no track at all, for sure"):
        (tmp_path / NAME).write_bytes(content)
        with pytest.raises(CaptureError, match="is damaged"):
            read_body_track(tmp_path, 5, 15.0)


def test_a_surface_of_millions_is_not_moved(track, tmp_path, monkeypatch):
    write_body_track(track, tmp_path)
    monkeypatch.setattr(body_track, "MOST_VERTICES", len(track.vertices) - 1)
    with pytest.raises(CaptureError, match="more than 3 vertices"):
        read_body_track(tmp_path, 5, 15.0)


def test_a_file_that_claims_much_is_not_read(tmp_path):
    write_claim(tmp_path / NAME, "rotations", 1 << 29)
    with pytest.raises(CaptureError, match="it has more than 256 MiB"):
        read_body_track(tmp_path, 5, 15.0)


def test_nothing_is_lost_where_nothing_can_be_written(track, tmp_path):
    (tmp_path / "file").write_text("no folder")
    with pytest.raises(CaptureError, match="cannot be written"):
        write_body_track(track, tmp_path / "file" / "recording.smc")


@pytest.mark.parametrize("kind", ["F8_E4M3", "BF16"])
def test_numbers_that_numpy_has_not_are_refused(track, tmp_path, kind):
    file = write_body_track(track, tmp_path)
    size = int.from_bytes(file.read_bytes()[:8], "little")
    about = json.loads(file.read_bytes()[8 : 8 + size])["__metadata__"]
    joints = {"dtype": kind, "shape": [2, 3], "data_offsets": [0, 6 if kind[0] == "F" else 12]}
    head = json.dumps({"__metadata__": about, "joints": joints}).encode()
    file.write_bytes(len(head).to_bytes(8, "little") + head + bytes(joints["data_offsets"][1]))
    with pytest.raises(CaptureError, match="is damaged"):
        read_body_track(tmp_path, 5, 15.0)


def test_a_track_that_says_megabytes_of_itself_is_not_opened(track, tmp_path, monkeypatch):
    """A head of 16 MB took 634 MB."""
    damaged(track, tmp_path, source="," * (1 << 20))
    monkeypatch.setattr(body_track, "safe_open", lambda *_: pytest.fail("opened"))
    with pytest.raises(CaptureError, match="head is larger"):
        read_body_track(tmp_path, 5, 15.0)
