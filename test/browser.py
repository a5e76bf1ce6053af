"""A headless Chromium under the test's control, over its DevTools pipe: no driver and no further package is needed."""

from __future__ import annotations

import base64
import json
import os
import select
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome")
SWITCHES = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-dev-shm-usage",
    "--no-first-run", "--disable-extensions", "--disable-component-update", "--remote-debugging-pipe",
)  # fmt: skip

REQUIRED = "SGMS_OBSERVER_REQUIRE_BROWSER"
"""Environment variable with which a missing browser is a failure: without it the tests in a browser skip."""

_PATIENCE = 180.0  # s, on a busy machine

_LOOK = """(() => {
  const seen = (e) => e.getClientRects().length > 0;
  const size = (e) => parseFloat(getComputedStyle(e).fontSize);
  const numbers = (colour) => (colour.match(/[\\d.]+/g) || []).map(Number);
  const luminance = (rgb) => rgb.slice(0, 3).map((c) => c / 255)
    .map((c) => (c <= 0.03928 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4))
    .reduce((sum, c, i) => sum + c * [0.2126, 0.7152, 0.0722][i], 0);
  const behind = (e) => {
    for (let one = e; one; one = one.parentElement) {
      const colour = numbers(getComputedStyle(one).backgroundColor);
      if (colour.length === 3 || colour[3] > 0.5) return colour;
    }
    return [255, 255, 255];
  };
  const contrast = (e, colour) => {
    const [one, other] = [luminance(numbers(colour)), luminance(behind(e))].sort((a, b) => b - a);
    return (one + 0.05) / (other + 0.05);
  };
  const written = [...document.querySelectorAll('h1, h2, h3, p, li, td, th, caption, figcaption, strong, summary')]
    .filter((e) => seen(e) && e.innerText.trim());
  const drawings = [...document.querySelectorAll('figure svg')].filter(seen);
  const labels = drawings.flatMap((d) => [...d.querySelectorAll('text')].map((t) => [t, d]));
  const scale = (d) => d.getBoundingClientRect().width / d.viewBox.baseVal.width;
  return {
    wide: document.scrollingElement.scrollWidth,
    view: document.documentElement.clientWidth,
    text: document.body.innerText.length,
    smallest: Math.min(...written.filter((e) => e.matches('p, li, td, th')).map(size)),
    smallestLabel: Math.min(999, ...labels.map(([t, d]) => size(t) * scale(d))),
    contrast: Math.min(21, ...written.map((e) => contrast(e, getComputedStyle(e).color)),
      ...labels.map(([t]) => contrast(t, getComputedStyle(t).fill))),
    background: luminance(behind(document.body)),
    images: [...document.images]
      .map((i) => [i.getAttribute('src').slice(0, 60), i.complete ? i.naturalWidth : 0, i.alt])
      .concat(drawings.map((d) => ['svg', d.getBoundingClientRect().width, d.getAttribute('aria-label')])),
    culprits: [...document.body.querySelectorAll('*')].filter((e) => seen(e) && e.getBoundingClientRect().right >
      document.documentElement.clientWidth + 1).slice(0, 5).map((e) => e.tagName + '.' + e.className),
  };
})()"""


@dataclass(frozen=True)
class View:
    """What a page looked like at one width.

    Attributes:
        width: width of the view [px].
        page_width: width of the page, larger if it scrolls sideways [px].
        text_length: letters of text on it.
        smallest_text: size of its smallest text [px].
        smallest_label: size of the smallest text of its drawings [px].
        contrast: least contrast of any text against what lies behind it, from 1 to 21 (WCAG 2.1).
        background: luminance of the page behind the text, from 0 to 1.
        images: source, width [px] (0 if not drawn) and description of each picture that shows.
        culprits: some elements that stick out.
        complaints: errors and warnings of the console, exceptions, and requests that failed.
        requests: addresses the page asked for, itself and data included in it excepted.
    """

    width: int
    page_width: int
    text_length: int
    smallest_text: float
    smallest_label: float
    contrast: float
    background: float
    images: tuple[tuple[str, int, str], ...]
    culprits: tuple[str, ...]
    complaints: tuple[str, ...]
    requests: tuple[str, ...]


