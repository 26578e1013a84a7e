"""Voices: text to speech."""

from ico3d.chat.services.provider import Provider, Table
from ico3d.chat.services.voice import espeak, hibari, kokoro, openai, openvoice, piper

PROVIDERS: Table = {
    "openvoice": Provider(
        "OpenVoice V2",
        openvoice.Settings,
        openvoice.make,
        openvoice.hindrance,
        detail=openvoice.detail,
    ),
    "kokoro": Provider("Kokoro", kokoro.Settings, kokoro.make, kokoro.hindrance),
    "piper": Provider("Piper", piper.Settings, piper.make, piper.hindrance),
    "espeak-ng": Provider(
        "espeak-ng", espeak.Settings, espeak.make, espeak.hindrance, stand_in=True
    ),
    # never the best by itself: it speaks English only
    "hibari": Provider("Hibari", hibari.Settings, hibari.make, hibari.hindrance),
    # never the best by itself: it may cost money, and takes what is said out of the house
    "openai": Provider("OpenAI-compatible server", openai.Settings, openai.make, openai.hindrance),
}
