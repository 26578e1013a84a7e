"""Rotation curves and the files of gestures: tolerance, round trips, and what is refused."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from safetensors.numpy import load, save

from ico3d.errors import SettingsError
from ico3d.motion import clip as files
from ico3d.motion.clip import Clip, Marks, clip_of, from_bytes, from_json, to_bytes, to_json
from ico3d.motion.curves import TOLERANCE, Curve, angles, packed, reduced, unpacked
from ico3d.motion.roles import ROLES
from ico3d.rig.quaternions import IDENTITY, continuous, from_rotvec, slerp

TIMES = np.round(np.arange(91) / 60, 3)


def wavy(seed: int, size: float = 1.0) -> np.ndarray:
    """(91, 4) a smooth motion."""
    rng = np.random.default_rng(seed)
    phase, speed = rng.uniform(0, 6, 3), rng.uniform(1, 5, 3)
    return continuous(from_rotvec(size * np.sin(phase + TIMES[:, None] * speed)))


@pytest.fixture(scope="module")
def clips() -> dict[str, Clip]:
    poses = np.tile(IDENTITY, (len(TIMES), len(ROLES), 1))
    for number in range(len(ROLES)):
        poses[:, number] = wavy(number)
    marks = Marks(0.4, 0.6, 0.6, 0.9, 1.5)
    return {
        "wave": clip_of("wave", marks, TIMES, poses, ("head", "left_elbow", "left_wrist")),
        "nod": clip_of("nod", marks, TIMES, poses, ("neck", "head")),
    }


@settings(max_examples=20)
@given(st.integers(0, 10_000), st.floats(0.05, 5.0))
def test_few_keys_and_16_bits_keep_the_tolerance(seed, tolerance):
    motion = wavy(seed)
    curve = reduced(TIMES, motion, tolerance)
    again = unpacked(*packed(curve))
    assert len(curve.times) < len(TIMES)
    assert angles(again.at(TIMES), motion).max() <= tolerance


def test_what_stays_still_has_one_key():
    still = np.tile(wavy(0)[:1], (91, 1))
    curve = reduced(TIMES, still)
    assert len(curve.times) == 1
    np.testing.assert_array_equal(curve.at(np.array([[0.0, 7.0]])), still[:2][None])


def test_it_goes_through_its_keys_and_stays_outside_of_them():
    curve = Curve(
        np.array([0.0, 0.3, 1.0]), from_rotvec(np.array([[0, 0, 0], [0, 1, 0], [1, 1, 0.0]]))
    )
    np.testing.assert_allclose(angles(curve.at(curve.times), curve.rotations), 0, atol=1e-5)
    np.testing.assert_allclose(curve.at(-1.0), curve.rotations[0], atol=1e-12)
    np.testing.assert_allclose(curve.at(2.0), curve.rotations[2], atol=1e-12)


def test_between_two_keys_it_eases_on_the_great_arc():
    ends = from_rotvec(np.array([[0.2, 0, 0], [0, 0.9, 0.3]]))
    curve = Curve(np.array([0.0, 2.0]), ends)
    for part in (0.25, 0.5, 0.9):
        wanted = slerp(ends[0], ends[1], part * part * (3 - 2 * part))
        np.testing.assert_allclose(curve.at(2 * part), wanted, atol=1e-12)


def test_files_come_back(clips):
    found = from_bytes(to_bytes(clips))
    assert list(found) == list(clips)
    for name, clip in clips.items():
        for again in (found[name], from_json(to_json(clip))):
            assert (again.name, again.marks) == (name, clip.marks)
            assert list(again.curves) == list(clip.curves)
            assert angles(again.at(TIMES), clip.at(TIMES)).max() < 0.01
    assert TOLERANCE == 0.5


def test_a_mirrored_clip_moves_the_other_hand(clips):
    other = clips["wave"].mirrored()
    assert list(other.curves) == ["head", "right_elbow", "right_wrist"]
    again = other.mirrored()
    np.testing.assert_allclose(again.at(TIMES), clips["wave"].at(TIMES), atol=1e-12)
    turned = clips["wave"].curves["left_elbow"].rotations
    np.testing.assert_array_equal(other.curves["right_elbow"].rotations, turned * [1, 1, -1, -1])


@pytest.mark.parametrize(
    ("times", "rotations", "why"),
    [
        ([0.0, 0.0], [IDENTITY, IDENTITY], "ascend"),
        ([0.0, -1.0], [IDENTITY, IDENTITY], "ascend"),
        ([0.1, 1.0], [IDENTITY, IDENTITY], "begin at 0"),
        ([0.0, 99.0], [IDENTITY, IDENTITY], "60 s at most"),
        ([0.0], [np.full(4, np.nan)], "NaN"),
        ([0.0, np.nan], [IDENTITY, IDENTITY], "NaN"),
        ([0.0], [np.ones(4)], "length 1"),
        ([0.0], [IDENTITY, IDENTITY], "as many"),
        ([], np.zeros((0, 4)), "one at least"),
    ],
)
def test_impossible_curves_are_refused(times, rotations, why):
    with pytest.raises(ValueError, match=why):
        Curve(np.array(times), np.array(rotations))


@pytest.mark.parametrize(
    "marks",
    [
        *((0.5, 0.4, 0.5, 0.6, 1), (0.1, 0.2, 0.3, np.nan, 1), (-1, 0, 0, 0, 0)),
        *((0, 0, 0, 0.2, 1), (0.1, 0.2, 0.3, 0.4, np.inf), (0.1, 0.2, 0.3, 0.4, 61)),
    ],
)
def test_phases_come_one_after_the_other(marks):
    with pytest.raises(ValueError, match="do not ascend"):
        Marks(*marks)


def changed(clips, key: str, value: np.ndarray, marks: dict | None = None) -> bytes:
    """The file with something else in it."""
    content = to_bytes(clips)
    arrays = dict(load(content)) | {key: value}
    about = {"version": 1, "marks": {n: vars(c.marks) for n, c in clips.items()} | (marks or {})}
    return save(arrays, {"clips": json.dumps(about)})


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("wave/head/rotations", np.zeros((2, 4), np.int16)),
        ("wave/head/times", np.array([0, 5, 3], np.uint16)),
        ("wave/tail/rotations", np.full((1, 4), 16383, np.int16)),
        ("wave/head/rotations", np.zeros((2, 4), np.float32)),
        ("dance/head/rotations", np.full((1, 4), 16383, np.int16)),
    ],
)
def test_damaged_files_are_refused(clips, key, value):
    with pytest.raises(SettingsError, match="gestures is damaged"):
        from_bytes(changed(clips, key, value))


def test_what_is_no_file_of_gestures_is_refused(clips):
    first = packed(clips["wave"].curves["head"])[0]
    late = vars(clips["nod"].marks) | {"ready": 3.0}
    for content in (b"", b"nothing of the kind", to_bytes(clips)[:-3]):
        with pytest.raises(SettingsError, match="damaged"):
            from_bytes(content)
    with pytest.raises(SettingsError, match="do not ascend"):
        from_bytes(changed(clips, "wave/head/times", first, {"nod": late}))
    with pytest.raises(SettingsError, match="damaged"):
        from_bytes(changed(clips, "wave/head/times", first, {"nod": late | {"end": 10**400}}))
    about = json.loads(to_json(clips["nod"]))
    for key, value in (
        ("marks", vars(clips["nod"].marks) | {"end": 10**400}),
        ("version", 2),
        ("curves", {"tail": about["curves"]["head"]}),
        ("marks", {}),
    ):
        with pytest.raises(SettingsError, match="the clip is damaged"):
            from_json(json.dumps(about | {key: value}))


def test_a_file_of_more_gestures_than_anybody_makes_is_refused(clips):
    first, marks = packed(clips["wave"].curves["head"])[0], vars(clips["nod"].marks)
    with pytest.raises(SettingsError, match="holds 5002 gestures: at most 1000"):
        many = {f"bow_{n}": marks for n in range(5000)}
        from_bytes(changed(clips, "wave/head/times", first, many))
    with pytest.raises(SettingsError, match="names of 100 letters"):
        from_bytes(changed(clips, "wave/head/times", first, {"b" * 101: marks}))


@pytest.mark.parametrize(
    ("parser", "content", "why"),
    [
        ("parse_json", (1 << 21).to_bytes(8, "little") + b"[" * (1 << 21), "head is larger"),
        ("bounded_head", bytes(files.MOST_BYTES + 1), "more than 4 MiB"),
    ],
)
def test_nothing_is_made_of_a_file_of_absurd_size(monkeypatch, parser, content, why):
    """A head of 100 MB in a bundle took 3.7 GB when the bundle was opened."""
    monkeypatch.setattr(files, parser, lambda *_: pytest.fail("parsed"))
    with pytest.raises(SettingsError, match=why):
        from_bytes(content)
