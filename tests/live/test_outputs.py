"""What goes to other programs: sentences of NMEA with their checksums, and figures for Prometheus."""

import re
import socket
from functools import reduce
from operator import xor
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from faintrack.errors import InputError
from faintrack.live.metrics import exposition
from faintrack.live.nmea import sender, sentence, target_messages
from faintrack.live.watch import Status


@pytest.mark.parametrize(
    "published",
    [
        "$GPGGA,092750.000,5321.6802,N,00630.3372,W,1,8,1.03,61.7,M,55.2,M,,*76",
        "$GPGSA,A,3,10,07,05,02,29,04,08,13,,,,,1.72,1.03,1.38*0A",
    ],
)
def test_checksums_are_those_of_published_sentences(published: str) -> None:
    assert sentence(published[1:-3]) == published + "\r\n"


@given(st.integers(1, 10**9), st.floats(-180, 180))
def test_a_target_message_is_whole(label: int, bearing: float) -> None:
    """Bearings lie in [0, 360) as written, numbers in 01 to 99, sentences within 82 characters."""
    (message,) = target_messages({"tracks": [{"label": label, "bearing_deg": bearing}]})
    body, check = re.fullmatch(r"\$(RATTM,.*)\*([0-9A-F]{2})\r\n", message).groups()
    assert int(check, 16) == reduce(xor, body.encode())
    fields = body.split(",")
    assert len(fields) == 16
    assert 1 <= int(fields[1]) <= 99
    assert fields[11] == str(label)
    assert 0 <= float(fields[3]) < 360
    assert abs((float(fields[3]) - bearing + 180) % 360 - 180) < 0.0501
    assert len(message) <= 82


def test_sentences_arrive_by_udp_and_in_a_file(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as plotter:
        plotter.bind(("127.0.0.1", 0))
        plotter.settimeout(5.0)
        with sender(f"udp://127.0.0.1:{plotter.getsockname()[1]}") as send:
            send(sentence("RATTM,01"))
        assert plotter.recv(100) == sentence("RATTM,01").encode()
    for number in (1, 2):
        with sender(str(tmp_path / "tracks.nmea")) as send:
            send(sentence(f"RATTM,0{number}"))
    assert (tmp_path / "tracks.nmea").read_bytes() == (sentence("RATTM,01") + sentence("RATTM,02")).encode()


def test_nobody_who_listens_holds_up_nothing() -> None:
    with sender("udp://127.0.0.1:9") as send:
        for _ in range(100):
            send(sentence("RATTM,01"))


@pytest.mark.parametrize("where", ["udp://127.0.0.1", "udp://:10110", "udp://127.0.0.1:99999", "/nowhere/tracks.nmea"])
def test_a_wrong_address_is_one_sentence(where: str) -> None:
    with pytest.raises(InputError, match=re.escape(where)), sender(where):
        pass


def test_figures_are_those_of_the_watch() -> None:
    status = Status(scans=25, behind_s=0.5, gaps=2, missing_s=3.25, left_out=4)
    text = exposition(status, {"lost": 3, "late": 1}, {"time": 12.5, "existence": float("nan"), "tracks": [{}, {}]})
    assert text.endswith("\n")
    values = dict(row.rsplit(" ", 1) for row in text.splitlines() if not row.startswith("#"))
    assert values == {
        "faintrack_scans_total": "25",
        "faintrack_left_out_scans_total": "4",
        "faintrack_gaps_total": "2",
        "faintrack_missing_seconds_total": "3.25",
        "faintrack_behind_seconds": "0.5",
        "faintrack_time_seconds": "12.5",
        "faintrack_existence": "NaN",
        "faintrack_tracks": "2",
        'faintrack_packets_total{what="late"}': "1",
        'faintrack_packets_total{what="lost"}': "3",
    }
