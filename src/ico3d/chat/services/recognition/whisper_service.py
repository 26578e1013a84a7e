"""pipecat's Whisper service around a model that is there already; needs faster-whisper."""

from typing import Any

from pipecat.services.whisper.stt import WhisperSTTService

from ico3d.chat.pipecat_internals import use_model
from ico3d.chat.services.recognition.segments import LONGEST_SPEECH, Segments

LONGEST = 30.0  # s; a small machine with a long speech


class Listener:
    """A model as pipecat calls it, with options for talks."""

    def __init__(self, model: Any):
        """Wraps a `faster_whisper.WhisperModel`."""
        self._model = model

    def transcribe(self, audio, **options):
        """Transcribes at once what a stretch of speech holds.

        One try: by default up to six follow one another where the model doubts, as it does with
        noise, while the visitor waits.
        """
        return self._model.transcribe(audio, temperature=0.0, **options)


class WhisperRecognition(Segments, WhisperSTTService):
    """Whisper for one session."""

    def __init__(self, model: Any, language: str | None, longest_speech: float = LONGEST_SPEECH):
        """A recogniser around a shared `faster_whisper.WhisperModel`."""
        self._shared = model
        settings = WhisperSTTService.Settings(model="shared", language=language)
        super().__init__(LONGEST, longest_speech, settings=settings)

    def _load(self):
        use_model(self, Listener(self._shared))  # pipecat would load one for each session
