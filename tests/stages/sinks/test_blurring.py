"""Nobody who was found can be recognised in a film or report with `blur`, and nothing else changes."""

from __future__ import annotations

import base64
import re
from dataclasses import replace
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import examples
from stages.sinks.fake_site import FakePicture, FakeSite, ended, quiet
from tolerances import ENCODED_LEVELS

from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import CameraMotion, Detections, FrameResult, ImageArray, Outcome, Tracks
from standoff.drawing.text import TextSprites
from standoff.stages.sinks import Composer, DrawParams, ReportParams, ReportSink, ShowParams, VideoParams, VideoSink
from standoff.stages.sinks.birdseye import BirdsEye
from standoff.stages.sinks.blurring import PeopleWatch, blur
from standoff.stages.sinks.collect import RunSummary
from standoff.stages.sinks.frame_measurements import FrameMeasurements
from standoff.stages.sinks.overlay import Overlay
from standoff.stages.sinks.sketch import Sketch

SIZE = (640, 360)
WHOLE = np.array([0.0, 0.0, *SIZE])
BARE = VideoParams(panel=False, draw=DrawParams(labels=False, legend=False, circles=False, fans=False))
WORKER, LOADER = 0, 2


def _noise(size_px: tuple[int, int] = SIZE) -> ImageArray:
    """Return a picture of which every pixel is news."""
    return np.random.default_rng(3).integers(0, 256, (size_px[1], size_px[0], 3), dtype=np.uint8)


_BASE, _NOISY = FakeSite(SIZE).result(0), FakePicture(_noise())


def _detail(picture: ImageArray, within: BoolArray | None = None) -> float:
    """Return the mean difference between neighbours, which noise has much of."""
    steps = np.abs(np.diff(picture.astype(float), axis=1)).mean(axis=2)
    return float(steps[within[:, 1:]].mean() if within is not None else steps.mean())


def _inside(boxes_px: FloatArray, size_px: tuple[int, int] = SIZE) -> BoolArray:
    mask = np.zeros((size_px[1], size_px[0]), dtype=bool)
    for left, top, right, bottom in boxes_px:
        mask[max(0, int(top)) : max(0, int(np.ceil(bottom))), max(0, int(left)) : max(0, int(np.ceil(right)))] = True
    return mask


def _seen(
    time_s: float,
    *,
    tracked: FloatArray | None = None,
    detected: FloatArray | None = None,
    class_id: int = WORKER,
    score: float = 0.12,
    observed: bool = True,
    motion: CameraMotion | None = None,
) -> FrameResult:
    result = _BASE
    of_tracks = np.zeros((0, 4)) if tracked is None else np.atleast_2d(tracked)
    of_detector = np.zeros((0, 4)) if detected is None else np.atleast_2d(detected)
    count, found = len(of_tracks), len(of_detector)
    tracks = Tracks(np.arange(1, count + 1), of_tracks, np.full(count, 0.9), np.full(count, class_id),
                    np.full(count, observed), np.full(count, 1.0))  # fmt: skip
    return replace(
        result,
        frame=replace(result.frame, index=int(time_s * 25), time_s=time_s, picture=_NOISY),
        detections=Detections(of_detector, np.full(found, score), np.full(found, class_id)),
        tracks=tracks,
        positions=result.positions[np.zeros(len(result.positions), dtype=bool)],
        proximities=result.proximities[np.zeros(len(result.proximities), dtype=bool)],
        motion=motion or result.motion,
    )


boxes = st.tuples(
    st.floats(-80, SIZE[0] + 20), st.floats(-80, SIZE[1] + 20), st.floats(0.5, 300), st.floats(0.5, 300)
).map(lambda box: np.array([box[0], box[1], box[0] + box[2], box[1] + box[3]]))


