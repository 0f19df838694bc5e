"""The roles of many classes at once."""

from __future__ import annotations

import numpy as np

from standoff.core.classes import CLASSES, Role
from standoff.core.homography import BoolArray

ROLE_OF_CLASS = np.array([list(Role).index(site_class.role) for site_class in CLASSES])
"""By class id, the position of its role in `Role`."""

REFERENCE_ROLE = list(Role).index(Role.REFERENCE)
PERSON_ROLE = list(Role).index(Role.PERSON)
IS_PERSON: BoolArray = np.array([site_class.role is Role.PERSON for site_class in CLASSES])
IS_EQUIPMENT: BoolArray = np.array([site_class.role is Role.EQUIPMENT for site_class in CLASSES])
"""By class id."""
