"""Language models: question to answer."""

from ico3d.chat.services.language import local, openai, persona, smollm
from ico3d.chat.services.language.hub import qwen
from ico3d.chat.services.provider import Provider, Table

PROVIDERS: Table = {
    "local": Provider(
        "a server on this machine",
        local.Settings,
        local.make,
        local.hindrance,
        detail=local.detail,
    ),
    "qwen": Provider(
        "a model in this process", qwen.Settings, qwen.make, qwen.hindrance, detail=qwen.detail
    ),
    "persona-notes": Provider("persona notes", persona.Settings, persona.make, stand_in=True),
    # never the best by itself: it speaks English only
    "smollm2": Provider("notes and SmolLM2-135M", smollm.Settings, smollm.make, smollm.hindrance),
    # never the best by itself: it may cost money, and takes what is said out of the house
    "openai": Provider(
        "OpenAI-compatible server",
        openai.Settings,
        openai.make,
        openai.hindrance,
        detail=openai.detail,
    ),
}
