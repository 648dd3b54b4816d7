"""What a parameter is stands beside its field, and from there in every file, and in what is refused."""

import os
import re
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Annotated, Any, get_args, get_type_hints

import pytest

from experiments.__main__ import app
from experiments.configs import CONFIGS
from stereogrid.config import MappingConfig, load_config, save_config
from stereogrid.described import Doc, check_fields, docs_of
from stereogrid.documented import documented_toml
from stereogrid.errors import InvalidInputError
from stereogrid.report.tables import config_table, units_of
from stereogrid.run_record import RunRecord
from stereogrid.tomlfile import read_table

KINDS = {"map": MappingConfig, "run.toml": RunRecord, **CONFIGS}
UNITS = {"m": "m", "px": "px", "rad": "rad", "s": "s", "gb": "GB"}
"""How a name ends, and the unit that it must have."""


def within(hint: Any):
    """The kinds in a hint: of a list its items', of what may be left out the rest."""
    return {each for arg in get_args(hint) for each in within(arg)} or {hint}


def every_kind(kind: type):
    """A config dataclass and all the sections in it."""
    found = {kind}
    for hint in get_type_hints(kind).values():
        found |= {each for inner in within(hint) if is_dataclass(inner) for each in every_kind(inner)}
    return found


@pytest.mark.parametrize("name", KINDS)
def test_every_parameter_has_words_and_every_number_with_a_dimension_its_unit(name):
    for kind in every_kind(KINDS[name]):
        docs, hints = docs_of(kind), get_type_hints(kind)
        for field in fields(kind):
            assert field.name in docs, f"{kind.__name__}.{field.name} has no words"
            doc = docs[field.name]
            assert re.fullmatch(r"[A-Z\[].*\.|[a-z-].* \.\.\.", doc.text, re.DOTALL), doc.text
            if float in within(hints[field.name]):
                assert doc.unit, f"{kind.__name__}.{field.name} has no unit"
            ending = field.name.rpartition("_")[2]
            if ending in UNITS and "_per_" not in field.name:
                assert doc.unit == UNITS[ending], f"{kind.__name__}.{field.name} is in {doc.unit or 'no unit'}"


@pytest.mark.parametrize("name", sorted(CONFIGS))
def test_a_units_name_is_that_of_its_parameter(name, tmp_path):
    config = CONFIGS[name]()
    save_config(config, tmp_path / "config.toml")
    units = units_of(config)
    tables = tuple(f"{each}." for each in units)  # what is in a table has no words of its own
    rows = config_table(read_table(tmp_path / "config.toml"), config).rows
    assert {row[0] for row in rows if not row[0].startswith(tables)} <= units.keys()
    assert any(unit for _, _, unit in rows) or not any(units.values())


def test_every_experiment_that_takes_a_config_can_print_it():
    taking = {
        (command.name or command.callback.__name__).replace("_", "-")
        for command in app.registered_commands
        if "config" in get_type_hints(command.callback)
    }
    assert taking == set(CONFIGS)


@pytest.mark.parametrize(
    "end", ["\u2028", "\u2029", "\x85", "\x0b", "\x0c", "\x1c", "\r", "\n", "\r\n", "\n\n\n", "\t"]
)
def test_whatever_is_in_a_text_is_read_back(end, tmp_path):
    record = RunRecord("map", f"map a{end}b.mcap", f"/a{end}b.mcap", versions={f"a{end}": end})
    record.save(tmp_path)
    assert RunRecord.load(tmp_path) == record


@pytest.mark.parametrize("field", ["command", "recording", "mount"])
def test_a_name_that_is_no_text_is_refused_in_one_line(field):
    name = os.fsdecode(b"/tmp/dr\xffve.mcap")
    with pytest.raises(InvalidInputError, match=r"'/tmp/dr\\udcffve\.mcap' is no text in UTF-8, .*: rename that file"):
        RunRecord("map", **{field: name})
    with pytest.raises(InvalidInputError, match="rename that file"):
        RunRecord("map").reading(("calibration", Path(name)))


@pytest.mark.parametrize("name", sorted({*CONFIGS, "map"}))
def test_what_is_printed_reads_back_as_the_defaults_and_explains_every_key(name, tmp_path):
    kind = KINDS[name]
    text = documented_toml(kind())
    (tmp_path / "config.toml").write_text(text, encoding="utf-8")
    assert load_config(kind, tmp_path / "config.toml") == kind()
    assert "\n\n\n" not in text and max(map(len, text.splitlines())) <= 120
    told = text.replace("\n# ", " ")
    for each in every_kind(kind):
        for field in fields(each):
            assert docs_of(each)[field.name].text in told


@dataclass(frozen=True)
class Wheel:
    """A wheel. It turns."""

    radius_m: Annotated[float, Doc("From the hub.", "m", above=0, most=2)] = 0.5
    spokes: Annotated[int, Doc("So many.", least=3)] = 8
    colour: Annotated[str, Doc("Of the rim.", choices=("red", "black"))] = "red"
    holes: Annotated[tuple[float, ...], Doc("Where the holes are.", "m", least=0)] = ()
    name: Annotated[str | None, Doc("What it is called.")] = None

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True)
class Big(Wheel):
    radius_m: float = 1.5


def test_a_file_says_of_each_key_what_it_is_its_unit_its_limits_its_choices_and_a_default_that_it_leaves(tmp_path):
    save_config(Wheel(radius_m=1.0, holes=(0.1, 0.2)), tmp_path / "wheel.toml")
    assert (tmp_path / "wheel.toml").read_text() == (
        "# A wheel. It turns.\n\n"
        "# From the hub. [m; > 0 and <= 2; default 0.5]\nradius_m = 1.0\n"
        "# So many. [>= 3]\nspokes = 8\n"
        '# Of the rim. [red, black]\ncolour = "red"\n'
        "# Where the holes are. [m; >= 0; default []]\nholes = [0.1, 0.2]\n"
        "# What it is called.\n# (name is not set)\n"
    )


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"radius_m": 0.0}, "radius_m must be > 0 and <= 2 and finite, not 0.0"),
        ({"radius_m": 2.1}, "radius_m must be > 0 and <= 2 and finite, not 2.1"),
        ({"radius_m": float("nan")}, "radius_m must be > 0 and <= 2 and finite, not nan"),
        ({"spokes": 2}, "spokes must be >= 3, not 2"),
        ({"holes": (0.1, -1.0)}, r"holes\[1\] must be >= 0 and finite, not -1.0"),
        ({"colour": "blak"}, "no colour named 'blak'; did you mean 'black'. choose from: black, red"),
    ],
)
def test_what_a_field_may_not_be_is_refused_with_what_it_may(given, said):
    with pytest.raises(InvalidInputError, match=f"^{said}$"):
        Wheel(**given)


def test_limits_themselves_are_allowed_or_not_as_they_say_and_another_default_keeps_the_words():
    assert Wheel(radius_m=2.0, spokes=3, holes=(0.0,)).spokes == 3
    assert docs_of(Big) == docs_of(Wheel)
    with pytest.raises(InvalidInputError, match="radius_m must be > 0 and <= 2"):
        Big(radius_m=3.0)
