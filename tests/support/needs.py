"""What tests need that is not everywhere, said without importing it: that takes seconds."""

from importlib.util import find_spec

import pytest


def needs(package: str) -> pytest.MarkDecorator:
    """Skips where a package is not installed."""
    return pytest.mark.skipif(find_spec(package) is None, reason=f"{package} is not installed")


def skip_without(package: str) -> None:
    """Skips what asks for a fixture where a package that it needs is not installed."""
    if find_spec(package) is None:
        pytest.skip(f"{package} is not installed")
