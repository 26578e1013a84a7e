"""How often something may be done: so many times a second for long, and so many at once."""

from collections.abc import Callable


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

    def owe(self, amount: float) -> float:
        """Takes an amount even if the bucket does not have it; returns the seconds until it has."""
        self.has(amount)  # brings the level up to date
        self._level -= amount
        return max(0.0, -self._level / self._rate)

    def drain(self, amount: float) -> None:
        """Takes an amount even if the bucket does not have it, down to empty."""
        self.has(amount)  # brings the level up to date
        self._level = max(0.0, self._level - amount)
