"""On which MQTT topics what is said."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class DeviceTopics:
    """Of one device; it reads the first two and writes the others.

    Attributes:
        alert: Hazards that it tells.
        supervision: Whether its wearer would be warned.
        position: Where it is.
        acknowledgement: That somebody took note of a hazard.
        echo: That it has shown an alert.
    """

    alert: str
    supervision: str
    position: str
    acknowledgement: str
    echo: str


@dataclass(frozen=True, slots=True)
class Topics:
    """Of one site.

    Attributes:
        prefix: Of all its topics.
    """

    prefix: str

    @classmethod
    def of(cls, template: str, site: str) -> Topics:
        """Fill in a template.

        >>> Topics.of("standoff/{site}", "yard").hazard("gate")
        'standoff/yard/stream/gate/hazard'
        """
        return cls(template.replace("{site}", site))

    @property
    def service(self) -> str:
        """Whether the service is there: `online` or `offline`, retained."""
        return f"{self.prefix}/service"

    def hazard(self, stream: str) -> str:
        """Of a stream's hazards."""
        return f"{self.prefix}/stream/{stream}/hazard"

    def health(self, stream: str) -> str:
        """Of a stream's state, retained."""
        return f"{self.prefix}/stream/{stream}/health"

    def heartbeat(self, stream: str) -> str:
        """Of a stream's heartbeats."""
        return f"{self.prefix}/stream/{stream}/heartbeat"

    def zone(self, zone: str) -> str:
        """Of a zone's hazards; signs that MQTT keeps for itself are left out of its name."""
        plain = "".join("-" if sign in "/+#" or sign.isspace() else sign for sign in zone)
        return f"{self.prefix}/zone/{plain}/hazard"

    def device(self, device: str) -> DeviceTopics:
        """Of a device."""
        of_it = f"{self.prefix}/device/{device}"
        return DeviceTopics(*(f"{of_it}/{name}" for name in ("alert", "supervision", "position", "ack", "echo")))

    def device_of(self, topic: str) -> tuple[str, str] | None:
        """Return of which device a topic is, and its last part; None: of none.

        >>> Topics("standoff/yard").device_of("standoff/yard/device/wrist-7/ack")
        ('wrist-7', 'ack')
        """
        start = f"{self.prefix}/device/"
        device, sign, part = topic.removeprefix(start).partition("/")
        return (device, part) if topic.startswith(start) and device and sign and "/" not in part else None
