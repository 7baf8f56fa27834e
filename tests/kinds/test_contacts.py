"""Contacts of an active sonar: a target is found and followed, from a file to the report; what does not fit is told."""

import dataclasses
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

import faintrack as ft
from faintrack.data.contacts import from_columns, to_columns
from faintrack.errors import InputError
from faintrack.io.contacts import read_contacts, write_contacts
from faintrack.kinds import kind_named
from faintrack.kinds.contacts.build import build_pairs, build_sensor
from faintrack.kinds.contacts.fit import Fit
from faintrack.kinds.stretches import of_returns
from faintrack.kinds.surrogates import exchanged
from faintrack.results.result import Result
from faintrack.sensors.bistatic import Bistatic, fixed
from faintrack.sensors.contact_sets import ContactSet
from faintrack.sensors.several_sets import SeveralSets
from tests.contacts import INTERVAL, PINGS, SCENARIO, drawn, scenario
from tests.kinds.refusing import refuse


@pytest.fixture(scope="module")
def followed() -> Result:
    return ft.track(drawn(), scenario())


def test_a_target_is_found_and_its_contacts_told(followed: Result) -> None:
    (track,) = followed.tracks
    (known,) = kind_named("contacts").targets(scenario())
    # A contact where it is expected says seven nats.
    assert 90 <= track.start_s <= 90 + 6 * INTERVAL
    assert track.end_s == (PINGS - 1) * INTERVAL
    error = np.hypot(*(track.mean[name] - known.at(track.time)[name] for name in "xy"))
    # 1.5 degrees at three kilometres are 80 m.
    assert np.sqrt(np.mean(error[-10:] ** 2)) < 80
    data = followed.data
    held = np.isin(data.time.values, track.time)
    true = known.at(data.time.values)
    away = np.hypot(*(data[f"contact_{name}"].values[:, 0] - true[name][:, None] for name in "xy"))
    chance = data.association.values[:, 0]
    assert chance[held][away[held] < 100].mean() > 0.9
    assert chance[held][away[held] > 600].mean() < 0.05


def test_what_is_kept_agrees_with_itself(followed: Result) -> None:
    data = followed.data
    assert data.association.sizes == {"time": PINGS, "pair": 1, "entry": 16}
    assert all("units" in data[name].attrs for name in data.data_vars)
    there = np.isfinite(data.distance.values)
    np.testing.assert_array_equal(there.sum(axis=-1), drawn().counts)
    # Of each target at most one contact, and only if it exists.
    assert np.all(data.association.sum(("pair", "entry")) <= data.existence.sum("slot") + 1e-3)
    place = np.hypot(data.contact_x, data.contact_y).values[there]
    np.testing.assert_allclose(place, data.distance.values[there], rtol=1e-5)
    assert followed.misfits == ()
    assert followed.plot().axes


def test_false_contacts_give_no_track() -> None:
    assert ft.track(drawn(present=False, seed=3), scenario()).tracks == []


def test_their_number_is_learnt_from_the_data() -> None:
    """The mean of all contacts, written beside the result."""
    plan = kind_named("contacts").plan(drawn(), scenario(contacts={"false_per_ping": None}))
    assert plan.scenario.contacts.false_per_ping == pytest.approx(len(drawn().ping) / PINGS)
    (said,) = plan.remarks()
    assert "is the mean of the data, targets among them" in said


# Files


def test_a_file_tells_that_it_holds_contacts(tmp_path: Path) -> None:
    path = tmp_path / "contacts.csv"
    write_contacts(path, drawn())
    about = ft.info(path)
    assert about.kind == "contacts"
    assert about.facts["contacts"].startswith(f"{len(drawn().ping)}, ")
    again = read_contacts(path)
    np.testing.assert_allclose(again.distance, drawn().distance, rtol=1e-8)
    np.testing.assert_array_equal(again.counts, drawn().counts)


RETURNS = "time_s,delay_s,bearing_deg,snr_db\n0,2,90,12\n0,3,40,15\n30,,,\n60,2.1,91,11\n"


