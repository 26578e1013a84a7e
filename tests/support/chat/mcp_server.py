"""A server of the Model Context Protocol, as a program and as an application.

Run as a program it speaks over standard input and output.
"""

import asyncio
import os
import sys

COMMAND = (sys.executable, __file__)


def museum():
    """What is true of a museum, and what goes wrong there."""
    from mcp.server import MCPServer

    server = MCPServer("museum")

    @server.tool()
    def opening_hours(day: str) -> str:
        """When the museum is open on a day."""
        return f"On {day} from ten to six."

    @server.tool(name="told.to/it")
    def told() -> str:
        """What the environment holds."""
        return f"{os.environ.get('MUSEUM_KEY')} {os.environ.get('OPENAI_API_KEY')}"

    @server.tool()
    def process() -> str:
        """Number of the program."""
        return str(os.getpid())

    @server.tool()
    def big() -> str:
        """A long answer."""
        return "x" * 20_000

    @server.tool()
    async def slow() -> str:
        """An answer that comes too late."""
        await asyncio.sleep(30)
        return "late"

    @server.tool()
    def leave() -> str:
        """Ends the program."""
        os._exit(1)

    return server


if __name__ == "__main__":
    museum().run()
