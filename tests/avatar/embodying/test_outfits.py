"""The packaged body in other outfits."""

import numpy as np
import pytest

from ico3d.avatar.embodying.garments import GARMENTS, garments_of
from ico3d.avatar.embodying.outfits import OUTFITS, dressed
from ico3d.avatar.embodying.surfaces import Surfaces, main_joints, surfaces_of
from ico3d.bundle.skinned.posing import posed, recorded_pose
from ico3d.errors import BundleError
from ico3d.motion.roles import cast

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def surfaces(body):
    head = body.rig.joints[body.rig.names.index("head")]
    back = (body.means[:, 1] > head[1] + 0.05) & (body.means[:, 2] < head[2] - 0.02)
    return surfaces_of(body, cast(body.rig), back)


@pytest.fixture(scope="module")
def share(body, surfaces):
    return garments_of(body, cast(body.rig), surfaces)


@pytest.fixture(scope="module")
def outfits(body, surfaces):
    return {name: dressed(body, cast(body.rig), surfaces, name) for name in OUTFITS}


def _on(body, *starts):
    return np.array([name.startswith(starts) for name in body.rig.names])[main_joints(body)]


def _shown(body):
    return posed(body, recorded_pose(body, 0)).rgb


def test_the_recorded_outfit_is_the_same_body(body, surfaces):
    assert dressed(body, cast(body.rig), surfaces, "recorded") is body


def test_garments_are_where_they_are_worn(body, share):
    solid, height = body.opacities > 127, body.means[:, 1]
    hips, knees = (
        body.rig.joints[body.rig.names.index(name), 1] for name in ("upperleg01.L", "lowerleg01.L")
    )
    worn = dict(zip(GARMENTS, (share > 0.9).T, strict=True))
    assert worn["jumper"][solid & _on(body, "upperarm", "spine01")].mean() > 0.9
    assert worn["trousers"][solid & _on(body, "lowerleg01")].all()
    assert worn["trousers"][solid & (height > knees) & (height < hips - 0.15)].mean() > 0.99
    assert worn["shoes"][solid & (height < 0.03)].mean() > 0.99
    assert height[worn["shoes"]].max() < 0.2 and height[worn["jumper"]].min() > knees
    assert not worn["jumper"][_on(body, "lowerleg", "foot", "finger", "head")].any()


@pytest.mark.parametrize("name", OUTFITS)
def test_garments_get_the_outfits_colours(outfits, share, body, name):
    shown, solid = _shown(outfits[name]), body.opacities > 127
    for part, color in zip(share.T, OUTFITS[name], strict=True):
        assert np.abs(np.median(shown[(part > 0.9) & solid], axis=0) - color).max() < 0.01


@pytest.mark.parametrize("name", OUTFITS)
def test_stitches_folds_and_light_stay_as_they_were(outfits, share, body, name):
    change = outfits[name].color_logits.astype(float) - body.color_logits
    for part in share.T:
        whole = change[part == 1]
        assert len(whole) > 100 and np.ptp(whole, axis=0).max() < 0.02  # rounded to 16 bits
    for tensor in ("means", "shapes", "light", "opacities", "shape_scales"):
        assert outfits[name].tensors[tensor] is body.tensors[tensor]


@pytest.mark.parametrize("name", OUTFITS)
def test_skin_and_hair_are_untouched(outfits, surfaces, body, name):
    same = (outfits[name].color_logits == body.color_logits).all(1)
    assert same[_on(body, "head", "finger")].all()
    bare = surfaces.skin + surfaces.hair > 0.95
    sure = bare & (body.opacities > 127) & ~_on(body, "spine", "clavicle", "shoulder")
    assert same[sure & _on(body, "neck", "wrist", "metacarpal")].mean() > 0.97


def test_the_order_of_gaussians_does_not_matter(body, surfaces, outfits):
    order = np.random.default_rng(0).permutation(body.info.num_gaussians)
    mixed = Surfaces(surfaces.head[order], surfaces.skin[order], surfaces.hair[order])
    found = dressed(body.chosen(order), cast(body.rig), mixed, "wine")
    away = np.abs(found.color_logits - outfits["wine"].color_logits[order].astype(float)).max(1)
    assert (away < 0.02).mean() > 0.9999


@pytest.mark.parametrize("gone", [(("foot",), "shoes"), (("upperleg", "lowerleg"), "trousers")])
def test_a_body_without_a_garment_is_told(body, surfaces, gone):
    left = np.flatnonzero(~_on(body, *gone[0]))
    bare = Surfaces(surfaces.head[left], surfaces.skin[left], surfaces.hair[left])
    with pytest.raises(BundleError) as refused:
        dressed(body.chosen(left), cast(body.rig), bare, "navy")
    assert str(refused.value) == (
        f"no {gone[1]} are found on the body, so it has no outfit but its own (recorded)."
    )


def test_a_body_of_one_gaussian_wears_nothing(body, surfaces):
    one = Surfaces(surfaces.head[:1], surfaces.skin[:1], surfaces.hair[:1])
    with pytest.raises(BundleError, match="no jumper is found"):
        dressed(body.chosen(np.array([0])), cast(body.rig), one, "navy")
