"""A real browser for tests of pages: Chromium without a window, led through a pipe by its DevTools protocol."""

import contextlib
import fcntl
import json
import os
import shutil
import subprocess

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "chrome"))), None)
FLAGS = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-sync"]
FLAGS += ["--no-first-run", "--disable-component-update", "--disable-extensions", "--remote-debugging-pipe"]
ANSWER_S = 120  # the longest that a page may think


class Page:
    """One open page. Its errors, uncaught ones and those it prints, gather in `errors`."""

    def __init__(self, commands, answers):
        self._commands, self._answers = commands, answers
        self._number = 0
        self._session = None
        self.errors = []

    def call(self, method, **parameters):
        """The result of a command of the protocol."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        self._commands.write(json.dumps(message).encode() + b"\0")
        self._commands.flush()
        while True:
            answer = self._read()
            if answer.get("id") == self._number:
                assert "error" not in answer, (method, answer["error"])
                return answer["result"]
            if answer.get("method") == "Runtime.exceptionThrown":
                self.errors.append(answer["params"]["exceptionDetails"])
            if answer.get("method") == "Runtime.consoleAPICalled" and answer["params"]["type"] == "error":
                self.errors.append(answer["params"]["args"])

    def _read(self):
        text = bytearray()
        while (byte := self._answers.read(1)) != b"\0":
            assert byte, "the browser has gone"
            text += byte
        return json.loads(text)

    def open(self, where, width, height=900, ratio=2, dark=False):
        """Show a file (its path), or what is at an address (text), at this width in CSS pixels."""
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        self.call("Runtime.enable")
        self.resize(width, height, ratio)
        self.colours(dark)
        self.call("Page.navigate", url=where if isinstance(where, str) else where.as_uri())

    def resize(self, width, height=900, ratio=2):
        """Another width, as when a telephone is turned."""
        self.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=ratio, mobile=False
        )

    def colours(self, dark):
        """Light or dark, as the reader prefers."""
        feature = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[feature])

    def value(self, script):
        """What a script says; a promise is waited for."""
        result = self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in result, result["exceptionDetails"]
        return result["result"].get("value")

    def until(self, condition):
        """Wait until a condition of the page holds; AssertionError with it after ANSWER_S."""
        look = f"({condition}) ? done(true) : tries-- > 0 ? setTimeout(look, 10) : done(false)"
        script = f"new Promise((done) => {{ let tries = {100 * ANSWER_S}; (function look() {{ {look} }})() }})"
        assert self.value(script), condition

    def point(self, x, y):
        """Move the mouse there, in CSS pixels of the window."""
        self.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)

    def key(self, name, modifiers=0):
        """Press and release a key."""
        for kind in ("rawKeyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=name, code=name, modifiers=modifiers)


@contextlib.contextmanager
def opened(profile):
    """A browser's first page; `profile` is a folder for what the browser keeps."""
    from_us, to_browser = os.pipe()
    from_browser, to_us = os.pipe()
    ends = [fcntl.fcntl(each, fcntl.F_DUPFD, 10) for each in (from_us, to_us)]  # none of them may be 3 or 4 by chance

    def as_the_protocol_has_it():
        for number, end in enumerate(ends, start=3):
            os.dup2(end, number)

    process = subprocess.Popen(
        [BROWSER, *FLAGS, f"--user-data-dir={profile}", "about:blank"],
        preexec_fn=as_the_protocol_has_it,
        pass_fds=(3, 4),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    for each in ends:
        os.close(each)
    os.close(from_us)
    os.close(to_us)
    with os.fdopen(to_browser, "wb") as commands, os.fdopen(from_browser, "rb") as answers:
        page = Page(commands, answers)
        try:
            yield page
        finally:
            with contextlib.suppress(OSError, AssertionError):
                page._session = None
                page.call("Browser.close")
            try:
                process.wait(timeout=20)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
