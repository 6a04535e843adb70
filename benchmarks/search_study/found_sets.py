"""The set that the search finds in a world, and the one that the same search finds when it is told the truth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from fusetune.analyze.analyze_flight import AnalysisSettings
from fusetune.analyze.delays.lag import Lag
from fusetune.analyze.delays.velocity_place import VelocityPlace
from fusetune.apply.search.kept_pairs import KeptPairs
from fusetune.apply.search.measured_place import DELAY
from fusetune.apply.search.replays import ReplayGround
from fusetune.apply.search.rounds import ON_ALL, Ground, Searched, run_searches, searches
from fusetune.apply.search.search_space import search_space
from fusetune.apply.search.space import Space
from fusetune.apply.search.stages import Found
from fusetune.apply.search.trial_keys import made_of, trial_settings
from fusetune.apply.search.workers import FlightTrier
from fusetune.apply.settings import DecisionSettings
from fusetune.design.around_present import not_exercised
from fusetune.design.search_settings import SearchSettings
from fusetune.design.tunable_parameters import ARM_PARAMETERS
from fusetune.save.exercise import exercise_of
from fusetune.save.flight_folder import read_metadata

from .true_figures import FIGURES, JudgedFlight, KeptFigures
from .truth_ground import TruthGround, change_percent
from .worlds import FRESH, SEARCHED, SearchWorld

Array = npt.NDArray[np.float64]

_EXACT = 1e-3
"""Error of what the truth knows, s and m."""

PROFILE_STEPS = np.arange(-6, 7) / 3.0
"""Powers of two by which a noise is varied about the found one, for what the truth says of it alone."""


@dataclass(frozen=True)
class JudgedWorld:
    """What was found in a world; changes (4,) of the mean true figures against the present set, %, on fresh flights.

    Attributes
    ----------
    found, oracle : by the search, and by the same search on the truth
    change, best_change : of the two
    ratio : (4,) true figures of the found set over those of the oracle's
    right : parameters that the vehicle is told wrong, as they should be: as the world has it, noises as the truth has
        them with all else as found
    """

    name: str
    found: Found
    oracle: Found
    present: Mapping[str, float]
    change: Array
    best_change: Array
    right: Mapping[str, float]

    @property
    def ratio(self) -> Array:
        return np.asarray((100.0 + self.change) / (100.0 + self.best_change))


class WorldSearch:
    """Searches in one world; replays of both kinds are kept in a folder and never made twice."""

    def __init__(self, world: SearchWorld, folder: Path, settings: SearchSettings, decision: DecisionSettings) -> None:
        self.world, self._folder, self._settings, self._decision = world, folder, settings, decision
        self._folders = {one.name: one for one in world.flights(range(max(FRESH) + 1))}
        self.names = list(self._folders)
        flights = [JudgedFlight(one, world.settings) for one in self._folders.values()]
        self.truth = KeptFigures(folder / "truth", flights)
        self.parameters = read_metadata(self._folders[self.names[0]])["ekf2_parameters"]

    @property
    def space(self) -> Space:
        """The product's own: around what the vehicle flies, of what its flights exercise."""
        exercises = [exercise_of(self._folders[self.names[number]]) for number in SEARCHED]
        names = [name for name in self._settings.searched if not not_exercised(name, exercises)]
        return search_space(self.parameters, names, self._settings)

    def judged(self) -> JudgedWorld:
        """Search both ways on the first flights, and judge on the others."""
        flights = [self.names[number] for number in SEARCHED]
        only = [Searched(ON_ALL, tuple(flights), ())]
        found, oracle = (
            run_searches(only, self.space, self._settings, ground)[0][0]
            for ground in (self.replays(), TruthGround(self.truth, self.names, self._true_place()))
        )
        return JudgedWorld(
            self.world.name,
            found,
            oracle,
            {name: self.parameters[name] for name in self.space.parameters},
            self.change_percent(found.values),
            self.change_percent(oracle.values),
            {name: self._right(name, found.values) for name in self.world.wrong},
        )

    def _true_place(self) -> VelocityPlace | None:
        """What the truth knows of the receiver where the vehicle is told it wrong."""
        told, right = self.space.present, self.world.right_place
        if not right:
            return None
        arm = [right.get(name, told.get(name, 0.0)) for name in ARM_PARAMETERS["gnss"]]
        lag = Lag(1e-3 * right.get(DELAY, told.get(DELAY, 0.0)), _EXACT, 1000, 1000)
        return VelocityPlace(lag, np.array(arm), _EXACT**2 * np.eye(3))

    def with_folds(self) -> tuple[list[Searched], list[Found], Ground]:
        """The product's searches, those with flights kept aside, too."""
        studied = searches([self.names[number] for number in SEARCHED], self._settings)
        ground = self.replays()
        return studied, run_searches(studied, self.space, self._settings, ground)[0], ground

    def change_percent(self, values: Mapping[str, float]) -> Array:
        """(4,) of the mean true figures on fresh flights against those of the present set."""
        return change_percent(self.truth, values, FRESH)

    def _right(self, name: str, found: Mapping[str, float]) -> float:
        """As the world has it; else where the true velocity error is smallest, by a parabola through the best three."""
        if name in self.world.right:
            return self.world.right[name]
        velocity = FIGURES.index("velocity")
        values = found[name] * 2.0**PROFILE_STEPS
        errors = [np.log(self.truth.figures({**found, name: one})[:, velocity]).mean() for one in values]
        at = int(np.clip(np.argmin(errors), 1, len(errors) - 2))
        curve = np.polyfit(PROFILE_STEPS[at - 1 : at + 2], errors[at - 1 : at + 2], 2)
        return float(found[name] * 2.0 ** (-0.5 * curve[1] / curve[0]))

    def replays(self) -> ReplayGround:
        """The ground of the search itself."""
        trials = trial_settings(self._decision, AnalysisSettings(replay=self.world.settings))
        pairs = KeptPairs(self._folder / "tried" / self.world.name, made_of(self._folders, trials))
        folders = {name: str(folder) for name, folder in self._folders.items()}
        ground = ReplayGround(FlightTrier(folders, trials), self._decision, pairs.keep)
        for batch, tried in pairs.kept():
            ground.know(batch, tried)
        return ground
