"""Talks are measured in virtual time."""

from support.chat.virtual_time import outside, pytest_asyncio_loop_factories  # noqa: F401
