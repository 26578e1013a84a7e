"""What whoever comes by a wrong address reads: a page in plain words; programs get JSON."""

import html

from fastapi import Request, Response
from fastapi.exception_handlers import http_exception_handler
from starlette.exceptions import HTTPException
from starlette.responses import HTMLResponse

WORDS = {
    "en": ("There is nothing here", "The address may be mistyped, or old.", "To the start"),
    "de": ("Hier ist nichts", "Die Adresse ist vielleicht vertippt oder alt.", "Zum Anfang"),
    "fr": (
        "Il n’y a rien ici",
        "L’adresse est peut-être mal tapée ou ancienne.",
        "Aller à l’accueil",
    ),
    "es": (
        "Aquí no hay nada",
        "Puede que la dirección esté mal escrita o sea antigua.",
        "Ir al inicio",
    ),
    "zh": ("这里什么也没有", "网址可能输错了，或者已经失效。", "返回首页"),
    "ja": (
        "ここには何もありません",
        "アドレスが間違っているか、古い可能性があります。",
        "最初のページへ",
    ),
}
"""Title, sentence and link in each language of the page (`viewer/src/words/text.ts`)."""
DEEPEST = 16
"""Folders of an address from which the link leads back."""
PAGE = """<!doctype html>
<html lang="{language}">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="dark light">
<link rel="icon" href="data:,">
<title>{title}</title>
<style>
:root {{ --backdrop: #131416; --ink: #f2efeb; --ink-soft: #b9b4ad; --accent: #e0ad82 }}
@media (prefers-color-scheme: light) {{
  :root {{ --backdrop: #f7f4f0; --ink: #1f1d1a; --ink-soft: #57524b; --accent: #9c5a27 }}
}}
body {{ display: grid; place-content: center; min-height: 100dvh; margin: 0; padding: 1rem;
  box-sizing: border-box; background: var(--backdrop); color: var(--ink); text-align: center;
  font: 16px/1.45 system-ui, sans-serif }}
h1 {{ margin: 0; font-size: 1.6rem; font-weight: 600 }}
p {{ margin: .5rem 0; color: var(--ink-soft) }}
a {{ padding: .6rem; color: var(--accent) }}
</style>
<h1>{title}</h1>
<p>{sentence}</p>
<p><a href="{start}">{link}</a></p>
</html>
"""


async def tell_missing(request: Request, error: Exception) -> Response:
    """The answer to an address at which nothing is, in the form that was asked for."""
    assert isinstance(error, HTTPException)
    if wants_page(request.headers.get("accept", "")):
        answer: Response = HTMLResponse(missing_page(request), error.status_code, error.headers)
    else:
        answer = await http_exception_handler(request, error)
    answer.headers.append("Vary", "Accept, Accept-Language")
    return answer


def wants_page(accepted: str) -> bool:
    """Whether an Accept header names pages, as browsers do for what stands in the address bar."""
    return "text/html" in _names(accepted)


def missing_page(request: Request) -> str:
    """The page in the visitor's language."""
    language = language_of(request.headers.get("accept-language", ""))
    title, sentence, link = (html.escape(words) for words in WORDS[language])
    # relative, as a proxy may have put the server in a folder
    start = "../" * min(request.scope["path"].count("/") - 1, DEEPEST) or "./"
    return PAGE.format(language=language, title=title, sentence=sentence, link=link, start=start)


def language_of(accepted: str) -> str:
    """The first known language of an Accept-Language header, which browsers sort; or English."""
    bases = (name.partition("-")[0] for name in _names(accepted))
    return next((base for base in bases if base in WORDS), "en")


def _names(header: str) -> list[str]:
    """What a header lists, without weights."""
    return [part.partition(";")[0].strip().lower() for part in header.split(",")]
