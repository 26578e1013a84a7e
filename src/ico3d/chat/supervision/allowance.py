"""How much a visitor may ask: questions cost computing time, and often money."""

from collections.abc import Callable

from pipecat.frames.frames import LLMContextFrame
from pipecat.observers.base_observer import BaseObserver, FramePushed
from pipecat.processors.aggregators.llm_response_universal import LLMUserAggregator


class Bucket:
    """A token bucket: `rate` per second on average, `burst` at once."""

    def __init__(self, rate: float, burst: float, now: Callable[[], float]):
        """Starts full."""
        self._rate, self._burst, self._now = rate, burst, now
        self._level, self._at = burst, now()

    def has(self, amount: float) -> bool:
        """Whether the bucket has an amount."""
        now = self._now()
        self._level = min(self._burst, self._level + self._rate * (now - self._at))
        self._at = now
        return amount <= self._level

    def take(self, amount: float) -> bool:
        """Takes an amount if the bucket has it; returns whether it has."""
        enough = self.has(amount)
        if enough:
            self._level -= amount
        return enough

    def drain(self, amount: float) -> None:
        """Takes an amount even if the bucket does not have it, down to empty."""
        self.has(amount)  # brings the level up to date
        self._level = max(0.0, self._level - amount)


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
