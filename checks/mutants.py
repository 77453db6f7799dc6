"""One changed operator for each module of kernels, and the tests that have to notice it."""

from typing import NamedTuple


class Mutant(NamedTuple):
    """A line of a module, as it stands and with another operator."""

    module: str  # below src/botohe_moo/kernels, without its ending
    line: str  # a part of one line, which is there once
    changed: str
    test: str  # below tests


_ANNEAL = "kernels/test_anneal.py::test_"
_BEAM = "kernels/test_beam.py::TestExact::test_"
_BOUNDS = "kernels/test_bounds.py::test_"
_CONSTRUCT = "kernels/test_construct.py::test_"
_EXACT = "kernels/test_exact.py::Test"
_MOVES = "kernels/test_moves.py::test_"
_PATHS = "kernels/test_paths.py::test_"
_SEARCH = "kernels/test_local_search.py::test_"
_STORE = "kernels/test_trail_store.py::test_"

MUTANTS = (
    Mutant(
        "anneal/schedule",
        "if new_score > best.score[0]:",
        "if new_score < best.score[0]:",
        _ANNEAL + "a_hot_search_roams_and_remembers_its_best",
    ),
    Mutant(
        "anneal/state",
        "here=2 * np.arange(n_robots)",
        "here=2 // np.arange(n_robots)",
        _ANNEAL + "figures_and_records_are_those_of_evaluate",
    ),
    Mutant(
        "beam/labels",
        "if visits[at.node] == 0:",
        "if visits[at.node] != 0:",
        "kernels/test_beam.py::TestCut::test_the_twin_finds_the_same",
    ),
    Mutant(
        "beam/prospects",
        "value += survives * ahead[graph.head[arc]]",
        "value -= survives * ahead[graph.head[arc]]",
        "kernels/test_beam.py::TestCut::test_the_twin_finds_the_same",
    ),
    Mutant(
        "beam/search",
        "if value > state.value:",
        "if value < state.value:",
        _BEAM + "a_wide_beam_finds_the_best_trail_under_a_floor",
    ),
    Mutant(
        "bounds/relaxed",
        "gain += before + (after - before) * part[arc]",
        "gain += before - (after - before) * part[arc]",
        _BOUNDS + "what_lies_ahead_is_that_of_value_iteration",
    ),
    Mutant(
        "bounds/states",
        "pays[link] = unpaid == NONE or",
        "pays[link] = unpaid != NONE or",
        _BOUNDS + "what_lies_ahead_is_that_of_value_iteration",
    ),
    Mutant(
        "bounds/trails",
        "while at >= 0 and stairs[at] < value:",
        "while at >= 0 and stairs[at] > value:",
        _BOUNDS + "stairs_are_above_all_trails",
    ),
    Mutant(
        "colony/construct",
        "alive *= graph.survival[arc]",
        "alive /= graph.survival[arc]",
        _CONSTRUCT + "what_the_first_robot_knows_of_the_second",
    ),
    Mutant(
        "colony/pheromone",
        "amounts[which, arc, 0] += reward",
        "amounts[which, arc, 0] -= reward",
        "kernels/test_pheromone.py::test_learn",
    ),
    Mutant(
        "colony/weighing",
        "weight = ant.fresh[a] if left == 1.0 else ant.seen[a]",
        "weight = ant.fresh[a] if left != 1.0 else ant.seen[a]",
        _CONSTRUCT + "what_the_first_robot_knows_of_the_second",
    ),
    Mutant(
        "exact/labels",
        "if length + short.home[graph.head[arc]] > longest:",
        "if length + short.home[graph.head[arc]] < longest:",
        _EXACT + "LookingAround",
    ),
    Mutant(
        "exact/tables",
        "follows = place[order[1:]] == place[order[:-1]]",
        "follows = place[order[1:]] != place[order[:-1]]",
        _EXACT + "Chains",
    ),
    Mutant(
        "exact/teams",
        "if bound > front.places[front.directory[at], place].survivors:",
        "if bound < front.places[front.directory[at], place].survivors:",
        _EXACT + "Teams::test_every_team_is_covered",
    ),
    Mutant(
        "exact/trails",
        "row.alive *= graph.survival[arc]",
        "row.alive -= graph.survival[arc]",
        _EXACT + "Trails::test_a_single_robot_finds_its_front",
    ),
    Mutant(
        "fronts/archive",
        "stop if most > best else first",
        "stop if most < best else first",
        "kernels/test_archive.py::test_archive_is_the_front_of_all_it_was_shown",
    ),
    Mutant(
        "fronts/ordered",
        "if front.places[block, middle].survivors >= survivors:",
        "if front.places[block, middle].survivors <= survivors:",
        "kernels/test_front.py::test_few_plans_with_many_ties",
    ),
    Mutant(
        "graph/arcs",
        "if graph.head[middle] <= head:",
        "if graph.head[middle] >= head:",
        _PATHS + "find_arc",
    ),
    Mutant(
        "graph/graph",
        "home[near] = survival[arc] * home[far]",
        "home[near] = survival[arc] + home[far]",
        _PATHS + "the_graph",
    ),
    Mutant(
        "graph/homing",
        "if alive * graph.home[node] < limits.min_survival:",
        "if alive * graph.home[node] > limits.min_survival:",
        _PATHS + "ways_within_limits_are_the_safest_or_else_the_shortest",
    ),
    Mutant(
        "graph/paths",
        "if key > distance[node]:",
        "if key <= distance[node]:",
        _PATHS + "paths_are_the_safest_over_unused_arcs",
    ),
    Mutant(
        "graph/ways",
        "if ways[node].dead > since:",
        "if ways[node].dead <= since:",
        "kernels/test_ways.py::test_trails_that_ask_at_each_hop_are_told_the_truth",
    ),
    Mutant(
        "local_search/admission",
        "survivors += trail.alive",
        "survivors -= trail.alive",
        _STORE + "objectives_have_the_bits_of_evaluate",
    ),
    Mutant(
        "local_search/children",
        "gained += node.left * alive",
        "gained -= node.left * alive",
        _SEARCH + "small_chances_of_the_others_keep_their_digits",
    ),
    Mutant(
        "local_search/layout",
        "now.survivors += trail.alive",
        "now.survivors -= trail.alive",
        "kernels/test_local_search.py::TestMovesByHand",
    ),
    Mutant(
        "local_search/moves",
        "if high < low + 2:",
        "if high < low - 2:",
        "kernels/test_local_search.py::TestMovesByHand",
    ),
    Mutant(
        "local_search/refill",
        "is_less = more < extra[node]",
        "is_less = more > extra[node]",
        "kernels/test_refill.py::test_tours_are_filled_as_the_naive_way",
    ),
    Mutant(
        "local_search/routes",
        "if routes.entries[goal, middle].source < node:",
        "if routes.entries[goal, middle].source > node:",
        "kernels/test_routes.py::test_on_larger_missions_rows_are_truncated",
    ),
    Mutant(
        "local_search/search",
        "work.tally[0, kind] += 1",
        "work.tally[0, kind] -= 1",
        "search/test_local_search.py::test_every_kind_of_move_is_counted",
    ),
    Mutant(
        "local_search/trail_store",
        "store.trails[trail].n_users -= 1",
        "store.trails[trail].n_users += 1",
        _STORE + "a_released_trail_gives_its_number_to_the_next",
    ),
    Mutant(
        "local_search/workspace",
        "return max(self.n_children, self.n_children_busy) + 1",
        "return max(self.n_children, self.n_children_busy) - 1",
        _SEARCH + "children_find_room",
    ),
    Mutant(
        "plans/change",
        "alive *= graph.survival[arc]",
        "alive /= graph.survival[arc]",
        _MOVES + "the_limits_bind_and_leave_room",
    ),
    Mutant(
        "plans/detours",
        "if via != graph.base and via != here",
        "if via == graph.base and via != here",
        _MOVES + "where_no_move_drawn_can_be_made_there_are_detours",
    ),
    Mutant(
        "plans/evaluate",
        "survivors += alive",
        "survivors -= alive",
        "kernels/test_evaluate.py::TestByHand",
    ),
    Mutant(
        "plans/marks",
        "for i in range(length - 1):",
        "for i in range(length - 2):",
        _MOVES + "trails_stay_trails_on_one_way_missions",
    ),
    Mutant(
        "plans/moves",
        "if used[arc] == mark or node == graph.base:",
        "if used[arc] != mark or node == graph.base:",
        _MOVES + "trails_stay_trails_on_one_way_missions",
    ),
    Mutant(
        "plans/order",
        "takes_right = keys[order[right]] > keys[order[left]]",
        "takes_right = keys[order[right]] < keys[order[left]]",
        "kernels/test_order.py::test_some_of_the_numbers_are_sorted",
    ),
    Mutant(
        "plans/ragged",
        "while n_done < n_trails:",
        "while n_done > n_trails:",
        _MOVES + "the_limits_bind_and_leave_room",
    ),
    Mutant(
        "plans/repair",
        "kept += drafted[arc] == trail",
        "kept += drafted[arc] != trail",
        "operators/test_repair.py::TestCounts",
    ),
    Mutant(
        "plans/simulate",
        "if draws[mission, robot] < alive[middle]:",
        "if draws[mission, robot] > alive[middle]:",
        "outcomes/test_outcomes.py::test_each_robot_gets_as_far_as_its_survivals_say",
    ),
    Mutant(
        "plans/vary",
        "other += other >= one",
        "other += other > one",
        "operators/test_variation.py::TestShare",
    ),
    Mutant("rng", "high ^= low", "high |= low", "kernels/test_rng.py::test_twin"),
)
