"""An RTSP server that passes on H.264 from its standard input. For Debian's Python, which has GStreamer.

Each coded picture comes as four bytes of its length, one that tells whether it is a key frame, and itself (Annex B).
As a camera does, it sends to who is there, from the next key frame on; what comes while nobody is there is gone. The
RTP time of a picture is when it came.
"""

from __future__ import annotations

import os
import struct
import sys
import threading
from typing import Any

import gi

gi.require_version("Gst", "1.0")
gi.require_version("GstRtspServer", "1.0")
from gi.repository import GLib, Gst, GstRtspServer  # noqa: E402

PIPELINE = (
    "( appsrc name=camera is-live=true do-timestamp=true format=time block=false max-bytes=20000000 "
    "caps=video/x-h264,stream-format=byte-stream,alignment=au ! h264parse ! "
    "rtph264pay name=pay0 pt=96 config-interval=-1 )"
)


class Relay:
    """Hands pictures to whatever pipeline there is."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._appsrc: Any = None
        self._is_whole = False

    def configured(self, _factory: object, media: Any) -> None:
        with self._lock:
            self._appsrc, self._is_whole = media.get_element().get_by_name("camera"), False
        media.connect("unprepared", self._ended)

    def _ended(self, _media: object) -> None:
        with self._lock:
            self._appsrc = None

    def run(self) -> None:
        stdin = sys.stdin.buffer
        while head := stdin.read(5):
            length, is_key = struct.unpack(">IB", head)
            data = stdin.read(length)
            with self._lock:
                self._is_whole = self._is_whole or bool(is_key)
                if self._appsrc is not None and self._is_whole:
                    self._appsrc.emit("push-buffer", Gst.Buffer.new_wrapped(data))
        os._exit(0)


def main() -> None:
    port, path, user, password = sys.argv[1:5]
    Gst.init(None)
    server = GstRtspServer.RTSPServer()
    server.set_address("127.0.0.1")
    server.set_service(port)
    factory = GstRtspServer.RTSPMediaFactory()
    factory.set_launch(PIPELINE)
    factory.set_shared(True)
    factory.set_latency(0)
    relay = Relay()
    factory.connect("media-configure", relay.configured)
    if user:
        auth = GstRtspServer.RTSPAuth()
        token = GstRtspServer.RTSPToken()
        token.set_string("media.factory.role", "viewer")
        auth.add_basic(GstRtspServer.RTSPAuth.make_basic(user, password), token)
        server.set_auth(auth)
        permissions = GstRtspServer.RTSPPermissions()
        permissions.add_permission_for_role("viewer", "media.factory.access", True)
        permissions.add_permission_for_role("viewer", "media.factory.construct", True)
        factory.set_permissions(permissions)
    server.get_mount_points().add_factory(path, factory)
    if not server.attach(None):
        sys.exit("the port is taken")
    threading.Thread(target=relay.run, daemon=True).start()
    GLib.MainLoop().run()


if __name__ == "__main__":
    main()
