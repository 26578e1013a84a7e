"""Which OpenAI-compatible server recognises speech."""

from dataclasses import dataclass

from ico3d.chat.services.recognition.segments import LONGEST_SPEECH, check_longest_speech
from ico3d.chat.settings.keys import check_key

WHERE = "chat settings: recognition 'openai'"


@dataclass(frozen=True)
class Settings:
    """Which server.

    Attributes:
        url: Its address, such as `http://localhost:8000/v1`; empty for OpenAI's own.
        model: Name of its model.
        key_variable: Environment variable that holds the key; empty for none, or for
            OPENAI_API_KEY where the server is OpenAI's. It is sent nowhere unencrypted but to
            this machine.
        language: Code of the language that is spoken, such as `de`; empty: the server tells.
        timeout: Seconds after which a transcript is given up, one retry included.
        longest_speech: Seconds of unbroken speech that are recognised at once, 5 to 300; what goes
            on longer is cut at a quiet place, and the pieces make one turn.
    """

    url: str = ""
    model: str = "whisper-1"
    key_variable: str = ""
    language: str = ""
    timeout: float = 8.0
    longest_speech: float = LONGEST_SPEECH

    def __post_init__(self):
        """Checks where the key would go, and ranges.

        Raises:
            SettingsError: If the key must not go there, or speech is cut too soon or too late.
        """
        check_key(self.url, self.key_variable, WHERE)
        check_longest_speech(self.longest_speech, WHERE)
