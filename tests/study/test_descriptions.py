"""Tables whose columns depend on the study: names, types, and what they may not hold."""

from botohe_moo import load_mission
from botohe_moo.study.scores import algorithm_table, mission_table

TOY = load_mission("toy")


def algorithms(*parameters):
    entry = {"name": "nsga2", "family": "A", "package": None, "version": None, "effective": {}}
    given = {f"A{i}": {**entry, "parameters": p} for i, p in enumerate(parameters)}
    return algorithm_table({"algorithms": given})


def missions(*grids):
    source = {"name_or_path": "terrain"}
    entry = {"source": source, "family": "hills", "min_survival": 0.0, "max_length": None}
    given = {f"M{i}": {**entry, "grid": grid} for i, grid in enumerate(grids)}
    return mission_table({"missions": given}, dict.fromkeys(given, TOY), {})


def test_columns_have_the_type_of_their_values():
    for values, dtype, kept in (
        ([1, 2], "Int64", [1, 2]),
        ([1, 0.5], "float64", [1.0, 0.5]),
        ([True, False], "boolean", [True, False]),
        ([1, "a"], "str", ["1", "a"]),
        ([True, 1], "str", ["true", "1"]),
        ([[1, 2], {"a": None}], "str", ["[1, 2]", '{"a": null}']),
        ([2**70, 1], "str", [str(2**70), "1"]),
    ):
        table = algorithms(*({"x": value} for value in values), {}, {"x": None})
        assert str(table["x"].dtype) == dtype
        assert list(table["x"].dropna()) == kept
        assert table["x"].isna().sum() == 2


def test_parameters_that_only_some_have_are_missing_for_the_others():
    table = algorithms({"a": 1}, {"b": 2.5, "a": 3}, {})
    assert list(table)[5:] == ["a", "b"]
    assert table["a"].isna().tolist() == [False, False, True]
    assert table["b"].isna().tolist() == [True, False, True]


def test_defaults_stand_beside_what_others_are_given():
    entry = {"name": "a", "family": "A", "package": None, "version": None}
    table = algorithm_table(
        {
            "algorithms": {
                "few": {**entry, "parameters": {"n": 5}, "effective": {"n": 5, "rate": 0.5}},
                "usual": {**entry, "parameters": {}, "effective": {"n": 100, "rate": 0.5}},
                "other": {**entry, "parameters": {}, "effective": {}},
            }
        }
    )
    assert list(table)[5:] == ["n"]  # what nobody is given tells nothing apart
    assert table["n"].tolist()[:2] == [5, 100]
    assert table["n"].isna().tolist() == [False, False, True]
    assert table["name"].tolist() == ["a"] * 3


def test_parameters_named_like_a_column_stay_apart():
    table = algorithms({"name": "x", "parameter_name": "y", "version": 2})
    assert list(table)[5:] == ["parameter_name", "parameter_parameter_name", "parameter_version"]
    table = missions({"nodes": 20, "robots": 3}, {"nodes": 40, "robots": 3})
    assert list(table)[11:] == ["grid_nodes", "grid_robots"]
    assert list(table["nodes"]) == [len(TOY.nodes)] * 2
    assert list(table["grid_nodes"]) == [20, 40]


def test_members_of_a_grid_are_a_family():
    table = missions({"seed": 1}, {"seed": 2})
    assert list(table["family"]) == ["hills", "hills"]
    assert list(table["seed"]) == [1, 2]
