"""Conversion of stamps between decimal text, ROS's (sec, nanosec) and integer nanoseconds, without rounding to a float.

Valid stamps, from 0 to 2^31 s, can be stored in every format. Digits beyond the nanosecond are cut off.
"""

from __future__ import annotations

from decimal import Decimal, InvalidOperation

NS_PER_S = 1_000_000_000
END_S = 1 << 31
END_NS = END_S * NS_PER_S
_UNIT_EXPONENT = {"s": 9, "ms": 6, "us": 3, "ns": 0}


def parse_stamp(text: str, unit: str = "s") -> int | None:
    """Nanoseconds of a decimal number of seconds (or ms, us, ns); None if it is not a valid stamp."""
    whole, dot, fraction = text.partition(".")
    if (
        unit == "s"
        and whole.isdigit()
        and whole.isascii()
        and (not dot or (fraction.isdigit() and fraction.isascii()))
    ):
        if len(whole) > 10:
            return None
        stamp = int(whole) * NS_PER_S + int((fraction[:9]).ljust(9, "0"))
    else:
        if "_" in text or not text.isascii():  # Decimal would read these, but other programs do not
            return None
        try:
            value = Decimal(text.strip())
        except InvalidOperation:
            return None
        if not value.is_finite() or value.adjusted() > 20:
            return None
        stamp = int(value.scaleb(_UNIT_EXPONENT[unit]))
        if value < 0:
            return None
    return stamp if stamp < END_NS else None


def join_stamp(seconds: int, nanoseconds: int) -> int | None:
    """Nanoseconds of ROS's two numbers; None if they are not a valid stamp."""
    if not (0 <= seconds < 1 << 31 and 0 <= nanoseconds < NS_PER_S):
        return None
    return seconds * NS_PER_S + nanoseconds


def split_stamp(stamp_ns: int) -> tuple[int, int]:
    """ROS's two numbers of a stamp: whole seconds, and nanoseconds."""
    return divmod(stamp_ns, NS_PER_S)


def earlier_stamp(stamp_ns: int, seconds: float) -> int:
    """A stamp moved by `seconds` into the past, but not below 0, where simulated clocks begin."""
    return max(stamp_ns - round(seconds * 1e9), 0)


def format_stamp(stamp_ns: int) -> str:
    """Seconds with nine decimals."""
    seconds, nanoseconds = split_stamp(stamp_ns)
    return f"{seconds}.{nanoseconds:09d}"
