"""Kokoro through pipecat's own service: 82 million parameters, on the CPU, nine languages."""

import functools
from collections.abc import AsyncGenerator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipecat.audio.utils import create_stream_resampler
from pipecat.frames.frames import Frame
from pipecat.services.tts_service import TTSService

from ico3d.chat.services.provider import Context, lacks_package, lacks_weights
from ico3d.chat.services.voice.base import LOADING, OPTIONS, SYNCHRONOUS, Prompt
from ico3d.chat.services.voice.portions import portions
from ico3d.common.espeak.phonemes import of_kokoro
from ico3d.common.weights import model_of
from ico3d.errors import MissingExtraError, SettingsError

LANGUAGES = {
    "a": "en-us",
    "b": "en-gb",
    "e": "es",
    "f": "fr-fr",
    "h": "hi",
    "i": "it",
    "j": "ja",
    "p": "pt-br",
    "z": "cmn",
}
"""espeak-ng's language for the first letter of a voice's name; it phonemises Kokoro's text."""


@dataclass(frozen=True)
class Settings:
    """Options of the voice `kokoro`.

    Attributes:
        voice: Name of the voice; the first letter stands for the language: `af_heart` American,
            `bf_emma` British, `ef_dora` Spanish, `ff_siwis` French, `hf_alpha` Hindi, `if_sara`
            Italian, `jf_alpha` Japanese, `pf_dora` Portuguese, `zf_xiaobei` Chinese.
        language: Language to speak, such as `en-us`; empty for the voice's own language.
        speed: Speed as a factor of the voice's own, 0.5 to 2.
    """

    voice: str = "af_heart"
    language: str = ""
    speed: float = 1.0

    def __post_init__(self):
        """Checks the speed.

        Raises:
            SettingsError: If Kokoro cannot speak at it.
        """
        if not 0.5 <= self.speed <= 2:
            raise SettingsError("chat settings: voice 'kokoro': speed must be 0.5 to 2.")


def language(settings: Settings) -> str:
    """espeak-ng's name of the language to speak."""
    return settings.language or LANGUAGES.get(settings.voice[:1], "en-us")


def hindrance(settings: Settings) -> str:
    """A sentence on a missing package or missing weights; empty if Kokoro works."""
    return lacks_package("kokoro_onnx", "kokoro") or lacks_weights("kokoro")


def make(settings: Settings, context: Context) -> TTSService:
    """Creates the voice of one session; all sessions share one model.

    Raises:
        MissingExtraError: If kokoro-onnx is not installed.
        MissingModelError: If Kokoro's files are not installed.
        SettingsError: If Kokoro has no such voice.
    """
    try:
        from pipecat.services.kokoro.tts import KokoroTTSService
    except ImportError:
        raise MissingExtraError("kokoro-onnx", "kokoro", "the Kokoro voice") from None

    class KokoroVoice(Prompt, KokoroTTSService):
        """pipecat's, with a model that is there: its own constructor loads or downloads one."""

        def __init__(self, model: Any):
            own = KokoroTTSService.Settings(
                model=None,
                voice=settings.voice,
                language=language(settings),
                speed=settings.speed,
            )
            TTSService.__init__(self, settings=own, **SYNCHRONOUS, **OPTIONS)
            self._kokoro, self._resampler = model, create_stream_resampler()

        async def run_tts(self, text: str, context_id: str) -> AsyncGenerator[Frame, None]:
            """Yields the sound of a text, portion by portion."""
            for portion in portions(text):
                async for frame in super().run_tts(portion, context_id):
                    yield frame

    with LOADING:
        model = engine(model_of("kokoro"))
    if settings.voice not in model.voices:
        names = " or ".join(model.get_voices())
        raise SettingsError(f"chat settings: voice 'kokoro': voice must be {names}.")
    return KokoroVoice(model)


@functools.cache
def engine(folder: Path) -> Any:
    """Loads the model, once per process."""
    from kokoro_onnx import Kokoro

    model = Kokoro(str(folder / "kokoro-v1.0.onnx"), str(folder / "voices-v1.0.bin"))

    def phonemize(text: str, lang: str = "en-us", norm: bool = True) -> str:
        return of_kokoro(text, lang)

    model.tokenizer.phonemize = phonemize
    return model
