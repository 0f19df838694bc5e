"""The renderer against geometry computed on paper and by OpenCV, on scenes of a few boxes."""

from __future__ import annotations

import sys
from collections.abc import Iterator

import cv2
import numpy as np
import pytest
import tolerances
from flat_ground import FlatGround, camera, light, view

from standoff.core.camera import Camera
from standoff.core.errors import MissingDependency
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff_sim.render import Look, Rendered, Renderer
from standoff_sim.scene.scene import Batch, place
from standoff_sim.solids.mesh import Surface, box, join, rotation, srgb, translation

BARREL = (-0.12, 0.03, 0.001, -0.0008, 0.0)
LENSES = [camera(), camera(distortion=BARREL), camera(distortion=(0.08, 0.0, 0.0, 0.0, 0.0))]
GREY = srgb("#808080")
CORNERS = np.array([[x, y, z] for x in (-1.5, 1.5) for y in (-1.0, 1.0) for z in (0.0, 1.2)])


@pytest.fixture(scope="module")
def renderer(opengl: None) -> Iterator[Renderer]:
    with Renderer((320, 240)) as made:
        made.load(FlatGround(), ())
        yield made


def boxed(pose: FloatArray, entity_id: int = 7) -> Batch:
    return place(box((3.0, 2.0, 1.2), GREY), pose, dust=0.0, entity_id=entity_id)


def shot(renderer: Renderer, seen: View, *batches: Batch, look: Look | None = None) -> Rendered:
    return renderer.render(seen, batches, light(), look or Look())


def linear(image: FloatArray) -> FloatArray:
    code = image / 255.0
    decoded: FloatArray = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
    return decoded


def drawn_hull(points_px: FloatArray, width_px: int = 320, height_px: int = 240) -> FloatArray:
    """Return, for every pixel centre, its distance in pixels to a hull's outline, positive inside."""
    hull = cv2.convexHull(points_px.astype(np.float32))
    grid = [[cv2.pointPolygonTest(hull, (x, y), True) for x in range(width_px)] for y in range(height_px)]
    return np.array(grid)


@pytest.mark.parametrize("lens", LENSES)
@pytest.mark.parametrize(("pitch_deg", "heading_deg", "turn_deg"), [(60.0, 0.0, 20.0), (35.0, 130.0, 75.0)])
def test_a_box_covers_the_pixels_that_its_corners_enclose_through_opencvs_lens(
    renderer: Renderer, lens: Camera, pitch_deg: float, heading_deg: float, turn_deg: float
) -> None:
    seen = view(lens, height_m=7.0, pitch_deg=pitch_deg, heading_deg=heading_deg, roll_deg=4.0)
    pose = translation(0.6, 0.4, 0.0) @ rotation("z", turn_deg)
    ids = shot(renderer, seen, boxed(pose)).ids
    # Edges are curved by the lens: points all along them, not corners alone.
    ends = np.linspace(0.0, 1.0, 30)[:, None, None, None]
    edges = (CORNERS[:, None] * ends + CORNERS[None] * (1 - ends)).reshape(-1, 3) @ pose[:3, :3].T + pose[:3, 3]
    turn, shift = cv2.Rodrigues(seen.site_to_camera)[0], -seen.site_to_camera @ seen.position_m
    points, _ = cv2.projectPoints(edges, turn, shift, lens.matrix, lens.distortion)
    inside = drawn_hull(points.reshape(-1, 2))
    assert (ids > 0).sum() > 4000
    assert set(np.unique(ids)) == {0, 7}
    margin_px = tolerances.RENDERED_EDGE_PX["lens" if lens.distortion.any() else "pinhole"]
    assert (ids[inside > margin_px] == 7).all()
    assert (ids[inside < -margin_px] == 0).all()


@pytest.mark.parametrize("lens", LENSES)
@pytest.mark.parametrize("height_m", [12.0, 12.3])
def test_the_pictures_edges_lie_where_the_lens_puts_them(renderer: Renderer, lens: Camera, height_m: float) -> None:
    plate = place(box((6.0, 4.0, 0.02), (0.8, 0.8, 0.8), Surface.SKIN), np.eye(4), dust=0.0)
    # Rolled, so that every edge crosses pixels at many fractions.
    seen = view(lens, height_m=height_m, pitch_deg=89.9, roll_deg=4.0)
    renderer.load(FlatGround(level=0), ())
    image = renderer.render(seen, [plate], light(sun=(0.0, 0.0, 0.0)), Look(exposure=2.0)).image
    renderer.load(FlatGround(), ())
    brightness = linear(image.astype(float)).mean(axis=2)
    for axis, middle in [(0, (3, 0)), (0, (-3, 0)), (1, (0, 2)), (1, (0, -2))]:
        expected_px = seen.project(np.array([[*middle, 0.02]]))[0]
        column, row = np.round(expected_px).astype(int)
        across = brightness if axis == 0 else brightness.T
        line, start = (row, column - 10) if axis == 0 else (column, row - 10)
        # The mean over lines on both sides of the middle: the edge's slope cancels.
        strip = across[line - 12 : line + 13, start : start + 21]
        before, after = strip[:, :6].mean(), strip[:, -6:].mean()
        edge_px = start + ((strip - after) / (before - after)).sum(axis=1) - 0.5
        slope = np.polynomial.Polynomial.fit(line + np.arange(-12.0, 13.0), edge_px, 2)
        assert slope(expected_px[1 - axis]) == pytest.approx(
            expected_px[axis], abs=tolerances.RENDERED_EDGE_PX["shaded"]
        )


