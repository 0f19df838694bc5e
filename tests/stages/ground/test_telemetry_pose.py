from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tolerances import NUMERICAL_DERIVATIVE_REL

from standoff.core.camera import Camera
from standoff.core.pose import View
from standoff.core.telemetry import Telemetry
from standoff.core.types import NoGroundMap
from standoff.stages.frames.flight_log import FlightLog, read_flight_log
from standoff.stages.ground import TelemetryPose, view_from_telemetry
from standoff_sim.camera.flight import drone_camera, make_flight
from standoff_sim.camera.telemetry import write_telemetry
from standoff_sim.clip.presets import FlightStyle

CAMERA = drone_camera(1280, 720, 70.0, np.random.default_rng(0))


def telemetry(**changed: float) -> Telemetry:
    readings = {
        "height_m": 30.0, "height_sigma_m": 1.0, "pitch_deg": 60.0, "pitch_sigma_deg": 0.5, "roll_deg": 1.0,
        "roll_sigma_deg": 0.5, "heading_deg": 40.0, "heading_sigma_deg": 4.0, "latitude_deg": 45.0,
        "longitude_deg": 9.0, "position_sigma_m": 1.5,
    }  # fmt: skip
    return Telemetry(0.0, "test", **{**readings, **changed})


def pose_of(now: Telemetry, first: Telemetry | None = None, camera: Camera = CAMERA) -> TelemetryPose:
    pose = view_from_telemetry(now, camera, first=first)
    assert isinstance(pose, TelemetryPose)
    return pose


@pytest.mark.parametrize("style", ["hover", "pass", "orbit"])
@pytest.mark.parametrize(("seed", "pitch_deg"), [(0, 45.0), (1, 60.0), (2, 88.0), (3, 30.0)])
def test_a_simulated_drones_readings_are_as_wrong_as_they_say(
    tmp_path: Path, style: FlightStyle, seed: int, pitch_deg: float
) -> None:
    rng = np.random.default_rng(seed)
    flight = make_flight(
        rng, style, CAMERA, target_xy_m=np.zeros(2), altitude_m=30.0, pitch_deg=pitch_deg,
        heading_deg=float(rng.uniform(0, 360)), duration_s=8.0,
    )  # fmt: skip
    times_s = np.arange(80) / 10.0
    write_telemetry(tmp_path / "telemetry.srt", flight, times_s, np.random.default_rng(100 + seed))
    log = read_flight_log(tmp_path / "telemetry.srt")
    assert isinstance(log, FlightLog)
    first, true_first = log.at(0.0), flight.view(0.0)
    assert first is not None
    assert first.focal_mm_35 == pytest.approx(CAMERA.matrix[0, 0] / 1280 * 36.0, abs=0.01)
    for time_s in np.arange(0.01, 7.9, 0.71).tolist():
        now, true = log.at(time_s), flight.view(time_s)
        assert now is not None
        pose = pose_of(now, first)
        error = np.empty(6)
        error[:3] = Rotation.from_matrix(true.site_to_camera @ pose.view.site_to_camera.T).as_rotvec()
        error[3:5] = true.position_m[:2] - true_first.position_m[:2] - pose.view.position_m[:2]
        error[5] = true.position_m[2] - pose.view.position_m[2]
        np.testing.assert_array_less(np.abs(error), 3.0 * np.sqrt(np.diag(pose.covariance)))


def test_the_first_reading_is_above_the_origin() -> None:
    pose = pose_of(telemetry())
    np.testing.assert_array_equal(pose.view.position_m, [0.0, 0.0, 30.0])
    expected = View.aimed(CAMERA, np.array([0.0, 0.0, 30.0]), heading_deg=40.0, pitch_deg=60.0, roll_deg=1.0)
    np.testing.assert_allclose(pose.view.site_to_camera, expected.site_to_camera, atol=1e-12)


def test_north_and_east_are_as_long_as_tables_of_wgs84_say() -> None:
    first = telemetry()
    north = pose_of(telemetry(latitude_deg=45.001), first).view.position_m
    east = pose_of(telemetry(longitude_deg=9.001), first).view.position_m
    np.testing.assert_allclose(north, [0.0, 111.132, 30.0], rtol=1e-4, atol=1e-9)
    np.testing.assert_allclose(east, [78.847, 0.0, 30.0], rtol=1e-4, atol=1e-9)


