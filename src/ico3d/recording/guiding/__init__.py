"""Looks at a camera's pictures while somebody records, and at each part when it is done."""
