"""pipecat's Whisper service around a model that is already loaded; needs faster-whisper."""

from typing import Any

from pipecat.services.whisper.stt import WhisperSTTService

from ico3d.chat.pipecat_internals import use_model
from ico3d.chat.services.recognition.segments import LONGEST_SPEECH, Segments

LONGEST = 30.0  # s; a small machine with a long speech


class Listener:
    """A Whisper model with options for conversations, called by pipecat."""

    def __init__(self, model: Any):
        """Wraps a `faster_whisper.WhisperModel`."""
        self._model = model

    def transcribe(self, audio, **options):
        """Transcribes a stretch of speech in a single pass.

        By default, up to six passes follow one another if the model is unsure, as it is with noise,
        while the visitor waits.
        """
        return self._model.transcribe(audio, temperature=0.0, **options)


class WhisperRecognition(Segments, WhisperSTTService):
    """The recogniser of one session, with Whisper."""

    def __init__(self, model: Any, language: str | None, longest_speech: float = LONGEST_SPEECH):
        """Takes a shared `faster_whisper.WhisperModel`."""
        self._shared = model
        settings = WhisperSTTService.Settings(model="shared", language=language)
        super().__init__(LONGEST, longest_speech, settings=settings)

    def _load(self):
        use_model(self, Listener(self._shared))  # pipecat would load one for each session
