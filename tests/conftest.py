"""What holds for all tests."""


def pytest_make_parametrize_id(val: object) -> str | None:
    """Names bytes by their length: names made of content differ where content does.

    Two processes that share the tests must collect the same names, and compressed files hold
    the time they were made at.
    """
    return f"{len(val)}-bytes" if isinstance(val, bytes) else None
