"""What was sent is known where it is heard, and looked at no more than that takes."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from ico3d.chat.turns import echo
from ico3d.chat.turns.bands import COUNT, FRAME, Bands
from ico3d.chat.turns.echo import BEHIND, UNHEARD, SentSound
from ico3d.chat.wire.protocol import SPEECH_RATE

FRAMES = 700
SOUND = np.random.default_rng(0).integers(-9000, 9000, FRAMES * 480).astype(np.int16)
ROWS = Bands(SPEECH_RATE).energies(SOUND / 32768)


def middle(row):
    return (row + 0.5) * FRAME


@given(
    st.lists(st.integers(1, 20_000), min_size=1, max_size=40),
    st.lists(st.integers(0, 90), min_size=1, max_size=40),
)
def test_frames_are_those_of_the_whole_sound(pieces, steps):
    sent, ends, row = SentSound(), np.minimum(np.cumsum(pieces), len(SOUND)), 0
    for begin, end, step in zip([0, *ends], ends, steps, strict=False):
        sent.add(3, SOUND[begin:end])
        row += step
        known = row < end // 480
        expected = ROWS[row] if known else np.zeros(COUNT)
        np.testing.assert_allclose(sent.at(3, middle(row)), expected)
        assert not sent.at(2, middle(row)).any() and not sent.at(None, 0.0).any()


def test_what_was_heard_some_seconds_ago_is_still_known():
    sent = SentSound()
    sent.add(0, SOUND)
    for row in (600, 600 - BEHIND, 650, 200):
        np.testing.assert_allclose(sent.at(0, middle(row)), ROWS[row])
    assert not sent.at(0, middle(50)).any()


def test_a_microphone_that_opens_late_finds_little_to_look_at(monkeypatch):
    looked, sent = [], SentSound()
    energies = Bands.energies
    counted = lambda self, samples: looked.append(len(samples)) or energies(self, samples)  # noqa: E731
    monkeypatch.setattr(echo.Bands, "energies", counted)
    for _ in range(100):  # 23 minutes
        sent.add(0, SOUND)
    last = 100 * FRAMES - 10
    np.testing.assert_allclose(sent.at(0, middle(last)), ROWS[FRAMES - 10])
    assert not sent.at(0, 1e5).any() and not sent.at(0, 0.0).any()
    assert sum(looked) <= (BEHIND + FRAMES) * 480
    assert sent._waiting <= UNHEARD * 480
