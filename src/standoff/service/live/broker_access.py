"""From the settings of a broker to where it is and who asks."""

from __future__ import annotations

from standoff.config import BrokerSettings
from standoff.service.live.broker import BrokerAccess


def broker_access(settings: BrokerSettings) -> BrokerAccess:
    """Return where a site's broker is, and who asks."""
    return BrokerAccess(
        settings.host,
        settings.port,
        settings.is_secure,
        settings.user,
        "" if settings.password is None else settings.password.value,
        str(settings.ca_file or ""),
        str(settings.cert_file or ""),
        str(settings.key_file or ""),
        is_v5=settings.protocol == "5",
    )
