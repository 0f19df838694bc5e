"""A random life of the outbox, with two processes, crashes and restarts, against a few lists that say the same."""

from __future__ import annotations

import random
import shutil
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, cast

import pytest
from laws import seeds
from service.live.made_news import UNIX_S, hazard, health, letter, moment

from standoff.messages import HazardNews, HealthNews
from standoff.service.live.outbox import Letter, Outbox, Shelf
from standoff.service.live.service_clock import Moment

STREAMS = ("gate", "crane")
LOST: dict[str, Any] = {"distance_m": None, "gap_m": None, "sigma_m": None, "breach_now": None, "breach_ahead": None}


@dataclass
class Model:
    """What the outbox should hold."""

    news: list[tuple[str, HazardNews | HealthNews, Moment]] = field(default_factory=list)
    routed: set[str] = field(default_factory=set)
    letters: dict[str, Letter] = field(default_factory=dict)
    ended: dict[str, str] = field(default_factory=dict)
    opened: dict[str, tuple[HazardNews, Moment]] = field(default_factory=dict)
    acknowledged: set[str] = field(default_factory=set)
    shelves: dict[str, Shelf] = field(default_factory=dict)

    def tell(self, ids: tuple[str, ...], told: list[HazardNews | HealthNews], at: Moment) -> None:
        for news_id, one in zip(ids, told, strict=True):
            self.news.append((news_id, one, at))
            if isinstance(one, HealthNews):
                continue
            if one.phase == "closed":
                self.opened.pop(one.hazard_id, None)
            else:
                begun = self.opened.get(one.hazard_id)
                self.opened[one.hazard_id] = (one, at if begun is None else begun[1])

    def route(self, letters: list[Letter]) -> None:
        for one in letters:
            if one.id in self.letters:
                continue
            self.letters[one.id] = one
            if one.retained:
                for other in self.waiting():
                    if other.retained and other.topic == one.topic and other.id != one.id:
                        self.ended[other.id] = "superseded"

    def end(self, ids: list[str], how: str) -> None:
        for one in ids:
            if one in self.letters:
                self.ended.setdefault(one, how)

    def waiting(self) -> list[Letter]:
        return [one for one in self.letters.values() if one.id not in self.ended]


