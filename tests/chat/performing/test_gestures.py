"""The body's motion while the avatar speaks, from the page's clock to its timeline."""

import numpy as np
import pytest

from ico3d.bundle.animation import Action, Animation, Rest
from ico3d.chat.frames import Utterances
from ico3d.chat.page import Page
from ico3d.chat.performing.gestures import OVERRUN, Gestures
from ico3d.chat.settings.conversation import ChatSettings, read_settings
from ico3d.chat.wire.protocol import (
    MAX_AHEAD_SECONDS,
    SPEECH_RATE,
    Clock,
    End,
    Interrupt,
    Speech,
    Stop,
    Text,
    Timeline,
)
from ico3d.errors import SettingsError
from ico3d.measure.talking.page import open_page
from support.chat.pages import FollowingPlayer
from support.chat.serving import TYPED, serving

pytestmark = pytest.mark.slow

ANIMATION = Animation(
    15.0, 60, Rest(0, 20), (Action(28, 0.9), Action(36, 0.7), Action(50, 0.5)), 0.6, 1.2
)
HOME = 20 / 15


class Body:
    """A page's body: rests back and forth at captured speed, then follows what was planned."""

    def __init__(self, place=0.3, direction=1):
        self.place, self.direction = place, direction
        self.points = []

    def take(self, timeline):
        assert not self.points or timeline.points[0][0] > self.points[-1][0]  # nothing is replaced
        self.points += timeline.points

    def advance(self, position, step):
        if self.points:
            self.place = float(np.interp(position, *np.array(self.points).T))
            return
        self.place += self.direction * step
        if not 0 <= self.place <= HOME:
            self.direction = -self.direction
            self.place = float(np.clip(self.place, 0, HOME))


class Recorder(Page):
    def __init__(self):
        super().__init__()
        self.sent = []

    def send(self, message):
        self.sent.append(message)


def played(seconds, sentences, moving=True, seed=0, body=None, stop=None, wish=None):
    """Plays an utterance whose sentences are made when the others are nearly heard.

    Returns:
        The body and where it was every 20 ms.
    """
    page, utterances, body = Recorder(), Utterances(), body or Body()
    gestures = Gestures(ANIMATION, page, utterances, moving, seed)
    utterance = utterances.begin()
    if wish is not None:
        gestures.request(wish)
    ends = np.cumsum(np.full(sentences, seconds / sentences))
    places, position = [], 0.0
    while position < (stop or seconds) + 1e-9:
        body.advance(position, 0.02)
        places.append(body.place)
        known = ends[min(int(np.searchsorted(ends, position + 0.5)), len(ends) - 1)]
        complete = known == ends[-1]
        utterances.made(utterance, round(known * SPEECH_RATE), complete)
        if len(places) % 10 == 0:
            gestures.clock(Clock(utterance, position, body.place), position)
            for message in page.sent:
                assert isinstance(message, Timeline) and message.utterance == utterance
                latest = position + MAX_AHEAD_SECONDS + (OVERRUN if complete else 0)
                assert message.points[-1][0] <= latest + 1e-3
                body.take(message)
            page.sent.clear()
        position += 0.02
    return body, np.array(places)


@pytest.mark.parametrize("sentences", [1, 3, 12])
@pytest.mark.parametrize("direction", [1, -1])
def test_the_body_gestures_without_a_jump_and_is_back_when_the_speech_ends(sentences, direction):
    for seed in range(5):
        body, places = played(12.0, sentences, seed=seed, body=Body(0.5, direction))
        assert np.abs(np.diff(places)).max() <= 1.2 * 0.02 + 1e-3
        assert places.max() > 28 / 15 - 0.01
        time, place = body.points[-1]
        assert place == pytest.approx(HOME, abs=1e-3)
        assert 12.0 - 1e-3 <= time <= 12.0 + (1 / 15 if sentences == 1 else OVERRUN + 1 / 15)
        turned = np.flatnonzero(np.diff(np.sign(np.diff(places[places != np.roll(places, 1)]))))
        assert len(turned) >= 2


def test_the_same_seed_and_reports_give_the_same_motion():
    one, same, other = (played(9.0, 2, seed=seed)[0].points for seed in (3, 3, 4))
    assert one == same and one != other


@pytest.mark.parametrize("direction", [1, -1])
def test_a_requested_gesture_comes_first(direction):
    for seed in range(5):
        wish = {"wish": "gesture-3", "seed": seed}
        _, places = played(14.0, 1, body=Body(0.5, direction), **wish)
        away = np.flatnonzero(places > HOME + 0.05)[0]
        rising = np.diff(places[away:]) > 0
        assert places[away + np.flatnonzero(~rising)[0]] == pytest.approx(50 / 15, abs=0.05)


