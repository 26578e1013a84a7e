"""The packaged body in other builds."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from ico3d.avatar.embodying.builds.change import DATA, NEAREST, change_to
from ico3d.avatar.embodying.builds.reshape import STRETCH, gestures_in, reshaped
from ico3d.avatar.embodying.surfaces import main_joints
from ico3d.bundle.skinned.baked import BakedSkinned
from ico3d.bundle.skinned.gestures import GESTURES, gesture_files, gestures_from
from ico3d.bundle.skinned.lamp import POINT_UNIT
from ico3d.bundle.skinned.posing import posed, recorded_pose
from ico3d.bundle.tensors import QUAT_UNIT
from ico3d.errors import BundleError
from ico3d.motion.gestures.library import library
from ico3d.motion.roles import INDEX
from ico3d.rig.quaternions import normalized, to_matrix
from ico3d.rig.rig import Rig

pytestmark = pytest.mark.slow

OTHERS = ("slender", "sturdy")


@pytest.fixture(scope="module")
def builds(body):
    return {"medium": body} | {build: reshaped(body, build) for build in OTHERS}


def _hangs_on(body: BakedSkinned, *starts: str) -> np.ndarray:
    return np.array([name.startswith(starts) for name in body.rig.names])[main_joints(body)]


def _covariances(body: BakedSkinned) -> np.ndarray:
    axes = (
        to_matrix(normalized(body.quats / QUAT_UNIT))
        * np.exp(body.log_scales.astype(np.float64))[:, None]
    )
    return axes @ axes.transpose(0, 2, 1)


def test_the_recorded_build_is_the_same_body(body):
    assert reshaped(body, "medium") is body


@pytest.mark.parametrize("build", OTHERS)
def test_head_fingers_soles_and_skeleton_stay_bit_for_bit(body, builds, build):
    other = builds[build]
    head = body.means[:, 1] > body.rig.joints[body.rig.names.index("head"), 1] + 0.03
    wrists = body.rig.joints[[body.rig.names.index(f"wrist.{side}") for side in "LR"]]
    hand = np.linalg.norm(body.means[:, None] - wrists, axis=2).min(1) > 0.09
    kept = _hangs_on(body, "finger") & hand
    kept |= _hangs_on(body, "head") & head  # but for hair on the back
    kept |= _hangs_on(body, "foot") & (body.means[:, 1] < body.rig.joints[:, 1].min() - 0.03)
    assert kept.sum() > 1000
    for name, tensor in body.tensors.items():
        if tensor.shape[:1] == body.means.shape[:1]:
            same = (other.tensors[name] == tensor).reshape(len(kept), -1).all(1)
            assert same[kept].all(), (name, body.means[kept & ~same][:5])
        elif name != "caster_points":
            assert np.array_equal(other.tensors[name], tensor), name
    whole = replace(other.info, num_rest=0)
    assert BakedSkinned.from_bytes(other.to_bytes(), whole).rig.names == body.rig.names


@pytest.mark.parametrize("build", OTHERS)
def test_the_neck_goes_over_into_the_heads_without_a_step(body, build):
    change, names = change_to(build, body.rig), body.rig.names
    low, top = (body.rig.joints[names.index(name)] for name in ("neck01", "neck03"))
    around = 0.055 * np.array([[0, 0, 1], [1, 0, 0], [-1, 0, 0], [0, 0, -1]])  # a neck's radius
    part = np.linspace(-0.5, 1.5, 201)[:, None]
    for side in around:
        moves, _ = change.at(low + part * (top - low) + side)  # 0.9 mm apart
        assert np.abs(moves[part[:, 0] > 1.35]).max() < 1e-5
        assert np.linalg.norm(np.diff(moves, axis=0), axis=1).max() < 6e-4


def test_everything_but_head_hands_and_shoes_grows_with_the_build(body, builds):
    solid = body.opacities > 127
    for part in ("spine", "upperleg", "upperarm"):
        hangs = solid & _hangs_on(body, part)
        sizes = [ConvexHull(builds[b].means[hangs]).volume for b in ("slender", "medium", "sturdy")]
        assert 1.02 * sizes[0] < sizes[1] < sizes[2] / 1.02, part
    widths = [change_to(build, body.rig).width for build in OTHERS]
    assert 0.8 < widths[0] < 0.98 and 1.03 < widths[1] < 1.3


@pytest.mark.parametrize("build", OTHERS)
def test_soles_stay_on_the_floor(body, builds, build):
    for frame in (0, body.info.num_frames // 2):
        pose = recorded_pose(body, frame)
        before, after = (
            posed(b, pose).means[_hangs_on(body, "foot")] for b in (body, builds[build])
        )
        assert abs(before[:, 1].min() - after[:, 1].min()) < 1e-3


def test_gaussians_are_stretched_as_the_surface_about_them_is(body, builds):
    change, some = change_to("sturdy", body.rig), np.arange(0, body.info.num_gaussians, 97)
    moves, slopes = change.at(body.means[some].astype(np.float64))
    before, after = (_covariances(b)[some] for b in (body, builds["sturdy"]))
    lengths = np.linalg.svd(slopes)[1]
    free = (lengths < STRETCH).all(1) & (lengths > 1 / STRETCH).all(1)
    assert free.mean() > 0.9
    expected = slopes @ before @ slopes.transpose(0, 2, 1)
    error = np.abs(after - expected).max((1, 2)) / np.trace(expected, axis1=1, axis2=2)
    assert error[free].max() < 0.01  # sizes are kept in 16 bits
    assert np.abs(builds["sturdy"].means[some] - body.means[some] - moves).max() < 1e-6
    sizes = [np.exp(b.log_scales.astype(np.float64)) for b in (body, builds["sturdy"])]
    assert (sizes[1].max(1) <= 1.01 * STRETCH * sizes[0].max(1)).all()


def test_the_change_knows_its_own_slope(body):
    change, step = change_to("sturdy", body.rig), 1e-6
    places = body.means[::501].astype(np.float64)
    sides = [[change.at(places + s * step * axis)[0] for s in (1, -1)] for axis in np.eye(3)]
    measured = np.stack([(ahead - behind) / (2 * step) for ahead, behind in sides], -1)
    assert np.median(np.abs(change.at(places)[1] - np.eye(3) - measured)) < 1e-6


def test_residual_shapes_and_shadows_go_along(body, builds):
    change, other = change_to("sturdy", body.rig), builds["sturdy"]
    some = np.arange(0, body.info.num_gaussians, 97)
    _, slopes = change.at(body.means[some].astype(np.float64))
    units = [b.shape_scales[some, :1].astype(np.float64)[:, None] for b in (body, other)]
    before, after = (
        b.shapes[some][..., :3] * unit for b, unit in zip((body, other), units, strict=True)
    )
    lengths = np.linalg.svd(slopes)[1]
    free = (lengths < STRETCH).all(1) & (lengths > 1 / STRETCH).all(1)
    off = np.abs(np.einsum("nab,nkb->nka", slopes, before) - after)[free]
    assert (off <= 0.51 * units[1][free] + 1e-3 * np.abs(after[free])).all()
    assert np.array_equal(body.shapes[..., 3:], other.shapes[..., 3:])
    assert body.lamp is not None and other.lamp is not None
    points = body.lamp.caster_points * POINT_UNIT
    moved = other.lamp.caster_points * POINT_UNIT - points
    assert np.abs(moved - change.at(points)[0]).max() < 0.51 * POINT_UNIT
    assert np.abs(moved).max() > 0.01


def test_arms_hang_beside_the_trunk_of_the_build(body, builds, monkeypatch):
    nod = partial(library, names=("nod",))  # hanging arms are those of all gestures
    monkeypatch.setattr("ico3d.bundle.skinned.gestures.library", nod)
    assert body.info.num_frames  # the same motion in all
    lifted = []
    for build in ("slender", "medium", "sturdy"):
        beside = build == "medium"
        files = gesture_files(body, (), 1.0) if beside else gestures_in(builds[build], build, ())
        file = files[GESTURES]
        hung = gestures_from(file, builds[build]).hung
        lifted.append(2 * np.degrees(np.arcsin(hung[INDEX["left_shoulder"], 3])))
    assert lifted[0] <= lifted[1] < lifted[2]


def test_a_larger_person_changes_in_proportion(body):
    rig = body.rig
    small = change_to("sturdy", rig)
    large = change_to("sturdy", Rig(rig.names, rig.parents, 1.2 * rig.joints))
    assert np.abs(large.points - 1.2 * small.points).max() < 1e-9
    assert np.abs(large.moves - 1.2 * small.moves).max() < 1e-9
    assert large.width == pytest.approx(small.width)


def test_both_sides_change_alike(body):
    change = change_to("slender", body.rig)
    half = len(change.points) // 2
    assert np.array_equal(change.moves[:half] * [-1, 1, 1], change.moves[half:])


def test_the_order_and_number_of_gaussians_do_not_matter(body, builds):
    some = np.random.default_rng(0).permutation(body.info.num_gaussians)[:200]
    alone = reshaped(body.chosen(some), "sturdy")
    for name in ("means", "quats", "log_scales", "shapes", "normals"):
        assert np.array_equal(alone.tensors[name], builds["sturdy"].tensors[name][some])
    assert reshaped(body.chosen(some[:1]), "sturdy").to_bytes()


def test_another_skeleton_is_refused(body):
    names = tuple(name.replace("upperleg", "thigh") for name in body.rig.names)
    strange = replace(body, info=replace(body.info, names=names))
    with pytest.raises(BundleError) as refused:
        reshaped(strange, "slender")
    assert str(refused.value) == (
        "the body's skeleton has no joint 'upperleg01.L': only bodies on MakeHuman's skeleton "
        "(ico3d capture pose) come in other builds than their own."
    )


@pytest.mark.parametrize(("normals", "edge"), [(0, 32767), (-128, -32768)])
def test_extreme_values_stay_within_the_file(body, normals, edge):
    some = body.chosen(np.arange(0, body.info.num_gaussians, 1999))
    count = some.info.num_gaussians
    hostile = replace(
        some,
        normals=np.full((count, 3), normals, np.int8),
        shapes=np.full_like(some.shapes, -128),
        log_scales=np.full((count, 3), -60_000, np.float16),
        means=some.means * 1e3,
        lamp=replace(some.lamp, caster_points=np.full_like(some.lamp.caster_points, edge)),
    )
    for build in OTHERS:
        with np.errstate(divide="raise", invalid="raise"):
            found = reshaped(hostile, build)
        assert found.to_bytes() and found.lamp is not None
        assert (np.sign(found.lamp.caster_points) == np.sign(edge)).all()


def test_the_data_is_small():
    assert DATA.stat().st_size < 48_000 and NEAREST < 100
