"""Drones' cameras: what their makers publish, and how far a picture may be from it.

Focal lengths in terms of 35 mm film, fields of view and sensors are those of the makers' specification pages and user
manuals; model codes are what the drones write into EXIF data and films. The published field of view (diagonal) is
kept beside the focal length because one checks the other: 2 atan(21.6 mm / focal length).

Sensors are 4:3 or 3:2 as their largest photographs are. Stills differ from the published focal length by its rounding
and by the lens's tolerance, 3 per cent. Films are cut out of the sensor by amounts that depend on the mode (UHD out of
4000 pixels: 4 per cent; the Mavic 2 Pro's "HQ" mode: 40 per cent), so their uncertainty is larger.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

FULL_FRAME_DIAGONAL_MM = math.hypot(36.0, 24.0)

_STILL, _FILM = 0.03, 0.08
_CORRECTED_K1 = 0.03
"""Consumer drones correct their lens before they write a picture; what remains is of this size."""


@dataclass(frozen=True, slots=True)
class DroneCamera:
    """A camera that flies.

    Attributes:
        name: As it is sold.
        codes: What it calls itself in EXIF data and films.
        focal_mm_35: Of the lens, in terms of 35 mm film; the shortest of a zoom lens.
        field_deg: Diagonal field of view, as published; NaN where the maker's two figures are not about the same mode.
        sensor_mm: (width, height), nominal.
        still_sigma: Standard error of a photograph's focal length, as a share of it.
        film_sigma: The same for films.
        film_factor: Focal length of films against that of photographs, in the usual mode.
        k1: First radial distortion coefficient of the pictures, and its standard error.
        professional: Whether it is made for surveying and inspection.
    """

    name: str
    codes: tuple[str, ...]
    focal_mm_35: float
    field_deg: float
    sensor_mm: tuple[float, float]
    still_sigma: float = _STILL
    film_sigma: float = _FILM
    film_factor: float = 1.0
    k1: tuple[float, float] = (0.0, _CORRECTED_K1)
    professional: bool = False

    @property
    def sensor_aspect(self) -> float:
        """Width over height."""
        return self.sensor_mm[0] / self.sensor_mm[1]


_HALF_INCH_3, _HALF_INCH, _INCH_1_3 = (6.3, 4.7), (6.4, 4.8), (9.7, 7.3)  # 1/2.3", 1/2", 1/1.3"
_INCH, _FOUR_THIRDS = (13.2, 8.8), (17.3, 13.0)
_UNCORRECTED = (-0.1, 0.15)  # survey drones leave the lens as it is unless told otherwise
_ANY_LENS = 0.3  # exchangeable, or a zoom whose position is not told

DRONE_CAMERAS = (
    # DJI Mini: specifications "FOV 83, 24 mm" up to the Mini 2, "FOV 82.1, 24 mm" from the Mini 3 on
    DroneCamera("DJI Mavic Mini", ("FC7203", "Mini SE", "Mini 1"), 24.0, 83.0, _HALF_INCH_3),
    DroneCamera("DJI Mini 2", ("FC7303",), 24.0, 83.0, _HALF_INCH_3),
    DroneCamera("DJI Mini 2 SE", ("FC7503",), 24.0, 83.0, _HALF_INCH_3),
    DroneCamera("DJI Mini 4K", ("FC7703",), 24.0, 83.0, _HALF_INCH_3),
    DroneCamera("DJI Mini 3", ("FC3682",), 24.0, 82.1, _INCH_1_3),
    DroneCamera("DJI Mini 3 Pro", ("FC3582",), 24.0, 82.1, _INCH_1_3),
    DroneCamera("DJI Mini 4 Pro", ("FC8482",), 24.0, 82.1, _INCH_1_3),
    # DJI Air: "FOV 85, 24 mm" (Mavic Air), "84, 24 mm" (Air 2), "88, 22 mm" (Air 2S),
    # "82, 24 mm" and "35, 70 mm" (Air 3)
    DroneCamera("DJI Spark", ("FC1102",), 25.0, 81.9, _HALF_INCH_3),
    DroneCamera("DJI Mavic Air", ("FC2103", "FC230"), 24.0, 85.0, _HALF_INCH_3),
    DroneCamera("DJI Mavic Air 2", ("FC3170", "Air 2"), 24.0, 84.0, _HALF_INCH),
    DroneCamera("DJI Air 2S", ("FC3411", "Mavic Air 2S"), 22.0, 88.0, _INCH),
    DroneCamera("DJI Air 3", ("FC8282",), 24.0, 82.0, _INCH_1_3),
    DroneCamera("DJI Air 3, medium tele", ("FC8284",), 70.0, 35.0, _INCH_1_3),
    # DJI Mavic: "FOV 78.8, 26 mm" (Pro), "77, 28 mm" (2 Pro; films also "HQ 55"), "83 to 48, 24 to 48 mm" (2 Zoom),
    # "84, 24 mm" (3), "15, 162 mm" (3, tele), "35, 70 mm" and "15, 166 mm" (3 Pro)
    DroneCamera("DJI Mavic Pro", ("FC220",), 26.0, 78.8, _HALF_INCH_3, film_factor=1.04),
    DroneCamera("DJI Mavic 2 Pro", ("L1D-20c",), 28.0, 77.0, _INCH, film_sigma=0.2, film_factor=1.1),
    DroneCamera("DJI Mavic 2 Zoom", ("FC2204",), 24.0, 83.0, _HALF_INCH_3, _ANY_LENS, _ANY_LENS),
    DroneCamera("DJI Mavic 3", ("L2D-20c", "Mavic 3 Pro", "Mavic 3 Classic", "Mavic 3 Cine"), 24.0, 84.0, _FOUR_THIRDS),
    DroneCamera("DJI Mavic 3, tele", ("FC4170",), 162.0, 15.0, _HALF_INCH),
    DroneCamera("DJI Mavic 3 Pro, medium tele", ("FC4382",), 70.0, 35.0, _INCH_1_3),
    DroneCamera("DJI Mavic 3 Pro, tele", ("FC4370",), 166.0, 15.0, _HALF_INCH),
    DroneCamera("DJI Mavic 3E", ("M3E", "Mavic 3 Enterprise"),
                24.0, 84.0, _FOUR_THIRDS, k1=_UNCORRECTED, professional=True),
    DroneCamera("DJI Mavic 3T", ("M3T", "Mavic 3 Thermal"), 24.0, 84.0, _HALF_INCH, k1=_UNCORRECTED, professional=True),
    DroneCamera("DJI Mavic 3M", ("M3M", "Mavic 3 Multispectral"),
                24.0, 84.0, _FOUR_THIRDS, k1=_UNCORRECTED, professional=True),
    # DJI Phantom: "FOV 94, 20 mm" (3 and 4), "84, 8.8 mm / 24 mm" (4 Pro, Advanced, RTK)
    DroneCamera("DJI Phantom 3", ("FC300C", "FC300S", "FC300X", "FC300XW", "FC300SE", "Phantom 3 Standard",
                "Phantom 3 Advanced", "Phantom 3 Professional", "Phantom 3 4K"),
                20.0, 94.0, _HALF_INCH_3, film_factor=1.04),
    DroneCamera("DJI Phantom 4", ("FC330",), 20.0, 94.0, _HALF_INCH_3, film_factor=1.04),
    DroneCamera("DJI Phantom 4 Pro", ("FC6310", "FC6310S", "Phantom 4 Advanced", "Phantom 4 Pro V2.0"),
                24.0, 84.0, _INCH,
                film_sigma=0.12, film_factor=1.05),
    DroneCamera("DJI Phantom 4 RTK", ("FC6310R",), 24.0, 84.0, _INCH, film_sigma=0.12, film_factor=1.05,
                k1=_UNCORRECTED, professional=True),
    # DJI Inspire: "FOV 94, 20 mm" (X3), "84, 24 mm" (X4S), "72, 15 mm" on four thirds, exchangeable (X5, X5S)
    DroneCamera("DJI Inspire 1, Zenmuse X3", ("FC350", "Inspire 1"), 20.0, 94.0, _HALF_INCH_3, film_factor=1.04),
    DroneCamera("DJI Inspire 2, Zenmuse X4S", ("FC6510", "Zenmuse X4S"),
                24.0, 84.0, _INCH, film_sigma=0.12, film_factor=1.05),
    DroneCamera("DJI Inspire 1, Zenmuse X5", ("FC550", "Zenmuse X5"), 30.0, 72.0, _FOUR_THIRDS, _ANY_LENS, _ANY_LENS),
    DroneCamera("DJI Inspire 2, Zenmuse X5S", ("FC6520", "Zenmuse X5S", "Inspire 2"),
                30.0, 72.0, _FOUR_THIRDS, _ANY_LENS, _ANY_LENS),
    # DJI Matrice: wide cameras "DFOV 82.9, 24 mm" (H20, H20T), "84, 24 mm" (30, 30T); their zooms write the same code
    DroneCamera("DJI Zenmuse H20", ("ZH20", "Matrice 300 RTK H20"), 24.0, 82.9, _HALF_INCH_3, _ANY_LENS, _ANY_LENS,
                k1=_UNCORRECTED, professional=True),
    DroneCamera("DJI Zenmuse H20T", ("ZH20T", "Matrice 300 RTK H20T"), 24.0, 82.9, _HALF_INCH_3, _ANY_LENS, _ANY_LENS,
                k1=_UNCORRECTED, professional=True),
    DroneCamera("DJI Matrice 30", ("M30",),
                24.0, 84.0, _HALF_INCH, _ANY_LENS, _ANY_LENS, k1=_UNCORRECTED, professional=True),
    DroneCamera("DJI Matrice 30T", ("M30T",),
                24.0, 84.0, _HALF_INCH, _ANY_LENS, _ANY_LENS, k1=_UNCORRECTED, professional=True),
    # Autel: "FOV 79, 25.6 mm" (8K). The EVO II Pro is given as "82, 28.6 mm", which do not agree.
    DroneCamera("Autel EVO II", ("XT701", "EVO II 8K"), 25.6, 79.0, _HALF_INCH, 0.05, 0.1),
    DroneCamera("Autel EVO II Pro", ("XT705",), 28.6, math.nan, _INCH, 0.08, 0.12),
    # Parrot: "23 to 69 mm (photo), 26 to 78 mm (video)", of which the longer end is digital; HFOV 75.5 for photographs
    DroneCamera("Parrot Anafi", ("Anafi", "Anafi4K"), 23.0, math.nan, (5.9, 4.4), 0.06, film_factor=1.13),
)  # fmt: skip


def _plain(name: str) -> str:
    """Return a name without case, punctuation and maker."""
    plain = re.sub(r"[^a-z0-9]", "", name.casefold())
    for maker in ("dji", "hasselblad", "autelrobotics", "autel", "parrot"):
        plain = plain.removeprefix(maker)
    return plain


_BY_NAME = {_plain(name): camera for camera in DRONE_CAMERAS for name in (camera.name, *camera.codes)}


def find_drone_camera(name: str) -> DroneCamera | None:
    """Return the camera with a model code or market name, or None.

    >>> find_drone_camera("DJI Mini3Pro").name, find_drone_camera("FC6310S").focal_mm_35
    ('DJI Mini 3 Pro', 24.0)
    """
    return _BY_NAME.get(_plain(name.strip("\0 ")))
