"""One Settings tree, and the stages that it describes.

Every stage's own settings are a plain dataclass beside the stage; this package is the only one that knows pydantic,
which checks their bounds.
"""

from standoff.config.build import (
    build_ground,
    build_marker_observer,
    build_replacement,
    build_stage,
    build_watcher,
    build_zones,
    import_factory,
    site_origin,
)
from standoff.config.live import (
    AlertSettings,
    BrokerSettings,
    CaptureSettings,
    LiveSettings,
    NotifySettings,
    ReceiverSettings,
    ShiftSettings,
)
from standoff.config.load import (
    anchor_paths,
    load_settings,
    named_files,
    read_settings_file,
    recorded_settings,
    resolved,
    settings_from,
)
from standoff.config.markers import MarkerSettings
from standoff.config.params import read_params
from standoff.config.secret import Secret, read_secret
from standoff.config.settings import (
    STAGE_NAMES,
    GroundSettings,
    ReferenceSettings,
    Replacement,
    Settings,
)
from standoff.config.site import SiteSettings, StreamSettings, broker_settings, is_site, load_site

__all__ = [
    "STAGE_NAMES",
    "AlertSettings",
    "BrokerSettings",
    "CaptureSettings",
    "GroundSettings",
    "LiveSettings",
    "MarkerSettings",
    "NotifySettings",
    "ReceiverSettings",
    "ReferenceSettings",
    "Replacement",
    "Secret",
    "Settings",
    "ShiftSettings",
    "SiteSettings",
    "StreamSettings",
    "anchor_paths",
    "broker_settings",
    "build_ground",
    "build_marker_observer",
    "build_replacement",
    "build_stage",
    "build_watcher",
    "build_zones",
    "import_factory",
    "is_site",
    "load_settings",
    "load_site",
    "named_files",
    "read_params",
    "read_secret",
    "read_settings_file",
    "recorded_settings",
    "resolved",
    "settings_from",
    "site_origin",
]
