"""What tests of heads share."""

import pytest

from support.heads.tiny_capture import TinyCapture


@pytest.fixture
def tiny(tmp_path) -> TinyCapture:
    return TinyCapture(tmp_path / "tiny")
