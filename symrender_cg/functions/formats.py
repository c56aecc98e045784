"""Binary floating-point formats as C knows them: their literals, their bit layout, their unit roundoff.

Comes in: nothing. Goes out: `DOUBLE` and `FLOAT`. Never done here: arithmetic in a format.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from fractions import Fraction
from typing import Any


@dataclass(frozen=True, slots=True)
class Format:
    """An IEEE 754 binary format: `precision` significant bits, one of them hidden, in a word of `width` bits."""

    name: str
    width: int
    precision: int
    digits: int
    suffix: str
    pack: str

    @property
    def unit_roundoff(self) -> Fraction:
        return Fraction(1, 2**self.precision)

    @property
    def fraction_bits(self) -> int:
        return self.precision - 1

    @property
    def bias(self) -> int:
        """What is added to an exponent before it is stored; the smallest normal number is 2^(1 - bias)."""
        return int(2 ** (self.width - self.precision - 1)) - 1

    @property
    def word(self) -> str:
        """The unsigned C type of the same width."""
        return f"uint{self.width}_t"

    def round(self, value: Any) -> float:
        """The number of the format nearest to an mpmath number, by way of a double (exact for binary64)."""
        return float(struct.unpack(self.pack, struct.pack(self.pack, float(value)))[0])

    def literal(self, value: float) -> str:
        """C source of a number of the format, in as many digits as bring it back."""
        text = f"{value:.{self.digits}g}"
        return (text if "." in text or "e" in text else f"{text}.0") + self.suffix

    def bits(self, pattern: int) -> str:
        """C source of a bit pattern of the format."""
        return f"UINT{self.width}_C(0x{pattern:0{self.width // 4}x})"

    def bits_of(self, value: float) -> int:
        """The bit pattern of a number."""
        return int.from_bytes(struct.pack(self.pack, value), "little")


DOUBLE = Format("double", 64, 53, 17, "", "<d")
FLOAT = Format("float", 32, 24, 9, "f", "<f")