def test_what_is_in_front_hides_what_is_behind(renderer: Renderer) -> None:
    seen = view(camera(), height_m=8.0, pitch_deg=40.0)
    behind, front = boxed(translation(0.0, 0.0, 0.0), 3), boxed(translation(0.0, -2.6, 0.0), 4)
    alone, together = shot(renderer, seen, behind).ids, shot(renderer, seen, behind, front).ids
    assert ((together == 4) & (alone == 3)).sum() > 500
    assert ((together == 3) <= (alone == 3)).all()
    np.testing.assert_array_equal(together, shot(renderer, seen, front, behind).ids)


def test_ground_hides_what_is_below_it_and_props_write_no_id(renderer: Renderer) -> None:
    seen = view(camera())
    assert not shot(renderer, seen, boxed(translation(0.0, 0.0, -3.0))).ids.any()
    assert not shot(renderer, seen, boxed(translation(0.0, 0.0, 0.0), 0)).ids.any()
    assert shot(renderer, seen, boxed(translation(0.0, 0.0, 0.0), 65535)).ids.max() == 65535


@pytest.mark.parametrize("lens", LENSES)
@pytest.mark.parametrize("height_m", [6.0, 25.0])
def test_a_silhouette_has_as_many_pixels_as_nothing_hides(renderer: Renderer, lens: Camera, height_m: float) -> None:
    seen = view(lens, height_m=height_m, pitch_deg=45.0)
    thing = boxed(translation(0.5, 0.0, 0.0), 3)
    visible = int((shot(renderer, seen, thing).ids == 3).sum())
    roof = boxed(translation(0.5, -1.0, 1.5), 4)
    assert (shot(renderer, seen, thing, roof).ids == 3).sum() < 0.8 * visible
    assert renderer.silhouette_px(seen, [thing]) == pytest.approx(visible, rel=0.01, abs=1.0)


def test_a_silhouette_goes_on_outside_the_picture(renderer: Renderer) -> None:
    lens = camera()
    thing = boxed(translation(0.0, 0.0, 0.0), 3)
    whole = renderer.silhouette_px(view(lens, height_m=10.0, pitch_deg=88.0), [thing])
    aside = View.aimed(lens, np.array([5.0, 0.0, 10.0]), heading_deg=0.0, pitch_deg=88.0)
    cut = int((shot(renderer, aside, thing).ids == 3).sum())
    # The far side of the box also shows from aside, so a little more than straight from above.
    assert 0 < cut < 0.9 * whole < renderer.silhouette_px(aside, [thing]) < 1.5 * whole
    behind = View.aimed(lens, np.array([0.0, 30.0, 10.0]), heading_deg=0.0, pitch_deg=30.0)
    assert renderer.silhouette_px(behind, [thing]) == 0


def test_a_mirrored_thing_and_an_open_sheet_are_drawn_whole(renderer: Renderer) -> None:
    seen = view(camera(), height_m=8.0)
    plain = boxed(np.eye(4))
    mirrored = boxed(np.diag([1.0, -1.0, 1.0, 1.0]))
    np.testing.assert_array_equal(shot(renderer, seen, plain).ids, shot(renderer, seen, mirrored).ids)
    lit = [shot(renderer, seen, thing) for thing in (plain, mirrored)]
    # The pattern is mirrored too, the light is not.
    shown = [one.image[one.ids > 0].mean() for one in lit]
    assert shown[0] == pytest.approx(shown[1], rel=0.03)
    solid = box((3.0, 2.0, 1.2), GREY)
    upper = solid.triangles[(solid.normals[solid.triangles[:, 0], 2] > 0.5)]
    sheet = type(solid)(
        solid.vertices_m,
        solid.normals,
        solid.albedo,
        solid.tintable,
        solid.surface,
        np.ascontiguousarray(upper[:, ::-1]),
    )
    assert (shot(renderer, seen, place(sheet, np.eye(4), entity_id=9)).ids == 9).sum() > 1000


