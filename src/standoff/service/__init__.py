"""Pages on this machine, and a site that is watched live. Needs the extra `serve`; nothing else of standoff does.

`setup` and `review` are pages for one person; `live` are the processes that watch and tell, `status` their page,
`wearable` the reference receiver, `latency` measures how late a stream is. Each page and its server share one contract,
the OpenAPI description of its `app`: a page computes nothing that its server knows.
"""
