"""What a language model remembers: the latest messages, a summary of the rest, and earlier visits.

Of earlier visits it knows the visitor's own sentences, which only the visitor's browser keeps.
"""

from collections.abc import Sequence

from pipecat.processors.aggregators.llm_context import LLMContext
from pipecat.processors.aggregators.llm_response_universal import LLMAssistantAggregatorParams
from pipecat.processors.frame_processor import FrameProcessor
from pipecat.services.llm_service import LLMService
from pipecat.utils.context.llm_context_summarization import (
    LLMAutoContextSummarizationConfig,
    LLMContextSummarizationUtil,
    LLMContextSummaryConfig,
)

from ico3d.chat.settings.conversation import Memory

KEPT = 4  # latest messages, word by word
SHARE = 4  # of the budget, one part in so many is the summary's
MOST = 2  # times the budget after which the oldest is forgotten, summary or none
SLOWEST = 60.0  # s for a summary, which is made beside the conversation
PROMPT = (
    "Summarise this conversation between a visitor and yourself for your own memory. Keep every "
    "fact that the visitor told: names, places, numbers, wishes, plans, likes and dislikes; keep "
    "what was promised and what is still open, and everything that an earlier summary says. Leave "
    "out greetings. Write short plain sentences in the language of the conversation, and nothing "
    "but the summary."
)
REMINDER = "(What we talked about before, in short: {summary})"
NOTES = "(From my earlier visits, in my own words: {notes})"


def remembering(memory: Memory, language: FrameProcessor) -> LLMAssistantAggregatorParams:
    """Settings of pipecat's summaries.

    Args:
        memory: Limit of the conversation's length.
        language: The language model; the offline one cannot summarise, so `forget` is used instead.
    """
    summary = LLMContextSummaryConfig(
        target_context_tokens=memory.tokens // SHARE,
        min_messages_after_summary=KEPT,
        summarization_prompt=PROMPT,
        summary_message_template=REMINDER,
        summarization_timeout=SLOWEST,
    )
    return LLMAssistantAggregatorParams(
        enable_auto_context_summarization=isinstance(language, LLMService),
        auto_context_summarization_config=LLMAutoContextSummarizationConfig(
            max_context_tokens=memory.tokens,
            max_unsummarized_messages=None,
            summary_config=summary,
        ),
    )


def forget(context: LLMContext, memory: Memory) -> None:
    """Drops the oldest questions with their answers if no summary has shortened the conversation.

    The offline model cannot summarise, and another model may fail to do so every time.

    Args:
        context: Context of the language model; the latest question is always kept.
        memory: Limit of the conversation's length.
    """
    while LLMContextSummarizationUtil.estimate_context_tokens(context) > MOST * memory.tokens:
        messages = context.get_messages()
        questions = [i for i, m in enumerate(messages) if i and is_question(m)]
        if not questions:
            return
        context.set_messages(messages[questions[0] :])


def is_question(message: object) -> bool:
    """Whether a message is the visitor's.

    Only there may a conversation be cut: elsewhere a tool's call could lose its result.
    """
    return isinstance(message, dict) and message.get("role") == "user"


def remembers_visits(memory: Memory, language: FrameProcessor) -> bool:
    """Whether notes of earlier visits are of use: the persona's notes answer without them."""
    return memory.visits and isinstance(language, LLMService)


def recall(context: LLMContext, notes: Sequence[str]) -> None:
    """Tells a language model what the visitor said in earlier visits.

    They are the visitor's words and no more: a page can put nothing into them that a question could
    not hold.

    Args:
        context: Context of the language model.
        notes: The visitor's sentences, as a page sent them.
    """
    plain = ["".join(c if c.isprintable() else " " for c in note) for note in notes]
    told = [" ".join(note.split()) for note in plain]
    if any(told):
        listed = " ".join(f"“{note}”" for note in told if note)
        context.add_message({"role": "user", "content": NOTES.format(notes=listed)})
