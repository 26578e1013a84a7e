"""Settings files in `golden/`, as the pages of their day showed them."""

from pathlib import Path

from ico3d.chat.settings.conversation import Choice, Turns, read_settings

GOLDEN = Path(__file__).parent / "golden"


def test_settings_of_the_first_day():
    settings = read_settings(GOLDEN / "2026-11-21.toml")
    assert settings.voice == Choice("espeak-ng") and settings.max_sessions == 2
    assert settings.language == Choice("openai", {"model": "m"})
    assert settings.turns == Turns(end_silence=1.0)


def test_settings_of_the_second_day():
    settings = read_settings(GOLDEN / "2026-11-22.toml")
    assert settings.recognition.use == "whisper"
    assert settings.recognition.options["model"] == "large-v3"
    assert settings.turns == Turns()
