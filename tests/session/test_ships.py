class TestShips:
    TIMES = np.arange(-10.0, 80.0, 7.0)

    def ships(self) -> list[Ship]:
        there = place(self.TIMES)
        return [
            Ship("target", self.TIMES, False, there, False),
            Ship("another", self.TIMES, False, there + np.array([300.0, 100.0]), False),
            Ship("elsewhere", self.TIMES, False, there + np.array([9000.0, 0.0]), False),
        ]

    def test_a_track_belongs_to_the_ship_that_is_near(self, result: Result) -> None:
        truth = ships_dataset(self.ships(), in_step(records()), scenario())
        assert truth.ship.values.tolist() == ["target", "another"]
        np.testing.assert_allclose(truth.truth_x.values[:, 0], place(np.arange(60.0))[:, 0], rtol=1e-6)
        parts = [result.data.isel(time=slice(0, 32)), result.data.isel(time=slice(32, 60))]
        data = xr.concat(list(beside(parts, truth)), "time", data_vars="minimal")
        found, missed = sightings(data, 50.0)
        assert (found.ship, found.tracks, found.from_s, found.to_s) == ("target", (1,), 0.0, 59.0)
        assert found.declared_s == result.tracks[0].start_s
        assert found.rmse_m == pytest.approx(np.sqrt(np.mean(distance(result.data) ** 2)), rel=1e-4)
        assert found.followed == 1.0
        assert (missed.declared_s, missed.tracks, missed.followed) == (None, (), 0.0)
        assert unexplained(data, 50.0) == []
        assert unexplained(data.assign(truth_x=data.truth_x + 500), 50.0) == [1]
        page = report(Result(data, result.tracks, result.scenario, None, 1.0))
        assert "Ships known to have been there" in page
        assert "never within 150 m of a ship: none" in page

    def test_ships_are_not_invented_between_reports_far_apart(self) -> None:
        ship = Ship("moored", np.array([0.0, 20.0, 900.0]), False, np.tile([0.0, 500.0], (3, 1)), False)
        truth = ships_dataset([ship], in_step(records()), scenario())
        np.testing.assert_array_equal(np.isfinite(truth.truth_x.values[:, 0]), np.arange(60) <= 20)

    def test_a_report_where_no_ship_could_be_is_passed_over(self) -> None:
        places = np.array([[0.0, 500.0], [0.0, 500.0], [9e6, 500.0], [0.0, 500.0], [0.0, 500.0]])
        ship = Ship("moored", np.arange(0.0, 75.0, 15.0), False, places, False)
        truth = ships_dataset([ship], in_step(records()), scenario())
        there = np.isfinite(truth.truth_x.values[:, 0])
        np.testing.assert_array_equal(there, (np.arange(60) <= 15) | (np.arange(60) > 45))

    @pytest.mark.parametrize(
        ("changes", "expected"),
        [
            ({"utc": True}, "ais.csv has times in UTC and the records do not tell when they start"),
            ({"degrees": True}, "ais.csv has latitude and longitude; expected the region in degrees too"),
            ({"places": np.zeros((2, 2))}, "ais.csv: no ship was in the region during the records"),
        ],
    )
    def test_ships_that_cannot_be_laid_over(self, changes: dict, expected: str) -> None:
        fields = {"utc": False, "degrees": False, "places": np.full((2, 2), 500.0)} | changes
        ship = Ship("ship", np.array([0.0, 60.0]), **fields)
        with pytest.raises(InputError) as caught:
            ships_dataset([ship], in_step(records()), scenario(), "ais.csv")
        assert expected in str(caught.value)