def executable() -> str | None:
    """Return the path of a Chromium on this machine, or None."""
    return next((found for name in NAMES if (found := shutil.which(name))), None)


def require_browser() -> None:
    """Skip the test where no Chromium is installed, or fail it where ``REQUIRED`` is set."""
    if executable() is None:
        sentence = f"no browser: none of {', '.join(NAMES)} is installed"
        if os.environ.get(REQUIRED):
            pytest.fail(f"{sentence}, and {REQUIRED} is set")
        pytest.skip(sentence)


class Browser:
    """One Chromium process; use it in a ``with`` statement."""

    def __enter__(self) -> Browser:
        program = executable()
        assert program is not None
        self._profile = tempfile.mkdtemp(prefix="sgms_browser_")
        to_read, self._to = os.pipe()
        self._from, to_write = os.pipe()

        def place_pipes() -> None:
            first, second = os.dup(to_read), os.dup(to_write)
            os.dup2(first, 3)
            os.dup2(second, 4)

        self._process = subprocess.Popen(
            [program, *SWITCHES, f"--user-data-dir={self._profile}"],
            preexec_fn=place_pipes, pass_fds=(3, 4),
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(to_read)
        os.close(to_write)
        self._number = 0
        self._buffer = b""
        self._events: list[dict[str, Any]] = []
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self._call("Browser.close")
            self._process.wait(10.0)
        except (OSError, TimeoutError, subprocess.TimeoutExpired):
            self._process.kill()
            self._process.wait()
        os.close(self._to)
        os.close(self._from)
        shutil.rmtree(self._profile, ignore_errors=True)

    def look(self, page: Path, sights: Sequence[tuple[int, str, str]]) -> tuple[View, ...]:
        """Open a page once and return what it looks like at several widths.

        Args:
            page: HTML file.
            sights: width of the view [px], media, which is ``print`` for the page as it is printed, and the colours the
                reader prefers, ``light`` or ``dark``.
        """
        with self._tab("Page", "Runtime", "Log", "Network") as session:
            self._resize(session, *sights[0])
            self._navigate(session, page)
            found = []
            for sight in sights:
                self._resize(session, *sight)
                found.append(self._evaluate(session))
            addresses = self._all("Network.requestWillBeSent", "request", "url")
            requests = tuple(url for url in addresses if url != page.resolve().as_uri() and not url.startswith("data:"))
            complaints = self._complaints()
        return tuple(
            View(
                looks["view"], looks["wide"], looks["text"], looks["smallest"] or 0.0, looks["smallestLabel"],
                looks["contrast"], looks["background"],
                tuple((source, drawn, alt) for source, drawn, alt in looks["images"]), tuple(looks["culprits"]),
                complaints, requests,
            )
            for looks in found
        )  # fmt: skip

    def press(
        self, page: Path, keys: Sequence[str], expressions: Sequence[str], width: int = 1200, media: str = ""
    ) -> list[Any]:
        """Open a page, press keys one after the other, and return what expressions say at the start and after each.

        Args:
            page: HTML file.
            keys: names as the DevTools protocol has them: ``Tab``, ``Enter``, ``ArrowRight``, ``+``.
            expressions: JavaScript; their values are one list for each moment.
            width: of the view [px].
            media: ``print`` for the page as it is printed.

        Returns:
            One entry for each moment, and at the end the complaints of the console.
        """
        with self._tab("Page", "Runtime", "Log", "Network") as session:
            self._resize(session, width, media, "light")
            self._navigate(session, page)
            script = f"[{', '.join(expressions)}]"
            found = [self._value(session, script)]
            for key in keys:
                text = {"Enter": "\r", " ": " "}.get(key, key if len(key) == 1 else "")
                code = {"Tab": 9, "Enter": 13, " ": 32}.get(key, 0)
                pressed = {"key": key, "windowsVirtualKeyCode": code, **({"text": text} if text else {})}
                self._call("Input.dispatchKeyEvent", session, type="keyDown" if text else "rawKeyDown", **pressed)
                self._call("Input.dispatchKeyEvent", session, type="keyUp", key=key, windowsVirtualKeyCode=code)
                found.append(self._value(session, script))
            return [*found, self._complaints()]

    def print(self, page: Path) -> bytes:
        """Return a page as the PDF that printing it on A4 gives.

        Args:
            page: HTML file.
        """
        with self._tab("Page") as session:
            self._navigate(session, page)
            answer = self._call("Page.printToPDF", session, paperWidth=8.27, paperHeight=11.69, printBackground=True)
        return base64.b64decode(answer["data"])

    @contextmanager
    def _tab(self, *domains: str) -> Iterator[str]:
        """Open a tab for the block and give its session, with the events of these domains."""
        target = self._call("Target.createTarget", url="about:blank")["targetId"]
        session: str = self._call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in domains:
            self._call(f"{domain}.enable", session)
        self._events.clear()
        yield session
        self._call("Target.closeTarget", targetId=target)

    def _navigate(self, session: str, page: Path) -> None:
        self._call("Page.navigate", session, url=page.resolve().as_uri())
        self._wait_for("Page.loadEventFired")
        # The event may have been the empty tab's own, which came late.
        end = time.monotonic() + _PATIENCE
        ready = "document.readyState === 'complete' && location.protocol === 'file:'"
        while not self._call("Runtime.evaluate", session, expression=ready, returnByValue=True)["result"]["value"]:
            assert time.monotonic() < end, f"{page} was not loaded in {_PATIENCE:g} s"
            time.sleep(0.02)

    def _resize(self, session: str, width: int, media: str, scheme: str) -> None:
        size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
        self._call("Emulation.setDeviceMetricsOverride", session, **size)
        preferred = [{"name": "prefers-color-scheme", "value": scheme}]
        self._call("Emulation.setEmulatedMedia", session, media=media, features=preferred)

    def _evaluate(self, session: str) -> dict[str, Any]:
        looks: dict[str, Any] = self._value(session, _LOOK)
        return looks

    def _value(self, session: str, script: str) -> Any:
        """Return the value of a script, once what was changed has been drawn."""
        drawn = f"new Promise(done => requestAnimationFrame(() => setTimeout(() => done({script}))))"
        answer = self._call("Runtime.evaluate", session, expression=drawn, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"]["value"]

    def _complaints(self) -> tuple[str, ...]:
        logs = [
            event["params"]["entry"]["text"]
            for event in self._events
            if event["method"] == "Log.entryAdded" and event["params"]["entry"]["level"] in ("error", "warning")
        ]
        calls = [
            json.dumps(event["params"]["args"])
            for event in self._events
            if event["method"] == "Runtime.consoleAPICalled"
            and event["params"]["type"] in ("error", "warning", "assert")
        ]
        thrown = self._all("Runtime.exceptionThrown", "exceptionDetails", "text")
        failed = self._all("Network.loadingFailed", "errorText")
        return (*logs, *calls, *thrown, *failed)

    def _all(self, method: str, *keys: str) -> list[str]:
        """Return one parameter of every event of a kind."""
        found = []
        for event in self._events:
            if event["method"] == method:
                value = event["params"]
                for key in keys:
                    value = value[key]
                found.append(str(value))
        return found

    def _wait_for(self, method: str) -> None:
        deadline = time.monotonic() + _PATIENCE
        while not any(event["method"] == method for event in self._events):
            self._events.append(self._receive(deadline))

    def _call(self, method: str, session: str = "", **parameters: Any) -> dict[str, Any]:
        """Call a method of the DevTools protocol and return its result."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if session:
            message["sessionId"] = session
        os.write(self._to, json.dumps(message).encode() + b"\0")
        deadline = time.monotonic() + _PATIENCE
        while True:
            answer = self._receive(deadline)
            if answer.get("id") == self._number:
                assert "error" not in answer, (method, answer)
                result: dict[str, Any] = answer["result"]
                return result
            if "method" in answer:
                self._events.append(answer)

    def _receive(self, deadline: float) -> dict[str, Any]:
        while b"\0" not in self._buffer:
            ready: Sequence[int] = select.select([self._from], [], [], max(0.0, deadline - time.monotonic()))[0]
            if not ready:
                raise TimeoutError(f"Chromium said nothing for {_PATIENCE:g} s")
            piece = os.read(self._from, 1 << 20)
            if not piece:
                raise OSError("Chromium ended")
            self._buffer += piece
        message, _, self._buffer = self._buffer.partition(b"\0")
        answer: dict[str, Any] = json.loads(message)
        return answer
