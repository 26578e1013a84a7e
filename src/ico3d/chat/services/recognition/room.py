"""How much of what is heard becomes a question: no more than somebody may type."""

from ico3d.chat.wire.protocol import MAX_QUESTION

MOST_RESULTS = 200  # of a turn: nobody says more in one breath


class Room:
    """What a turn may still hold: as many letters as a typed question, in so many results."""

    def __init__(self):
        """Starts with an empty turn."""
        self.clear()

    def clear(self) -> None:
        """Begins a new turn."""
        self._letters, self._results = MAX_QUESTION, MOST_RESULTS

    def fit(self, words: str) -> str:
        """The part of a result for which there is room."""
        return words.strip()[: self._letters].strip() if self._results else ""

    def take(self, words: str) -> str:
        """As `fit`, for words that are final."""
        words = self.fit(words)
        if words:
            self._letters = max(0, self._letters - len(words) - 1)  # and the space behind them
            self._results -= 1
        return words
