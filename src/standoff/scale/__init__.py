"""Many films on many machines: one plan for each film, carried out by Ray wherever there is room.

from standoff.config import load_settings
from standoff.scale import find_films, plan_films, watch_films

plans = plan_films(find_films([Path("films")]), Path("out"), load_settings(Path("site.yaml")))
for result in watch_films(plans):
    print(result.film, result.status)

Ray is imported here and nowhere else.
"""

from standoff.scale.film import FilmPlan
from standoff.scale.films import find_films, plan_films
from standoff.scale.overview import write_overview
from standoff.scale.part import FilmPart, parts_of
from standoff.scale.places import write_moments
from standoff.scale.pool import watch_films
from standoff.scale.result import FilmResult, Findings, Moment
from standoff.scale.table import write_tables

__all__ = [
    "FilmPart",
    "FilmPlan",
    "FilmResult",
    "Findings",
    "Moment",
    "find_films",
    "parts_of",
    "plan_films",
    "watch_films",
    "write_moments",
    "write_overview",
    "write_tables",
]
