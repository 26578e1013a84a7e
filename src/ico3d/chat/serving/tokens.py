"""Tokens that admit pages to an avatar for some minutes.

A token is `EXPIRY.ORIGIN.SIGNATURE`: Unix seconds, the origin of the site in base64url (empty for
the server's own page), and HMAC-SHA-256 of both.
"""

import base64
import hmac

CONTEXT = b"ico3d page token\n"
LONGEST = 1000  # characters


def sign(key: str, origin: str, expires: int) -> str:
    """A token for the pages of a site.

    Args:
        key: Secret of the server.
        origin: Origin of the site; empty for the server's own page.
        expires: Unix time in seconds from which on the token no longer admits.
    """
    payload = f"{expires}.{_text(origin.encode())}"
    digest = hmac.digest(key.encode(), CONTEXT + payload.encode(), "sha256")
    return f"{payload}.{_text(digest)}"


def is_valid(token: str, key: str, origin: str, now: float) -> bool:
    """Whether a token was signed with `key` for `origin` and has not expired.

    The time that this takes does not depend on how much of the signature is right.

    Args:
        token: What a page sent.
        key: Secret of the server.
        origin: Origin of the page; empty for the server's own.
        now: Unix time in seconds.
    """
    expires = token.partition(".")[0]
    if not token.isascii() or not expires.isdecimal() or len(token) > LONGEST:
        return False
    expected = sign(key, origin, int(expires))
    return hmac.compare_digest(expected.encode(), token.encode()) and now < int(expires)


def _text(data: bytes) -> str:
    return base64.urlsafe_b64encode(data).rstrip(b"=").decode()
