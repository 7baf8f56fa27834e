"""What holds of every kind: it is complete, its scenarios are its own, its data tell what they are."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import faintrack as ft
from faintrack.kinds import KINDS, kind_named
from faintrack.kinds.commented import commented_scenario
from tests.cli.calling import call
from tests.kinds.small import EVERY, FILES, SCANS, SCENARIOS, data, plan, result

SMALL = pytest.mark.parametrize("kind", EVERY)


def says(sentence: str, *names: str) -> None:
    """It is one sentence that holds these names."""
    assert sentence.endswith((".", "?"))
    assert "\n" not in sentence
    for name in names:
        assert name in sentence, sentence


def refused(*names: str, what: Any, **sections: Any) -> None:
    with pytest.raises(ft.InputError) as caught:
        ft.track(what, **sections)
    says(str(caught.value), *names)


# Complete


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_is_complete(kind: str) -> None:
    about = kind_named(kind)
    assert about.name == kind
    for field in dataclasses.fields(about):
        if field.default is dataclasses.MISSING:
            assert getattr(about, field.name), field.name
    assert about.scenario.model_fields["kind"].default == kind
    assert issubclass(about.scenario, ft.Scenario)


@pytest.mark.parametrize("kind", KINDS)
def test_a_commented_scenario_reads_back(kind: str, tmp_path: Path) -> None:
    """As it stands, and with what is written out: a second writing changes nothing."""
    path = tmp_path / "scenario.toml"
    path.write_text(commented_scenario(kind), encoding="utf-8")
    scenario = ft.Scenario.read(path)
    assert scenario.kind == kind
    scenario.save(path)
    assert ft.Scenario.read(path) == scenario


@SMALL
def test_a_scenario_survives_its_file(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "scenario.toml"
    for scenario in (ft.Scenario(**SCENARIOS[kind]), result(kind).scenario):
        scenario.save(path)
        again = ft.Scenario.read(path)
        assert again == scenario
        assert type(again) is kind_named(kind).scenario


@SMALL
def test_data_and_results_can_be_described_and_drawn(kind: str) -> None:
    about = kind_named(kind)
    for facts in (about.describe(data(kind)), about.about(result(kind))):
        assert facts
        assert all(isinstance(fact, str) and fact for pair in facts.items() for fact in pair)
    assert isinstance(result(kind).plot(), Figure)


@SMALL
def test_silence_holds_no_target_and_is_as_long(kind: str) -> None:
    scenario = ft.Scenario(**SCENARIOS[kind])
    silent = ft.track(kind_named(kind).silence(scenario, 1), scenario)
    assert silent.tracks == []
    assert silent.data.sizes["time"] == SCANS


@SMALL
def test_the_target_of_the_simulation_is_found_and_named(kind: str) -> None:
    (known,) = kind_named(kind).targets(ft.Scenario(**SCENARIOS[kind]))
    (track,) = result(kind).tracks
    places = known.at(track.time)
    assert set(places) == set(track.place)
    off = [track.mean[name] - values for name, values in places.items()]
    assert np.sqrt(np.sum(np.square(off), axis=0)).max() < plan(kind).within


# The same by every door


@SMALL
def test_command_and_python_give_the_same_numbers(kind: str, tmp_path: Path) -> None:
    scenario, file = tmp_path / "scenario.toml", tmp_path / FILES[kind]
    ft.Scenario(**SCENARIOS[kind]).save(scenario)
    assert call("simulate", scenario, "--out", file).status == 0
    done = call("track", file, "--scenario", scenario, "--out", tmp_path / "command")
    assert done.status == 0, done.err
    kept = ft.track(file, scenario, out=tmp_path / "python")
    states = [(tmp_path / name / "states.csv").read_text(encoding="utf-8") for name in ("command", "python")]
    assert states[0] == states[1]
    assert len(states[0].splitlines()) > 3
    # What was chosen for the data is kept beside the result, and gives the same again.
    again = ft.track(file, tmp_path / "python" / "scenario.toml")
    assert again.to_dataframe().equals(kept.to_dataframe())
    assert again.scenario == kept.scenario


@pytest.mark.slow
def test_the_options_of_the_command_are_sections_of_python(tmp_path: Path) -> None:
    array, file = tmp_path / "array.toml", tmp_path / "night.h5"
    array.write_text("line = {count = 4, spacing = 1.5}\n")
    ft.simulate(SCENARIOS["recording"], file)
    options = ("--array", array, "--band", 50, 200, "--frame", 0.2, "--set", "filter.particles=60")
    done = call("track", file, *options, "--out", tmp_path / "out")
    assert done.status == 0, done.err
    own = ft.track(file, array=array, analysis={"band": (50, 200), "frame": 0.2}, filter={"particles": 60})
    assert ft.read_result(tmp_path / "out").to_dataframe().equals(own.to_dataframe())


# The file tells the kind


@SMALL
def test_a_file_tells_its_kind(kind: str, tmp_path: Path) -> None:
    file = tmp_path / FILES[kind]
    ft.simulate(SCENARIOS[kind], file)
    about = ft.info(file)
    assert about.kind == kind
    assert f"faintrack track {file}" in about.command
    assert isinstance(ft.read(file), kind_named(kind).data)
    told = call("info", file)
    assert told.status == 0, told.err
    assert told.out == f"{about}\n"


def test_a_wrong_guess_is_answered(tmp_path: Path) -> None:
    samples, images, text = tmp_path / "samples.h5", tmp_path / "images.npz", tmp_path / "notes.txt"
    ft.simulate(SCENARIOS["recording"], samples)
    ft.simulate(SCENARIOS["frames"], images)
    text.write_text("nothing")
    refused("images.npz holds frames", "no section cfar", "--kind", what=images, cfar={"guard": 1})
    refused("images.npz was taken for frames", "--kind", what=images, tracker={"declares": 0.9})
    refused("notes.txt", "the name does not tell what it holds", "recording, frames", what=text)
    refused("samples.film", "unknown kind of file", what=samples.rename(tmp_path / "samples.film"), kind="recording")
    refused("kind is 'film'", "recording, frames", what=images, kind="film")
    refused("recording", "frames", "expected the same", what=data("recording"), kind="frames")
    refused("[array]", "recording", "[cells]", "frames", what=text, array={}, cells={})
    refused("none.wav does not exist", what=tmp_path / "none.wav")


# A scenario has the sections of its kind


def test_sections_tell_the_kind() -> None:
    assert ft.Scenario(frames={}).kind == "frames"
    with pytest.raises(ft.InputError, match="kind is missing; expected one of recording, frames"):
        ft.Scenario(tracker={"declare": 0.9})


@pytest.mark.parametrize(
    ("sections", "names"),
    [
        ({"kind": "frames", "analysis": {}}, ("no field analysis",)),
        ({"kind": "recording", "cells": {}}, ("no field cells",)),
        ({"kind": "frames", "filter": {"guided": True}}, ("no field filter.guided",)),
        ({"kind": "recording", "filter": {"kind": "grid"}}, ("no field filter.kind",)),
        ({"kind": "frames", "tracker": {"method": "cfar"}}, ("no field tracker.method",)),
        ({"kind": "frames", "cell": {}}, ("no field cell; did you mean cells?",)),
        ({"kind": "frames", "tracker": {"declared": 0.9}}, ("no field tracker.declared; did you mean declare?",)),
        ({"kind": "recording", "array": {"lines": {"count": 2}}}, ("no field array.lines; did you mean line?",)),
        ({"frame": {}}, ("no section frame; did you mean frames?",)),
        ({"kind": "frames", "zebra": 1}, ("no field zebra; known are kind, frames, cells",)),
        ({"frames": {}, "array": {}}, ("[frames]", "[array]", "expected sections of one kind")),
        ({"kind": "frames", "tracker": 3}, ("tracker is 3", "expected a table")),
    ],
)
def test_what_is_of_another_kind_or_of_none_is_refused(sections: dict[str, Any], names: tuple[str, ...]) -> None:
    with pytest.raises(ft.InputError) as caught:
        ft.Scenario(**sections)
    says(str(caught.value), *names)


# What Python users have


def states(what: Any, scenario: Any = None, **sections: Any) -> Any:
    return ft.track(what, scenario, **sections).to_dataframe()


def test_paths_arrays_and_numbers_are_taken_as_python_has_them(tmp_path: Path) -> None:
    """Each of these is the same run."""
    small = SCENARIOS["recording"]
    expected = result("recording").to_dataframe()
    scenario, array = tmp_path / "scenario.toml", tmp_path / "array.toml"
    ft.Scenario(**small).save(scenario)
    array.write_text("line = {count = 4, spacing = 1.5}\n")
    line = ft.line_array(4, 1.5)
    numbers = small | {
        "analysis": {"frame": np.float64(0.2), "beams": np.int64(24)},
        "filter": {"particles": np.int32(60), "births": 30},
    }
    heard = data("recording")
    assert states(heard, numbers).equals(expected)
    assert states(heard, scenario).equals(expected)
    assert states(heard, str(scenario)).equals(expected)
    assert states(heard, ft.Scenario(**small)).equals(expected)
    for given in (line, array, str(array)):
        assert states(heard, small, array=given).equals(expected)
    channels = {"channels": [{"name": str(k), "x": 0.0, "y": y} for k, y in enumerate(line.positions[:, 1])]}
    assert states(heard, small | {"array": channels}).equals(expected)


def test_several_files_are_given_as_a_list(tmp_path: Path) -> None:
    heard = data("recording")
    samples = heard.read(0, heard.length)
    files = [tmp_path / "left.h5", tmp_path / "right.h5"]
    for file, columns in zip(files, (samples[:, :2], samples[:, 2:]), strict=True):
        kind_named("recording").write(file, ft.from_samples(columns, heard.sample_rate))
    for given in (files, tuple(map(str, files))):
        assert states(given, SCENARIOS["recording"]).equals(result("recording").to_dataframe())


def test_arrays_of_numpy_are_taken_for_lists() -> None:
    scenario = ft.Scenario(kind="recording", analysis={"band": np.array([50.0, 200.0])})
    assert scenario.analysis.band == (50.0, 200.0)
    levels = ft.Scenario(kind="frames", cells={"levels": np.array([2, 5])})
    assert levels.cells.levels == (2.0, 5.0)


def test_what_is_no_number_scenario_or_data_is_refused(tmp_path: Path) -> None:
    heard, line = data("recording"), ft.line_array(4, 1.5)
    refused("analysis.frame is '0.2'", "valid number", what=heard, array=line, analysis={"frame": "0.2"})
    refused("filter.particles is 60.5", what=heard, array=line, filter={"particles": 60.5})
    refused("analysis.frame is nan", "finite", what=heard, array=line, analysis={"frame": np.nan})
    refused("scenario is a SensorArray", "track(what, array=...)", what=heard, scenario=line)
    refused("what to track is a ndarray", "Recording, Sequence", "from_samples", what=np.zeros((9, 4)))
    refused("what to track is a int", what=[3])
    refused("expected paths", what=[])
    refused("no array was given", "--array", what=heard)


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("line = {count = 4, spacing = 1.5}\nspeed = 1500.0\n", "there is no field speed; did you mean sound_speed?"),
        ("line = {count = 4, spacing = 1.5}\ndead = ['x']\n", "dead lists 'x'; the channels are 0, 1, 2, 3, or by"),
        ("line = {count = 1, spacing = 1.5}\n", "line.count is 1: input should be greater than or equal to 2."),
    ],
)
def test_what_is_wrong_in_the_file_of_an_array_names_that_file_once(text: str, names: str, tmp_path: Path) -> None:
    array = tmp_path / "array.toml"
    array.write_text(text)
    with pytest.raises(ft.InputError) as caught:
        ft.Scenario(kind="recording", array=array)
    assert str(caught.value).startswith(f"array: {array}: {names}")
    assert not str(caught.value).endswith("..")


def test_numbers_that_stand_in_text_are_refused_in_files_too(tmp_path: Path) -> None:
    path = tmp_path / "scenario.toml"
    path.write_text('[frames]\nframe_interval = "0.04"\n')
    with pytest.raises(ft.InputError, match=r"scenario\.toml: frames\.frame_interval is '0\.04': input should be"):
        ft.Scenario.read(path)
