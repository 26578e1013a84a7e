"""The voice of espeak-ng: offline, its library and voices are inside a package."""

import unicodedata
from collections import Counter
from dataclasses import dataclass
from functools import partial

import numpy as np

from ico3d.chat.services.provider import Context, lacks_package
from ico3d.chat.services.voice.pieces import PieceVoice, at_speech_rate
from ico3d.common.espeak import synthesize

VARIANT = "+f3"
NAMES = {"en": "en-us", "zh": "cmn"}
"""espeak-ng's names of languages where they are not the codes."""
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
"""espeak-ng's languages by script, the first where nothing else is known. Scripts are named by
the first word of their letters' Unicode names."""


@dataclass(frozen=True)
class Settings:
    """Which voice.

    Attributes:
        voice: espeak-ng's language and variant, such as `de+f3`; empty for the persona's first
            language, English where it has none. What is written in another script is spoken by
            that script's language, with the same variant.
        rate: Words per minute.
    """

    voice: str = ""
    rate: int = 165


def voice_of(language: str) -> str:
    """The voice for a language, given by its code such as `de` or `pt-BR`."""
    code = language.partition("-")[0].lower()
    return NAMES.get(code, code)


def voice_for(text: str, voice: str) -> str:
    """The voice for a text: the given one, or that of the script in which most of it is written."""
    names = Counter(unicodedata.name(c, "").partition(" ")[0] for c in text if c.isalpha())
    kana = names["HIRAGANA"] + names["KATAKANA"]  # Japanese has more Chinese characters than these
    script = "HIRAGANA" if kana else max(names, key=lambda name: names[name], default="")
    language, plus, variant = voice.partition("+")
    languages = SCRIPTS.get(script, language).split()
    return voice if language in languages else languages[0] + plus + variant


def spoken(text: str, voice: str, rate: int) -> np.ndarray:
    """A text as (S,) int16 samples at 24 kHz."""
    speech = synthesize(text, voice_for(text, voice), rate)
    return at_speech_rate(speech.samples, speech.rate)


def hindrance(settings: Settings) -> str:
    """What espeak-ng lacks here, its packages included; empty if it works."""
    return lacks_package("espeakng_loader", "voice") or lacks_package("soxr", "chat")


def make(settings: Settings, context: Context) -> PieceVoice:
    """A voice for one session; it speaks a sentence in about 20 ms.

    Raises:
        MissingExtraError: If espeakng-loader or soxr is not installed.
        SettingsError: If there is no such voice.
    """
    languages = context.persona.languages or ("en",)
    voice = settings.voice or voice_of(languages[0]) + VARIANT
    spoken("a", voice, settings.rate)  # fails now rather than in mid-talk
    return PieceVoice(voice, partial(spoken, voice=voice, rate=settings.rate))