def test_a_degree_beyond_the_date_line_is_near() -> None:
    west = pose_of(telemetry(longitude_deg=-179.9995), telemetry(longitude_deg=179.9995)).view.position_m
    assert west[0] == pytest.approx(78.847, rel=1e-4)


@pytest.mark.parametrize("pitch_deg", [20.0, 60.0, 89.9])
@pytest.mark.parametrize("roll_deg", [-5.0, 0.0, 3.0])
def test_the_rotations_covariance_is_that_of_wrong_angles_and_of_a_sideways_tilt(
    pitch_deg: float, roll_deg: float
) -> None:
    step_deg = 1e-3
    angles = {"heading_deg": 40.0, "pitch_deg": pitch_deg, "roll_deg": roll_deg}
    pose = pose_of(telemetry(**angles))
    turns = [np.array([0.0, np.sin(np.deg2rad(pitch_deg)), 0.0]) * np.deg2rad(0.5)]
    turns[0] = Rotation.from_rotvec([0.0, 0.0, np.deg2rad(-roll_deg)]).apply(turns[0])
    for name, sigma_deg in (("heading_deg", 4.0), ("pitch_deg", 0.5), ("roll_deg", 0.5)):
        more, less = (
            View.aimed(CAMERA, pose.view.position_m, **{**angles, name: angles[name] + sign * step_deg})
            for sign in (1.0, -1.0)
        )
        turn = Rotation.from_matrix(more.site_to_camera @ less.site_to_camera.T).as_rotvec()
        turns.append(turn / (2.0 * step_deg) * sigma_deg)
    expected = sum(np.outer(turn, turn) for turn in turns)
    np.testing.assert_allclose(pose.covariance[:3, :3], expected, rtol=NUMERICAL_DERIVATIVE_REL, atol=1e-9)


@pytest.mark.parametrize("pitch_deg", [0.0, 45.0, 90.0])
def test_no_direction_is_certain(pitch_deg: float) -> None:
    covariance = pose_of(telemetry(pitch_deg=pitch_deg)).covariance
    assert np.linalg.eigvalsh(covariance[3:, 3:]).min() > 0.0
    assert np.sqrt(np.linalg.eigvalsh(covariance[:3, :3]).min()) > np.deg2rad(0.3)


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"roll_deg": np.nan}, "without the camera's angles"),
        ({"height_m": np.nan}, "without a height"),
        ({"height_m": 0.5}, "not above the ground"),
        ({"height_m": -3.0}, "not above the ground"),
        ({"latitude_deg": np.nan, "longitude_deg": np.nan}, "without a place"),
    ],
)
def test_what_is_missing_is_the_reason(changed: dict[str, float], reason: str) -> None:
    pose = view_from_telemetry(telemetry(**changed), CAMERA)
    assert isinstance(pose, NoGroundMap)
    assert reason in pose.reason


@pytest.mark.shared
def test_real_photographs_look_straight_down_from_40_m(shared_data: Path) -> None:
    from standoff.stages.frames.photograph import read_photograph

    paths = sorted((shared_data / "drone_photos").glob("*.JPG"))
    readings = [now for path in paths if (now := read_photograph(path, 0.0).telemetry) is not None]
    camera = Camera(4000, 2250, np.array([[2311.0, 0, 1999.5], [0, 2311.0, 1124.5], [0, 0, 1.0]]), np.zeros(5))
    poses = [pose_of(now, readings[0], camera) for now in readings]
    sides_m = [np.ptp(pose.view.to_plane(np.array([[0.0, 1124.5], [3999.0, 1124.5]])), axis=0) for pose in poses]
    for pose, side_m in zip(poses, sides_m, strict=True):
        assert np.linalg.norm(side_m) == pytest.approx(3999.0 / 2311.0 * pose.view.position_m[2], rel=1e-3)
    # The second was taken 69 m from the first, by the great circle.
    assert np.linalg.norm(poses[1].view.position_m[:2] - poses[0].view.position_m[:2]) == pytest.approx(68.3, abs=1.0)
