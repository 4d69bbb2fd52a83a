"""A run that is watched: a page on the loopback address shows frames and curves as they come, pauses and stops the run.

Only requests with the token of the run, from the same machine, are answered.
"""

from __future__ import annotations

import _thread
import hmac
import json
import secrets
import signal
import threading
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from typing import Any
from urllib.parse import parse_qs, urlsplit

import numpy as np

from ..interfaces import FrameReport
from ..interfaces.frame import Frame, Surface
from ..output.info import finite_values
from ..output.progress import Progress
from .coarsen import clusters, contracted

HOST = "127.0.0.1"
# Points of the sheet that the page draws, at most about.
POINTS = 20_000
# Seconds between two looks at whether a paused run goes on.
LOOK = 0.1
# The page loads nothing, and nothing may show it inside another one.
HEADERS = {
    "Cache-Control": "no-store", "Referrer-Policy": "no-referrer", "X-Content-Type-Options": "nosniff",
    "Content-Security-Policy": "default-src 'self' 'unsafe-inline' data:; frame-ancestors 'none'",
}  # fmt: skip


class LiveRun(Progress):
    """Reports the progress of a run and receives its frames, for a page; it is reporter and writer of the run.

    Args:
        quiet: Whether to show only the address and notes in the terminal.

    Attributes:
        address: Address of the page, with its token.
    """

    def __init__(self, quiet: bool = False) -> None:
        super().__init__(quiet)
        self._token, self._going = secrets.token_urlsafe(24), threading.Event()
        self._going.set()
        self._over = False
        self._state: dict[str, Any] = {"status": "starting", "progress": 0.0, "when": "", "fields": [], "frame": -1}
        self._rows: list[dict[str, float]] = []
        self._surface: Surface | None = None
        self._frame: Frame | None = None
        self._cluster: np.ndarray | None = None
        self._server = ThreadingHTTPServer((HOST, 0), _handler_of(self))
        self._server.daemon_threads = True
        self.address = f"http://{HOST}:{self._server.server_port}/{self._token}/"
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    # Of the run's thread.

    def shows(self, surface: Surface) -> None:
        """Receive what is common to all frames."""
        points, faces = np.asarray(surface.points), np.asarray(surface.faces)
        if len(faces):
            self._cluster = clusters(points, faces, faces, POINTS)
        self._surface = surface

    def write(self, frame: Frame) -> None:
        """Receive a frame."""
        self._frame = frame
        damage = [] if frame.damage is None else ["damage"]
        self._state |= {"frame": frame.index, "fields": ["displacement", *damage, *frame.point_data]}

    def save(self) -> None:
        """Nothing is kept."""

    def frame(self, report: FrameReport) -> None:
        """Show the progress, and wait while the run is paused."""
        super().frame(report)
        self._rows.append(dict(report.row))
        self._tell(report.fraction, report.when)

    def between(self, fraction: float, when: str, rate: float, left: float) -> None:
        """Likewise, between frames."""
        super().between(fraction, when, rate, left)
        self._tell(fraction, when)

    def residual(self, steps: int, residual: float, tolerance: float, round_of: str) -> None:
        """Likewise, of a static run."""
        super().residual(steps, residual, tolerance, round_of)
        self._tell(self._state["progress"], f"step {steps}, residual {residual:.2e} {round_of}")

    def stops(self) -> None:
        """The user asked to stop, here or in the terminal: a pause ends."""
        self._going.set()

    def close(self) -> None:
        """The run is over; the page is served until `end`."""
        super().close()
        self._over = True
        self._state["status"] = "over: pictures and files are written"

    def end(self) -> None:
        """Serve the page no longer."""
        self._server.shutdown()
        self._server.server_close()

    def _tell(self, fraction: float, when: str) -> None:
        self._state |= {"progress": fraction, "when": when, "status": "running"}
        while not self._going.is_set():
            self._state["status"] = "paused"
            self._going.wait(LOOK)

    # Of the server's threads.

    def answer(self, method: str, path: str, host: str) -> tuple[str, bytes] | None:
        """Type and body of the answer to a request; None for one without the token, or for nothing of the run."""
        known = f"{HOST}:{self._server.server_port}", f"localhost:{self._server.server_port}"
        url = urlsplit(path)
        token, _, what = url.path.removeprefix("/").partition("/")
        # A page of another site may reach this address by a name of its own.
        if host not in known or not hmac.compare_digest(token.encode(), self._token.encode()):
            return None
        if method == "POST" and what in ("pause", "go", "stop"):
            self._going.clear() if what == "pause" else self._going.set()
            # What follows a run is not lost.
            if what == "stop" and not self._over:
                _thread.interrupt_main(signal.SIGINT)
            return "application/json", b"{}"
        asked = {name: values[-1] for name, values in parse_qs(url.query).items()}
        if method == "GET" and what == "":
            return "text/html; charset=utf-8", files(__package__).joinpath("page", "live.html").read_bytes()
        if method == "GET" and what == "state":
            begin = int(asked["from"]) if asked.get("from", "").isdecimal() else 0
            title = "" if self._surface is None else self._surface.title
            told = {**self._state, "title": title, "rows": self._rows[begin:]}
            return "application/json", json.dumps(finite_values(told)).encode()
        if method == "GET" and what == "frame" and self._frame is not None and self._surface is not None:
            return "application/octet-stream", self._drawn(self._surface, self._frame, asked.get("field", ""))
        return None

    def _drawn(self, surface: Surface, frame: Frame, field: str) -> bytes:
        """Numbers of points and triangles, positions [m], values (bodies: none), and corners of the triangles."""
        known = {"damage": frame.damage, **frame.point_data}
        values = np.asarray(frame.displacement if known.get(field) is None else known[field], np.float32)
        values = np.linalg.norm(values, axis=1) if values.ndim == 2 else values
        faces: np.ndarray = frame.faces(surface)
        faces = faces if self._cluster is None else contracted(faces, self._cluster)
        chosen, corners = np.unique(faces, return_inverse=True)
        places, triangles, inks = [frame.positions(surface)[chosen]], [corners.reshape(-1, 3)], [values[chosen]]
        for body, pose in zip(surface.bodies, () if frame.bodies is None else frame.bodies, strict=False):
            if body.kind != "plane":
                triangles.append(np.asarray(body.triangles) + sum(map(len, places)))
                places.append(body.placed(pose))
                inks.append(np.full(len(body.vertices), np.nan))
        number = np.array([sum(map(len, places)), sum(map(len, triangles))], "<i4")
        reals = np.concatenate([*(each.ravel() for each in places), *inks]).astype("<f4")
        return number.tobytes() + reals.tobytes() + np.concatenate(triangles).astype("<i4").tobytes()


def _handler_of(live: LiveRun) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        """Answers requests of the page."""

        def do_GET(self) -> None:
            found = live.answer(self.command, self.path, self.headers.get("Host", ""))
            self.send_response(HTTPStatus.FORBIDDEN if found is None else HTTPStatus.OK)
            kind, body = ("text/plain", b"expected the address that the run printed\n") if found is None else found
            for name, value in {**HEADERS, "Content-Type": kind, "Content-Length": str(len(body))}.items():
                self.send_header(name, value)
            self.end_headers()
            self.wfile.write(body)

        do_POST = do_GET

        def log_message(self, *_: Any) -> None:
            """The token is in the address: nothing is written."""

    return Handler
