"""The status as Prometheus reads it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from standoff.core.health import STREAM_STATES
from standoff.service.status.answers import Quantiles, StatusAnswer

_QUANTILES: Final = (("0.5", "p50"), ("0.95", "p95"), ("0.99", "p99"))


class _Told(Collector):
    def __init__(self, status: StatusAnswer) -> None:
        self._status = status

    def collect(self) -> Iterator[Metric]:
        yield from _of_streams(self._status)
        yield from _of_service(self._status)


def metrics_text(status: StatusAnswer) -> bytes:
    """Return the exposition of a moment."""
    registry = CollectorRegistry(auto_describe=False)
    registry.register(_Told(status))
    return generate_latest(registry)


def _of_streams(status: StatusAnswer) -> Iterator[Metric]:
    state = GaugeMetricFamily(
        "standoff_stream_state", "1 for the state that a stream is in.", labels=["stream", "state"]
    )
    watched = GaugeMetricFamily("standoff_stream_watched", "Whether a stream is watched.", labels=["stream"])
    age = GaugeMetricFamily("standoff_picture_age_seconds", "Since the newest picture came.", labels=["stream"])
    share = GaugeMetricFamily("standoff_watched_share", "Part of the ground in the picture.", labels=["stream"])
    hazards = GaugeMetricFamily("standoff_open_hazards", "Hazards that are open.", labels=["stream", "severity"])
    frames = CounterMetricFamily("standoff_frames", "Pictures that were analysed.", labels=["stream"])
    missed = CounterMetricFamily("standoff_frames_not_looked_at", "Pictures that were not.", labels=["stream"])
    result = _summary("standoff_arrival_to_result_milliseconds", "From a picture's arrival to its result.")
    for stream in status.streams:
        for name in STREAM_STATES:
            state.add_metric([stream.name, name], float(stream.state == name))
        watched.add_metric([stream.name], float(stream.is_watched))
        if stream.picture_age_ms is not None:
            age.add_metric([stream.name], stream.picture_age_ms / 1e3)
        if stream.watched_share is not None:
            share.add_metric([stream.name], stream.watched_share)
        for severity in ("warning", "danger", "unknown"):
            hazards.add_metric([stream.name, severity], sum(one.severity == severity for one in stream.hazards))
        frames.add_metric([stream.name], stream.frames)
        missed.add_metric([stream.name], stream.not_looked_at)
        _add(result, [stream.name], stream.arrival_to_result_ms)
    yield from (state, watched, age, share, hazards, frames, missed, result)


def _of_service(status: StatusAnswer) -> Iterator[Metric]:
    yield GaugeMetricFamily("standoff_broker_connected", "Whether the broker is there.", status.broker_connected)
    letters = GaugeMetricFamily("standoff_letters", "Messages by state.", labels=["state"])
    for name, count in status.letters.items():
        letters.add_metric([name], count)
    supervised = GaugeMetricFamily("standoff_device_supervised", "Whether a wearer would be warned.", labels=["device"])
    for device in status.devices:
        supervised.add_metric([device.name], float(device.supervised))
    starts = CounterMetricFamily("standoff_process_starts", "How often a process was started.", labels=["process"])
    for process in status.processes:
        starts.add_metric([process.name], process.starts)
    wrist = GaugeMetricFamily(
        "standoff_to_wrist_milliseconds", "From a picture's capture to its alert on a device.", labels=["quantile"]
    )
    _add(wrist, [], status.to_wrist_ms)
    yield from (letters, supervised, starts, wrist)


def _summary(name: str, meaning: str) -> GaugeMetricFamily:
    return GaugeMetricFamily(name, meaning, labels=["stream", "quantile"])


def _add(metric: GaugeMetricFamily, labels: list[str], quantiles: Quantiles | None) -> None:
    if quantiles is not None:
        for quantile, name in _QUANTILES:
            metric.add_metric([*labels, quantile], getattr(quantiles, name))
