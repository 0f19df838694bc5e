"""`report.html`: one self-contained page about a run, also about one that was interrupted or failed."""

from __future__ import annotations

import base64
import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from datetime import UTC, datetime
from importlib.resources import files
from pathlib import Path
from typing import Any

from markupsafe import Markup

from standoff import __version__
from standoff.core.durations import minutes_text
from standoff.core.hazard_life import HazardLife
from standoff.core.outputs import ASSISTANCE
from standoff.core.types import FrameResult, Outcome
from standoff.core.zones import NOT_PLACED, ZONE_WORDS, Zone
from standoff.drawing.page_template import page_template
from standoff.files.json_text import plain
from standoff.files.whole import partial_file
from standoff.stages.sinks.collect import RunSummary
from standoff.stages.sinks.params import ReportParams, ShowParams

_MOST_ROWS = 200
_MOMENT_MARGIN_M = 5.0
_RANK = {"danger": 0, "warning": 1, "unknown": 2}


class ReportSink:
    """Gather what the report shows while the run goes on; write it at the end.

    Args:
        path: The file, usually `report.html`.
        params: How much is kept.
        warning_gap_m: Gap (distance less both action radii) below which the hazard stage warns, to be drawn;
            below 0 the circles touch, which is danger.
        checked: Gives after the last frame what the page says, in HTML, of how true the stated errors are, where truth
            is known; None or an empty text: they were not checked, and the page says so.
        zones: Of the site.
        show: The unit of lengths, and whether people are made unrecognisable.
    """

    def __init__(
        self,
        path: Path | str,
        params: ReportParams | None = None,
        *,
        warning_gap_m: float = 1.0,
        checked: Callable[[], str] | None = None,
        zones: tuple[Zone, ...] = (),
        show: ShowParams | None = None,
    ) -> None:
        self._checked = checked
        self._path, self._warning_gap_m = Path(path), warning_gap_m
        self._summary = RunSummary(params or ReportParams(), zones, show)

    def write(self, result: FrameResult) -> None:
        """Take one frame."""
        self._summary.add(result)

    def close(self, outcome: Outcome) -> None:
        """Write the page; its name appears when it is whole."""
        for event in outcome.hazards:
            self._summary.take_event(event)
        checked = "" if self._checked is None else self._checked()
        page = render(self._summary, outcome, self._warning_gap_m, checked)
        with partial_file(self._path) as partial:
            partial.write_text(page, encoding="utf-8")


def render(summary: RunSummary, outcome: Outcome, warning_gap_m: float, checked: str) -> str:
    """Return the page."""
    # matplotlib takes long to load; a run starts without it, and whoever imports another sink does not need it
    from standoff.stages.sinks.charts import pair_charts, plan_chart, site_chart, watched_chart

    unit = summary.unit
    template = page_template(
        "standoff.stages.sinks", "report.html.j2",
        clock=minutes_text, percent=_percent, length=unit.length, said=unit.said,
    )  # fmt: skip
    about, counts = outcome.about, outcome.counts
    has_frames = counts.rows["frames"] > 0
    hazards = sorted(summary.hazards.values(), key=_gravest_first)
    shown = summary.moments.worth_showing(warning_gap_m + _MOMENT_MARGIN_M)
    return template.render(
        version=__version__,
        written_at=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        css=Markup((files("standoff.stages.sinks") / "report.css").read_text(encoding="utf-8")),
        outcome=outcome,
        run=summary,
        counts=counts,
        warning_gap_m=warning_gap_m,
        unmeasured_frames=counts.no_map.total(),
        closest=summary.site.closest,
        hazards=hazards[:_MOST_ROWS],
        hazards_left_out=max(0, len(hazards) - _MOST_ROWS) + summary.hazards_left_out,
        severities=Counter(hazard.severity for hazard in hazards),
        site_chart=Markup(site_chart(summary, warning_gap_m)) if has_frames else "",
        watched_chart=Markup(watched_chart(summary)) if counts.watched.frames else "",
        guessed=(about.get("watched") or {}).get("measured") is False,
        pair_charts=Markup(pair_charts(summary, warning_gap_m)),
        plan_chart=Markup(plan_chart(summary)),
        zones=[_zone_row(zone, summary) for zone in summary.zones],
        unplaced=NOT_PLACED,
        moments=[(moment, _data_uri(moment.jpeg(summary.unit))) for moment in shown],
        warnings=about.get("warnings", ()),
        basis=(ground := about.get("ground") or {}).get("basis", ""),
        better=ground.get("better", ""),
        descriptions={heading: list(_flat(plain(value))) for heading, value in about.items() if value},
        assistance=ASSISTANCE,
        checked=Markup(checked),
    )


def _zone_row(zone: Zone, summary: RunSummary) -> dict[str, Any]:
    """Return what the table of zones says of one."""
    lives = summary.of_zone(zone)
    return {
        "name": zone.name,
        "kind": ZONE_WORDS[zone.kind],
        "severities": Counter(life.severity for life in lives),
        "open_s": sum(life.lasted_s(summary.last_s) for life in lives),
    }


def _gravest_first(hazard: HazardLife) -> tuple[int, float, float]:
    gap_m = hazard.gap_m if math.isfinite(hazard.gap_m) else math.inf
    return _RANK[hazard.severity], gap_m, hazard.opened_s


def _data_uri(jpeg: bytes) -> str:
    return "data:image/jpeg;base64," + base64.b64encode(jpeg).decode("ascii")


def _percent(share: float) -> str:
    """Return a share for people; rounded so that only all of it is 100 %."""
    if not math.isfinite(share):
        return "unknown"
    percent = 100.0 * share
    return f"{percent:.0f} %" if percent in (0.0, 100.0) else f"{min(max(percent, 0.1), 99.9):.1f} %"


def _flat(value: Any, prefix: str = "") -> Iterator[tuple[str, str]]:  # noqa: ANN401
    """Yield (dotted name, text) of every leaf of nested mappings."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _flat(item, f"{prefix}.{key}" if prefix else str(key))
    else:
        text = ", ".join(map(str, value)) if isinstance(value, list) else "none" if value is None else str(value)
        yield prefix, text