@examples(40)
@given(st.lists(boxes, min_size=1, max_size=4))
def test_outside_of_boxes_no_pixel_changes_and_inside_only_blocks_are_left(given_px: list[FloatArray]) -> None:
    before = _noise()
    after = before.copy()
    blur(after, np.array(given_px), WHOLE)
    inside = _inside(np.array(given_px))
    np.testing.assert_array_equal(after[~inside], before[~inside])
    # The last box is whole: a mosaic has no more colours than blocks.
    left, top, right, bottom = (int(v) for v in (*np.floor(given_px[-1][:2]), *np.ceil(given_px[-1][2:])))
    last = after[max(top, 0) : max(bottom, 0), max(left, 0) : max(right, 0)]
    side = max(given_px[-1][2] - given_px[-1][0], given_px[-1][3] - given_px[-1][1])
    most = (min(10.0, side / 4.0) + 1.5) ** 2
    assert not last.size or len(np.unique(last.reshape(-1, 3), axis=0)) <= most


def test_what_is_finer_than_a_block_leaves_no_trace() -> None:
    box = np.array([[200.0, 100.0, 280.0, 260.0]])  # blocks of 16 px
    flat = np.full((SIZE[1], SIZE[0], 3), 120, dtype=np.uint8)
    checked = flat.copy()
    checked[::2, ::2], checked[1::2, 1::2] = 20, 20
    checked[::2, 1::2], checked[1::2, ::2] = 220, 220
    blur(checked, box, WHOLE)
    inside = checked[100:260, 200:280].astype(int)
    assert np.abs(inside - 120).max() <= 1
    assert _detail(checked[:90]) > 190


def test_means_are_kept_so_that_a_vest_stays_a_vest() -> None:
    picture = np.zeros((SIZE[1], SIZE[0], 3), dtype=np.uint8)
    picture[150:200, 200:280] = (40, 230, 210)
    blur(picture, np.array([[200.0, 100.0, 280.0, 260.0]]), WHOLE)
    np.testing.assert_allclose(picture[170:185, 230:250].reshape(-1, 3).mean(axis=0), (40, 230, 210), atol=12)
    assert picture[110:130, 210:270].max() == 0


@pytest.mark.parametrize("twice", [[0, 0], [0, 1]])
def test_whoever_is_in_two_boxes_is_not_blurred_twice(twice: list[int]) -> None:
    both = np.array([[200.0, 100.0, 280.0, 260.0], [202.0, 102.0, 282.0, 262.0]])
    once, again = _noise(), _noise()
    blur(once, both[twice[-1:]], WHOLE)
    blur(again, both[twice], WHOLE)
    inside = _inside(both[twice[-1:]])
    np.testing.assert_array_equal(once[inside], again[inside])


@pytest.mark.parametrize("observed", [True, False])
def test_a_tracked_worker_is_hidden_with_a_margin_seen_or_not(observed: bool) -> None:
    box = np.array([300.0, 100.0, 320.0, 160.0])
    (hidden,) = PeopleWatch(wanted=True).update(_seen(1.0, tracked=box, observed=observed))
    margin = np.concatenate([box[:2] - hidden[:2], hidden[2:] - box[2:]])
    assert (margin >= (6.0 if observed else 18.0)).all() and (margin < 30.0).all()


def test_an_unsure_detection_of_a_worker_is_hidden_and_a_machine_never() -> None:
    box = np.array([300.0, 100.0, 320.0, 160.0])
    assert len(PeopleWatch(wanted=True).update(_seen(1.0, detected=box, score=0.1))) == 1
    assert len(PeopleWatch(wanted=True).update(_seen(1.0, tracked=box, detected=box, class_id=LOADER))) == 0


def test_whoever_is_missed_stays_hidden_for_a_second_and_more_widely_the_longer() -> None:
    watch, box = PeopleWatch(wanted=True), np.array([300.0, 100.0, 320.0, 160.0])
    (seen,) = watch.update(_seen(1.0, detected=box))
    widths = []
    for time_s in np.arange(1.04, 3.0, 0.04).tolist():
        hidden = watch.update(_seen(time_s))
        if time_s <= 2.0:
            (one,) = hidden
            assert (one[:2] < seen[:2]).all() and (one[2:] > seen[2:]).all()
            widths.append(one[2] - one[0])
        else:
            assert not len(hidden) or time_s < 2.05
    assert widths == sorted(widths) and len(widths) > 20


def test_whoever_is_seen_again_is_hidden_once() -> None:
    watch, box = PeopleWatch(wanted=True), np.array([300.0, 100.0, 320.0, 160.0])
    for index in range(50):
        assert len(watch.update(_seen(index / 25, tracked=box + index, detected=box + index + 0.5))) == 2
    assert len(watch._boxes) == 2  # the memory does not grow


