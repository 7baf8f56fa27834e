"""Seconds and dates: Stone Soup's times are dates without a zone, here those of UTC."""

from datetime import UTC, datetime, timedelta

EPOCH = datetime(1970, 1, 1)


def seconds(time: datetime) -> float:
    """Seconds since the start of 1970; a date without a zone is one of UTC.

    Examples
    --------
    >>> seconds(datetime(1970, 1, 2))
    86400.0
    """
    naive = time if time.tzinfo is None else time.astimezone(UTC).replace(tzinfo=None)
    return (naive - EPOCH) / timedelta(seconds=1)


def date(time: float) -> datetime:
    """Date of seconds since the start of 1970, the inverse of `seconds`; to a microsecond.

    Examples
    --------
    >>> date(86400.5)
    datetime.datetime(1970, 1, 2, 0, 0, 0, 500000)
    """
    return EPOCH + timedelta(seconds=time)
