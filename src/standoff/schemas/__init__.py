"""JSON Schemas of what a run writes, made from what the code that writes it says of itself.

>>> from standoff.schemas import SCHEMAS
>>> SCHEMAS["tracks"]()["properties"]["x_m"]
{'type': ['number', 'null'], 'description': 'site frame; null where the position is invalid', 'unit': 'm'}
"""

from standoff.schemas.outputs import SCHEMAS

__all__ = ["SCHEMAS"]