def test_returns_are_contacts_where_the_scenario_has_them_so(tmp_path: Path) -> None:
    path, told = tmp_path / "returns.csv", {"delay": (0.2, 8.0), "delay_std": 0.03, "range": None, "range_std": None}
    path.write_text(RETURNS, encoding="utf-8")
    assert ft.info(path).kind == "returns"
    sections = scenario(contacts=told).model_dump(exclude_none=True, exclude={"kind"})
    contacts = ft.read(path, scenario=sections)
    assert contacts.counts.ravel().tolist() == [2, 0, 1]
    assert not contacts.ranged
    assert contacts.remarks == ("snr_db of the contacts is not read: whether one is loud does not count.",)


def test_columns_come_back(tmp_path: Path) -> None:
    """Of two receivers, the second of which misses a ping, with Doppler and places that move; as Zarr too."""
    columns = {
        "time_s": [0.0, 0.0, 0.0, 9.0],
        "delay_s": [2.0, 3.0, np.nan, 4.0],
        "bearing_deg": [10.0, 350.0, np.nan, 180.0],
        "doppler_hz": [-3.0, 1.0, np.nan, 0.0],
        "receiver": np.array(["a", "a", "b", "a"]),
        **{f"receiver_{name}": [1.0, 1.0, 5.0, 2.0] for name in ("x_m", "y_m", "vx", "vy")},
    }
    contacts = from_columns(columns)
    assert contacts.counts.tolist() == [[2, 0], [1, 0]]
    assert contacts.heard.tolist() == [[True, True], [True, False]]
    for name, values in to_columns(contacts).items():
        np.testing.assert_array_equal(values, columns[name])
    write_contacts(tmp_path / "contacts.zarr", contacts)
    again = read_contacts(tmp_path / "contacts.zarr")
    assert again.pairs == (("", "a"), ("", "b"))
    np.testing.assert_array_equal(again.doppler, contacts.doppler)


def test_stretches_and_surrogates_keep_what_belongs_together() -> None:
    part = of_returns(drawn(), 3 * INTERVAL, 6 * INTERVAL)
    np.testing.assert_array_equal(part.counts, drawn().counts[3:6])
    other = exchanged(drawn(), seed=1)
    assert sorted(other.distance) == sorted(drawn().distance)
    assert sorted(other.counts.ravel()) == sorted(drawn().counts.ravel())
    assert (other.counts != drawn().counts).any()


# Sources and receivers


def test_places_come_from_columns_names_or_the_section() -> None:
    one = from_columns({"time_s": [0.0], "range_m": [900.0], "bearing_deg": [0.0]})
    (pair,) = build_pairs(scenario(contacts={"receiver": [5.0, 6.0]}), one)
    assert (float(pair.receiver.x[0]), float(pair.receiver.y[0])) == (5.0, 6.0)
    named = dataclasses.replace(one, pairs=(("", "2"),), pair=np.array([0]), reported=np.array([[True]]))
    several = ft.Scenario(
        **scenario().model_dump(exclude_none=True)
        | {"receivers": [{"name": "north", "place": [0.0, 9.0]}, {"name": "east", "place": [7.0, 0.0]}]}
    )
    (pair,) = build_pairs(several, named)
    assert float(pair.receiver.x[0]) == 7.0
    for contacts, known, says in (
        (one, several, "there is no column receiver; expected it, since the scenario has 2"),
        (named, scenario(), r"a column receiver, and the scenario has no \[\[receivers\]\]"),
        (dataclasses.replace(named, pairs=(("", "west"),)), several, "receiver is 'west'; expected one of the"),
        (one, scenario(contacts={"source": None}), "contacts.source is missing; expected metres"),
    ):
        with pytest.raises(InputError, match=says):
            build_pairs(known, contacts)


