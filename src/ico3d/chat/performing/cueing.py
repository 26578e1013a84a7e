"""Chooses gestures of a body on a skeleton from speech, and sends them to the page as cues."""

from ico3d.chat.frames import SpeechFrame, UtteranceEndFrame
from ico3d.chat.page import Page
from ico3d.chat.performing.script import Script
from ico3d.chat.wire import protocol_gestures as wire
from ico3d.chat.wire.protocol import Clock, Cues
from ico3d.chat.wire.protocol_gestures import MAX_CUES
from ico3d.motion.clip import Clip
from ico3d.motion.composing.composer import Composer
from ico3d.motion.composing.cues import Cue, Direction, Release
from ico3d.motion.composing.lexicon import requested
from ico3d.motion.composing.takes import Takes
from ico3d.motion.noise import scrambled

LEAD = 0.8
"""Seconds beyond the heard sound for which gestures are decided, so that cues arrive in time."""
APART = 0.1
"""Least time in seconds between two reports that are looked at; a page sends one each 0.2 s."""
SOONEST = 0.15
"""Least time in seconds between the first heard sound of an utterance and a gesture."""
MOST = 4
"""Utterances that are remembered: a page that reports nothing would have all of them kept."""


class Cueing:
    """Composes the gestures of an utterance while the page plays it."""

    def __init__(self, clips: dict[str, Clip], page: Page, moving: bool, seed: int):
        """Creates the gestures of one session.

        Args:
            clips: Gestures of the bundle, by name.
            page: Receives `Cues`.
            moving: If False, the body makes no gestures.
            seed: Together with an utterance's number, the seed of all random choices.
        """
        self._clips, self._page, self._moving, self._seed = clips, page, moving, seed
        self._scripts: dict[int, Script] = {}
        self._wanted: list[str] = []
        self._utterance = -1  # the last one that was heard
        self._composer: Composer | None = None  # until all is handed out
        self._looked = -APART, False  # at which position, and whether all of the sound was known

    def stop(self) -> None:
        """Ends the utterance; the page lets the hands come down by itself."""
        self._composer = None

    @property
    def names(self) -> list[str]:
        """Names of gestures that can be requested."""
        return Takes(self._clips).meanings if self._moving else []

    def request(self, name: str) -> None:
        """Requests a gesture for the current utterance or, if there is none, for the next."""
        self._wanted = [name]
        self._hand_over()

    def asked(self, question: str) -> None:
        """Looks for a requested gesture in the visitor's words, to be made with the answer."""
        name = requested(question, self.names)
        if name is not None and name in self.names:
            self.request(name)

    def forget(self) -> None:
        """Drops requested gestures, because their utterance is over."""
        self._wanted = []
        self.stop()

    def read(self, frame: SpeechFrame | UtteranceEndFrame) -> None:
        """Takes the next piece of synthesised sound, or the end of an utterance."""
        script = self._scripts.setdefault(frame.utterance, Script())
        for older in sorted(self._scripts)[:-MOST]:
            del self._scripts[older]
        if isinstance(frame, SpeechFrame):
            script.add(frame)
        else:
            script.end()

    def clock(self, message: Clock, position: float) -> None:
        """Takes a report of the page's playback.

        Args:
            message: Report about the current utterance.
            position: Seconds of the utterance that can have been heard.
        """
        script = self._scripts.get(message.utterance)
        if not self._moving or script is None:
            return
        if message.utterance != self._utterance:
            self._begin(message.utterance, position)
        before, complete = self._looked
        if self._composer is not None and (
            abs(position - before) >= APART or script.complete is not complete
        ):
            self._looked = position, script.complete
            self._go_on(self._composer, script, position)

    def _go_on(self, composer: Composer, script: Script, position: float) -> None:
        composer.know(script.words, script.levels)
        if script.complete:
            composer.end(script.seconds)
        ends = script.complete and script.seconds - position <= LEAD
        self._send(composer.directions(float("inf") if ends else position + LEAD))
        if ends:
            self._composer = None  # what is asked for from now on is for the next utterance

    def _begin(self, utterance: int, position: float) -> None:
        """Composes another utterance; those before it are over."""
        self._scripts = {n: script for n, script in self._scripts.items() if n >= utterance}
        self._utterance = utterance
        seed = scrambled(self._seed, utterance)
        self._composer = Composer(self._clips, seed, position + SOONEST)
        self._looked = position - APART, False
        self._hand_over()

    def _hand_over(self) -> None:
        if self._composer is None:
            return
        for name in self._wanted:
            self._composer.request(name)
        self._wanted = []

    def _send(self, directions: list[Direction]) -> None:
        for first in range(0, len(directions), MAX_CUES):
            some = directions[first : first + MAX_CUES]
            cues = [_cue(one) for one in some if isinstance(one, Cue)]
            releases = [_release(one) for one in some if isinstance(one, Release)]
            self._page.send(Cues(self._utterance, cues, releases))


def _cue(cue: Cue) -> wire.Cue:
    times = (round(float(time), 4) for time in (cue.begin, cue.stroke, cue.skip))
    return wire.Cue(cue.number, cue.name, cue.mirror, *times)


def _release(release: Release) -> wire.Release:
    return wire.Release(release.number, round(float(release.time), 4))
