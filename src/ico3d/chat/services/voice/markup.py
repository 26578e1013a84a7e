"""Removes from a written answer what is not spoken: markup and emoji, but no words.

pipecat's own `strip_markdown` drops the words of code and of struck-through text, and only
recognises pairs of marks within one piece. Here every word is spoken, and the marks of a pair may
lie in different pieces.
"""

import re

EMOJI = (
    r"[\u231a\u231b\u23e9-\u23f3\u2600-\u266c\u2670-\u2775\u2794-\u27bf\u2b1b\u2b1c\u2b50\u2b55"
    r"\U0001f004\U0001f0cf\U0001f18e\U0001f191-\U0001f19a\U0001f1e6-\U0001f1ff"
    r"\U0001f300-\U0001faff\U000e0020-\U000e007f]"
)
"""Pattern of one code point of an emoji, which joiners and modifiers may follow."""

_RULES = tuple(
    (re.compile(pattern, re.MULTILINE), replacement)
    for pattern, replacement in (
        (r"^[ \t]*(```|~~~)[^\n`]*$", ""),  # a code fence, with the language it names
        (r"^[ \t]*([-*_=])([ \t]*\1){2,}[ \t]*$", ""),  # a rule
        (
            r"^[ \t]*\|?[ \t]*:?-+:?[ \t]*(\|[ \t]*:?-+:?[ \t]*)+\|?[ \t]*$",
            "",
        ),  # of a table
        (r"!?\[([^\]\n]*)\]\([^)\n]*\)", r"\1"),  # a link or picture: its words
        (r"^[ \t]*(>[ \t]?)+", ""),  # quotations
        (r"^[ \t]*#{1,6}[ \t]+", ""),  # headings
        (r"^[ \t]*[-+*•‣▪●][ \t]+(\[[ xX]\][ \t]+)?(?=\S)", ""),  # entries of lists
        (r"`+|~~", ""),
        (r"(?<!\d)\*\*+|\*\*+(?!\d)", ""),
        (r"(?<=[A-Za-z])\*(?=[A-Za-z])", " "),
        (r"(?<![\d\s*])\*(?!\*)|(?<!\*)\*(?![\d\s*])", ""),  # 2*3 and 2 * 3 keep theirs
        (r"(?<!\w)_+(?=\S)|(?<=\S)_+(?!\w)", ""),  # snake_case keeps its own
        (r"(^|[ \t])\|(?=[ \t]|$)", r"\1"),  # between cells of a table
        (r"([0-9#*])\ufe0f?\u20e3", r"\1"),  # keys
        (rf"({EMOJI}|[^\w\s]\ufe0f)(\ufe0f|\u200d(?={EMOJI}|[^\w\s]\ufe0f)|{EMOJI})*", ""),
    )
)


async def speakable(text: str, text_type: str = "") -> str:
    """Prepares a piece of an answer for the voice; a text transform of pipecat.

    Args:
        text: A sentence, a part of one, or a line.
        text_type: pipecat's type of the text; ignored.

    Returns:
        The words of the text; empty if it has none, since some voices fail on lone marks.
    """
    for pattern, replacement in _RULES:
        text = pattern.sub(replacement, text)
    return text if any(map(str.isalnum, text)) else ""
