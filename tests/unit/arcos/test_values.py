"""Commands, SIPs and replies: what is encoded is decoded again; what does not fit is refused by name."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from arcos import (
    ROBOTS,
    ArcosError,
    Code,
    Command,
    ConfigReply,
    Identity,
    Sip,
    Sonar,
    heading_step,
    position_step,
    robot_of,
    vel2,
    vel2_mmps,
)
from arcos.sip import _TAIL, stall_bumpers

U8, U16, I16 = st.integers(0, 0xFF), st.integers(0, 0xFFFF), st.integers(-0x8000, 0x7FFF)
TAIL = {"B": U8, "b": st.integers(-0x80, 0x7F), "H": U16, "h": I16}


@st.composite
def sips(draw: st.DrawFn) -> Sip:
    names = list(_TAIL)[: draw(st.integers(0, len(_TAIL)))]
    return Sip(
        moving=draw(st.booleans()),
        x_raw=draw(U16),
        y_raw=draw(U16),
        heading_raw=draw(I16),
        left_mmps=draw(I16),
        right_mmps=draw(I16),
        battery_dv=draw(U8),
        stall_bumpers=draw(U16),
        control_raw=draw(I16),
        flags=draw(U16),
        compass_raw=draw(U8),
        sonars=tuple(Sonar(*pair) for pair in draw(st.lists(st.tuples(U8, U16), max_size=32))),
        **{name: draw(TAIL[_TAIL[name]]) for name in names},
    )


@given(sips())
def test_a_sip_survives_the_wire(sip: Sip) -> None:
    assert Sip.decode(sip.body()) == sip


@given(sips(), st.integers(0, 200))
def test_a_sip_cut_anywhere_is_refused_or_keeps_every_byte(sip: Sip, size: int) -> None:
    body = sip.body()[:size]
    try:
        assert Sip.decode(body).body() == body
    except ArcosError:
        assert size < 22 + 3 * len(sip.sonars)


def test_a_sip_whose_field_is_half_there_keeps_the_half() -> None:
    sip = Sip(False, *([0] * 10), sonars=(), gripper=1, analog_port=2, analog=3, digital_in=4, digital_out=5)
    cut = Sip.decode(sip.body() + b"\x07")
    assert (cut.digital_out, cut.battery2_dv, cut.rest) == (5, None, b"\x07")


def test_a_sip_cannot_skip_a_field_of_its_tail() -> None:
    with pytest.raises(ArcosError, match="analog cannot follow a field that is missing"):
        Sip(False, *([0] * 10), sonars=(), gripper=1, analog=3)


def test_a_sip_names_the_value_that_does_not_fit() -> None:
    sip = Sip(False, *([0] * 10), sonars=())
    with pytest.raises(ArcosError, match="battery_dv must be a whole number of 0 to 255, not 300"):
        replace(sip, battery_dv=300)


@given(st.booleans(), st.booleans(), st.integers(0, 127), st.integers(0, 127))
def test_stalls_and_bumpers_are_told_apart(left: bool, right: bool, front: int, rear: int) -> None:
    bits = stall_bumpers(stalled=(left, right), front=front, rear=rear)
    sip = replace(Sip(False, *([0] * 10), sonars=()), stall_bumpers=bits)
    assert (sip.stalled, sip.front_bumpers, sip.rear_bumpers) == ((left, right), front, rear)


def test_rear_bumpers_lie_in_the_low_byte_and_front_ones_in_the_high_byte() -> None:
    assert stall_bumpers(stalled=(True, False), front=0, rear=1) == 0x0003
    assert stall_bumpers(stalled=(False, True), front=1, rear=0) == 0x0300


@given(U8, st.one_of(st.none(), st.binary(max_size=196), st.integers(-0xFFFF, 0xFFFF)))
def test_a_command_survives_the_wire(code: int, argument: int | bytes | None) -> None:
    assert Command.decode(Command(code, argument).body()) == Command(code, argument)


@given(st.binary(max_size=200))
def test_any_body_is_a_report_or_an_error(body: bytes) -> None:
    for decode in (Sip.decode, ConfigReply.decode, Identity.decode):
        try:
            again = decode(body).body()
        except ArcosError:
            continue
        # An identity may lack its last 0.
        assert again == (body + b"\0")[: len(again)]


@given(st.binary(max_size=200))
def test_any_body_is_a_command_or_an_error(body: bytes) -> None:
    try:
        command = Command.decode(body)
    except ArcosError:
        return
    assert Command.decode(command.body()) == command


@given(st.integers(-128, 127), st.integers(-128, 127), st.booleans())
def test_vel2_is_understood_as_ariacoda_and_as_player_send_it(left: int, right: int, unsigned: bool) -> None:
    command = Command.decode(vel2(left, right, unsigned=unsigned).body())
    assert vel2_mmps(command, ROBOTS["p3at"]) == (20 * left, 20 * right)
    if unsigned:
        assert vel2(left, right, unsigned=True).body()[1:] == bytes([0x3B, right & 0xFF, left & 0xFF])


@pytest.mark.parametrize("body", [b"", b"\x0b\x3b\x01", b"\x0f\x2b\x02\x41", b"\x0f\x2b", b"\x0b\x4b\0\0"])
def test_commands_that_are_cut_off_or_of_an_unknown_type_are_refused(body: bytes) -> None:
    with pytest.raises(ArcosError, match=r"command|code"):
        Command.decode(body)


@pytest.mark.parametrize(("code", "argument"), [(256, None), (-1, None), (11, 65536), (15, bytes(197))])
def test_commands_that_cannot_be_sent_are_refused(code: int, argument: int | bytes | None) -> None:
    with pytest.raises(ArcosError, match=r"must be|has at most"):
        Command(code, argument)


@given(st.text(st.characters(codec="latin-1", exclude_characters="\0"), max_size=30), U16, I16, st.binary(max_size=20))
def test_a_config_reply_survives_the_wire(name: str, top: int, drift: int, rest: bytes) -> None:
    reply = ConfigReply(name=name, top_speed_mmps=top, drift=drift, rest=rest)
    assert ConfigReply.decode(reply.body()) == reply


def test_names_that_cannot_be_sent_are_refused() -> None:
    for name in ("a\0b", "\u20ac"):
        with pytest.raises(ArcosError, match=r"0 byte|cannot send"):
            Identity(name, "Pioneer", "p3at")


def test_an_unknown_subclass_is_refused_with_the_choices() -> None:
    with pytest.raises(ArcosError, match="no robot of the subclass 'p2at'; choose from: p3at, p3at-sh"):
        robot_of("p2at")


@pytest.mark.parametrize(("said", "meant"), [("P3AT", "p3at"), ("p3at-sh ", "p3at-sh"), ("p3at-sh-lms500", "p3at-sh")])
def test_a_subclass_is_known_in_any_case_and_with_what_it_carries(said: str, meant: str) -> None:
    assert robot_of(said) is ROBOTS[meant]


def test_the_effective_track_is_the_published_one() -> None:
    assert robot_of("p3at").effective_track_m == pytest.approx(0.588, abs=0.0005)


@given(st.integers(0, 10**6), st.integers(-4095, 4095), st.sampled_from([15, 16]))
def test_a_position_that_wrapped_is_followed(start: int, step: int, bits: int) -> None:
    mask = (1 << bits) - 1
    assert position_step(start & mask, (start + step) & mask) == step


@given(st.integers(-(10**6), 10**6), st.integers(-2048, 2047))
def test_a_heading_that_wrapped_is_followed(start: int, step: int) -> None:
    def raw(heading: int) -> int:
        return (heading + 2048) % 4096 - 2048

    assert heading_step(raw(start), raw(start + step)) == step


def test_codes_are_those_of_the_facts() -> None:
    assert Command(Code.E_STOP).packet().hex() == "fafb03370037"
