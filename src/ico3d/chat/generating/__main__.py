"""Writes all files that are generated from the messages: `python -m ico3d.chat.generating`."""

from ico3d.chat.generating import reference, server_fields, shared, typescript

for target, text in (
    (typescript.TARGET, typescript.typescript()),
    (server_fields.TARGET, server_fields.typescript()),
    (shared.TARGET, shared.typescript()),
    (reference.TARGET, reference.markdown()),
):
    target.write_text(text, encoding="utf-8")
    print(f"wrote {target}")
