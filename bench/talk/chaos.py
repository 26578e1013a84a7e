"""What does a visitor see when something fails amid a talk?

    python bench/talk/chaos.py --markdown runs/chaos.md

Lets each fault happen to visitors of a real server, whose services have set delays, and prints as
a table of Markdown what they were told, after how many seconds they could ask again, and whether
the session went on. The exit status is the number of faults that did not end as they must.
"""

import asyncio
import sys
from dataclasses import dataclass
from pathlib import Path

from ico3d.chat.settings.conversation import ChatSettings
from ico3d.cli import run_script
from ico3d.common.files import write_atomic
from ico3d.measure.talking.chaos import CASES, SCRIPT, Case, Outcome, Stage, suffer
from ico3d.measure.talking.serving import watching

DAY = 86_400.0  # s
HEAD = ("| fault | the visitor is told | s | the session | as it must |", "|---|---|---|---|---|")


@dataclass(frozen=True)
class Chaos:
    """Lets faults happen, and judges what came of them.

    Attributes:
        bundle: The avatar to serve.
        markdown: File for the table.
    """

    bundle: Path = Path("demo")
    markdown: Path | None = None

    def run(self) -> None:
        """Prints the table."""
        own = [case for case in CASES if not case.is_for_all]
        found = self._together(own)
        for case in CASES:
            if case.is_for_all:
                found |= self._together([case])
        lines = [*HEAD, *(row(case, found[case]) for case in CASES)]
        print("\n".join(lines))
        if self.markdown is not None:
            write_atomic(self.markdown, "\n".join([*lines, ""]).encode())
        sys.exit(sum(not isinstance(o := found[c], Outcome) or not o.holds(c) for c in CASES))

    def _together(self, cases: list[Case]) -> dict[Case, Outcome | BaseException]:
        """Some cases at once, each with a visitor of its own, on one server."""
        settings = ChatSettings(max_sessions=max(2, 2 * len(cases)))
        with watching(self.bundle, SCRIPT, settings, jump=DAY) as server:
            found = asyncio.run(outcomes(cases, Stage(server.url, server.process)))
        return dict(zip(cases, found, strict=True))


async def outcomes(cases: list[Case], stage: Stage) -> list[Outcome | BaseException]:
    """What came of each case, or the error with which it ended."""
    return await asyncio.gather(*(suffer(case, stage) for case in cases), return_exceptions=True)


def row(case: Case, outcome: Outcome | BaseException) -> str:
    """A line of the table."""
    if not isinstance(outcome, Outcome):
        return f"| {case.name} | {type(outcome).__name__} {outcome} | – | – | **no** |"
    told, verdict = " / ".join(outcome.seen), "yes" if outcome.holds(case) else "**no**"
    session = "goes on" if outcome.session == "same" else "ended; a new one is opened"
    return f"| {case.name} | {told} | {outcome.seconds:.1f} | {session} | {verdict} |"


if __name__ == "__main__":
    sys.exit(run_script(Chaos))
