"""`ico3d bench sessions`: its figures from made visits, and visitors of a real server."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ico3d.bundle.format import Bundle
from ico3d.chat.settings.conversation import ChatSettings
from ico3d.chat.wire.protocol import Speech
from ico3d.errors import SettingsError
from ico3d.measure.talking.crowd import SCRIPT, Visit, ahead, figures, measure, tone_of, visit
from ico3d.measure.talking.scripted import tone
from support.chat.serving import serving

pytestmark = pytest.mark.slow

ROWS = np.zeros((1, 39), np.float16)


class Log:
    """A page that got speech at some seconds."""

    def __init__(self, *pieces):
        self.log = [
            (at, Speech(n, 0, first, 0, np.zeros(9, np.int16), ROWS)) for at, n, first in pieces
        ]


def test_tones_of_visitors_are_told_apart():
    for pitch in (200.0, 250.0, 1150.0, 5150.0):
        assert tone_of(tone(pitch, 0.2)) == pitch
        assert tone_of(tone(pitch, 0.2)[1000:3400]) == pitch


def test_a_piece_is_as_early_as_its_first_sample_is_due():
    page = Log((10.0, 0, 0), (10.1, 0, 4800), (10.5, 0, 9600), (11.0, 1, 0), (11.0, 1, 24000))
    assert ahead(page) == pytest.approx([150, -50, 1050])


def test_a_tone_that_two_heard_is_nobodys_own():
    found = figures([Visit([200.0, 200.0], [150.0]), Visit([250.0], [90.0, 400.0])])
    assert found["heard_their_own_tone_only"] == 2 and found["pieces"] == 3
    assert found["ahead_ms"] == {"least": 90.0, "p50": 150.0}
    for tones in ([200.0], [250.0, 200.0], []):
        visits = [Visit([200.0], [1.0]), Visit(tones, [1.0]), Visit([300.0], [1.0])]
        assert figures(visits)["heard_their_own_tone_only"] == (2 if not tones else 1)


def test_there_are_no_more_visitors_than_tones():
    for visitors in (0, 101):
        with pytest.raises(SettingsError, match="visitors"):
            measure(Path("demo"), visitors)
    with pytest.raises(SettingsError, match="microphones"):
        measure(Path("demo"), 2, microphones=3)


async def test_four_visitors_of_a_real_server():
    script = replace(SCRIPT, seconds=0.5)

    def scripted(avatar):
        return replace(avatar, services=script.services())

    demo, settings = Bundle.open(Path("demo")), ChatSettings(max_sessions=4)
    async with serving(demo, settings, adapt=scripted) as (url, _):
        found = figures(await visit(url, 4, 2))
    assert found["heard_their_own_tone_only"] == found["visitors"] == 4
    assert found["pieces"] > 50
    assert found["ahead_ms"]["least"] > 100
