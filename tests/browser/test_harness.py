"""The watch that every other test of this folder relies on: what it must not miss."""

from __future__ import annotations

import pytest

QUIET = "<!doctype html><title>t</title><body>{}</body>"
LOUD = {
    "console.warn('w')": ["console warning: w"],
    "console.log('l')": ["console log: l"],
    "setTimeout(() => { throw new Error('boom') })": ["error: boom"],
    "alert('a')": ["dialog: a"],
    "window.open('about:blank')": ["window: about:blank"],
}


def told(visit, path, body):
    path.write_text(QUIET.format(body), encoding="utf-8")
    seen = visit(path)
    seen.page.wait_for_load_state()
    seen.page.wait_for_timeout(200)
    events, seen.events = seen.events, []
    return events


@pytest.mark.parametrize("script", LOUD)
def test_what_a_page_says_is_heard(visit, tmp_path, script):
    assert told(visit, tmp_path / "page.html", f"<script>{script}</script>") == LOUD[script]


def test_every_request_is_seen_and_fails(visit, tmp_path):
    (tmp_path / "beside.js").write_text("window.loaded = 1")
    asking = "<script src=beside.js></script><img src='http://localhost:9/i.png'><script>fetch('https://h.invalid/')</script>"
    events = told(visit, tmp_path / "page.html", asking)
    requests = sorted(event for event in events if event.startswith("request"))
    assert requests == [
        f"request: {(tmp_path / 'beside.js').as_uri()}",
        "request: http://localhost:9/i.png",
        "request: https://h.invalid/",
    ]


def test_a_quiet_page_is_quiet(visit, tmp_path):
    assert told(visit, tmp_path / "page.html", "text") == []


def test_what_is_too_wide_is_named(visit, tmp_path):
    path = tmp_path / "page.html"
    path.write_text(QUIET.format("<p class=wide style='width:3000px'>w"), encoding="utf-8")
    assert visit(path).overflow()[0].startswith("P.wide ")
