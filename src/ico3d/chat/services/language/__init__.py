"""Question to answer."""

from ico3d.chat.services.language import openai, persona
from ico3d.chat.services.provider import Provider, Table

PROVIDERS: Table = {
    "persona-notes": Provider("persona notes", persona.Settings, persona.make, stand_in=True),
    # never the best by itself: it may cost money, and takes what is said out of the house
    "openai": Provider("OpenAI-compatible server", openai.Settings, openai.make),
}
