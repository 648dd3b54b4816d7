"""Packets: FA FB | N | body | checksum, with N = len(body) + 2."""

from .errors import ArcosError

HEADER = b"\xfa\xfb"
BODY_MAX = 200


def checksum(body: bytes) -> int:
    """The 16-bit sum of the body's big-endian words; a byte left over at the end is XORed in."""
    even = len(body) & ~1
    total = ((sum(body[0:even:2]) << 8) + sum(body[1:even:2])) & 0xFFFF
    return total ^ body[-1] if len(body) % 2 else total


def packet(body: bytes) -> bytes:
    """A body as it goes over the wire. Raises ArcosError when it is empty or longer than BODY_MAX bytes."""
    if not 1 <= len(body) <= BODY_MAX:
        raise ArcosError(f"a packet's body must have 1 to {BODY_MAX} bytes, not {len(body)}")
    return HEADER + bytes([len(body) + 2]) + body + checksum(body).to_bytes(2, "big")


class PacketParser:
    """Finds the packets in a stream of bytes, however it is cut and whatever lies between them.

    After anything that is no packet it looks for the next header one byte later, so that a good packet is found even
    inside a broken one. It keeps less than one packet of the longest kind between calls.
    good, bad: packets so far with a right and with a wrong checksum; skipped: bytes so far that were part of no good
    packet.
    """

    def __init__(self) -> None:
        self.good = 0
        self.bad = 0
        self.skipped = 0
        self._rest = b""

    @property
    def pending(self) -> int:
        """Bytes (at most BODY_MAX + 4) that may be the start of a packet whose end has not come."""
        return len(self._rest)

    def feed(self, data: bytes) -> list[bytes]:
        """The bodies of the packets that end in data, in their order."""
        stream = self._rest + data
        bodies = []
        at = 0
        while (start := self._next_header(stream, at)) is not None:
            at = start
            if len(stream) < at + 3:
                break
            size = stream[at + 2]
            # One compare skips most garbage: N itself is implausible.
            if 3 <= size <= BODY_MAX + 2:
                end = at + 3 + size
                if len(stream) < end:
                    break
                body = stream[at + 3 : end - 2]
                if checksum(body) == int.from_bytes(stream[end - 2 : end], "big"):
                    bodies.append(body)
                    self.good += 1
                    at = end
                    continue
                self.bad += 1
            self.skipped += 1
            at += 1
        self._rest = stream[at:] if start is not None else self._tail(stream, at)
        return bodies

    def give_up(self) -> list[bytes]:
        """The end of a started packet will not come: the bodies of the whole packets that lie inside it.

        Without this, a false header in garbage would hold back up to BODY_MAX good bytes behind it.
        """
        bodies: list[bytes] = []
        while self._rest:
            rest, self._rest = self._rest, b""
            self.skipped += 1
            bodies += self.feed(rest[1:])
        return bodies

    def _next_header(self, stream: bytes, at: int) -> int | None:
        start = stream.find(HEADER, at)
        if start < 0:
            return None
        self.skipped += start - at
        return start

    def _tail(self, stream: bytes, at: int) -> bytes:
        """What to keep of a stream without a header from `at` on: half a header at its very end."""
        kept = stream[-1:] if len(stream) > at and stream[-1:] == HEADER[:1] else b""
        self.skipped += len(stream) - at - len(kept)
        return kept
