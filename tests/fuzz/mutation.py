"""Wrong inputs made of right ones: as files are damaged, and as somebody would forge them."""

import re
import struct

import numpy as np

NUMBER = re.compile(rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
ODD_NUMBERS = [*b"nan inf -inf 1e999 -1 0 1e-320 2147483648 1e9 60000".split(), b"9" * 40, b""]
ODD_TEXTS = [
    *b"\0 [ ]]] { \" ' # = : ../../x /etc/passwd &a *a".split(b" "),
    *(b"\xff\xfe", b"\r", b"\n\n", b"\xe2\x80\xa8", b"!!python/object/apply:os.system [true]"),
]
ODD_INTEGERS = (0, 1, 2**7, 2**8 - 1, 2**15, 2**16 - 1, 2**31 - 1, 2**31, 2**32 - 1, 2**62, 2**63, 2**64 - 1)


def mutated(samples: list[bytes], rng: np.random.Generator) -> bytes:
    """One of the samples with one to four things wrong."""
    data = samples[rng.integers(len(samples))]
    for _ in range(rng.integers(1, 5)):
        change = CHANGES[rng.integers(len(CHANGES))]
        data = change(data, samples, rng)
    return data[:1_000_000]


def _place(data: bytes, rng: np.random.Generator) -> int:
    # Heads decide most: half of the changes fall into the first hundred bytes.
    end = len(data) if rng.random() < 0.5 else min(len(data), 100)
    return int(rng.integers(end + 1))


def flip(data: bytes, samples: list[bytes], rng: np.random.Generator) -> bytes:
    """Bits of a byte or of a few."""
    wrong = bytearray(data)
    for _ in range(rng.integers(1, 4)):
        if wrong:
            wrong[min(_place(data, rng), len(wrong) - 1)] ^= int(rng.integers(1, 256))
    return bytes(wrong)


def cut(data: bytes, samples: list[bytes], rng: np.random.Generator) -> bytes:
    """The end is missing, or a piece in the middle."""
    start = _place(data, rng)
    return data[:start] if rng.random() < 0.5 else data[:start] + data[start + int(rng.integers(1, 64)) :]


def repeat(data: bytes, samples: list[bytes], rng: np.random.Generator) -> bytes:
    """A piece is there twice, or very often."""
    start, length, times = _place(data, rng), int(rng.integers(1, 64)), int(rng.choice([2, 3, 50, 1000]))
    return data[:start] + data[start : start + length] * times + data[start + length :]


def splice(data: bytes, samples: list[bytes], rng: np.random.Generator) -> bytes:
    """The head of one, the tail of another."""
    other = samples[rng.integers(len(samples))]
    return data[: _place(data, rng)] + other[_place(other, rng) :]


def number(data: bytes, samples: list[bytes], rng: np.random.Generator) -> bytes:
    """A number in a text becomes an odd one."""
    found = list(NUMBER.finditer(data[:20_000]))
    if not found:
        return integer(data, samples, rng)
    one = found[rng.integers(len(found))]
    return data[: one.start()] + ODD_NUMBERS[rng.integers(len(ODD_NUMBERS))] + data[one.end() :]


def text(data: bytes, samples: list[bytes], rng: np.random.Generator) -> bytes:
    """Something that texts do not expect."""
    place = _place(data, rng)
    return data[:place] + ODD_TEXTS[rng.integers(len(ODD_TEXTS))] + data[place:]


def integer(data: bytes, samples: list[bytes], rng: np.random.Generator) -> bytes:
    """A count or a size in binary becomes an odd one."""
    letter, size = (("B", 1), ("H", 2), ("I", 4), ("Q", 8))[rng.integers(4)]
    place = _place(data, rng)
    value = ODD_INTEGERS[rng.integers(len(ODD_INTEGERS))] % 256**size
    return data[:place] + struct.pack(("<", ">")[rng.integers(2)] + letter, value) + data[place + size :]


CHANGES = (flip, cut, repeat, splice, number, text, integer)
