"""Checks the links between the pages of a site: check_links.py FOLDER."""

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class Page(HTMLParser):
    """The links and anchors of a page."""

    def __init__(self, path):
        super().__init__()
        self.links, self.anchors = [], set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.anchors |= {attributes.get("id"), attributes.get("name")}
        self.links += [attributes[key] for key in ("href", "src") if attributes.get(key)]


site = Path(sys.argv[1]).resolve()
# print.html holds all pages at once, with their links as they were.
pages = {path: Page(path) for path in sorted(site.rglob("*.html")) if path.name not in ("print.html", "404.html")}
broken, count = [], 0
for path, page in pages.items():
    for link in page.links:
        parts = urlsplit(link)
        if parts.scheme or parts.netloc:
            continue
        count += 1
        target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
        target = target / "index.html" if target.is_dir() else target
        anchored = not parts.fragment or target not in pages or unquote(parts.fragment) in pages[target].anchors
        if not (target.is_file() and target.is_relative_to(site) and anchored):
            broken.append(f"{path.relative_to(site)}: {link}")
print(f"{len(pages)} pages, {count} links")
if broken or count < 100:
    sys.exit("links that lead nowhere:\n" + "\n".join(broken) if broken else "too few links: were the pages built?")
