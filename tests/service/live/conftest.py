"""Debian's Python runs the RTSP server, with modules that this one does not have: it is no place of doctests."""

collect_ignore = ["rtsp_server.py"]
