"""A site set up by looking at it: what `standoff setup` shows, asks and saves."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from standoff.config import settings_from
from standoff.files.zone_file import read_zones
from standoff.service.loopback import OpenPages, serve_page
from standoff.service.page_files import page_folder
from standoff.service.setup.app import SetupPage, setup_app
from standoff.service.setup.draft import Draft, DraftFile, ReferenceDraft, Shape, ZoneDraft
from standoff.service.setup.film import Film
from standoff.service.setup.sight import Sight
from standoff.service.setup.site_file import read_site

__all__ = ["Draft", "SetupPage", "open_setup", "serve_setup", "setup_app"]


def open_setup(film: Path, site_file: Path, pages: OpenPages) -> SetupPage:
    """Open a film, and the settings and the draft where there are any.

    Args:
        film: Video file, or folder of pictures.
        site_file: Settings file, which need not be there yet.
        pages: Which will show it.

    Raises:
        StandoffError: One of them cannot be used.
    """
    base = read_site(site_file)
    opened = Film(film, settings_from(base, str(site_file)))
    drafts = DraftFile(site_file.with_name(f".{site_file.name}.draft"), draft_of(base))
    return SetupPage(opened, Sight(opened, base), drafts, site_file, pages)


def draft_of(site: Mapping[str, Any]) -> Draft:
    """Return the draft with which a site begins that has settings already, as far as a page can show them."""
    reference = (site.get("ground") or {}).get("reference") or {}
    shapes: dict[Shape, Callable[[], list[float | None]]] = {
        "square": lambda: [reference["square_m"]],
        "rectangle": lambda: list(reference["rectangle_m"]),
        "sides": lambda: [*reference["sides_m"], reference["diagonal_m"]],
    }
    shape = next((name for name in shapes if reference.get(f"{name}_m") is not None), None)
    draft = Draft(
        unit=(site.get("show") or {}).get("unit", "metres"),
        radius_m=(site.get("locate") or {}).get("radius_m") or {},
        zones=_zones(site),
    )
    if shape is not None:
        draft.reference = ReferenceDraft(
            shape=shape, lengths_m=shapes[shape](), height_m=reference.get("height_m"),
            time_s=reference.get("box_time_s") or 0.0,
        )  # fmt: skip
    return draft


def _zones(site: Mapping[str, Any]) -> list[ZoneDraft]:
    """Return the zones that are simple polygons; others keep their file until one is drawn."""
    if site.get("zones") is None:
        return []
    zones = read_zones(Path(site["zones"]))
    simple = all(len(zone.polygons_m) == 1 and len(zone.polygons_m[0]) == 1 for zone in zones)
    return [ZoneDraft(name=zone.name, kind=zone.kind, ring_m=zone.rings_m[0].tolist()) for zone in zones if simple]


def serve_setup(film: Path, site_file: Path, port: int, tell: Callable[[str], None], *, opens_browser: bool) -> None:
    """Show the page until it is closed.

    Args:
        film: Video file, or folder of pictures.
        site_file: Settings file, which need not be there yet.
        port: On which; 0: any that is free.
        tell: Called with the address.
        opens_browser: Show it there, too.

    Raises:
        StandoffError: The page was not built, the port is taken, or film or settings cannot be used.
    """
    pages = OpenPages()
    page = open_setup(film, site_file, pages)
    try:
        serve_page(setup_app(page, pages, page_folder()), pages, port, tell, opens_browser=opens_browser)
    finally:
        page.close()
