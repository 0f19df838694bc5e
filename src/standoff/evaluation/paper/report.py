"""One self-contained page about the paper's tests on one or several clips."""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from standoff import __version__
from standoff.core.errors import OutputError
from standoff.drawing.page_template import page_template
from standoff.evaluation.paper.answers import UP_TO_M
from standoff.evaluation.paper.benchmark_polynomial import DEGREE, KEPT_SD, MEDIAN_FRAMES
from standoff.evaluation.paper.captions import ISOLATES, board_caption, number_text, pair_caption, published_for
from standoff.evaluation.paper.figures import ESTIMATE, RAW, TREND, board_chart, corner_chart, pair_chart
from standoff.evaluation.paper.map_only import NEAR_M
from standoff.evaluation.paper.pairs import AFTER, BEFORE, PairSeries
from standoff.evaluation.paper.pooled import pool
from standoff.evaluation.paper.rectified import failed_frames
from standoff.evaluation.paper.result import ClipResult
from standoff.evaluation.paper.snapshots import Snapshot
from standoff.files.whole import whole_file

MOST_CHARTS = 4


def write_report(
    results: Sequence[ClipResult], path: Path | str, failures: Mapping[str, Exception] | None = None
) -> None:
    """Write the page, whole or not at all.

    Args:
        results: One section each.
        path: An existing file is replaced.
        failures: Why others are missing, by their names.

    Raises:
        OutputError: The file cannot be written.
    """
    path = Path(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        found = f"{path}: {error.strerror or error}"
        raise OutputError(expected="a report to write", found=found, fix="choose another path") from error
    with whole_file(path) as partial:
        partial.write_text(render(results, failures or {}), encoding="utf-8")


def render(results: Sequence[ClipResult], failures: Mapping[str, Exception]) -> str:
    """Return the page."""
    here, look = files("standoff.evaluation.paper"), files("standoff.stages.sinks")
    template = page_template(
        "standoff.evaluation.paper", "report.html.j2",
        number=number_text, percent=_percent, metres=_metres, picture=_data_uri, words=_words,
    )  # fmt: skip
    css = (look / "report.css").read_text(encoding="utf-8") + (here / "report.css").read_text(encoding="utf-8")
    return template.render(
        version=__version__,
        written_at=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        css=Markup(css),
        setup=results[0].setup.describe(),
        clips=[_section(result) for result in results],
        colours={"estimate": ESTIMATE, "raw": RAW, "trend": TREND},
        failures=failures,
        pooled=pool(results),
        near_m=NEAR_M,
        up_to_m=UP_TO_M,
        isolates=ISOLATES,
        after=AFTER,
        before=BEFORE,
        degree=DEGREE,
        kept_sd=KEPT_SD,
        median_frames=MEDIAN_FRAMES,
    )


def _section(result: ClipResult) -> dict[str, Any]:
    """Return what the template needs for one clip."""
    monitored, snapshots = result.monitored, result.monitored.snapshots if result.monitored else None
    charted = sorted(result.series, key=_unmeasured_and_far)[:MOST_CHARTS]
    corners = ""
    if monitored is not None and result.clip.reference is not None:
        corners = corner_chart(monitored, failed_frames(monitored, result.clip.reference))
    return {
        "name": result.clip.name,
        "preset": result.clip.preset,
        "frames": result.clip.frame_count,
        "size_px": monitored.size_px if monitored else None,
        "figures": result.figures(),
        "rectification": result.rectification,
        "map_only": result.map_only,
        "localisation": result.localisation,
        "groups": result.groups,
        "answers": result.answers,
        "breaches": result.breaches,
        "board": result.board,
        "corner_chart": Markup(corners),
        "board_chart": Markup(board_chart(result.board) if result.board else ""),
        "board_caption": board_caption(result.board) if result.board else "",
        "pair_charts": [_pair_figure(result, series) for series in charted],
        "pairs_left_out": len(result.series) - len(charted),
        "rectified": snapshots.rectified() if snapshots else None,
        "reference": snapshots.reference() if snapshots else None,
        "failures": list(snapshots.failures.values()) if snapshots else [],
    }


def _unmeasured_and_far(series: PairSeries) -> tuple[bool, float]:
    return not np.isfinite(series.before_m).any(), float(np.nanmin(series.truth_m))


def _pair_figure(result: ClipResult, series: PairSeries) -> dict[str, Any]:
    paper = published_for(result.clip.preset, series.class_pair)
    median_m = paper["median"].value if "median" in paper else None
    return {"svg": Markup(pair_chart(series, median_m)), "caption": pair_caption(result, series)}


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f} %" if math.isfinite(share) else "none"


def _metres(value: float) -> str:
    """Errors of a map are centimetres."""
    return f"{value:.3f} m" if math.isfinite(value) else "none"


def _words(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return str(value).replace("_", " ")


def _data_uri(snapshot: Snapshot) -> str:
    return "data:image/jpeg;base64," + base64.b64encode(snapshot.jpeg).decode("ascii")
