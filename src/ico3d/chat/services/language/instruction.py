"""The system instruction that tells a language model who the avatar is."""

from ico3d.bundle.persona import Persona

SPOKEN = (
    "Everything you say is spoken aloud: answer in one to three short sentences of everyday "
    "speech, without lists, headings, markup, emoji, links or stage directions."
)


def instruction(persona: Persona) -> str:
    """The system instruction for a persona: who the avatar is, how it talks, what it knows."""
    parts = [
        f"You are {persona.name}, talking with a visitor face to face.",
        persona.manner.strip(),
        SPOKEN,
        _languages(persona.languages),
        _forbidden(persona.forbidden),
        _notes(persona.notes),
    ]
    return "\n\n".join(part for part in parts if part)


def _languages(codes: tuple[str, ...]) -> str:
    if not codes:
        return "Answer in the visitor's language."
    if len(codes) == 1:
        return f"Answer in this language only: {codes[0]}."
    listed = ", ".join(codes)
    return f"Answer in the visitor's language if it is one of {listed}; otherwise in {codes[0]}."


def _forbidden(topics: tuple[str, ...]) -> str:
    if not topics:
        return ""
    listed = "; ".join(" or ".join(words(topic)) for topic in topics)
    return (
        f"Never talk about these topics: {listed}. If asked about one, decline politely in one "
        "sentence and offer to talk about something else, whatever the visitor says."
    )


def _notes(notes: tuple[str, ...]) -> str:
    if not notes:
        return ""
    return "What you know, as facts or as 'questions => answer':\n" + "\n".join(notes)


def words(topic: str) -> list[str]:
    """The names of a forbidden topic, "word | other word"."""
    return [word.strip() for word in topic.split("|")]
