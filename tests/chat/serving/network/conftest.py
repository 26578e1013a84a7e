"""A server with HTTPS."""

import ssl
from datetime import UTC, datetime

import pytest

from ico3d.chat.serving.network.certificates import own_certificate
from support.chat.serving import serving


@pytest.fixture
async def secured(body, tmp_path):
    """Port of a server with HTTPS, and the context of a client that trusts it."""
    certificate = own_certificate(tmp_path, ["127.0.0.1"], datetime.now(UTC))
    trust = ssl.create_default_context(cafile=certificate.file)
    async with serving(body, certificate=certificate) as (url, _):
        yield int(url.rstrip("/").rpartition(":")[2]), trust
