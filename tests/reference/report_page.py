"""Reads a report page back: its elements, and the data that its script unpacks."""

from __future__ import annotations

import gzip
import json
import re
from base64 import b64decode
from html.parser import HTMLParser

from navfuse.report.packing import unpack

ELEMENTS_WITHOUT_END = {"meta", "input", "br", "img", "link"}


class Page(HTMLParser):
    """Elements, attributes and texts of a page, with a check that what opens also closes."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.elements, self.texts, self.open = [], [], []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag not in ELEMENTS_WITHOUT_END:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] not in ("script", "style"):
            self.texts.append(data)

    def all(self, tag):
        return [attributes for name, attributes in self.elements if name == tag]


def packed(text, identity):
    """What the page unpacks in the browser."""
    content = re.search(rf'<script id="{identity}" type="application/gzip">([^<]*)</script>', text)
    return gzip.decompress(b64decode(content[1]))


def data_of(text):
    """The page's data, arrays unpacked."""
    block = packed(text, "numbers")

    def plain(node):
        if isinstance(node, list):
            return [plain(entry) for entry in node]
        if not isinstance(node, dict):
            return node
        return unpack(node, block) if "planes" in node else {key: plain(entry) for key, entry in node.items()}

    return plain(json.loads(packed(text, "data")))


def panels(text):
    return {panel["title"]: panel for panel in data_of(text)["panels"]}


def curve(text, title, row, name):
    return next(found for found in panels(text)[title]["rows"][row]["curves"] if found["name"] == name)


def explained(text):
    """Title and reason of every panel that is not drawn."""
    return dict(re.findall(r'<div class="empty"><h3>(.*?)</h3><p>Not shown: (.*?)</p></div>', text, re.S))