@pytest.mark.parametrize("azimuth_deg", [0.0, 90.0, 215.0])
@pytest.mark.parametrize("size_m", [0.4, 2.0])
def test_a_shadowed_place_is_darker_than_when_nothing_casts_and_its_twin_across_is_not(
    renderer: Renderer, azimuth_deg: float, size_m: float
) -> None:
    seen, sun = view(camera()), light(45.0, azimuth_deg)
    caster = place(box((size_m, size_m, 0.1), GREY), translation(0.0, 0.0, 3.0), entity_id=1)
    bare, cast = renderer.render(seen, [], sun, Look()), renderer.render(seen, [caster], sun, Look())
    away = -sun.to_sun / sun.to_sun[2] * 3.05
    shadowed, twin = np.round(seen.project(np.array([away, -away * [1, 1, 0]]) * [1.0, 1.0, 0.0])).astype(int)
    darker = cast.image.astype(float).mean(axis=2) / bare.image.astype(float).mean(axis=2)
    assert darker[shadowed[1], shadowed[0]] < 0.75
    assert darker[twin[1], twin[0]] == pytest.approx(1.0, abs=0.03)


def test_a_crane_outside_the_picture_throws_its_shadow_into_it(renderer: Renderer) -> None:
    seen, sun = view(camera(), height_m=15.0, pitch_deg=80.0), light(30.0, 90.0)
    mast = place(box((1.0, 1.0, 60.0), GREY), translation(40.0, 0.0, 0.0))
    bare, cast = renderer.render(seen, [], sun, Look()), renderer.render(seen, [mast], sun, Look())
    middle = np.round(seen.project(np.zeros((1, 3)))[0]).astype(int)
    assert cast.image[middle[1], middle[0]].mean() < 0.8 * bare.image[middle[1], middle[0]].mean()


def test_things_darken_the_ground_beside_them_without_sun(renderer: Renderer) -> None:
    seen, cloudy = view(camera(), height_m=10.0, pitch_deg=75.0), light(sun=(0.0, 0.0, 0.0))
    bare = renderer.render(seen, [], cloudy, Look()).image.astype(float).mean(axis=2)
    stood = renderer.render(seen, [boxed(np.eye(4))], cloudy, Look()).image.astype(float).mean(axis=2)
    near, far = np.round(seen.project(np.array([[1.65, 0.0, 0.0], [4.5, 0.0, 0.0]]))).astype(int)
    assert stood[near[1], near[0]] < 0.9 * bare[near[1], near[0]]
    assert stood[far[1], far[0]] == pytest.approx(bare[far[1], far[0]], rel=0.03)


def test_the_same_scene_gives_the_same_bytes_in_any_renderer_with_any_history(renderer: Renderer) -> None:
    seen = view(camera(distortion=BARREL))
    things = [boxed(translation(x, 0.3 * x, 0.0), x + 10) for x in range(-4, 5, 2)]
    first = shot(renderer, seen, *things)
    with Renderer((320, 240)) as other:
        other.load(FlatGround(2.0), [boxed(translation(1.0, 1.0, 2.0))])
        shot(other, seen, place(box((1.0, 1.0, 4.0), GREY), np.eye(4)))
        other.load(FlatGround(), ())
        second = shot(other, seen, *things)
        third = shot(renderer, seen, *things)
    for again in (second, third):
        np.testing.assert_array_equal(first.image, again.image)
        np.testing.assert_array_equal(first.ids, again.ids)


def test_twice_the_exposure_is_twice_the_light(renderer: Renderer) -> None:
    seen = view(camera())
    dark = shot(renderer, seen, look=Look(exposure=0.6)).image.astype(float)
    bright = shot(renderer, seen, look=Look(exposure=1.2)).image.astype(float)
    linear_part = linear(bright) < 0.5
    assert linear_part.mean() > 0.9
    assert linear(bright)[linear_part].mean() == pytest.approx(2.0 * linear(dark)[linear_part].mean(), rel=0.02)


def test_development_follows_the_look(renderer: Renderer) -> None:
    seen = view(camera())
    plain = shot(renderer, seen).image.astype(float)
    grey = shot(renderer, seen, look=Look(saturation=0.0)).image
    assert np.ptp(grey.astype(int), axis=2).max() <= 1
    warm = shot(renderer, seen, look=Look(white_balance=(1.3, 1.0, 0.7))).image.astype(float)
    assert warm[..., 2].mean() > plain[..., 2].mean() > warm[..., 0].mean()
    corner = shot(renderer, seen, look=Look(vignette=0.4)).image.astype(float)
    assert corner[:20, :20].mean() < 0.9 * plain[:20, :20].mean()
    assert corner[110:130, 150:170].mean() == pytest.approx(plain[110:130, 150:170].mean(), rel=0.02)
    veiled = shot(renderer, seen, look=Look(lift=0.05)).image
    assert linear(veiled.astype(float)).min() >= 0.045


