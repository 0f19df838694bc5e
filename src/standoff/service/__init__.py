"""Pages on this machine: a site set up by looking at it. Needs the extra `serve`; nothing else of standoff does.

Server and page share one contract, the OpenAPI description of `setup.app`: the page computes nothing that the server
knows.
"""
