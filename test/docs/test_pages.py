"""The documentation builds without a warning, is complete, and reads well in a real browser."""

from __future__ import annotations

import re
from pathlib import Path

import yaml
from browser import Browser
from looks import check

ROOT = Path(__file__).resolve().parents[2]

DOCS = ROOT / "docs"


def _in_nav(entry: object) -> list[str]:
    """Return the pages below an entry of the navigation."""
    if isinstance(entry, str):
        return [entry]
    children = entry.values() if isinstance(entry, dict) else entry
    return [page for child in children for page in _in_nav(child)]  # type: ignore[attr-defined]


def test_every_page_is_in_the_navigation_once() -> None:
    nav = _in_nav(yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))["nav"])
    pages = sorted(path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md"))
    assert sorted(nav) == pages, "add the page to nav in mkdocs.yml"


def test_pages_are_of_four_kinds() -> None:
    nav = yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))["nav"]
    assert [kind for entry in nav for kind in entry] == ["Start", "Tutorial", "How-to", "Reference", "Explanation"]
    assert nav[0] == {"Start": "index.md"}


def test_first_page_leads_to_every_other() -> None:
    door = (DOCS / "index.md").read_text(encoding="utf-8")
    linked = set(re.findall(r"\]\((\w+\.md)", door))
    assert linked == {path.name for path in DOCS.glob("*.md")} - {"index.md"}


def test_pages_build_without_a_warning(site: Path) -> None:
    for page in DOCS.rglob("*.md"):
        assert (site / page.relative_to(DOCS).with_suffix(".html")).exists()


def test_pages_ask_for_nothing_from_a_network(site: Path) -> None:
    for page in site.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        loaded = re.findall(r"<(?:script|img|iframe)[^>]+src=\"([^\"]+)|<link[^>]+href=\"([^\"]+)", text)
        assert not [address for pair in loaded for address in pair if address.startswith(("http:", "https:", "//"))]


def test_search_finds_pages_from_the_disk(site: Path, browser: Browser) -> None:
    """As a reader types: one page first by its title, and a sentence where no page has all the words."""
    links = "[...document.querySelectorAll('#mkdocs-search-results h3 a')]"
    titles = f"{links}.map(link => [link.textContent, link.getAttribute('href')])"
    *found, complaints = browser.press(site / "search.html", list("diagnose a recording"), [titles])
    assert found[0] == [[]] and complaints == ()
    assert found[-1][0][0] == ["Diagnose a recording", "diagnose.html"]
    said = "document.getElementById('mkdocs-search-results').textContent"
    assert browser.press(site / "search.html", list("xyzzy"), [said])[-2] == ["No page has all of these words."]


def test_pages_read_well_in_a_browser(site: Path, browser: Browser) -> None:
    pages = [page for page in sorted(site.rglob("*.html")) if page.name not in ("404.html", "search.html")]
    assert pages
    for page in pages:
        check(browser, page)
    assert browser.print(site / "index.html").startswith(b"%PDF")