def test_blur_smears_along_the_path_and_stays_centred(renderer: Renderer) -> None:
    seen = view(camera(), height_m=12.0, pitch_deg=89.9)
    post = place(box((0.4, 3.0, 0.02), srgb("#101010"), Surface.RUBBER), np.eye(4), dust=0.0)
    cloudy = light(sun=(0.0, 0.0, 0.0))
    rows, path_px = slice(105, 130), 12.0
    moved = np.array([[1.0, 0.0, path_px], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    bare = renderer.render(seen, [], cloudy, Look()).image[rows].astype(float).mean(axis=(0, 2))
    masses, spreads = [], []
    for blur in (None, moved):
        line = renderer.render(seen, [post], cloudy, Look(blur=blur)).image[rows].astype(float).mean(axis=(0, 2))
        weight = np.where(np.abs(np.arange(320) - 163) < 25, np.clip(bare - line, 0.0, None), 0.0)
        centre = (weight * np.arange(320)).sum() / weight.sum()
        masses.append(centre)
        spreads.append(np.sqrt((weight * (np.arange(320) - centre) ** 2).sum() / weight.sum()))
    assert masses[0] == pytest.approx(masses[1], abs=0.7)
    assert spreads[1] ** 2 - spreads[0] ** 2 == pytest.approx(path_px**2 / 12.0, rel=0.4)


def test_haze_hides_the_distance(renderer: Renderer) -> None:
    lens = camera()
    far = View.aimed(lens, np.array([0.0, -50.0, 12.0]), heading_deg=0.0, pitch_deg=2.0)
    clear = light()
    hazy = type(clear)(
        clear.to_sun, clear.sun, clear.sky, clear.bounce, clear.sun_softness_m_per_m, 0.03, (0.5, 0.5, 0.5)
    )
    distant, near = (
        linear(renderer.render(seen, [], hazy, Look()).image.astype(float))[118] for seen in (far, view(lens))
    )
    assert np.abs(distant - 0.5).max() < 0.02
    assert np.abs(near.mean(axis=0) - 0.5).max() > 0.1


def test_a_lens_that_shows_nothing_in_the_corners_leaves_them_black(renderer: Renderer) -> None:
    fisheye = camera(distortion=(-0.9, 0.0, 0.0, 0.0, 0.0))
    corners = np.array([[0.0, 0.0], [319.0, 0.0], [0.0, 239.0], [319.0, 239.0]])
    assert np.isnan(fisheye.undistort(corners)).any()
    seen = shot(renderer, view(fisheye))
    assert seen.image[120, 160].min() > 30
    dark = np.isnan(fisheye.undistort(np.stack(np.meshgrid(np.arange(320.0), np.arange(240.0)), -1).reshape(-1, 2)))
    assert not seen.image.reshape(-1, 3)[dark[:, 0]].any()


def test_another_picture_size_and_a_missing_scene_are_refused(renderer: Renderer) -> None:
    with pytest.raises(ValueError, match="320"):
        shot(renderer, view(camera(640, 480)))
    with Renderer((320, 240)) as empty, pytest.raises(RuntimeError, match="load"):
        shot(empty, view(camera()))


def test_joined_meshes_and_many_instances_look_like_single_ones(renderer: Renderer) -> None:
    seen = view(camera(), height_m=9.0)
    solid = box((0.5, 0.5, 1.0), GREY)
    places = [translation(x, y, 0.0) for x in (-2.0, 0.0, 2.0) for y in (-1.0, 1.0)]
    many = place(solid, np.stack(places), entity_id=5)
    one = place(join([solid.moved(pose) for pose in places]), np.eye(4), entity_id=5)
    np.testing.assert_array_equal(shot(renderer, seen, many).ids, shot(renderer, seen, one).ids)


def test_without_a_driver_one_line_names_the_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    moderngl = pytest.importorskip("moderngl")

    def fail(*_: object, **__: object) -> None:
        raise Exception("libEGL.so not loaded")

    monkeypatch.setattr(moderngl, "create_context", fail)
    with pytest.raises(MissingDependency, match=r"libEGL.so not loaded.*libegl1 libgl1-mesa-dri") as caught:
        Renderer((320, 240))
    assert "\n" not in str(caught.value)


def test_without_moderngl_one_line_names_the_simulator(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "moderngl", None)
    with pytest.raises(MissingDependency, match=r"pip install \./simulator"):
        Renderer((320, 240))
