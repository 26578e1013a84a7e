"""How much a visitor may ask: questions cost computing time, and often money."""

from pipecat.frames.frames import LLMContextFrame
from pipecat.observers.base_observer import BaseObserver, FramePushed
from pipecat.processors.aggregators.llm_response_universal import LLMUserAggregator

from ico3d.chat.bucket import Bucket


class Allowance(BaseObserver):
    """Counts the requests to the language model that a visitor causes.

    A request that was begun is not called back, so a visitor who has used everything up is no
    longer heard until some of it has come back.
    """

    def __init__(self, *buckets: Bucket):
        """Takes the buckets from which each question is drawn; without any there is no limit."""
        super().__init__(observe_every_push=False)
        self._buckets = buckets
        self.is_begun = False
        """Whether words of a question were heard of which no request has been made yet."""

    def may_ask(self) -> bool:
        """Whether the visitor may ask a question now."""
        return all(bucket.has(1) for bucket in self._buckets)

    def begin(self) -> None:
        """Notes that a question has begun: it is heard until it has become a request."""
        self.is_begun = True

    def spend(self) -> None:
        """Counts a question."""
        self.is_begun = False
        for bucket in self._buckets:
            bucket.drain(1)

    async def on_push_frame(self, data: FramePushed):
        """Counts questions, also those prepared before the visitor has finished."""
        if isinstance(data.frame, LLMContextFrame) and isinstance(data.source, LLMUserAggregator):
            self.spend()