def test_what_was_requested_can_be_forgotten():
    page, utterances = Recorder(), Utterances()
    gestures, same = (
        Gestures(ANIMATION, page, utterances, True, 0),
        Gestures(ANIMATION, page, utterances, True, 0),
    )
    assert gestures.names == ["gesture-1", "gesture-2", "gesture-3"]
    gestures.request("gesture-3")
    gestures.forget()
    utterances.made(utterances.begin(), 20 * SPEECH_RATE, complete=True)
    sent = []
    for each in (gestures, same):
        for position in (0.1, 0.3, 0.5, 2.0, 4.0):
            each.clock(Clock(0, position, 1.0), position)
        sent.append([message.points for message in page.sent])
        page.sent.clear()
    assert sent[0] == sent[1]


def test_a_held_body_has_no_gestures():
    assert Gestures(ANIMATION, Recorder(), Utterances(), moving=False, seed=0).names == []


def test_without_gestures_the_body_is_held_at_rest():
    body, places = played(6.0, 1, moving=False)
    assert places.max() <= HOME + 1e-3
    assert places[-150:] == pytest.approx(HOME, abs=1e-3)
    assert body.points[-1] == pytest.approx((6.0, HOME), abs=1e-3)


def test_a_stopped_utterance_gets_no_motion_and_the_next_one_begins_where_the_body_is():
    page, utterances = Recorder(), Utterances()
    gestures = Gestures(ANIMATION, page, utterances, True, 0)
    for utterance in (utterances.begin(), utterances.begin()):
        utterances.made(utterance, 8 * SPEECH_RATE)
        for position, place in [(0.0, 2.0), (0.2, 2.2), (0.4, 2.4)]:
            gestures.clock(Clock(utterance, position, place), position)
        (timeline,) = page.sent
        assert timeline.points[0] == (0.4, 2.4)
        assert timeline.points[1][1] > 2.4  # it moved forwards, and goes on
        page.sent.clear()
        gestures.stop()


def test_a_body_that_stands_may_start_in_any_direction():
    page, utterances = Recorder(), Utterances()
    gestures = Gestures(ANIMATION, page, utterances, True, 0)
    utterances.made(utterances.begin(), 30 * SPEECH_RATE, complete=True)
    for position in (0.1, 0.3):
        gestures.clock(Clock(0, position, 3.9), position)
    times, places = np.array(page.sent[0].points).T
    assert places[-1] < 3.9 and times[0] == 0.3


async def test_timelines_travel_with_the_speech_and_end_at_rest(person):
    async with serving(person, TYPED) as (url, _):
        page, _ = await open_page(url, microphone=False)
        page.player = FollowingPlayer()
        await page.send(Text("tell me something nobody has written down"))
        _, end = await page.wait(End, where=lambda m: m.utterance == 0)
        await page.heard(0)
        timelines = [m for m in page.messages(Timeline) if m.utterance == 0]
        points = np.array([point for m in timelines for point in m.points])
        assert (np.diff(points[:, 0]) > 0).all()
        assert points[-1, 1] == pytest.approx(person.animation.rest.end / 15, abs=1e-3)
        seconds = end.samples / SPEECH_RATE
        assert seconds - 1e-3 <= points[-1, 0] <= seconds + OVERRUN + 1 / 15
        assert np.ptp(points[:, 1]) > 0.2
        await page.close()


async def test_nothing_of_a_stopped_motion_follows_its_stop(person):
    async with serving(person, TYPED) as (url, _):
        page, _ = await open_page(url, microphone=False)
        await page.send(Text("tell me something nobody has written down"))
        await page.wait(Timeline, where=lambda m: m.utterance == 0)
        await page.send(Interrupt(None))
        await page.wait(Stop, where=lambda m: m.utterance == 0)
        since = len(page.log)
        await page.send(Text("who are you?"))
        await page.wait(Speech, since, where=lambda m: m.utterance == 1)
        assert {m.utterance for m in page.messages(Timeline, since)} <= {1}
        await page.close()


def test_the_settings_can_hold_the_body(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text("gestures = false")
    assert read_settings(path) == ChatSettings(gestures=False)
    path.write_text("gestures = 1")
    with pytest.raises(SettingsError, match="must be true or false"):
        read_settings(path)
