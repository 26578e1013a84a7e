"""Decides whether a voice during the avatar's speech is an interruption.

The avatar is paused at the first sign of a voice, which loses nothing. What follows decides: a
voice that continues interrupts, and so do words; "uh-huh" and a cough let the avatar resume.
Durations are counted in samples of the microphone, so that a busy machine that processes sound late
does not make a voice seem longer.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from ico3d.chat.frames import VoiceFrame
from ico3d.chat.settings.conversation import Turns
from ico3d.chat.turns.phrases import Phrases

LAST_SOUND = 0.16  # s; a voice that fades is given time to end: "okay" is over, a question goes on
GONE = 0.2  # s of silence after which what never became a voice is over
UNDERSTOOD = 0.6  # s of silence within which a recogniser tells what a short voice said
BRIEF = 0.2  # s; no recogniser is asked about less
LATE = 3.0  # s after which words do not belong to that voice any more


class Verdict(Enum):
    """What the avatar is to do: pause, resume, or yield to the visitor."""

    PAUSE = "pause"
    RESUME = "resume"
    YIELD = "yield"


@dataclass
class Voice:
    """A voice that began during the avatar's speech.

    Attributes:
        since: Time of its beginning, in seconds of microphone sound.
        last: Time at which the voice was last heard, in seconds of microphone sound.
        words: Words that the recogniser has understood so far.
        paused: Whether the avatar is paused because of this voice.
    """

    since: float
    last: float
    words: str = ""
    paused: bool = True


class Floor:
    """Judges voices during the avatar's speech."""

    def __init__(self, settings: Turns, phrases: Phrases, trusted: bool, now: Callable[[], float]):
        """Starts in silence.

        Args:
            settings: Durations that decide on interruptions.
            phrases: Words that do not start a turn, and commands.
            trusted: Whether the recogniser understands short words reliably. Of an unreliable one,
                which may turn "uh-huh" into any word, only commands are believed.
            now: Returns the time in seconds.
        """
        self._settings, self._phrases, self._trusted, self._now = settings, phrases, trusted, now
        self._speaking = False
        self._voice: Voice | None = None
        self._behind = 0.0  # clock less seconds of microphone

    @property
    def is_paused(self) -> bool:
        """Whether the avatar is paused until the voice has been judged."""
        return self._voice is not None and self._voice.paused

    @property
    def is_disputed(self) -> bool:
        """Whether words that arrive now may belong to a voice during the avatar's speech."""
        return self._voice is not None and self._time() - self._voice.last <= LATE

    @property
    def is_speaking(self) -> bool:
        """Whether it is the avatar's turn to speak, paused or not."""
        return self._speaking

    def avatar(self, speaking: bool) -> None:
        """Registers that the avatar begins or ends to speak."""
        self._speaking = speaking
        if not speaking and self.is_paused:
            self._voice = None

    def hear(self, sound: VoiceFrame) -> Verdict | None:
        """Takes the next piece of microphone sound; returns a verdict if there is a new one."""
        end = sound.at + sound.seconds
        self._behind = self._now() - end
        if sound.voiced and self._speaking and not self.is_paused:
            self._voice = Voice(sound.at, end)
            return Verdict.PAUSE
        if self._voice is None or not self._voice.paused:
            return None
        if not sound.voiced:
            return self.wait()
        self._voice.last = end
        lasts = round(end - self._voice.since, 3) >= self._needed(self._voice, sound)
        return self._yield() if lasts else None

    def wait(self) -> Verdict | None:
        """Checks whether the passage of time allows a verdict."""
        voice = self._voice
        if voice is None or not voice.paused:
            return None
        brief = voice.last - voice.since < BRIEF
        if round(self._time() - voice.last, 3) < (GONE if brief else UNDERSTOOD):
            return None
        voice.paused = False
        return Verdict.RESUME

    def understand(self, text: str, final: bool) -> Verdict | None:
        """Takes words of the recogniser; late words may interrupt, too."""
        voice = self._voice
        if voice is None or not self.is_disputed:
            return None
        voice.words = text
        if self._is_turn(text, final):
            return self._yield()
        if not final:
            return None
        paused, self._voice = voice.paused, None
        return Verdict.RESUME if paused else None

    def _time(self) -> float:
        """Seconds of microphone, gone on by the clock since it was heard last."""
        return self._now() - self._behind

    def _is_turn(self, text: str, final: bool) -> bool:
        if not self._trusted:
            return final and self._phrases.is_command(text)
        return bool(text.strip()) and not self._phrases.are_backchannels(text)

    def _needed(self, voice: Voice, sound: VoiceFrame) -> float:
        """Seconds that a voice must last."""
        settings = self._settings
        if sound.plain or (self._trusted and self._phrases.are_backchannels(voice.words)):
            return settings.longest_backchannel
        return settings.interrupt_after + (LAST_SOUND if sound.fading else 0.0)

    def _yield(self) -> Verdict:
        self._voice = None
        return Verdict.YIELD
