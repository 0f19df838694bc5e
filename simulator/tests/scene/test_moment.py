from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from standoff.core.classes import CLASS_BY_NAME
from standoff_sim.clip.presets import CoverPlan, Plan, plan_clip
from standoff_sim.clip.studio import Studio
from standoff_sim.scene.moment import Moment, scene_at
from standoff_sim.scene.scene import NOTHING, Scene
from standoff_sim.scene.site import Site, build_site


def _plan(name: str, seed: int = 1) -> Plan:
    plan = plan_clip(name, seed=seed, frames=90, width_px=160, height_px=90)
    covers = (CoverPlan("plate", 0.3, 0.7),)
    return replace(plan, preset=replace(plan.preset, clutter=0.05, covers=covers, motion="pass"))


@pytest.fixture(scope="module")
def site() -> Site:
    return build_site(_plan("busy"))


def _heights_m(scene: Scene, time_s: float) -> list[float]:
    """Return how high above its own base each cover stands, one number a batch."""
    return [float(np.abs(batch.poses[:, :3, 2]).sum()) for batch in scene_at(scene, time_s).loose]


def _equal(one: Moment, other: Moment) -> bool:
    views = np.array_equal(one.view.position_m, other.view.position_m)
    batches = zip(one.batches, other.batches, strict=True)
    return views and all(a.mesh is b.mesh and np.array_equal(a.poses, b.poses) for a, b in batches)


@pytest.mark.parametrize("time_s", [0.0, 0.77, 2.9])
def test_the_same_time_gives_the_same_moment(site: Site, time_s: float) -> None:
    first = scene_at(site.scene, time_s)
    scene_at(site.scene, 1.234)
    assert _equal(first, scene_at(site.scene, time_s))


def test_another_time_gives_another_moment(site: Site) -> None:
    assert not _equal(scene_at(site.scene, 0.0), scene_at(site.scene, 1.9))


def test_a_cover_rises_lies_and_vanishes(site: Site) -> None:
    reference = site.scene.reference
    assert reference is not None
    (cover,) = reference.covers
    middle_s = (cover.start_s + cover.stop_s) / 2
    assert cover.start_s < middle_s < cover.stop_s
    for time_s in (0.0, cover.start_s, cover.stop_s, cover.stop_s + 0.1):
        assert not scene_at(site.scene, time_s).reference_covered
        assert _heights_m(site.scene, time_s) == []
    rising = [_heights_m(site.scene, cover.start_s + share * cover.rise_s)[0] for share in (0.1, 0.4, 0.9)]
    (whole,) = _heights_m(site.scene, min(middle_s, cover.start_s + cover.rise_s))
    assert rising == sorted(rising) and rising[0] < rising[-1] <= whole
    assert scene_at(site.scene, middle_s).reference_covered


@pytest.mark.parametrize("name", ["busy", "mobile"])
def test_parts_have_their_owners_number_and_loads_have_none(name: str) -> None:
    scene = build_site(_plan(name, 2)).scene
    carried = 0
    for time_s in np.linspace(0.0, 3.0, 5):
        moment = scene_at(scene, float(time_s))
        for body in moment.bodies:
            assert body.batches and {part.entity_id for part in body.batches} == {body.entity_id}
            assert {part.entity_id for part in body.carried} <= {NOTHING}
            carried += len(body.carried)
        assert {batch.entity_id for batch in moment.loose} <= {NOTHING}
    assert carried > 0


def test_the_reference_object_is_the_last_body(site: Site) -> None:
    *actors, reference = scene_at(site.scene, 0.5).bodies
    assert reference.class_id == CLASS_BY_NAME["reference"].id
    assert [body.entity_id for body in actors] == [actor.entity_id for actor in site.scene.actors]


def _with_street() -> Site:
    """Return a site whose surroundings have parked cars."""
    for seed in range(10):
        site = build_site(_plan("busy", seed))
        if len(site.scene.parked) > 3:
            return site
    raise AssertionError("no site with a street in ten")


def test_parked_vehicles_are_single_numbered_and_stand_still() -> None:
    scene = _with_street().scene
    first, later = (scene_at(scene, time_s).parked for time_s in (0.0, 2.0))
    numbers = [body.entity_id for body in first]
    others = {body.entity_id for body in scene_at(scene, 0.0).bodies}
    assert len(set(numbers)) == len(numbers) and not others & set(numbers)
    for body, again in zip(first, later, strict=True):
        assert body.class_id == CLASS_BY_NAME["vehicle"].id
        assert len(body.batches[0].poses) == 1 and body.velocity_mps.tolist() == [0.0, 0.0]
        np.testing.assert_array_equal(body.centre_m, again.centre_m)
        props = {id(batch) for batch in scene.props}
        assert id(body.batches[0]) in props


def test_parked_vehicles_have_rows_only_where_they_show(opengl: None) -> None:
    site = _with_street()
    with Studio(site) as studio:
        shot = studio.shoot(0, 0.0)
    parked = {body.entity_id for body in scene_at(site.scene, 0.0).parked}
    rows = [row for row in shot.entities if row["entity_id"] in parked]
    assert {row["entity_id"] for row in rows} == parked & set(np.unique(shot.ids).tolist())
    assert all(row["visible_px"] > 0 for row in rows)
