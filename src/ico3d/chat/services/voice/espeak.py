"""The offline voice, espeak-ng, whose library and voices are part of a Python package."""

import unicodedata
from collections import Counter
from dataclasses import dataclass
from functools import partial

import numpy as np

from ico3d.chat.services.provider import Context, lacks_package
from ico3d.chat.services.voice.base import PieceVoice, Spoken, at_speech_rate
from ico3d.common.espeak.speech import synthesize

VARIANT = "+f3"
NAMES = {"en": "en-us", "zh": "cmn"}
"""espeak-ng's names of languages that differ from the language's code."""
SCRIPTS = {
    "ARABIC": "ar fa ur ku sd ug",
    "ARMENIAN": "hy hyw",
    "BENGALI": "bn as",
    "CJK": "cmn yue hak ja",
    "CYRILLIC": "ru uk be bg mk sr ba cv kk ky tt",
    "DEVANAGARI": "hi mr ne kok",
    "ETHIOPIC": "am ti",
    "GEORGIAN": "ka",
    "GREEK": "el grc",
    "GUJARATI": "gu",
    "GURMUKHI": "pa",
    "HANGUL": "ko",
    "HEBREW": "he",
    "HIRAGANA": "ja",
    "KANNADA": "kn",
    "KATAKANA": "ja",
    "MALAYALAM": "ml",
    "MYANMAR": "my shn",
    "ORIYA": "or",
    "SINHALA": "si",
    "TAMIL": "ta",
    "TELUGU": "te",
    "THAI": "th",
}
"""espeak-ng's languages for each script, the default first.

A script is named by the first word of its letters' Unicode names.
"""


@dataclass(frozen=True)
class Settings:
    """Options of the voice `espeak-ng`.

    Attributes:
        voice: espeak-ng's language and variant, such as `de+f3`; empty for the persona's first
            language, or English if it has none. Text in another script is spoken in a language of
            that script, with the same variant.
        rate: Words per minute.
    """

    voice: str = ""
    rate: int = 165


def voice_of(language: str) -> str:
    """espeak-ng's voice for a language code such as `de` or `pt-BR`."""
    code = language.partition("-")[0].lower()
    return NAMES.get(code, code)


def voice_for(text: str, voice: str) -> str:
    """The voice for a text: `voice`, or one for the script in which most of the text is written."""
    names = Counter(unicodedata.name(c, "").partition(" ")[0] for c in text if c.isalpha())
    kana = names["HIRAGANA"] + names["KATAKANA"]  # Japanese has more Chinese characters than these
    script = "HIRAGANA" if kana else max(names, key=lambda name: names[name], default="")
    language, plus, variant = voice.partition("+")
    languages = SCRIPTS.get(script, language).split()
    return voice if language in languages else languages[0] + plus + variant


def speak(text: str, voice: str, rate: int) -> Spoken:
    """Speaks a text in a voice, or in one for the text's script."""
    speech = synthesize(text, voice_for(text, voice), rate)
    return Spoken(at_speech_rate(speech.samples, speech.rate), speech.events)


def spoken(text: str, voice: str, rate: int) -> np.ndarray:
    """The sound of a text, (S,) int16 at 24 kHz."""
    return speak(text, voice, rate).pcm


def hindrance(settings: Settings) -> str:
    """A sentence on what espeak-ng needs on this machine; empty if it works."""
    return lacks_package("espeakng_loader", "voice") or lacks_package("soxr", "chat")


def make(settings: Settings, context: Context) -> PieceVoice:
    """Creates the voice of one session; a sentence takes about 20 ms.

    Raises:
        MissingExtraError: If espeakng-loader or soxr is not installed.
        SettingsError: If espeak-ng has no such voice.
    """
    languages = context.persona.languages or ("en",)
    voice = settings.voice or voice_of(languages[0]) + VARIANT
    spoken("a", voice, settings.rate)  # fails now rather than in mid-talk
    return PieceVoice(voice, partial(speak, voice=voice, rate=settings.rate))
