"""A friendly person smiles all the time, and still speaks, blinks and closes the lips."""

from dataclasses import replace

import numpy as np
import pytest

from ico3d.common.espeak.speech import Phoneme
from ico3d.studio.acting.manner import BEAMING, GLAD, MANNERS, PARTED, mannered
from ico3d.studio.acting.performance import SOUND_RATE, perform
from ico3d.studio.choice import load_subject
from support.needs import needs

pytestmark = needs("anny")


@pytest.fixture(scope="module")
def anny():
    return load_subject("anny")


@pytest.fixture(scope="module")
def acted(anny):
    return perform(anny, "Bob may pop by.", 75, 25.0, 0, False)


def test_a_neutral_person_does_what_was_acted(anny, acted):
    assert mannered(anny, acted, "neutral") is acted


def test_a_friendly_person_smiles_in_every_frame_and_does_the_same_otherwise(anny, acted):
    friendly = mannered(anny, acted, "friendly")
    names = anny.blendshape_names
    for column, name in enumerate(names):
        added = GLAD.get(name, 0.0)
        wanted = np.minimum(acted.weights[:, column] + np.float32(added), 1)
        np.testing.assert_array_equal(friendly.weights[:, column], wanted)
    smile = names.index("mouthSmileLeft")
    assert (friendly.weights[:, smile] >= acted.weights[:, smile] + 0.3).all()
    np.testing.assert_array_equal(friendly.eyes, acted.eyes)
    np.testing.assert_array_equal(friendly.samples, acted.samples)
    assert friendly.weights.dtype == acted.weights.dtype


def test_a_smiling_person_is_now_grave_and_now_laughs_and_neither_changes_within_a_word(
    anny, acted
):
    seconds = 60
    longer = replace(
        acted,
        weights=np.zeros((25 * seconds, len(anny.blendshape_names)), np.float32),
        samples=np.zeros(seconds * SOUND_RATE, np.float32),
    )
    smile = mannered(anny, longer, "smiling", 3).weights[
        :, anny.blendshape_names.index("mouthSmileLeft")
    ]
    how = MANNERS["smiling"]
    least, most = (share * GLAD["mouthSmileLeft"] for share in (how.least, how.most))
    assert smile.min() == pytest.approx(least, abs=0.02)
    assert smile.max() == pytest.approx(most, abs=0.02)
    assert np.abs(smile[5:] - smile[:-5]).max() < 0.25 * (most - least)  # a fifth of a second
    other = mannered(anny, longer, "smiling", 4).weights
    assert np.abs(other - mannered(anny, longer, "smiling", 3).weights).max() > 0.3


@pytest.mark.parametrize(
    ("manner", "most"), [("friendly", 0.003), ("smiling", 0.0035), ("beaming", 0.0035)]
)
def test_a_smile_keeps_lips_closed_at_bilabials(anny, manner, most):
    smile = MANNERS[manner].most * anny.weights(dict(MANNERS[manner].smile))
    gaps = {}
    for viseme in ("PP", "aa"):
        marks = anny.landmarks(anny.posed(np.minimum(anny.visemes[viseme] + smile, 1)))
        gaps[viseme] = np.linalg.norm(marks[62] - marks[66])
    assert gaps["PP"] < most and gaps["aa"] > 0.012


def test_a_wide_smile_shows_teeth_but_not_at_bilabials(anny, acted):
    seconds = 40
    spoken = [Phoneme(0.5 * n, "m" if n % 2 else "") for n in range(2 * seconds)]
    silent = replace(
        acted,
        weights=np.zeros((25 * seconds, len(anny.blendshape_names)), np.float32),
        samples=np.zeros(seconds * SOUND_RATE, np.float32),
        phonemes=tuple(spoken),
    )
    weights = mannered(anny, silent, "beaming").weights
    smile = weights[:, anny.blendshape_names.index("mouthSmileLeft")]
    jaw = weights[:, anny.blendshape_names.index("jawOpen")]
    half = BEAMING["mouthSmileLeft"] * (MANNERS["beaming"].least + MANNERS["beaming"].most) / 2
    closed = (np.arange(len(jaw)) / 25 - 0.6) % 1 < 0.3  # well within each m
    assert jaw.max() == pytest.approx(PARTED["jawOpen"], abs=0.001)
    assert (jaw[closed | (smile <= half)] == 0).all()
    assert (jaw[~closed & (smile > half)] > 0).mean() > 0.7
