"""Statures and stooping: whoever works here changes, where they are and when does not."""

from __future__ import annotations

import numpy as np
import pytest
from flat_ground import FlatGround, camera, light
from laws import seeds
from tolerances import GEOMETRY_REL

from standoff.core.homography import FloatArray
from standoff_sim.behaviour import standing_working, stooping, walking_past
from standoff_sim.camera.flight import Still
from standoff_sim.clip.truth import full_box_px
from standoff_sim.movement.motion import Place, sample
from standoff_sim.people.worker import make_worker
from standoff_sim.scene.cast import Cast, FilmedArea, is_person
from standoff_sim.scene.casting import CASTS, bend_over
from standoff_sim.scene.moment import scene_at
from standoff_sim.scene.scene import Actor, Scene

_LASTING_S = 60.0


def _cast(mean_stature_m: float, *, share: float = 0.0, name: str = "demo") -> Cast:
    area = FilmedArea(0.0, 1.0, _LASTING_S, None, (-3.0, -2.0), mean_stature_m)
    cast = CASTS[name](np.random.default_rng(4), area)
    bend_over(np.random.default_rng(5), cast, share)
    return cast


def _workers(cast: Cast) -> list[Actor]:
    return [actor for actor in cast.actors if is_person(actor.model)]


def _box_heights_px(cast: Cast, time_s: float) -> FloatArray:
    flight = Still.over(camera(1280, 720), np.zeros(2), altitude_m=25.0, pitch_deg=35.0, heading_deg=0.0)
    scene = Scene("test", 0, FlatGround(), (), tuple(_workers(cast)), (), None, light(), flight)
    moment = scene_at(scene, time_s)
    boxes_px = np.array([full_box_px(body.batches, moment.view) for body in moment.bodies])
    return np.asarray(boxes_px[:, 3] - boxes_px[:, 1])


def test_a_mean_stature_moves_everybody_by_as_much() -> None:
    statures_m = {
        mean_m: [make_worker(np.random.default_rng(seed), mean_stature_m=mean_m).body.stature_m for seed in range(40)]
        for mean_m in (1.62, 1.75, 1.85)
    }
    for mean_m, own_m in statures_m.items():
        np.testing.assert_allclose(np.array(own_m) - mean_m, np.array(statures_m[1.75]) - 1.75, atol=1e-12)
        assert np.mean(own_m) == pytest.approx(mean_m, abs=4 * 0.075 / 40**0.5)


def test_statures_reach_heights_and_boxes_and_leave_ways_and_times_alone() -> None:
    short, tall = _cast(1.62), _cast(1.85)
    for one, other in zip(short.actors, tall.actors, strict=True):
        np.testing.assert_array_equal(one.motion.xy_m, other.motion.xy_m)
        np.testing.assert_array_equal(one.motion.time_s, other.motion.time_s)
        expected_m = 0.0 if not is_person(one.model) else 1.85 - 1.62
        assert other.model.height_m - one.model.height_m == pytest.approx(expected_m, abs=0.02)
    taller = _box_heights_px(tall, 0.0) / _box_heights_px(short, 0.0)
    np.testing.assert_allclose(taller, 1.85 / 1.62, atol=0.03)


def test_as_many_stoop_as_wanted_and_stay_where_they_were() -> None:
    upright = _cast(1.75)
    for share, count in ((0.0, 0), (0.34, 1), (1.0, 3)):
        cast = _cast(1.75, share=share)
        bent = 0
        for actor, before in zip(_workers(cast), _workers(upright), strict=True):
            np.testing.assert_array_equal(actor.motion.xy_m, before.motion.xy_m)
            bent += actor.motion.joints.get("bend_deg", np.zeros(1)).mean() > (
                before.motion.joints.get("bend_deg", np.zeros(1)).mean() + 1.0
            )
        assert bent == count


@pytest.mark.parametrize("seed", seeds(4))
def test_who_stoops_is_bent_most_of_the_time_and_upright_now_and_then(seed: int) -> None:
    rng = np.random.default_rng(seed)
    worker = make_worker(rng)
    motion = stooping(rng, standing_working(rng, worker, Place(0.0, 0.0), _LASTING_S))
    bend_deg = motion.joints["bend_deg"]
    assert np.mean(bend_deg > 40.0) > 0.6
    assert bend_deg.min() < 30.0
    assert bend_deg.max() <= worker.joints["bend_deg"][1]


def test_who_walks_leans_forward_less() -> None:
    rng = np.random.default_rng(1)
    worker = make_worker(rng)
    motion = stooping(rng, walking_past(rng, worker, [(0.0, 0.0), (30.0, 0.0)], _LASTING_S))
    for time_s in np.linspace(0.0, _LASTING_S, 40).tolist():
        placement = sample(motion, time_s)
        if np.linalg.norm(placement.velocity_mps) > 0.6:
            assert placement.joints["bend_deg"] < 0.35 * 85.0


def test_boxes_of_stooping_workers_are_lower() -> None:
    times_s = np.linspace(0.0, _LASTING_S, 5).tolist()
    casts = [_cast(1.75, share=share) for share in (0.0, 1.0)]
    upright, bent = (np.mean([_box_heights_px(cast, time_s) for time_s in times_s]) for cast in casts)
    assert bent < 0.95 * upright
    assert bent > GEOMETRY_REL
