"""Looks at the built site in Chromium: `python docs/examine.py SITE`. Searches find what is looked for, pages are no wider than a telephone, nothing fails."""

from __future__ import annotations

import shutil
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

#: What people type, and a page that has to be among the first three.
SEARCHES = {
    "two wheels": "tutorials/satellite",
    "CNOT": "tutorials/qubit",
    "keep-out cone": "howto/steering/keep_out",
    "pickle": "howto/clusters",
    "FMU": "reference/c",
    "180 degrees": "howto/half_turns",
    "Kapitza": "tutorials/vibration",
    "not controllable": "howto/steering/no",
}
_FIRST = 3


class _Quiet(SimpleHTTPRequestHandler):
    def log_message(self, format: str, *args: Any) -> None:
        """Nothing is printed for a page that is fetched."""


@contextmanager
def served(site: Path) -> Iterator[str]:
    """The address of the site on this machine."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(_Quiet, directory=str(site)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()


def examine(site: Path, tab: Any, home: str) -> list[str]:
    """What is wrong, a line each."""
    wrong: list[str] = []
    tab.on("pageerror", lambda error: wrong.append(f"{tab.url}: {error}"))
    for words, page in SEARCHES.items():
        tab.goto(f"{home}/search.html?q={words.replace(' ', '+')}")
        tab.wait_for_function(
            "document.querySelector('#search-results p.search-summary')?.textContent.includes('found')"
        )
        links = tab.eval_on_selector_all("#search-results li a", "all => all.map(a => a.getAttribute('href'))")
        if not any(link.startswith(f"{page}.html") for link in links[:_FIRST]):
            wrong.append(f"search for {words!r}: {page} is not among {links[:_FIRST]}")
    tab.set_viewport_size({"width": 320, "height": 700})
    for path in sorted(site.rglob("*.html")):
        name = path.relative_to(site).as_posix()
        if name.startswith(("_static/", "genindex", "search")):
            continue
        tab.goto(f"{home}/{name}")
        wide = tab.evaluate("document.documentElement.scrollWidth")
        if wide > 320:
            wrong.append(f"{name}: {wide} pixels wide on a page of 320")
    return wrong


def main() -> None:
    """Examines the site of the first argument; status 1 where something is wrong."""
    from playwright.sync_api import sync_playwright

    site, chromium = Path(sys.argv[1]), shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        print("no Chromium: the site is not looked at")  # noqa: T201
        return
    with served(site) as home, sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-gpu"])
        wrong = examine(site, browser.new_page(), home)
        browser.close()
    print("\n".join(wrong) or f"site: {len(SEARCHES)} searches find their pages; every page fits a telephone")  # noqa: T201
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
