"""Nobody but the browser that opened the printed address is answered."""

from __future__ import annotations

import pytest

pytest.importorskip("fastapi", reason="the page's server needs the extra `serve`")

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse
from starlette.routing import Route
from starlette.testclient import TestClient

from standoff.service.access import Access

TOKEN = "a-token-of-this-test"
HERE = "http://127.0.0.1:8123"


def answer(_request: Request) -> PlainTextResponse:
    return PlainTextResponse("the answer")


def client(address: str = HERE) -> TestClient:
    routes = [Route("/", answer, methods=["GET"]), Route("/api", answer, methods=["GET", "POST"])]
    return TestClient(Access(Starlette(routes=routes), TOKEN), base_url=address, follow_redirects=False)


def test_without_the_token_there_is_no_answer_and_with_it_the_cookie_is_enough() -> None:
    browser = client()
    assert browser.get("/api").status_code == 403
    assert browser.get("/?token=another").status_code == 403
    opened = browser.get(f"/?token={TOKEN}")
    assert (opened.status_code, opened.headers["location"]) == (303, "/")
    cookie = opened.headers["set-cookie"].lower()
    assert "httponly" in cookie and "samesite=strict" in cookie and TOKEN not in cookie
    assert browser.get("/").text == browser.get("/api").text == "the answer"


def test_the_token_opens_once() -> None:
    browser = client()
    browser.get(f"/?token={TOKEN}")
    browser.cookies.clear()
    assert browser.get(f"/?token={TOKEN}").status_code == 403
    browser.cookies.set("standoff", "a guess")
    assert browser.get("/api").status_code == 403


@pytest.mark.parametrize("host", ["evil.example", "evil.example:8123", "127.0.0.1.evil.example:8123", ""])
def test_a_name_of_somebody_elses_that_points_here_is_refused(host: str) -> None:
    browser = client()
    browser.get(f"/?token={TOKEN}")
    assert browser.get("/api", headers={"Host": host}).status_code == 403


def test_another_page_cannot_change_anything() -> None:
    browser = client()
    browser.get(f"/?token={TOKEN}")
    assert browser.post("/api", headers={"Origin": "http://evil.example"}).status_code == 403
    assert browser.post("/api", headers={"Origin": "http://127.0.0.1:9999"}).status_code == 403
    assert browser.post("/api", headers={"Origin": HERE}).text == browser.post("/api").text == "the answer"


def test_every_answer_forbids_what_comes_from_elsewhere_and_what_stands_inline() -> None:
    browser = client()
    for reply in (browser.get("/api"), browser.get(f"/?token={TOKEN}"), browser.get("/api")):
        policy = reply.headers["content-security-policy"]
        assert "default-src 'none'" in policy and "unsafe" not in policy and "http" not in policy
        assert reply.headers["x-content-type-options"] == "nosniff"