def test_whoever_is_missed_beside_somebody_else_stays_hidden() -> None:
    watch = PeopleWatch(wanted=True)
    one, other = np.array([300.0, 100.0, 320.0, 160.0]), np.array([316.0, 110.0, 336.0, 170.0])
    watch.update(_seen(1.0, detected=np.array([one, other])))
    hidden = watch.update(_seen(1.04, detected=one))
    mask, missed = _inside(hidden), _inside(other[None])
    assert mask[missed].all()


def test_a_moving_camera_takes_along_where_somebody_was() -> None:
    watch, box = PeopleWatch(wanted=True), np.array([300.0, 100.0, 320.0, 160.0])

    def moved(index: int) -> CameraMotion:
        shift = np.array([[1.0, 0.0, 9.0 * index], [0.0, 1.0, -4.0 * index], [0.0, 0.0, 1.0]])
        return CameraMotion(shift, np.zeros((9, 9)), keyframe_s=0.0)

    watch.update(_seen(0.04, detected=box, motion=moved(1)))
    for index in range(2, 20):
        (hidden,) = watch.update(_seen(0.04 * index, motion=moved(index)))
        centre = (hidden[:2] + hidden[2:]) / 2
        np.testing.assert_allclose(centre, [310 + 9.0 * (index - 1), 130 - 4.0 * (index - 1)], atol=1e-6)


def test_a_clock_that_is_set_back_forgets() -> None:
    watch, box = PeopleWatch(wanted=True), np.array([300.0, 100.0, 320.0, 160.0])
    watch.update(_seen(100.0, detected=box))
    assert len(watch.update(_seen(3.0))) == 0


@pytest.mark.parametrize("size_px", [SIZE, (320, 180)])
def test_in_the_film_nothing_but_people_changes(size_px: tuple[int, int]) -> None:
    params = replace(BARE, max_width_px=size_px[0])
    result = _seen(1.0, detected=np.array([[300.0, 100.0, 330.0, 180.0], [90.0, 200.0, 120.0, 290.0]]))
    hidden_px = PeopleWatch(wanted=True).update(result)
    picture = result.frame.picture.resized_bgr(*size_px)
    composer = Composer(SIZE, params)
    plain = composer.compose(picture, FrameMeasurements.of(quiet(result))).copy()
    blurred = composer.compose(picture, FrameMeasurements.of(quiet(result), (), hidden_px)).copy()
    inside = _inside(hidden_px * size_px[0] / SIZE[0], size_px)
    np.testing.assert_array_equal(plain[~inside], blurred[~inside])
    assert _detail(blurred, inside) < 0.25 * _detail(plain, inside)


def test_without_blur_the_film_is_drawn_on_the_picture_as_it_is() -> None:
    result = FakeSite(SIZE).result(10)
    composer, params, text = Composer(SIZE, VideoParams(max_width_px=900)), DrawParams(), TextSprites()
    width, height = composer.picture_size_px
    measurements = FrameMeasurements.of(quiet(result), (), PeopleWatch(wanted=False).update(result))
    picture = result.frame.picture.resized_bgr(width, height)
    composed = composer.compose(picture, measurements).copy()
    by_hand, sketch = picture.copy(), Sketch.of(measurements, params)
    panel = np.zeros((height, composer.size_px[0] - width, 3), dtype=np.uint8)
    BirdsEye(panel.shape[1::-1], params, text).draw(panel, picture, sketch)
    Overlay(params, text).draw(by_hand, sketch)
    np.testing.assert_array_equal(composed, np.hstack([by_hand, panel]))
    np.testing.assert_array_equal(picture, result.frame.picture.resized_bgr(width, height))


