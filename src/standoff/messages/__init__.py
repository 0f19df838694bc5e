"""What a live site sends and is sent: CloudEvents in JSON on MQTT topics, and small messages of devices.

>>> from standoff.messages import Acknowledgement, read_message
>>> read_message(b'{"hazard_id": "01J"}', Acknowledgement)
Acknowledgement(hazard_id='01J')
"""

from standoff.messages.device import Acknowledgement, DevicePosition, Echo
from standoff.messages.envelope import CONTENT_TYPE, EVENT_TYPES, Unreadable, event_text, read_event, read_message
from standoff.messages.events import Alert, HazardNews, HealthNews, Heartbeat, Supervision, Timing, WatchedZone
from standoff.messages.topics import DeviceTopics, Topics

__all__ = [
    "CONTENT_TYPE",
    "EVENT_TYPES",
    "Acknowledgement",
    "Alert",
    "DevicePosition",
    "DeviceTopics",
    "Echo",
    "HazardNews",
    "HealthNews",
    "Heartbeat",
    "Supervision",
    "Timing",
    "Topics",
    "Unreadable",
    "WatchedZone",
    "event_text",
    "read_event",
    "read_message",
]