@pytest.mark.slow
def test_two_that_cross_keep_their_labels() -> None:
    """They meet after 400 s; each track is at the end nearest to the target that it began with."""
    targets = [{"x": -2000.0, "y": 1200.0, "vx": 5.0, "vy": 3.0}, {"x": -2000.0, "y": 3600.0, "vx": 5.0, "vy": -3.0}]
    told = scenario(
        tracker={"targets": 3},
        filter={"particles": 8000, "births": 8000},
        simulation={"pings": 40, "interval": 20.0, "targets": targets},
    )
    result = ft.track(ft.simulate(told), told)
    assert len(result.tracks) == 2
    known = kind_named("contacts").targets(told)
    for track in result.tracks:
        assert track.start_s < 300
        assert track.end_s == 780
        away = [np.hypot(*(track.mean[name] - each.at(track.time)[name] for name in "xy")) for each in known]
        assert np.argmin([each[0] for each in away]) == np.argmin([each[-1] for each in away])
        assert min(each[-1] for each in away) < 150


@pytest.mark.slow
def test_two_receivers_report_together() -> None:
    """Delays of one source, Doppler too; each receiver detects half of the time."""
    content: dict[str, Any] = scenario().model_dump(exclude_none=True)
    content["contacts"] |= {
        "delay": (0.3, 9.0),
        "delay_std": 0.03,
        "doppler": (-40.0, 40.0),
        "doppler_std": 1.0,
        "frequency": 2000.0,
        "detection_probability": 0.6,
    }
    content["contacts"] = {name: each for name, each in content["contacts"].items() if not name.startswith("range")}
    content["receivers"] = [{"name": "a", "place": [0.0, 0.0]}, {"name": "b", "place": [-1500.0, -800.0]}]
    result = ft.track(ft.simulate(content), content)
    (track,) = result.tracks
    (known,) = kind_named("contacts").targets(ft.Scenario(**content))
    error = np.hypot(*(track.mean[name] - known.at(track.time)[name] for name in "xy"))
    assert np.sqrt(np.mean(error[-10:] ** 2)) < 80
    assert result.data.sizes["pair"] == 2
    result.plot()


# What does not fit


def fit_of(values: np.ndarray, **fields: Any) -> Fit:
    """Of 40 pings with the same contacts, shape (entry, 2), none of a target."""
    table = scenario(contacts=fields).contacts
    fit = Fit(build_sensor(table), learnt=False)
    shape = 40, 1, len(values)
    here = Bistatic(fixed(0.0, 0.0), fixed(0.0, 0.0))
    held = ContactSet(jnp.zeros(shape[:2]), jnp.broadcast_to(values, (*shape, 2)), jnp.ones(shape, bool), here)
    fit.add(SeveralSets(jnp.zeros(40), held, jnp.ones((40, 1), bool)), np.zeros(shape))
    return fit


def test_bins_of_echoes_that_were_told_as_contacts_are_recognised() -> None:
    cells = np.array([[2000.0, 1.0], [2025.0, 1.0], [2000.0, 1.03], [2025.0, 1.03], [5000.0, -2.0]])
    (said,) = [each for each in fit_of(cells, false_per_ping=5.0).misfits() if "bins of one echo" in each]
    assert "near each other 240 times" in said
    assert "a scenario with [sonar]" in said
    spread = np.array([[2000.0, 1.0], [3000.0, -1.0], [4000.0, 2.0]])
    assert not any("bins of one echo" in each for each in fit_of(spread).misfits())


def test_too_many_and_uneven_contacts_are_told() -> None:
    near = np.stack([np.full(6, 400.0), np.arange(6.0) - 3], axis=-1)
    number, places = fit_of(near).misfits()
    assert "6 contacts a ping that are no target's, and contacts.false_per_ping is 3" in number
    assert "100 % have a range (m) of 200 to 780" in places


CONTACTS = "time_s,range_m,bearing_deg\n0,900,90\n30,910,91\n"


def refuse_contacts(folder: Path, rows: str, told: str, *names: str) -> None:
    (folder / "contacts.csv").write_text(rows, encoding="utf-8")
    (folder / "scenario.toml").write_text(told, encoding="utf-8")
    refuse(folder, folder / "contacts.csv", folder / "scenario.toml", names)


