"""pipecat's OpenAI service, for servers that lack some of what OpenAI's has."""

from typing import Any

from loguru import logger
from openai import APIStatusError, AsyncStream
from openai.types.chat import ChatCompletionChunk
from pipecat.adapters.llm.services.open_ai_adapter import OpenAILLMInvocationParams
from pipecat.processors.aggregators.llm_context import LLMContext
from pipecat.services.openai.llm import OpenAILLMService

from ico3d.chat.failures import cause

MOST_ROUNDS = 4
"""How often in a turn a model may call functions before it must speak."""


class CompatibleModel(OpenAILLMService):
    """A language model that goes without functions where its server cannot call any."""

    supports_developer_role = False  # chat templates of open models do not know it

    def __init__(self, url: str, key: str, model: str, instruction: str, functions: bool):
        """A model for one session.

        Args:
            url: Of the server; empty for OpenAI's.
            key: Sent as the bearer's.
            model: Its name.
            instruction: Who it is.
            functions: Whether it may call functions.
        """
        super().__init__(
            api_key=key,
            base_url=url or None,
            settings=OpenAILLMService.Settings(model=model, system_instruction=instruction),
        )
        self._functions_allowed = functions

    def build_chat_completion_params(
        self, params_from_context: OpenAILLMInvocationParams
    ) -> dict[str, Any]:
        """The request, without functions where there are none."""
        params = super().build_chat_completion_params(params_from_context)
        if not self._functions_allowed or rounds(params["messages"]) >= MOST_ROUNDS:
            for name in ("tools", "tool_choice"):
                params.pop(name, None)
        return params

    async def get_chat_completions(self, context: LLMContext) -> AsyncStream[ChatCompletionChunk]:
        """Asks; once more without functions if the server refuses those."""
        try:
            return await super().get_chat_completions(context)
        except APIStatusError as error:
            if not self._functions_allowed or "tool" not in str(error).lower():
                raise
            logger.warning(f"language goes on without functions, refused by {cause(error)}")
            self._functions_allowed = False
            return await super().get_chat_completions(context)


def rounds(messages: list[dict[str, Any]]) -> int:
    """How often functions were called since the visitor spoke."""
    count = 0
    for message in reversed(messages):
        if message["role"] == "user":
            break
        count += "tool_calls" in message
    return count