class Life:
    """Two processes on one outbox, and the model beside them."""

    def __init__(self, folder: Path, rng: random.Random) -> None:
        self.folder, self.rng, self.model = folder, rng, Model()
        self.generation, self.s = 0, 0.0
        folder.mkdir()
        self.processes, self.gone = [Outbox(folder), Outbox(folder)], list[Outbox]()

    @property
    def now(self) -> Moment:
        return moment(self.s)

    def step(self) -> None:
        self.s += self.rng.random()
        act = self.rng.choice(
            [self.tell, self.tell, self.route, self.route, self.end, self.lose, self.note, self.shelve, self.restart]
        )
        act(self.rng.choice(self.processes))

    def tell(self, outbox: Outbox) -> None:
        told = [self._event() for _ in range(self.rng.randint(1, 3))]
        self.model.tell(outbox.tell(told, self.now, self.now.s - 0.2), told, self.now)

    def _event(self) -> HazardNews | HealthNews:
        stream = self.rng.choice(STREAMS)
        if self.rng.random() < 0.2:
            return health(stream, self.rng.choice(["live", "stale", "lost"]), "no picture comes")
        return hazard(
            f"h-{stream}-{self.rng.randint(0, 4)}",
            stream=stream,
            session=self.rng.choice(["s-1", "s-2"]),
            phase=self.rng.choice(["opened", "updated", "unknown", "closed"]),
            distance_m=round(self.rng.random(), 3),
        )

    def route(self, outbox: Outbox) -> None:
        found = outbox.unrouted(most=3)
        for one in found:
            letters = [
                letter(f"{one.id}/{name}", at=self.now, topic=name, retained=name == "health", valid_s=5.0)
                for name in self.rng.sample(["health", "wrist", "foreman"], self.rng.randint(0, 3))
            ]
            if self.rng.random() < 0.3 and self.model.letters:
                letters.append(self.rng.choice([*self.model.letters.values()]))
            outbox.route(one.id, letters)
            self.model.route(letters)
            self.model.routed.add(one.id)

    def end(self, outbox: Outbox) -> None:
        ids = self.rng.sample([*self.model.letters, "nobody's"], min(len(self.model.letters) + 1, 3))
        how = self.rng.choice(["delivered", "expired"])
        (outbox.delivered if how == "delivered" else outbox.expired)(ids, self.now)
        self.model.end(ids, how)

    def lose(self, outbox: Outbox) -> None:
        stream, is_unknown = self.rng.choice(STREAMS), self.rng.random() < 0.5
        mine = [one for one, _ in self.model.opened.values() if one.stream == stream]
        if is_unknown:
            outbox.leave_unknown(stream, "why", self.now)
            told = [replace(one, phase="unknown", reason="why", **LOST) for one in mine if one.phase != "unknown"]
        else:
            outbox.close_left(stream, "s-2", "why", self.now)
            told = [replace(one, phase="closed", reason="why") for one in mine if one.session != "s-2"]
        new = [one.id for one in outbox.unrouted(10_000) if one.id not in {news_id for news_id, *_ in self.model.news}]
        told.sort(key=lambda one: self.model.opened[one.hazard_id][1].unix_s)
        self.model.tell(tuple(new), cast("list[HazardNews | HealthNews]", told), self.now)

    def note(self, outbox: Outbox) -> None:
        hazard_id = f"h-gate-{self.rng.randint(0, 9)}"
        outbox.acknowledge(hazard_id, self.rng.choice(["wrist", "foreman"]), self.now)
        self.model.acknowledged.add(hazard_id)

    def shelve(self, outbox: Outbox) -> None:
        if self.model.shelves and self.rng.random() < 0.3:
            gone = self.rng.choice([*self.model.shelves])
            assert outbox.unshelve(gone)
            del self.model.shelves[gone]
            return
        made = Shelf(f"shelf-{self.s}", "gate", "", "", "anna", "why", UNIX_S + self.s + self.rng.uniform(0.1, 9.0))
        outbox.shelve(made)
        self.model.shelves[made.id] = made

    def restart(self, outbox: Outbox) -> None:
        """One ends in order, one is just gone; or the machine is: what is on disk is all that is left."""
        kind = self.rng.random()
        if kind < 0.5:
            place = self.processes.index(outbox)
            if self.rng.random() < 0.5:
                outbox.close()
            self.gone.append(outbox)
            self.processes[place] = Outbox(self.folder)
            return
        self.generation += 1
        left = self.folder.with_name(f"left-{self.generation}")
        shutil.copytree(self.folder, left)
        for one in self.processes:
            one.close()
        self.folder, self.processes = left, [Outbox(left), Outbox(left)]

    def check(self) -> None:
        model = self.model
        for outbox in self.processes:
            unrouted = [(one.id, one.told, one.at) for one in outbox.unrouted(10_000)]
            assert unrouted == [one for one in model.news if one[0] not in model.routed]
            assert outbox.waiting(10_000) == model.waiting()
            counts = {how: [*model.ended.values()].count(how) for how in set(model.ended.values())}
            assert outbox.counts() == counts | ({"waiting": len(model.waiting())} if model.waiting() else {})
            assert {one.latest.hazard_id: (one.latest, one.opened) for one in outbox.open_hazards()} == model.opened
            assert outbox.acknowledged() == model.acknowledged
            holding = {name: one for name, one in model.shelves.items() if one.until_unix_s > self.now.unix_s}
            assert {one.id: one for one in outbox.shelves(self.now)} == holding


@pytest.mark.parametrize("seed", seeds(200, quick=4))
def test_whatever_happens_it_holds_what_it_should(tmp_path: Path, seed: int) -> None:
    life = Life(tmp_path / "state", random.Random(seed))
    for number in range(120):
        life.step()
        if number % 10 == 0:
            life.check()
    life.check()
    for one in [*life.processes, *life.gone]:
        one.close()