@pytest.mark.parametrize(
    ("old", "new", "names"),
    [
        ("range_std = 25.0", "", ("either delay and delay_std, or range and range_std",)),
        ("range_std = 25.0", "delay_std = 1.0", ("either delay and delay_std",)),
        ("range_std = 25.0", "range_std = 0.0", ("contacts.range_std is 0.0",)),
        ("range = [200.0, 6000.0]", "range = [6000.0, 200.0]", ("range goes from 6000 to 200",)),
        ("range = [200.0, 6000.0]", "range = [-1.0, 200.0]", ("range begins at -1",)),
        ("bearing_std_deg = 1.5", "bearing_std_deg = 60.0", ("contacts.bearing_std_deg is 60.0",)),
        ("bearing_std_deg = 1.5", "", ("contacts.bearing_std_deg is missing",)),
        ("detection_probability = 0.9", "detection_probability = 1.5", ("contacts.detection_probability is 1.5",)),
        ("false_per_ping = 3.0", "false_per_ping = 0.0", ("contacts.false_per_ping is 0.0",)),
        ("speed = 8.0", "speed = 8.0\nsector_deg = [30.0, 390.0]", ("sector_deg goes from 30 to 390",)),
        ("speed = 8.0", "speed = 8.0\ndoppler_std = 1.0", ("doppler, doppler_std and frequency together",)),
        ("source = [0.0, 0.0]", "", ("contacts.source is missing",)),
        ("[filter]", "[grid]\n[filter]", ("[contacts] is of contacts", "[grid] of returns")),
        ("[filter]", '[[receivers]]\nname = "a"\n[[receivers]]\nname = "a"\n[filter]', ("receivers[1].name is 'a'",)),
    ],
)
def test_scenario_that_is_wrong(old: str, new: str, names: tuple[str, ...], tmp_path: Path) -> None:
    assert old in SCENARIO
    refuse_contacts(tmp_path, CONTACTS, SCENARIO.replace(old, new), *names)


@pytest.mark.parametrize(
    ("rows", "names"),
    [
        ("time_s,bearing_deg\n0,90\n", ("neither of delay_s and range_m",)),
        ("time_s,range_m,delay_s,bearing_deg\n0,900,1,90\n", ("both of delay_s and range_m",)),
        ("time_s,range_m\n0,900\n", ("no column bearing_deg",)),
        ("time_s,range_m,bearing_deg,strength\n0,900,90,1\n", ("a column 'strength'",)),
        ("time_s,range_m,bearing_deg\n0,900,90\n30,-5,90\n", ("row 3", "range_m is -5", "at least 0")),
        ("time_s,range_m,bearing_deg\n0,900,90\n30,7000,90\n", ("row 3", "range_m is 7000", "200 to 6000")),
        ("time_s,range_m,bearing_deg\n0,900,90\n30,800,\n", ("row 3", "bearing_deg is missing")),
        ("time_s,range_m,bearing_deg\n0,900,90\n0,,\n", ("row 3", "its time alone", "range_m and the others")),
        ("time_s,delay_s,bearing_deg\n0,1,90\n", ("a column delay_s", "contacts.delay and contacts.delay_std")),
        ("time_s,range_m,bearing_deg,doppler_hz\n0,900,90,1\n", ("a column doppler_hz", "contacts.doppler")),
        ("time_s,range_m,bearing_deg\n9,900,90\n0,900,90\n", ("row 3", "time_s is 0", "ascending")),
    ],
)
def test_contacts_that_are_wrong(rows: str, names: tuple[str, ...], tmp_path: Path) -> None:
    refuse_contacts(tmp_path, rows, SCENARIO, *names)


def test_outside_the_sector_nothing_is_reported(tmp_path: Path) -> None:
    told = SCENARIO.replace("speed = 8.0", "speed = 8.0\nsector_deg = [300.0, 60.0]")
    refuse_contacts(tmp_path, CONTACTS, told, "row 2: bearing_deg is 90", "the sector, 300 to 60 degrees clockwise")


def test_what_a_simulation_needs() -> None:
    with pytest.raises(InputError, match=r"contacts\.false_per_ping is missing"):
        ft.simulate(scenario(contacts={"false_per_ping": None}))
    with pytest.raises(InputError, match=r"the scenario has no \[simulation\]"):
        ft.simulate(ft.Scenario(**scenario().model_dump(exclude={"simulation"}, exclude_none=True)))
