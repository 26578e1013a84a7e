"""What synthetic people may have: glasses, a beard, loose hair, dark skin, a child's head."""

from functools import cache

import numpy as np
import pytest

from ico3d.errors import SettingsError
from ico3d.studio import choice
from ico3d.studio.choice import load_subject
from ico3d.studio.person.subject import Material
from ico3d.studio.picture.lamps import STUDIOS
from ico3d.studio.recording import Recording, record
from ico3d.studio.rigs import cameras_of
from ico3d.studio.studio import Studio
from support.needs import needs
from support.recordings import synthetic_people

pytestmark = [pytest.mark.slow, needs("anny")]


@pytest.fixture(scope="module", autouse=True)
def read_once():
    """Who is given traits is read from files once: nobody changes her."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(choice, "load_anny", cache(choice.load_anny))
        yield


@pytest.fixture(scope="module")
def plain(read_once):
    return load_subject("anny")


def _marks(person):
    return person.landmarks(person.vertices).astype(float)


def _on(person, material):
    return person.vertices[np.unique(person.faces[person.materials == material])]


def _hair(person):
    """Points of all hair, (M, 3)."""
    strands = person.strands
    counts = np.diff(strands.first)
    return strands.on(person.vertices)[np.repeat(strands.material == Material.HAIR, counts)]


def test_glasses_sit_before_the_eyes_and_do_not_move(plain):
    person = load_subject("anny", traits=("glasses",))
    lenses, frame = _on(person, Material.LENS), _on(person, Material.FRAME)
    for eye in person.eyes:
        near = np.abs(lenses[:, 0] - eye.centre[0]) < 0.012
        front = eye.centre[2] + 0.0125  # the cornea
        assert 0.004 < lenses[near, 2].min() - front < 0.022
    assert 0.05 < np.abs(frame[:, 0]).max() < 0.09  # the temples, beside the head
    assert frame[:, 2].min() < 0.0  # as far back as the ears
    moved = person.posed(person.weights({"jawOpen": 1.0, "noseSneerLeft": 1.0}))
    glass = np.unique(person.faces[np.isin(person.materials, (Material.LENS, Material.FRAME))])
    assert (moved[glass] == person.vertices[glass]).all()
    assert len(person.vertices) > len(plain.vertices)


def test_lenses_show_what_is_behind_them():
    person = load_subject("anny", traits=("glasses",))
    camera = cameras_of(person, "head", 1, 64)[0]
    pose = np.eye(4)
    pose[:3, 3] = person.head_in_world
    studio = Studio(person, STUDIOS["studio"])
    with_lenses = studio.picture(camera, studio.figure(person.vertices, pose))[0]
    studio._lenses = studio._lenses[:0]
    without = studio.picture(camera, studio.figure(person.vertices, pose))[0]
    changed = np.abs(with_lenses - without).max(-1)
    assert 0.01 < (changed > 0).mean() < 0.10  # the lenses, and nothing else
    assert np.median(changed[changed > 0]) < 0.06  # one looks through them


def test_a_beard_covers_the_chin_and_moves_with_the_jaw(plain):
    person = load_subject("anny", traits=("beard",))
    marks = _marks(plain)
    grown = person.strands.first[-1] - plain.strands.first[-1]
    assert grown > 50_000
    beard = person.strands.on(person.vertices)[-grown:]
    nose = (beard[:, 1] > marks[33, 1]) & (np.abs(beard[:, 0]) < 0.01)
    assert not nose.any()
    assert beard[:, 1].min() < marks[8, 1] - 0.005  # it hangs below the chin
    opened = person.strands.on(person.posed(person.weights({"jawOpen": 1.0})))[-grown:]
    assert (beard - opened)[:, 1].max() > 0.01


def test_loose_hair_falls_to_the_shoulders_and_not_into_the_face(plain):
    person = load_subject("anny", traits=("long-hair",))
    hair, marks = _hair(person), _marks(plain)
    assert np.quantile(hair[:, 1], 0.02) < -0.2
    aside = np.abs(hair[:, 0]) < 0.7 * marks[16, 0]
    face = aside & (hair[:, 1] < 0.0) & (hair[:, 1] > marks[8, 1]) & (hair[:, 2] > 0.06)
    assert face.mean() < 0.001
    throat = (np.abs(hair[:, 0]) < 0.035) & (hair[:, 2] > 0.0) & (hair[:, 1] < marks[8, 1])
    assert throat.mean() < 0.001


def test_dark_skin_is_dark(plain):
    person = load_subject("anny", traits=("dark-skin",))
    assert np.mean(person.look.skin) < 0.3 * np.mean(plain.look.skin)
    assert (person.vertices == plain.vertices).all()


def test_a_child_has_a_smaller_head_and_larger_eyes_in_it(plain):
    child = load_subject("anny", traits=("child",))
    heights = [_marks(p)[27, 1] - _marks(p)[8, 1] for p in (plain, child)]
    assert heights[1] < 0.92 * heights[0]
    assert child.head_in_world[1] < 1.3 < plain.head_in_world[1]
    apart = [_marks(p)[45, 0] - _marks(p)[36, 0] for p in (plain, child)]
    assert apart[1] / heights[1] > 1.05 * apart[0] / heights[0]


def test_traits_go_together(plain):
    both = load_subject("anny", traits=("glasses", "beard", "dark-skin"))
    assert (both.materials == Material.FRAME).any()
    assert both.strands.first[-1] > plain.strands.first[-1]
    assert np.mean(both.look.skin) < 0.1


def test_what_cannot_be_is_refused(tmp_path):
    file = synthetic_people.write_person(tmp_path / "block.npz")
    with pytest.raises(SettingsError, match="only the subject 'anny'"):
        load_subject(str(file), traits=("child",))
    settings = dict(rig="head", cameras=1, frames=2, fps=25.0, views_per_frame=1, size=40, text="")
    settings |= dict(seed=0, lively=False, light="studio", motion="talk")
    for changes, words in (({"traits": ("hat",)}, "no trait"), ({"rig": "body"}, "of heads")):
        some = {"traits": ("beard",)} | settings | changes
        with pytest.raises(SettingsError, match=words):
            record(Recording("anny", **some), tmp_path / "x", workers=1)
