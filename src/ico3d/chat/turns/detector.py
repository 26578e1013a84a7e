"""Detects voices: Silero's decision for turns, and an early hint for pausing the avatar."""

import numpy as np
from pipecat.audio.vad.silero import SileroVADAnalyzer
from pipecat.audio.vad.vad_analyzer import VADParams, VADState
from pipecat.frames.frames import (
    Frame,
    InputAudioRawFrame,
    VADUserStartedSpeakingFrame,
    VADUserStoppedSpeakingFrame,
)
from pipecat.processors.audio.vad_processor import VADProcessor
from pipecat.processors.frame_processor import FrameDirection

from ico3d.chat.frames import VoiceFrame, message_in
from ico3d.chat.pipecat_internals import begin_silero
from ico3d.chat.turns.bands import Bands
from ico3d.chat.wire.protocol import MICROPHONE_RATE, Talk

QUIETEST = 0.4  # smoothed volume of speech; it rises over 0.2 s, so more would notice it later
HINT = 0.5  # Silero's confidence that makes a first hint
AUDIBLE = 0.01  # RMS of a voice that is near, full scale = 1
PLAIN = 2.6  # dB; "uh-huh" and "aha" of 6 voices: up to 2.0, speech and "yeah": from 3.4
TRAIL = 0.2  # s of silence behind what was said with the button
FADED = 0.03  # of its loudest power: 15 dB down
KEPT = 100  # frames of a voice that are compared: 2 s
AFTERGLOW = 1.0  # s of silence behind a voice that are told of, too


class EagerSilero(SileroVADAnalyzer):
    """The Silero VAD, which also reports early hints of a voice."""

    def __init__(self, pause: float):
        """A voice is over after `pause` seconds of silence."""
        params = VADParams(stop_secs=pause, min_volume=QUIETEST)
        begin_silero(self, sample_rate=MICROPHONE_RATE, params=params)
        self._hint = False
        self.silence = 0.0  # s of a pause that may end the voice

    async def analyze_audio(self, buffer: bytes) -> VADState:
        """Silero's state of the voice after this sound.

        Afterwards `voiced` describes this sound alone, and `silence` counts earlier silence, too.
        """
        self._hint = False
        state = await super().analyze_audio(buffer)
        seconds = len(buffer) / 2 / MICROPHONE_RATE
        self.silence = self.silence + seconds if state == VADState.STOPPING else 0.0
        self.voiced = self._hint or state in (VADState.STARTING, VADState.SPEAKING)
        return state

    def voice_confidence(self, buffer: bytes) -> float:
        """Silero's confidence in a voice for 32 ms of sound; runs in a thread."""
        confidence = super().voice_confidence(buffer)
        if confidence >= HINT:
            samples = np.frombuffer(buffer, np.int16) / 32768
            self._hint = self._hint or bool(np.sqrt(np.mean(samples**2)) >= AUDIBLE)
        return confidence


class Timbre:
    """Detects voices that consist of a single sound: "uh-huh", "aha", humming.

    Such voices vary only in loudness, whereas the spectrum of words changes from sound to sound.
    """

    def __init__(self):
        """Starts without a voice."""
        self._bands = Bands(MICROPHONE_RATE)
        self.forget()

    def forget(self) -> None:
        """Ends the voice."""
        self._energies = np.zeros((0, 0))
        self._rest = np.zeros(0)

    def hear(self, samples: np.ndarray) -> None:
        """Adds sound of the voice, (S,) in [-1, 1] at 16 kHz."""
        samples = np.concatenate([self._rest, samples])
        whole = len(samples) - len(samples) % self._bands.length
        self._rest = samples[whole:]
        fresh = self._bands.energies(samples[:whole])  # (frames, bands)
        known = self._energies[-KEPT:].reshape(-1, fresh.shape[1])
        self._energies = np.concatenate([known, fresh])

    @property
    def is_plain(self) -> bool:
        """Whether the shape of the spectrum has not changed."""
        return bool(self.spread < PLAIN)

    @property
    def is_fading(self) -> bool:
        """Whether the voice's last frames are much quieter than its loudest."""
        total = self._energies.sum(axis=1)
        return bool(total[-2:].mean() < FADED * total.max()) if len(total) else False

    @property
    def spread(self) -> float:
        """Variation of the spectrum's shape in dB: standard deviations, mean over the bands."""
        total = self._energies.sum(axis=1)
        if not total.any():
            return 0.0
        loud = self._energies[total > total.max() / 30]  # (frames, bands)
        level = 10 * np.log10(loud + total.max() * 1e-5)
        return float((level - level.mean(axis=1, keepdims=True)).std(axis=0).mean())


class VoiceDetector(VADProcessor):
    """Detects beginnings and ends of voices; while the button is in use, it alone decides."""

    def __init__(self, vad: EagerSilero):
        """Creates the detector of one session."""
        super().__init__(vad_analyzer=vad)
        self._vad = vad
        self._timbre = Timbre()
        self._heard = 0.0  # s
        self._silence = AFTERGLOW  # s since a voice
        self._held = False

    async def process_frame(self, frame: Frame, direction: FrameDirection):
        """Passes frames on, and adds frames about voices."""
        if isinstance(frame, InputAudioRawFrame) and self._held:
            await self.push_frame(frame, direction)
            return
        await super().process_frame(frame, direction)
        if isinstance(frame, InputAudioRawFrame):
            await self._tell(np.frombuffer(frame.audio, np.int16) / 32768)
        elif (talk := message_in(frame, Talk)) and talk.pressed != self._held:
            self._held = talk.pressed
            await self._hold()

    async def _tell(self, samples: np.ndarray) -> None:
        seconds, voiced = len(samples) / MICROPHONE_RATE, self._vad.voiced
        at, self._heard = self._heard, self._heard + seconds
        self._silence = 0.0 if voiced else self._silence + seconds
        if self._silence >= AFTERGLOW:
            self._timbre.forget()
            return
        self._timbre.hear(samples)
        plain, fading = self._timbre.is_plain, self._timbre.is_fading
        await self.push_frame(VoiceFrame(at, seconds, voiced, plain, fading, self._vad.silence))

    async def _hold(self) -> None:
        if self._held:
            await self.broadcast_frame(VADUserStartedSpeakingFrame, start_secs=0.0)
        else:  # recognisers take the last word for cut off without a little silence
            silence = bytes(2 * int(TRAIL * MICROPHONE_RATE))
            await self.push_frame(InputAudioRawFrame(silence, MICROPHONE_RATE, 1))
            await self.broadcast_frame(VADUserStoppedSpeakingFrame, stop_secs=0.0)
