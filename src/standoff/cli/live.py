"""`standoff serve`, `reload`, `wearable`, `latency`, `shelve`: a site that is watched live."""

from __future__ import annotations

import logging
import os
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from standoff.core.errors import ConfigError, MissingDependency

_Site = Annotated[Path, typer.Argument(help="Settings of the site, YAML (see docs/live.md).", show_default=False)]
_HOUR_S = 3600.0


@contextmanager
def _served() -> Generator[None, None, None]:
    """Say in one line which package is missing."""
    try:
        yield
    except ImportError as error:
        raise MissingDependency(
            expected="the packages of a live site", found=f"no {error.name}", fix="pip install 'standoff[serve]'"
        ) from error


def serve(site: _Site) -> None:
    """Watch the streams of a site live and warn people; until Ctrl-C."""
    with _served():
        from standoff.config import load_site
        from standoff.service.live.log import begin_log
        from standoff.service.live.supervisor import Supervisor

        loaded = load_site(site)
        begin_log(loaded.secrets)
        Supervisor(site, loaded, lambda address: typer.echo(f"Status: {address}", err=True)).run()


def reload(site: _Site) -> None:
    """Let the service that runs read its settings again; say what holds now and what needs a restart."""
    with _served():
        from standoff.config import load_site
        from standoff.service.live.supervisor import ask_reload

        reloaded = ask_reload(load_site(site).live.state)
    if reloaded.problem:
        raise ConfigError(
            expected="settings that can be used", found=reloaded.problem, fix="correct them; all is as it was before"
        )
    typer.echo(f"holds now: {', '.join(reloaded.applied) or 'nothing has changed'}")
    if reloaded.needs_restart:
        typer.echo(f"needs a restart: {', '.join(reloaded.needs_restart)}")


def wearable(
    device: Annotated[str, typer.Option(help="Name of the device, as in the site's receivers.")],
    site: Annotated[str, typer.Option(help="Name of the site.")] = "site",
    broker: Annotated[str, typer.Option(help="mqtt://host:port or mqtts://host:port.")] = "mqtt://127.0.0.1:1883",
    user: Annotated[str, typer.Option(help="Account at the broker.")] = "",
    password: Annotated[str | None, typer.Option(help="env:NAME or file:PATH.")] = None,
    ca_file: Annotated[Path | None, typer.Option(help="Certificates that vouch for the broker.")] = None,
    cert_file: Annotated[Path | None, typer.Option(help="The device's own certificate.")] = None,
    key_file: Annotated[Path | None, typer.Option(help="Its key.")] = None,
    prefix: Annotated[str, typer.Option(help="Of all topics.")] = "standoff/{site}",
    language: Annotated[str, typer.Option(help="en or de.")] = "en",
    protocol: Annotated[str, typer.Option(help="5, or 3.1.1.")] = "5",
    as_json: Annotated[bool, typer.Option("--json", help="Print what happens as lines of JSON.")] = False,
) -> None:
    """Be a receiver: show and sound alerts, acknowledge with Enter, say when nobody watches."""
    with _served():
        from standoff.config import broker_settings
        from standoff.messages import Topics
        from standoff.service.live.broker_access import broker_access
        from standoff.service.live.log import begin_log
        from standoff.service.wearable.phrases import Phrases
        from standoff.service.wearable.terminal import Wearable, run_as_json, run_in_terminal

        given = {
            "address": broker, "user": user, "password": password, "protocol": protocol, "prefix": prefix,
            "ca_file": ca_file, "cert_file": cert_file, "key_file": key_file,
        }  # fmt: skip
        settings = broker_settings({name: value for name, value in given.items() if value is not None})
        begin_log(level=logging.WARNING)
        phrases = Phrases.read(language)
        topics = Topics.of(settings.prefix, site)
        (run_as_json if as_json else run_in_terminal)(
            lambda say: Wearable(device, topics, broker_access(settings), phrases, say)
        )


def shelve(
    site: _Site,
    author: Annotated[str, typer.Option(help="Who answers for it.")],
    reason: Annotated[str, typer.Option(help="Why.")],
    minutes: Annotated[float, typer.Option(min=1, max=480, help="For how long.")] = 30.0,
    stream: Annotated[str, typer.Option(help="Hazards of this stream only.")] = "",
    zone: Annotated[str, typer.Option(help="Hazards of this zone only.")] = "",
    hazard: Annotated[str, typer.Option(help="This hazard only, by its id.")] = "",
    take_back: Annotated[str, typer.Option(help="Take back what was set aside, by its id.")] = "",
) -> None:
    """Set alarms of a zone, of a stream or of one hazard aside for a while: they are recorded and told to nobody."""
    with _served():
        from standoff.config import load_site
        from standoff.service.live.shelving import set_aside, take_back_shelf

        loaded = load_site(site)
        if take_back:
            take_back_shelf(loaded.live.state, take_back)
            typer.echo(f"taken back: {take_back}")
            return
        shelf = set_aside(loaded, author, reason, minutes * 60.0, stream=stream, zone=zone, hazard_id=hazard)
    typer.echo(
        f"{shelf.id}: set aside for {minutes:g} minutes; `standoff shelve {site} --take-back {shelf.id} ...` ends it"
    )


def latency(
    site: _Site,
    stream: Annotated[str, typer.Argument(help="Name of the stream.", show_default=False)],
    pictures: Annotated[int, typer.Option(min=3, max=500, help="How many pictures of the clock are enough.")] = 20,
    patience_s: Annotated[float, typer.Option(min=5, help="Give up after so long; s.")] = 120.0,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Of the page with the clock; 0: any that is free.")] = 0,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in a browser.")] = True,
) -> None:
    """Measure how late a stream's pictures come: let its camera film the clock that a page on this machine shows."""
    with _served():
        from standoff.config import load_site
        from standoff.service.latency import measure_latency

        measured = measure_latency(
            load_site(site), stream, pictures, patience_s, port,
            lambda address: typer.echo(f"Show {address} on a screen, and film it with the stream's camera."),
            opens_browser=browser,
        )  # fmt: skip
    typer.echo(
        f"{stream}: {measured.delay_s:.2f} s late (median of {measured.pictures} pictures, {measured.worst_s:.2f} s at "
        f"worst); kept for `standoff serve`{os.linesep}A service that runs takes it with the next `standoff reload`."
    )
