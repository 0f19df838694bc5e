"""Any process may be killed at any moment: no open hazard is lost, none is told twice, and all is back in seconds."""

from __future__ import annotations

import os
import random
import signal
import time
from collections import Counter
from functools import partial
from pathlib import Path
from statistics import median

import pytest
from laws import seeds
from service.live.running import Wearable
from service.live.scenes import FAR_M, NEAR_M, Scene, scene, told
from service.live.servers import until

from standoff.service.live.outbox import Outbox

pytestmark = pytest.mark.live
PROCESSES = ("capture-gate", "analysis", "messenger")
BACK_WITHIN_S = 5.0
SETTLED_S = 3.0
RAISED = "SELECT json_extract(body, '$.hazard_id') FROM news WHERE kind = 'hazard'"
KILLS = int(os.environ.get("SOAK_KILLS", "10"))
"""`make soak` asks for 200."""


def open_pairs(outbox: Outbox) -> list[str]:
    return [row.latest.hazard_id for row in outbox.open_hazards() if row.latest.rule == "proximity"]


def is_back(one: Scene, since_s: float, frames_of: dict[str, int]) -> bool:
    """Return whether frames are watched again by those who run now, and told by a messenger that is connected."""
    words, messenger = one.run.stream(), one.run.words("messenger.record")
    fresh = (words.get("seen_s") or 0.0) > since_s and words.get("state") == "live"
    beats = messenger.get("beat_s", 0.0) > since_s and messenger.get("is_connected", False)
    return fresh and beats and frames_of.get(words["session"], -1) != words["frames"]


def walk(one: Scene, rng: random.Random) -> None:
    one.worker_m = NEAR_M if rng.random() < 0.6 else FAR_M


@pytest.mark.parametrize("seed", seeds(1))
def test_whoever_is_killed_no_open_hazard_is_lost_and_none_is_told_twice(seed: int, tmp_path: Path) -> None:
    rng, away_s = random.Random(seed), []
    with scene(tmp_path) as one, Wearable("foreman", one.broker.port) as foreman:
        one.drives = True
        for number in range(KILLS):
            walk(one, rng)
            time.sleep(rng.uniform(0.5, 4.0))
            process = PROCESSES[number % len(PROCESSES)]
            pid = until(partial(one.run.pid, process), 10.0, process)
            words = one.run.stream()
            os.kill(pid, signal.SIGKILL)
            killed_s = time.monotonic()
            frames_of = {words["session"]: words["frames"]}
            until(
                partial(is_back, one, killed_s, frames_of), 30.0, f"{process} again: {one.run.log.read_text()[-1500:]}"
            )
            away_s.append((time.monotonic() - killed_s, process))
        one.worker_m = FAR_M
        # What the last near pictures show may open a moment after they were seen.
        time.sleep(SETTLED_S)
        outbox = Outbox(one.run.state)
        # What a session that is gone had left open is closed once the new one has measured for some seconds.
        until(
            lambda: not [row for row in outbox.open_hazards() if row.latest.rule == "proximity"],
            30.0,
            "that all is over",
        )
        until(lambda: "waiting" not in outbox.counts(), 10.0, f"{outbox.counts()}")
        told(f"letters: {outbox.counts()}")
        raised = {row[0] for row in outbox._db.execute(RAISED)}
        outbox.close()
        time.sleep(0.5)
        acted = Counter(one["alert"]["id"] for one in foreman.of_kind("alert") if not one["dropped"])
        heard = {one["alert"]["data"]["hazard"]["hazard_id"] for one in foreman.of_kind("alert") if not one["dropped"]}
        doubles = sum(one["dropped"] == "known already" for one in foreman.of_kind("alert"))
        worst_s, worst = max(away_s)
        told(
            f"{KILLS} kills: back after {median(one for one, _ in away_s):.2f} s (median), {worst_s:.2f} s ({worst}); "
            f"{len(raised)} hazards, {len(raised - heard)} not heard, {doubles} doubles dropped, "
            f"{sum(n > 1 for n in acted.values())} acted on twice"
        )
        assert max(acted.values(), default=0) == 1
        assert raised == heard
        assert worst_s <= BACK_WITHIN_S
