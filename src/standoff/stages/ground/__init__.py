"""Where a pixel becomes a metre: the map from the picture to the ground."""

from standoff.stages.ground.boards import BoardView, find_corners, read_boards
from standoff.stages.ground.calibration import CalibrationResult, calibrate, calibrate_views
from standoff.stages.ground.camera_file import load_camera, save_camera
from standoff.stages.ground.fixed_camera import FixedCamera
from standoff.stages.ground.fused import FusedGround
from standoff.stages.ground.marker_family import MARKER_FAMILIES, MarkerFamily, marker_pattern
from standoff.stages.ground.marker_observer import MarkerObserver
from standoff.stages.ground.marker_place import MarkerPlace
from standoff.stages.ground.markers import Markers, find_markers
from standoff.stages.ground.observation import PointObservation
from standoff.stages.ground.params import FusedParams, ReferenceParams
from standoff.stages.ground.point_fit import belief_from_points, fit_points
from standoff.stages.ground.pose_map import map_from_view
from standoff.stages.ground.reference import ReferenceGround
from standoff.stages.ground.scale_watch import ScaleWatch
from standoff.stages.ground.shape import ReferenceShape
from standoff.stages.ground.solid_observer import Reference
from standoff.stages.ground.survey_file import load_survey
from standoff.stages.ground.surveyed import SurveyedGround
from standoff.stages.ground.telemetry_pose import TelemetryPose, view_from_telemetry
from standoff.stages.ground.unmapped import Unmapped
from standoff.stages.ground.where import GivenPlace

__all__ = [
    "MARKER_FAMILIES",
    "BoardView",
    "CalibrationResult",
    "FixedCamera",
    "FusedGround",
    "FusedParams",
    "GivenPlace",
    "MarkerFamily",
    "MarkerObserver",
    "MarkerPlace",
    "Markers",
    "PointObservation",
    "Reference",
    "ReferenceGround",
    "ReferenceParams",
    "ReferenceShape",
    "ScaleWatch",
    "SurveyedGround",
    "TelemetryPose",
    "Unmapped",
    "belief_from_points",
    "calibrate",
    "calibrate_views",
    "find_corners",
    "find_markers",
    "fit_points",
    "load_camera",
    "load_survey",
    "map_from_view",
    "marker_pattern",
    "read_boards",
    "save_camera",
    "view_from_telemetry",
]
