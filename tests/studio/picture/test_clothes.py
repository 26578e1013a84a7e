"""Plain clothes: where they end, where they fold, how relief tilts a surface."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from ico3d.studio.dress.tailoring import FOLD, HEM_RIB, RIB, _even, tailored
from ico3d.studio.person.edges import open_loops, without_covered_neck
from ico3d.studio.person.skeleton import about
from ico3d.studio.person.subject import Material
from ico3d.studio.picture.clothes.clothed import STEEPEST, tilted
from ico3d.studio.picture.clothes.knitwear import jumper
from ico3d.studio.picture.clothes.relief import RAISED, ROW, WALE, Weave, folds, knit_height, stitch
from support.recordings.sleeves import sleeved

RINGS, SIDES, RADIUS = 30, 16, 0.05


@pytest.fixture(scope="module")
def sleeve(tmp_path_factory):
    """Somebody who wears nothing but an open sleeve from the left shoulder to the wrist."""
    return sleeved(tmp_path_factory.mktemp("people"), RINGS, SIDES, RADIUS)


def test_relief_tilts_a_surface_as_its_height_rises():
    n, one, two = (0.0, 0.0, 1.0), (0.5, 0.1, 0.0), (-0.1, 0.4, 0.0)
    slope = np.array([0.3, -0.2])
    rises = [slope @ np.array(edge[:2]) for edge in (one, two)]
    expected = np.array([-slope[0], -slope[1], 1.0])
    found = tilted(n, one, two, *rises)
    np.testing.assert_allclose(found, expected / np.linalg.norm(expected), atol=1e-12)
    np.testing.assert_allclose(tilted(n, two, one, *rises[::-1]), found, atol=1e-12)


def test_relief_is_never_steeper_than_cloth_can_be():
    n = tilted((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), 50.0, 0.0)
    assert -n[0] / n[2] == pytest.approx(STEEPEST)


def test_clothes_end_in_loops_and_ribs_are_counted_around_them(sleeve):
    fields, ends = tailored(sleeve).fields, (slice(0, SIDES), slice(-SIDES, None))
    assert len(open_loops(sleeve, Material.CLOTH)) == 2
    for end in ends:
        np.testing.assert_allclose(fields[end, 3], 0, atol=1e-6)
        assert (fields[end, 6] == round(2 * np.pi * RADIUS / RIB)).all()
        turn = np.unwrap(np.arctan2(*fields[end, 5:3:-1].T))
        np.testing.assert_allclose(np.abs(np.diff(turn)), 2 * np.pi / SIDES, rtol=0.2)
    middle = fields[(RINGS // 2) * SIDES]
    assert middle[3] * HEM_RIB > 0.15


def test_a_bent_elbow_pushes_cloth_into_folds_there(sleeve):
    bones, cut = sleeve.skeleton, tailored(sleeve)
    rest = cut.folds(sleeve.vertices)
    np.testing.assert_allclose(rest, cut.loose, atol=1e-5)
    rotations = np.tile(np.eye(3), (1, len(bones.names), 1, 1))
    elbow = bones.index("lowerarm01.L")
    rotations[:, elbow] = about(np.array([0.0, 1.0, 0.0]), np.array(-1.8))
    bent = bones.skinned(sleeve.vertices, bones.matrices(rotations, np.zeros((1, 3)))[0])
    deeper = cut.folds(bent) - rest
    assert deeper.max() > 1e-3
    assert np.linalg.norm(sleeve.vertices[deeper.argmax()] - bones.at[elbow]) < 0.09
    np.testing.assert_allclose(deeper[: 8 * SIDES], 0, atol=1e-5)


def test_folds_are_as_deep_as_asked_and_none_where_none_are():
    flat = Weave(0.0, 0.0, 0.0, 0.0, 0.0, 9.0, 1.0, 0.0, 0.0, 9.0, 0.0)
    assert folds(flat) == 0.0
    spots = np.random.default_rng(0).uniform(-4, 4, (300, 3)).tolist()
    heights = np.array([folds(flat._replace(x=x, y=y, z=z, fold=0.004)) for x, y, z in spots])
    assert (heights >= 0).all() and 0.003 < heights.max() < 0.0065 and np.ptp(heights) > 0.002


def test_knitwear_repeats():
    for u, v in np.random.default_rng(1).uniform(-0.02, 0.02, (20, 2)):
        assert stitch(u + WALE, v, 1e-4) == pytest.approx(stitch(u, v, 1e-4), abs=1e-9)
        assert stitch(u, v + ROW, 1e-4) == pytest.approx(stitch(u, v, 1e-4), abs=1e-5)
    assert stitch(0.0, 0.0, 1e-4) == pytest.approx(0, abs=1e-9)  # the valley between two columns


@pytest.mark.parametrize("pixel", [0.0004, 0.001, 0.003])
def test_a_plain_jumper_has_one_colour_and_is_as_bright_from_near_as_from_far(pixel):
    wool = SimpleNamespace(jumper=(0.05, 0.13, 0.15))
    middle = Weave(0.0, 0.0, 0.0, 0.0, 0.0, 9.0, 1.0, 0.0, 0.0, 9.0, 0.0)
    colours, heights = [], []
    for u, v, z in np.random.default_rng(2).uniform(-0.12, 0.12, (4000, 3)).tolist():
        w = middle._replace(u=u, v=v)
        heights.append(knit_height(w, pixel))
        colours.append(jumper(wool, w, heights[-1], u, v, z, pixel)[:3])
    tones = np.array(colours) / wool.jumper
    np.testing.assert_allclose(tones, tones[:, :1] * np.ones(3), rtol=1e-9)
    assert tones.mean() == pytest.approx(1, abs=0.015)
    assert min(heights) >= 0 and max(heights) <= RAISED
    fine = pixel == 0.003  # as wide as a column of stitches
    assert (np.ptp(tones) < 0.08) == fine and (np.ptp(heights) < 0.0001) == fine


def test_a_jumper_that_hangs_in_folds_has_none_painted(sleeve):
    assert tailored(sleeve).loose.max() > 0.002
    assert tailored(replace(sleeve, draped=True)).loose.max() == 0


def test_folds_fade_where_their_pattern_is_squeezed():
    places = np.zeros((30, 3))
    at = 0.01 * np.arange(30)
    places[:, 1] = (at + 0.08 * (at > 0.145)) / FOLD
    edges = np.stack([np.arange(29), np.arange(1, 30)], 1)
    even = _even(places, edges, np.diff(at))
    assert (even[14:16] == 0).all() and (even[:10] == 1).all() and (even[20:] == 1).all()


def test_skin_far_below_a_collar_is_left_out(sleeve):
    edge = sleeve.vertices[:SIDES].mean(axis=0)
    patch = np.array([[0, 0, 0], [0.01, 0, 0], [0, 0.01, 0]], np.float32)
    patches = [patch + (edge - [0, drop, 0]).astype(np.float32) for drop in (0.09, -0.05, 0.4)]
    count, new = len(sleeve.vertices), np.arange(9, dtype=np.int32).reshape(3, 3)
    more = replace(
        sleeve,
        vertices=np.concatenate([sleeve.vertices, *patches]),
        faces=np.concatenate([sleeve.faces, count + new]),
        materials=np.append(sleeve.materials, np.full(3, Material.SKIN, np.uint8)),
        corner_uv=np.concatenate([sleeve.corner_uv, np.zeros((3, 3, 2), np.float32)]),
    )
    kept = without_covered_neck(more).faces
    np.testing.assert_array_equal(kept, np.concatenate([sleeve.faces, count + new[1:]]))
