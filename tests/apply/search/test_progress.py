"""What is told while a search goes on."""

from __future__ import annotations

from tests.apply.search.made_ground import SPACE

from fusetune.apply.search.plan import plan_of
from fusetune.apply.search.progress import Progress
from fusetune.apply.search.rounds import searches
from fusetune.design.search_settings import SearchSettings


def test_lines_say_the_round_the_best_so_far_and_the_time_left() -> None:
    seconds, lines = [0.0], []
    settings = SearchSettings(evaluations=300)
    plan, studied = plan_of(SPACE, settings), searches(["a"], settings)
    progress = Progress(plan, studied, lines.append, lambda: seconds[0])
    progress.begin(1)
    seconds[0] = 2.0
    progress.replayed(4, 4)
    # half a second a replay, and all rounds but the first are left
    left = 0.5 * sum(size for _, size in plan.rounds[1:])
    assert lines == [f"round 1 of {len(plan.rounds)} (delays): 4 of 4 replays, {left:.0f} s left at the most"]
    progress.better(-0.105)
    progress.begin(2)
    seconds[0] = 4.0
    progress.replayed(1, 6)
    # told a moment ago
    assert len(lines) == 1
    seconds[0] = 9.0
    progress.replayed(2, 6)
    assert "2 of 6 replays, errors 10.0 % smaller so far" in lines[1]
