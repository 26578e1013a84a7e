"""Writes all files that are generated from the messages: `python -m ico3d.chat.generating`."""

from ico3d.chat.generating import fields, reference, shared, typescript

for target, text in (
    (typescript.TARGET, typescript.typescript()),
    (fields.TARGET, fields.typescript()),
    (shared.TARGET, shared.typescript()),
    (reference.TARGET, reference.markdown()),
):
    target.write_text(text, encoding="utf-8")
    print(f"wrote {target}")
