"""The preset `my-site`: the detector that comes with standoff goes on with the frames of one site."""

from standoff.training.my_site.mixture import prepare_plan
from standoff.training.my_site.preset import read_preset

__all__ = ["prepare_plan", "read_preset"]
