"""Who has the floor, on a clock that only the test moves."""

import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ico3d.chat.frames import VoiceFrame
from ico3d.chat.settings.conversation import Turns
from ico3d.chat.turns.floor import GONE, UNDERSTOOD, Floor, Verdict
from ico3d.chat.turns.phrases import phrases

PIECE = 0.04  # s
SETTINGS = Turns()


class Talk:
    """A microphone and a clock."""

    def __init__(self, trusted=False, late=0.0):
        self.now, self.at, self.late = 100.0, 0.0, late
        self.floor = Floor(SETTINGS, phrases(), trusted, lambda: self.now)
        self.floor.avatar(True)

    def hear(self, seconds, voiced=True, plain=False, fading=False):
        """The verdicts of some sound, each with the seconds since its beginning."""
        verdicts = []
        for piece in range(1, round(seconds / PIECE) + 1):
            sound = VoiceFrame(self.at, PIECE, voiced, plain, fading)
            self.at += PIECE
            self.now = 100.0 + self.at + self.late
            verdict = self.floor.hear(sound)
            if verdict:
                verdicts.append((verdict, round(piece * PIECE, 2)))
        return verdicts

    def wait(self, seconds):
        self.now += seconds
        return self.floor.wait()


def test_the_avatar_falls_silent_at_once_and_yields_to_a_voice_that_goes_on():
    assert Talk().hear(2.0)[:2] == [(Verdict.PAUSE, 0.04), (Verdict.YIELD, 0.4)]


def test_a_busy_machine_does_not_make_voices_shorter_or_longer():
    talk = Talk(late=3.0)
    assert talk.hear(0.36) == [(Verdict.PAUSE, 0.04)]
    assert talk.hear(0.04) == [(Verdict.YIELD, 0.04)]


def test_a_voice_that_fades_is_given_time_to_end():
    talk = Talk()
    talk.hear(0.36)
    assert talk.hear(0.12, fading=True) == []
    talk = Talk()
    talk.hear(0.36)
    assert talk.hear(0.2, fading=True) == [(Verdict.YIELD, 0.2)]


def test_one_vowel_or_a_hum_gets_longer():
    assert Talk().hear(0.96, plain=True) == [(Verdict.PAUSE, 0.04)]
    assert Talk().hear(1.04, plain=True)[:2] == [(Verdict.PAUSE, 0.04), (Verdict.YIELD, 1.0)]


def test_a_click_is_forgotten_soon():
    talk = Talk()
    talk.hear(0.08)
    assert talk.hear(1.0, voiced=False) == [(Verdict.RESUME, GONE)]


def test_a_short_voice_waits_for_its_words_but_not_for_ever():
    talk = Talk()
    talk.hear(0.32)
    verdicts = talk.hear(1.0, voiced=False)
    assert [verdict for verdict, _ in verdicts] == [Verdict.RESUME]
    assert UNDERSTOOD <= verdicts[0][1] <= UNDERSTOOD + PIECE


def test_a_microphone_that_is_turned_off_does_not_keep_the_avatar_silent():
    talk = Talk()
    talk.hear(0.32)
    assert talk.wait(UNDERSTOOD - 0.01) is None
    assert talk.wait(0.02) is Verdict.RESUME
    assert talk.wait(5.0) is None


@pytest.mark.parametrize(
    ("trusted", "text", "verdict"),
    [
        (True, "Uh-huh.", Verdict.RESUME),
        (True, "Yeah, yeah, okay!", Verdict.RESUME),
        (True, "Ach so, genau.", Verdict.RESUME),
        (True, "嗯", Verdict.RESUME),
        (True, "Why?", Verdict.YIELD),
        (True, "Okay, but why?", Verdict.YIELD),
        (True, "Stopp!", Verdict.YIELD),
        (False, "total", Verdict.RESUME),  # what pocketsphinx makes of uh-huh
        (False, "but ah", Verdict.RESUME),
        (False, "stop", Verdict.YIELD),
        (False, "wait a minute", Verdict.YIELD),
    ],
)
def test_words_decide_on_a_short_voice(trusted, text, verdict):
    talk = Talk(trusted)
    talk.hear(0.32)
    assert talk.hear(0.24, voiced=False) == []
    assert talk.floor.understand(text, final=True) is verdict
    assert not talk.floor.is_paused


def test_words_that_come_late_take_the_floor_all_the_same():
    talk = Talk(trusted=True)
    talk.hear(0.32)
    talk.hear(1.0, voiced=False)  # resumed meanwhile
    assert talk.floor.understand("Why?", final=True) is Verdict.YIELD
    talk.hear(0.32)
    talk.hear(4.0, voiced=False)
    assert talk.floor.understand("Why?", final=True) is None  # but not any time later


def test_first_words_of_a_good_recogniser_hasten_or_delay():
    talk = Talk(trusted=True)
    talk.hear(0.2)
    assert talk.floor.understand("okay", final=False) is None
    assert talk.hear(0.72) == []
    assert talk.floor.understand("okay but", final=False) is Verdict.YIELD
    unsure = Talk(trusted=False)
    unsure.hear(0.2)
    assert unsure.floor.understand("stop", final=False) is None
    assert unsure.hear(0.2) == [(Verdict.YIELD, 0.2)]


def test_nobody_is_interrupted_in_silence():
    talk = Talk()
    talk.floor.avatar(False)
    assert talk.hear(2.0) == []
    assert talk.floor.understand("Why?", final=True) is None


@given(st.lists(st.tuples(st.booleans(), st.booleans(), st.booleans()), max_size=80))
def test_verdicts_alternate(pieces):
    """After a pause comes a resume or the end; nothing is resumed that was not paused."""
    talk, paused = Talk(), False
    for voiced, plain, fading in pieces:
        for verdict, _ in talk.hear(PIECE, voiced, plain, fading):
            assert (verdict is Verdict.PAUSE) != paused
            paused = verdict is Verdict.PAUSE
            assert talk.floor.is_paused == paused
            if verdict is Verdict.YIELD:
                return


def test_thousands_of_backchannels_hold_nobody_up():
    said = "uh-huh, ok " * 360  # nearly as long as a page may send
    begun = time.process_time()
    assert phrases().are_backchannels(said)
    assert not phrases().are_backchannels(f"{said} but")
    assert not phrases().is_command("one " * 1000)
    assert time.process_time() - begun < 0.5  # it took ten seconds, in the loop of all visitors
