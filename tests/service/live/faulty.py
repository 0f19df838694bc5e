"""Senders that do not send: silent ones, slow ones, and one that says yes to everything and shows nothing."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress

SDP = b"".join(
    line + b"\r\n"
    for line in (
        b"v=0", b"o=- 1 1 IN IP4 127.0.0.1", b"s=x", b"t=0 0",
        b"m=video 0 RTP/AVP 96", b"a=rtpmap:96 H264/90000", b"a=control:s0",
    )
)  # fmt: skip

Behaviour = Callable[[socket.socket], None]


def silent(connection: socket.socket) -> None:
    """Take the connection and say nothing."""
    connection.settimeout(60.0)
    while connection.recv(4096):
        pass


def drip(connection: socket.socket) -> None:
    """Answer a letter a second."""
    for letter in b"RTSP/1.0 200 OK\r\nCSeq: 1\r\nPublic: OPTIONS, DESCRIBE, SETUP, PLAY\r\n\r\n":
        connection.sendall(bytes([letter]))
        time.sleep(1.0)


def no_pictures(connection: socket.socket) -> None:
    """Be an RTSP server to the letter, and never send a picture."""
    file = connection.makefile("rwb")
    while line := file.readline():
        method, sequence, more = line.split()[0].decode(), "1", b""
        while (header := file.readline()).strip():
            name, _, value = header.decode().partition(":")
            sequence = value.strip() if name.lower() == "cseq" else sequence
        lines = [f"CSeq: {sequence}", "Session: 1"]
        if method == "OPTIONS":
            lines.append("Public: OPTIONS, DESCRIBE, SETUP, PLAY")
        elif method == "DESCRIBE":
            more = SDP
            lines += ["Content-Type: application/sdp", f"Content-Length: {len(more)}"]
        elif method == "SETUP":
            lines.append("Transport: RTP/AVP/TCP;unicast;interleaved=0-1")
        file.write(("\r\n".join(["RTSP/1.0 200 OK", *lines]) + "\r\n\r\n").encode() + more)
        file.flush()


@contextmanager
def faulty_server(port: int, behaviour: Behaviour) -> Generator[None, None, None]:
    """Listen on a port, and behave so to everybody who comes."""
    listening = socket.socket()
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    listening.bind(("127.0.0.1", port))
    listening.listen(16)
    held: list[socket.socket] = []

    def behave(connection: socket.socket) -> None:
        with suppress(OSError):
            behaviour(connection)

    def serve() -> None:
        while True:
            try:
                connection, _ = listening.accept()
            except OSError:
                return
            held.append(connection)
            threading.Thread(target=behave, args=(connection,), daemon=True).start()

    threading.Thread(target=serve, daemon=True).start()
    try:
        yield
    finally:
        # Closing alone does not wake who waits in accept.
        listening.shutdown(socket.SHUT_RDWR)
        listening.close()
        for connection in held:
            connection.close()
