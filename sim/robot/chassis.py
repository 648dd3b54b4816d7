"""The robot's body: its shapes, as the URDF gives them, and its mass with a payload on top."""

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from stereogrid.errors import InvalidInputError
from stereogrid.geometry import FloatArray

URDF = Path(__file__).parent / "assets" / "pioneer3at.urdf"
MASS_KG = 21.0
"""With three batteries; bare it weighs 12 kg."""
MASSES_KG = (12.0, 25.0)
MOST_PAYLOAD_KG = 12.0
TOP_M = 0.274
PAYLOAD_SIZE_M = (0.3, 0.3, 0.2)
"""A payload is a box that stands in the middle of the top plate."""


@dataclass(frozen=True)
class Part:
    """A box of size_m (x, y, z), or a wheel of size_m (radius, width), with its middle at place_m (3,) of base."""

    name: str
    size_m: tuple[float, ...]
    place_m: FloatArray

    @property
    def is_wheel(self) -> bool:
        """Whether it is a cylinder about the y axis."""
        return len(self.size_m) == 2

    @property
    def is_tread(self) -> bool:
        """Whether it is what a wheel stands on."""
        return self.is_wheel and self.name.endswith(" 0")


@dataclass(frozen=True)
class Chassis:
    """A robot of mass_kg, wheels and batteries included, with payload_kg on its top plate."""

    mass_kg: float = MASS_KG
    payload_kg: float = 0.0

    def __post_init__(self) -> None:
        low, high = MASSES_KG
        if not low <= self.mass_kg <= high:
            raise InvalidInputError(f"mass_kg must be {low:g} to {high:g}, not {self.mass_kg}")
        if not 0 <= self.payload_kg <= MOST_PAYLOAD_KG:
            raise InvalidInputError(f"payload_kg must be 0 to {MOST_PAYLOAD_KG:g}, not {self.payload_kg}")

    def balance(self) -> tuple[FloatArray, FloatArray]:
        """Centre of mass (3,) in base [m], and (4,): total mass [kg], moments of inertia about its axes [kg m^2]."""
        links = _links()
        # What the batteries add lies as the rest of the body does.
        scale = 1 + (self.mass_kg - sum(m for m, _, _ in links)) / links[0][0]
        bodies = [(links[0][0] * scale, links[0][1] * scale, links[0][2]), *links[1:]]
        x, y, z = PAYLOAD_SIZE_M
        box = self.payload_kg / 12 * np.array([y * y + z * z, x * x + z * z, x * x + y * y])
        bodies.append((self.payload_kg, box, np.array([0.0, 0.0, TOP_M + z / 2])))
        total = sum(m for m, _, _ in bodies)
        com = np.sum([m * place for m, _, place in bodies], axis=0) / total
        moments = np.zeros(3)
        for m, inertia, place in bodies:
            d = place - com
            moments += inertia + m * (d @ d - d * d)
        return com, np.array([total, *moments])


def parts() -> list[Part]:
    """The shapes that meet the world; the treads come left front, left rear, right front, right rear."""
    found = []
    for link, offset in _placed_links():
        for k, collision in enumerate(link.findall("collision")):
            box, cylinder = collision.find("geometry/box"), collision.find("geometry/cylinder")
            place = offset + _numbers(collision.find("origin"), "xyz")
            if box is not None:
                size = tuple(_numbers(box, "size"))
            else:
                assert cylinder is not None
                size = (float(cylinder.attrib["radius"]), float(cylinder.attrib["length"]))
            found.append(Part(f"{link.attrib['name']} {k}", size, place))
    return found


def bottom_corners(shapes: list[Part]) -> FloatArray:
    """The lower corners (C, 3) of the boxes, in base."""
    signs = np.array([(x, y, -1) for x in (1, -1) for y in (1, -1)])
    return np.concatenate([part.place_m + signs * part.size_m / 2 for part in shapes if not part.is_wheel])


def _links() -> list[tuple[float, FloatArray, FloatArray]]:
    """Mass [kg], moments of inertia (3,) and centre (3,) in base of each link, the base first."""
    links = []
    for link, offset in _placed_links():
        mass, inertia = link.find("inertial/mass"), link.find("inertial/inertia")
        assert mass is not None and inertia is not None
        moments = np.array([float(inertia.attrib[name]) for name in ("ixx", "iyy", "izz")])
        links.append((float(mass.attrib["value"]), moments, offset + _numbers(link.find("inertial/origin"), "xyz")))
    return links


def _placed_links() -> list[tuple[ElementTree.Element, FloatArray]]:
    """The links with the places (3,) of their frames in base; the base link comes first."""
    robot = ElementTree.parse(URDF).getroot()
    places = {}
    for joint in robot.findall("joint"):
        child = joint.find("child")
        assert child is not None
        places[child.attrib["link"]] = _numbers(joint.find("origin"), "xyz")
    return [(link, places.get(link.attrib["name"], np.zeros(3))) for link in robot.findall("link")]


def _numbers(element: ElementTree.Element | None, name: str) -> FloatArray:
    """The three numbers of an attribute; zeros where it is not given."""
    text = None if element is None else element.get(name)
    return np.zeros(3) if text is None else np.array([float(number) for number in text.split()])
