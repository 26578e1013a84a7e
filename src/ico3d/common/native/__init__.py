"""Libraries of compiled code: what they print, and what they are kept from reading."""
