"""Links between the pages of the documentation lead to pages and headings that are there."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = [
    *sorted(ROOT.glob("*.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
    *sorted((ROOT / "examples").glob("*.md")),
    ROOT / "viewer" / "README.md",
]
SOURCES = ("src/**/*.py", "viewer/src/**/*.ts", "bench/*.py", "tests/**/*.py", "*.toml", "Makefile")
NAMED = re.compile(r"docs/[\w./-]*?\.md(?:#[\w-]+)?")
MOST = 15
"""Loose files in a folder of the documentation."""
LINK = re.compile(r"\]\(((?!https?:)[^)\s]+)\)")
HEADING = re.compile(r"^#+ (.*)$", re.MULTILINE)


def slugs(page):
    """What the headings of a page are called in links."""
    headings = HEADING.findall(page.read_text("utf-8"))
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page):
    for target in LINK.findall(page.read_text("utf-8")):
        file, _, heading = target.partition("#")
        other = page.parent / file if file else page
        assert other.exists(), f"{page.name} links {target}"
        assert not heading or heading in slugs(other), f"{page.name} links {target}"


def test_sources_and_errors_name_pages_that_are_there():
    named = [
        (file.relative_to(ROOT), name)
        for pattern in SOURCES
        for file in ROOT.glob(pattern)
        for name in NAMED.findall(file.read_text("utf-8"))
    ]
    assert len(named) > 20, "the pattern finds nothing any more"
    for file, name in named:
        page, _, heading = name.partition("#")
        assert (ROOT / page).is_file(), f"{file} names {name}"
        assert not heading or heading in slugs(ROOT / page), f"{file} names {name}"


def test_folders_of_the_documentation_are_small():
    for folder in (ROOT / "docs", *(p for p in (ROOT / "docs").rglob("*") if p.is_dir())):
        loose = [file.name for file in folder.iterdir() if file.is_file()]
        assert len(loose) <= MOST, f"{folder.name} holds {len(loose)} files"