def test_the_panel_shows_the_blurred_picture() -> None:
    site = FakeSite(SIZE)
    result = replace(site.result(0), frame=replace(site.result(0).frame, picture=FakePicture(_noise())))
    params = VideoParams(max_width_px=900, draw=DrawParams(circles=False, labels=False, fans=False, legend=False))
    composer = Composer(SIZE, params)
    width, height = composer.picture_size_px
    measurements = FrameMeasurements.of(quiet(result), (), np.array([[-50.0, -50.0, 5000.0, 5000.0]]))
    panel = composer.compose(result.frame.picture.resized_bgr(width, height), measurements)[:, width:].copy()
    sharp = composer.compose(
        result.frame.picture.resized_bgr(width, height), replace(measurements, hidden_px=np.zeros((0, 4)))
    )
    assert _detail(panel[height // 2 : -40]) < 0.5 * _detail(sharp[height // 2 : -40, width:])


def test_the_encoded_film_shows_nobody_and_all_else(tmp_path: Path) -> None:
    shown = {}
    people = np.array([[300.0, 100.0, 340.0, 190.0], [90.0, 200.0, 140.0, 320.0]])
    smooth = cv2.GaussianBlur(_noise(), (0, 0), 1.5)
    smooth = cv2.normalize(smooth, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)
    for name in (False, True):
        sink = VideoSink(tmp_path / f"{name}.mp4", replace(BARE, crf=8), show=ShowParams(blur=name))
        for index in range(3):
            result = _seen(index / 25, detected=people)
            sink.write(replace(result, frame=replace(result.frame, picture=FakePicture(smooth))))
        sink.close(Outcome("complete"))
        with av.open(str(tmp_path / f"{name}.mp4")) as container:
            shown[name] = [frame.to_ndarray(format="bgr24") for frame in container.decode(video=0)][-1]
    near, inside = _inside(people + np.array([-40, -40, 40, 40])), _inside(people)
    assert np.abs(shown[True].astype(int) - shown[False])[~near].mean() < ENCODED_LEVELS
    assert _detail(shown[True], inside) < 0.35 * _detail(shown[False], inside)


def test_every_picture_of_the_report_is_blurred() -> None:
    site = FakeSite(SIZE)
    found = {}
    for wanted in (False, True):
        summary = RunSummary(ReportParams(moments=3), (), ShowParams(blur=wanted))
        for index in range(20):
            result = site.result(index)
            unsure = Detections(np.array([[5.0, 5.0, 60.0, 120.0]]), np.array([0.1]), np.array([WORKER]))
            noisy = replace(result.frame, picture=FakePicture(_noise()))
            summary.add(replace(result, frame=noisy, detections=unsure))
        found[wanted] = summary
    sharp, hidden = (found[wanted].moments.worth_showing(100.0) for wanted in (False, True))
    assert len(sharp) == len(hidden) == 3
    for one, other in zip(sharp, hidden, strict=True):
        factor = one.picture.shape[1] / (one.region_px[2] - one.region_px[0])
        people = one.measurements.tracks.xyxy_px[one.measurements.tracks.class_id == WORKER]
        size = (one.picture.shape[1], one.picture.shape[0])
        inside = _inside((people - np.tile(one.region_px[:2], 2)) * factor, size)
        assert inside.any()
        assert _detail(other.picture, inside) < 0.6 * _detail(one.picture, inside)
    plans = [found[wanted].background for wanted in (False, True)]
    assert plans[0] is not None and plans[1] is not None
    corner = _inside(np.array([[5.0, 5.0, 60.0, 120.0]]))
    assert _detail(plans[1][0], corner) < 0.25 * _detail(plans[0][0], corner)


def test_the_page_says_that_people_are_blurred_and_embeds_no_sharp_picture(tmp_path: Path) -> None:
    site, pages = FakeSite((320, 180)), {}
    for wanted in (False, True):
        sink = ReportSink(tmp_path / "report.html", ReportParams(pairs=1, moments=1), show=ShowParams(blur=wanted))
        results = [site.result(index) for index in range(5)]
        for result in results:
            sink.write(result)
        sink.close(ended(results))
        pages[wanted] = (tmp_path / "report.html").read_text(encoding="utf-8")
    sentence = "People are blurred; whom the detector missed is not."
    assert sentence in pages[True] and sentence not in pages[False]
    pictures = {wanted: set(re.findall(r"data:image/[a-z]+;base64,([^\"]+)", page)) for wanted, page in pages.items()}
    assert len(pictures[True]) == len(pictures[False]) >= 2  # a moment and the plan
    assert not pictures[True] & pictures[False]
    assert all(base64.b64decode(one) for one in pictures[True])
