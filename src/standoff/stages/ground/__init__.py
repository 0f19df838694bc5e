"""Where a pixel becomes a metre: the map from the picture to the ground."""

from standoff.stages.ground.boards import BoardView, check_square, find_corners, read_boards
from standoff.stages.ground.calibration import CalibrationResult, calibrate, calibrate_views
from standoff.stages.ground.camera_file import load_camera, save_camera
from standoff.stages.ground.edges import Edges, canny, sobel_gradients
from standoff.stages.ground.fixed_camera import FixedCamera
from standoff.stages.ground.fused_ground import FusedGround
from standoff.stages.ground.lines import line_through, ransac_contours, sample_pairs
from standoff.stages.ground.marker_family import MARKER_FAMILIES, MarkerFamily, marker_pattern
from standoff.stages.ground.marker_observer import MarkerObserver
from standoff.stages.ground.marker_place import MarkerPlace
from standoff.stages.ground.markers import Markers, find_markers
from standoff.stages.ground.observation import PointObservation
from standoff.stages.ground.outline import OutlineFinder
from standoff.stages.ground.params import FusedParams, ReferenceMethod, ReferenceParams
from standoff.stages.ground.point_fit import belief_from_points, fit_points
from standoff.stages.ground.pose_map import map_from_view
from standoff.stages.ground.quadrilateral import Quadrilateral
from standoff.stages.ground.reference import ReferenceGround, rectified_scale_m_per_px
from standoff.stages.ground.reference_box import GivenPlace
from standoff.stages.ground.scale_watch import ScaleWatch
from standoff.stages.ground.shape import ReferenceShape
from standoff.stages.ground.size_scale import scale_from_sizes, unit_hint
from standoff.stages.ground.sizes import SizesEstimator
from standoff.stages.ground.solid_fit import Belief
from standoff.stages.ground.solid_observer import Reference
from standoff.stages.ground.survey_file import load_survey
from standoff.stages.ground.surveyed_ground import SurveyedGround
from standoff.stages.ground.telemetry_pose import TelemetryPose, view_from_telemetry
from standoff.stages.ground.unmapped import Unmapped

__all__ = [
    "MARKER_FAMILIES",
    "Belief",
    "BoardView",
    "CalibrationResult",
    "Edges",
    "FixedCamera",
    "FusedGround",
    "FusedParams",
    "GivenPlace",
    "MarkerFamily",
    "MarkerObserver",
    "MarkerPlace",
    "Markers",
    "OutlineFinder",
    "PointObservation",
    "Quadrilateral",
    "Reference",
    "ReferenceGround",
    "ReferenceMethod",
    "ReferenceParams",
    "ReferenceShape",
    "ScaleWatch",
    "SizesEstimator",
    "SurveyedGround",
    "TelemetryPose",
    "Unmapped",
    "belief_from_points",
    "calibrate",
    "calibrate_views",
    "canny",
    "check_square",
    "find_corners",
    "find_markers",
    "fit_points",
    "line_through",
    "load_camera",
    "load_survey",
    "map_from_view",
    "marker_pattern",
    "ransac_contours",
    "read_boards",
    "rectified_scale_m_per_px",
    "sample_pairs",
    "save_camera",
    "scale_from_sizes",
    "sobel_gradients",
    "unit_hint",
    "view_from_telemetry",
]
