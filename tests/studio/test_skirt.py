"""Cloth that swings: what holds it, what it hangs on, and that it lags behind."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ico3d.capture.formats import open_capture
from ico3d.errors import SettingsError
from ico3d.studio.acting.performance import Performance
from ico3d.studio.choice import load_subject
from ico3d.studio.dress import fabric
from ico3d.studio.dress.fabric import THICKNESS, Cloth, Course, hung
from ico3d.studio.dress.limbs import limbs_of, trunk_section, waist_height
from ico3d.studio.dress.skirt import COLUMNS, cut_skirt
from ico3d.studio.dress.wearing import dressed, tucked_in
from ico3d.studio.person.skeleton import about
from ico3d.studio.person.subject import Material
from ico3d.studio.picture import paint
from ico3d.studio.recording import Recording, record
from support.recordings import synthetic_bodies

pytestmark = pytest.mark.slow

FPS = 15.0
TURN = np.radians(40.0)
BEGIN, END = 5, 10
"""Frames between which the hips turn."""


@pytest.fixture(scope="module")
def person(tmp_path_factory):
    return synthetic_bodies.write_body(tmp_path_factory.mktemp("people") / "tubes.npz")


@pytest.fixture(scope="module")
def subject(person):
    return load_subject(str(person), whole=True)


@pytest.fixture(scope="module")
def angles():
    """(F,) radians that the person has turned: all at once, a third of a second long."""
    part = np.clip((np.arange(26) - BEGIN) / (END - BEGIN), 0, 1)
    return TURN * part**3 * (10 - 15 * part + 6 * part**2)


@pytest.fixture(scope="module")
def turning(subject, angles):
    """The person turns on the spot, in a skirt."""
    bones = subject.skeleton
    rotations = np.tile(np.eye(3), (len(angles), len(bones.names), 1, 1))
    rotations[:, 0] = about(np.array([0.0, 1.0, 0.0]), angles)
    joints = bones.matrices(rotations, np.zeros((len(angles), 3)))
    joints[..., :3, 3] += subject.head_in_world
    weights = np.zeros((len(angles), len(subject.blendshape_names)), np.float32)
    heads = joints[:, bones.index("head")]
    acted = Performance(np.zeros(1), "", (), weights, np.zeros((1, 7)), heads, joints)
    return dressed(subject, acted, "skirt", FPS)


@pytest.fixture(scope="module")
def tucked(subject):
    return tucked_in(subject)


def _strand(points, pinned=1):
    """A thread of points that weigh 10 g each."""
    pairs = np.stack([np.arange(len(points) - 1), np.arange(1, len(points))], 1).astype(np.int32)
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return Cloth(points, np.full(len(points), 0.01), pinned, pairs, lengths, np.zeros(len(pairs)))


def test_a_thread_comes_to_hang_straight_down():
    points = np.linspace((0, 2.0, 0), (0.3, 2.0, 0.1), 8)
    nothing = np.full((1, 1, 2, 3), 50.0)
    pins = points[None, :1]
    course = Course((pins[0], nothing[0]), pins, nothing, np.full((1, 2), 0.1), FPS)
    (still,) = hung(_strand(points), course)
    length = np.linalg.norm(points[-1] - points[0])
    np.testing.assert_allclose(still[-1], points[0] - (0, length, 0), atol=0.01)  # it swung
    assert np.linalg.norm(still[-1] - still[0]) == pytest.approx(length, rel=0.001)
    np.testing.assert_array_equal(still[0], points[0])


@settings(max_examples=30)
@given(st.integers(0, 2**31))
def test_springs_and_viscosity_keep_the_momentum(seed):
    random = np.random.default_rng(seed)
    masses = random.uniform(0.5, 2, 6)
    pairs = np.array([(i, j) for i in range(6) for j in range(i)], np.int32)
    velocity = random.normal(size=(6, 3))
    before, spread = masses @ velocity, np.ptp(velocity, axis=0)
    fabric._calm(velocity, pairs, masses, 0.1)
    np.testing.assert_allclose(masses @ velocity, before, atol=1e-12)
    assert (np.ptp(velocity, axis=0) < spread).all()
    points = random.normal(size=(6, 3))
    middle = masses @ points
    fabric.hold(points, pairs, np.ones(len(pairs)), np.full(len(pairs), 0.3), 1 / masses, 0.01)
    np.testing.assert_allclose(masses @ points, middle, atol=1e-12)


@settings(max_examples=60)
@given(st.integers(0, 2**31))
def test_a_limb_pushes_points_to_its_surface(seed):
    random = np.random.default_rng(seed)
    ends, radii = random.normal(size=(2, 3)), random.uniform(0.2, 0.5, 2)
    points = np.concatenate([[(9.0, 9.0, 9.0)], random.normal(size=(20, 3))])
    before = points.copy()
    fabric._push(points, points.copy(), 1, ends, ends, radii)
    gap = _gaps(before[1:], ends, radii) - THICKNESS
    outside = gap >= 0
    np.testing.assert_array_equal(points[1:][outside], before[1:][outside])
    moved = np.linalg.norm(points[1:] - before[1:], axis=1)[~outside]
    # Friction takes back a part of what a slide along the limb was; nothing slid here.
    np.testing.assert_allclose(moved, -gap[~outside], rtol=0.05)


def _gaps(points, ends, radii):
    """(…,) metres between points (…, 3) and a limb."""
    along = ends[1] - ends[0]
    long = max(along @ along, 1e-12)  # a limb may be a ball
    part = np.clip((points - ends[0]) @ along / long, 0, 1)
    axis = ends[0] + part[..., None] * along
    return np.linalg.norm(points - axis, axis=-1) - (radii[0] + part * (radii[1] - radii[0]))


def test_limbs_lie_in_the_body_as_it_is(subject):
    height = waist_height(subject)
    section = trunk_section(subject, height)  # of a tube of 0.14 m whose sides bulge
    assert section.radius == pytest.approx(0.14, abs=0.02)
    assert section.half_length + section.radius == pytest.approx(0.14, abs=0.02)
    limbs = limbs_of(subject)
    for name, radius in (("upperleg01.L", 0.08), ("lowerleg01.R", 0.06)):
        own = limbs.joints == subject.skeleton.index(name)
        assert limbs.radii[own] == pytest.approx(radius, abs=0.02)


def test_the_skirt_is_closed_and_looks_outwards(subject):
    skirt = cut_skirt(subject)
    points, faces = skirt.cloth.points, skirt.faces
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, often = np.unique(edges, axis=0, return_counts=True)
    assert (often == 1).sum() == 2 * COLUMNS and often.max() == 2  # waist and hem
    a, b, c = points[faces].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    outward = (a + b + c) / 3 - points.mean(axis=0)
    assert ((normals * outward)[:, [0, 2]].sum(axis=1) > 0).all()


def test_threads_keep_their_length(turning, tucked):
    cloth, points = cut_skirt(tucked).cloth, turning[1].cloth.astype(float)
    threads = cloth.pairs[cloth.compliance == 0]
    lengths = cloth.lengths[cloth.compliance == 0]
    now = np.linalg.norm(points[:, threads[:, 0]] - points[:, threads[:, 1]], axis=-1)
    np.testing.assert_allclose(now, np.broadcast_to(lengths, now.shape), rtol=0.03)


def test_no_limb_comes_through(turning, tucked):
    limbs, (_, acted) = limbs_of(tucked), turning
    ends = limbs.posed(acted.joints)
    for frame, points in enumerate(acted.cloth.astype(float)):
        for limb, radii in enumerate(limbs.radii):
            assert _gaps(points[COLUMNS:], ends[frame, limb], radii).min() > -0.002


def test_the_waistband_goes_with_the_hips_and_the_hem_lags(turning, subject, angles):
    _, acted = turning
    axis = acted.joints[:, 0] @ np.append(subject.skeleton.at[0], 1.0)  # (F, 4)
    band, hem = (
        _turned(acted.cloth[:, rows] - axis[:, None, :3])
        for rows in (slice(COLUMNS), slice(-COLUMNS, None))
    )
    np.testing.assert_allclose(band, angles, atol=1e-5)
    assert np.abs(hem[:BEGIN]).max() < np.radians(0.5)  # it hung still
    first, second = (np.interp(TURN / 2, a[: END + 3], np.arange(END + 3)) for a in (band, hem))
    lag = (second - first) / FPS
    assert 0.04 < lag < 0.25
    assert hem.max() > TURN + np.radians(4.0)  # it swings past
    assert abs(hem[-1] - TURN) < np.radians(4.0)  # and back


def _turned(points):
    """(F,) mean radians that points (F, P, 3) have turned about Y since the first frame."""
    angle = np.arctan2(points[..., 0], points[..., 2])
    return np.angle(np.exp(1j * (angle - angle[:1]))).mean(axis=1)


def test_a_shirt_is_tucked_in(turning, subject):
    wearer, least = turning[0], waist_height(subject) - 0.02
    shirt = wearer.faces[wearer.materials == Material.CLOTH]
    assert (wearer.vertices[shirt][..., 1].max(axis=1) > least).all()
    bare, worn = (np.bincount(p.materials, minlength=len(Material)) for p in (subject, wearer))
    others = [m for m in Material if m not in (Material.CLOTH, Material.SKIRT)]
    np.testing.assert_array_equal(bare[others], worn[others])


def test_who_stands_still_has_a_skirt_that_does_not_tremble(turning):
    cloth = turning[1].cloth[:BEGIN].astype(float)
    assert np.linalg.norm(np.diff(cloth, 2, axis=0), axis=-1).max() < 0.002


def _settings(person, **changes) -> Recording:
    values = dict(rig="body", cameras=2, frames=3, fps=15.0, views_per_frame=2, size=64, text="")
    values |= dict(seed=1, lively=True, light="studio", motion="sway", garment="skirt")
    return Recording(str(person), **(values | changes))


def test_a_skirt_is_recorded_alike_each_time(person, tmp_path, monkeypatch):
    monkeypatch.setattr(paint, "DIRECTIONS", 4)
    monkeypatch.setattr(fabric, "SETTLING", 0.2)  # shown sooner, hanging less still
    for name in ("one", "again"):
        record(_settings(person), tmp_path / name, workers=2)
    record(_settings(person, garment="none"), tmp_path / "bare", workers=2)
    for file in (tmp_path / "one").rglob("*"):
        if file.is_file():
            again = tmp_path / "again" / file.relative_to(tmp_path / "one")
            assert again.read_bytes() == file.read_bytes(), file.name
    about = json.loads((tmp_path / "one" / "capture.json").read_text())
    assert about["settings"]["garment"] == "skirt"
    skirt, bare = open_capture(tmp_path / "one"), open_capture(tmp_path / "bare")
    assert skirt.mask(0, 2).sum() > 1.15 * bare.mask(0, 2).sum()
    pixels, _ = skirt.cameras[0].project(skirt.world_points(2))
    x, y = np.floor(pixels).astype(int).T
    inside = np.pad(skirt.mask(0, 2), 1)
    around = np.max([inside[y + i, x + j] for i in range(3) for j in range(3)], axis=0)
    assert (around > 0).all()  # points lie on the skirt where it is seen


def test_a_head_wears_no_skirt(person, tmp_path):
    with pytest.raises(SettingsError, match="--rig body"):
        record(_settings(person, rig="head"), tmp_path / "x", workers=1)
    with pytest.raises(SettingsError, match="garment"):
        record(_settings(person, garment="cape"), tmp_path / "y", workers=1)


def test_a_bust_has_no_waist(subject):
    with pytest.raises(SettingsError, match="whole person"):
        cut_skirt(replace(subject, skeleton=None))
