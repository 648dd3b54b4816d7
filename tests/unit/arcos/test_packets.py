"""Framing: laws of the checksum and of the parser, which finds every good packet whatever surrounds it."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from arcos import BODY_MAX, ArcosError, PacketParser, checksum, packet

BODIES = st.binary(min_size=1, max_size=BODY_MAX)
# Mostly what a parser could take for a header.
NASTY = st.lists(st.sampled_from([b"\xfa", b"\xfb", b"\xfa\xfb", b"\x03", b"\xca", b"\x00", b"WMS2\r"]), max_size=40)
GARBAGE = st.one_of(st.binary(max_size=300), NASTY.map(b"".join))


def cut(stream: bytes, places: list[int]) -> list[bytes]:
    edges = [0, *sorted(min(place, len(stream)) for place in places), len(stream)]
    return [stream[a:b] for a, b in pairwise(edges)]


def literal_checksum(body: bytes) -> int:
    """The rule as the protocol states it, word by word."""
    total = 0
    for k in range(0, len(body) - 1, 2):
        total = (total + (body[k] << 8 | body[k + 1])) & 0xFFFF
    return total ^ body[-1] if len(body) % 2 else total


@given(BODIES)
def test_the_checksum_is_the_literal_rule(body: bytes) -> None:
    assert checksum(body) == literal_checksum(body)


@given(st.lists(BODIES, max_size=6), st.lists(st.integers(0, 1300), max_size=30))
def test_packets_are_found_however_the_stream_is_cut(bodies: list[bytes], places: list[int]) -> None:
    parser = PacketParser()
    found = [body for piece in cut(b"".join(map(packet, bodies)), places) for body in parser.feed(piece)]
    assert found == bodies
    assert (parser.good, parser.bad, parser.skipped, parser.pending) == (len(bodies), 0, 0, 0)


@given(GARBAGE, BODIES, st.lists(st.integers(0, 600), max_size=30))
def test_a_packet_behind_any_garbage_is_found_when_the_stream_goes_on(
    garbage: bytes, body: bytes, places: list[int]
) -> None:
    stream = garbage + packet(body)
    parser = PacketParser()
    found = [each for piece in cut(stream, places) for each in parser.feed(piece)] + parser.give_up()
    # Garbage may hold packets by chance, but one that swallows the packet behind it would need its checksum.
    assert found[-1:] == [body]


@given(GARBAGE, BODIES, st.lists(st.integers(0, 600), max_size=30))
def test_what_is_found_does_not_depend_on_the_cuts(garbage: bytes, body: bytes, places: list[int]) -> None:
    stream = packet(body) + garbage + packet(body) + garbage
    whole, cuts = PacketParser(), PacketParser()
    once = whole.feed(stream)
    assert [each for piece in cut(stream, places) for each in cuts.feed(piece)] == once
    assert (cuts.good, cuts.bad, cuts.skipped, cuts.pending) == (whole.good, whole.bad, whole.skipped, whole.pending)


@given(BODIES, st.data())
def test_a_changed_byte_is_noticed_and_the_next_packet_found(body: bytes, data: st.DataObject) -> None:
    good = packet(body)
    at = data.draw(st.integers(3, len(good) - 1))
    broken = bytearray(good)
    broken[at] ^= data.draw(st.integers(1, 255))
    parser = PacketParser()
    found = parser.feed(bytes(broken) + good) + parser.give_up()
    assert found[-1:] == [body] and parser.bad >= 1


def test_a_doubled_header_is_no_obstacle() -> None:
    parser = PacketParser()
    assert parser.feed(b"\xfa\xfb" + packet(b"\x0b") + b"\xfa" + packet(b"\x0c")) == [b"\x0b", b"\x0c"]
    assert parser.skipped == 3


@given(st.lists(st.binary(max_size=2000), max_size=20))
def test_memory_is_bounded_and_every_byte_is_accounted_for(pieces: list[bytes]) -> None:
    parser = PacketParser()
    taken = 0
    for piece in pieces:
        taken += sum(len(body) + 5 for body in parser.feed(piece))
        assert parser.pending < BODY_MAX + 5
    assert taken + parser.skipped + parser.pending == sum(map(len, pieces))


def test_a_false_header_holds_good_packets_back_only_until_it_is_given_up() -> None:
    parser = PacketParser()
    assert parser.feed(b"\xfa\xfb\xc8" + packet(b"\x00")) == []
    assert parser.give_up() == [b"\x00"]
    assert parser.pending == 0


@pytest.mark.parametrize("size", [0, BODY_MAX + 1])
def test_bodies_of_impossible_length_are_refused(size: int) -> None:
    with pytest.raises(ArcosError, match=f"1 to {BODY_MAX} bytes, not {size}"):
        packet(bytes(size))
