"""Options of speech recognition by an OpenAI-compatible server."""

from dataclasses import dataclass

from ico3d.chat.services.recognition.segments import LONGEST_SPEECH, check_longest_speech
from ico3d.chat.settings.keys import check_key

WHERE = "chat settings: recognition 'openai'"


@dataclass(frozen=True)
class Settings:
    """Options of the recogniser `openai`.

    Attributes:
        url: Address of the server, such as `http://localhost:8000/v1`; empty for OpenAI's own.
        model: Name of the model.
        key_variable: Environment variable that holds the server's key; empty for none, or for
            OPENAI_API_KEY where the server is OpenAI's. A key is never sent unencrypted to another
            machine.
        language: Code of the spoken language, such as `de`; empty to let the server detect it.
        timeout: Seconds after which a transcript is given up, one retry included.
        longest_speech: Seconds of unbroken speech that are recognised at once, 5 to 300; longer
            speech is cut at a quiet place, and the pieces form one turn.
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
