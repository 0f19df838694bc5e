"""A heartbeat: what the newest frame of a stream has shown, told once a second."""

from __future__ import annotations

import math

from standoff.messages import Heartbeat
from standoff.service.live.sighting import Sighting


def heartbeat_of(sighting: Sighting, site: str, sequence: int) -> Heartbeat:
    """Return what a frame that was watched to its end says.

    Args:
        sighting: Of the frame.
        site: Name of the site.
        sequence: How many heartbeats the stream has had before.
    """
    share = sighting.watched.share
    return Heartbeat(
        site=site,
        stream=sighting.stream,
        session=sighting.session,
        sequence=sequence,
        frame=sighting.frame,
        time_s=sighting.time_s,
        measured=bool(sighting.ground),
        reason="" if sighting.ground else getattr(sighting.ground, "reason", ""),
        watched_share=None if math.isnan(share) else round(share, 3),
        unwatched={reason: round(part, 3) for reason, part in sighting.watched.unwatched.items()},
        zones=sighting.zones,
        delay=sighting.delay,
        open_hazards=sighting.open_hazards,
    )
