"""No places of doctests: Debian's Python runs the RTSP server, and the stepped clock changes its process' time."""

collect_ignore = ["rtsp_server.py", "stepped_clock"]
