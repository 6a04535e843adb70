"""The whole configuration: the sections that the rooms declare, and what stands beside them.

`workflow/schemas/config.schema.yaml`, `config/config.yaml` and the table in `config/README.md` are made from it
(`pytest tests/workflow/test_configuration.py --update`).

Imports only declarations, no numerics: the workflow reads the configuration whenever it starts.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import PurePath
from typing import Any, Literal

from fusetune.analyze.conformance.settings import ConformanceSettings
from fusetune.analyze.delays.settings import DelaySettings
from fusetune.analyze.effects.settings import EffectSettings
from fusetune.analyze.health.settings import HealthSettings
from fusetune.analyze.reconstruction.settings import ReconstructionSettings
from fusetune.analyze.replaying.settings import ReplaySettings, StartSettings, WithholdingSettings
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.analyze.trust.settings import TrustSettings
from fusetune.apply.settings import DecisionSettings
from fusetune.px4.releases import ReleaseChoice
from fusetune.px4.ulog.reading_limits import ReadingLimits
from fusetune.running.workflow_files import file_or_packaged
from fusetune.save.thresholds import VerdictThresholds
from fusetune.settings.checking import checked, read_checked, validate
from fusetune.settings.declaration import section, setting
from fusetune.settings.given_values import in_their_types, nested
from fusetune.settings.schema import schema_of
from fusetune.storage.files import AnyPath


@dataclass(frozen=True)
class Demonstration:
    """What is simulated while there are no logs."""

    study: str = setting(
        "config/studies/paper_table11.yaml",
        "file of the parameter sets that are flown and compared where `study` needs flights, as one around the present "
        "values does",
        at_least=1,
    )
    vehicle: str = setting("config/vehicles/mistuned_quadrotor.yaml", "file of the simulated vehicle", at_least=1)
    seed: int = setting(1, "seed of wind and sensor errors; the same seed gives the same logs", low=0)
    flights_per_set: int = setting(1, "flights that are simulated with each set of the study", low=1, high=100)
    faults: Mapping[str, tuple[Mapping[str, Any], ...]] = setting(
        {}, "faults to switch on: name of a simulated flight → list of faults, see below"
    )


@dataclass(frozen=True)
class Configuration:
    """Configuration of the pipeline."""

    flights_dir: str = setting(
        "flights",
        "folder of the logs; every `.ulg` in it, and in folders below it, is a flight, named by its place: folders and "
        "file with `_` between them, without the suffix and without a first folder `log`; while there are none, the "
        "demonstration is simulated",
        at_least=1,
    )
    study: str = setting(
        "config/studies/around_present.yaml",
        "file of the parameter sets that are compared, see [docs/studies.md](../docs/studies.md)",
        at_least=1,
    )
    mission: str = setting(
        "config/missions/short_survey.yaml",
        "file of the mission that is planned, and flown by the demonstration; `.yaml`, or a `.plan` of QGroundControl",
        at_least=1,
    )
    mission_vehicle: str | None = setting(
        None,
        "file of the vehicle that the mission is planned for (limits, endurance); empty: that of the demonstration "
        "while it is flown, else one with PX4's defaults",
        at_least=1,
    )
    missions_dir: str | None = setting(
        None,
        "folder whose missions, every `.yaml` and `.plan` in it, flights are compared with beside `mission`; empty: "
        "that one alone",
        at_least=1,
    )
    present_flight: str | None = setting(
        None, "name of the flight whose parameters count as the vehicle's present ones; empty: the newest that counts"
    )
    vehicle: str | None = setting(
        None,
        "vehicle that is decided for: its name or id in `results/save/flights.csv`, or how either begins; empty: that "
        "of the newest real flight that counts",
        at_least=1,
    )
    search_job: Literal["round", "flight"] = setting(
        "round",
        "what one job of a search takes: all flights of a `round`, on all cores, or one `flight` of it; the files are "
        "the same; the profile for Slurm says `flight`",
    )
    covariance_designs: tuple[str, ...] = setting(
        ("config/covariance/marker_landing.yaml", "config/covariance/ekf2_survey.yaml"),
        "files of the covariance designs that `snakemake covariances` evaluates, see "
        "[docs/covariance.md](../docs/covariance.md)",
    )
    demonstration: Demonstration = section(Demonstration)
    reading: ReadingLimits = section(ReadingLimits)
    verdict: VerdictThresholds = section(VerdictThresholds)
    reconstruction: ReconstructionSettings = section(ReconstructionSettings)
    start: StartSettings = section(StartSettings)
    trust: TrustSettings = section(TrustSettings)
    scoring: ScoringSettings = section(ScoringSettings)
    withheld: WithholdingSettings = section(WithholdingSettings)
    delays: DelaySettings = section(DelaySettings)
    effects: EffectSettings = section(EffectSettings)
    health: HealthSettings = section(HealthSettings)
    conformance: ConformanceSettings = section(ConformanceSettings)
    decision: DecisionSettings = section(DecisionSettings)
    release: ReleaseChoice = setting(
        "auto",
        "release of PX4 whose estimator replays the flights; `auto`: of each flight the one that flew, or the nearest "
        "that is modelled ([docs/releases.md](../docs/releases.md))",
    )
    seed: int = setting(1, "seed of the bootstrap of the decision", low=0)

    @property
    def replay(self) -> ReplaySettings:
        """What is done about a flight before it is replayed."""
        return ReplaySettings(self.withheld, self.reconstruction, self.start, self.release)

    @property
    def located(self) -> Configuration:
        """The same, with files that the working folder lacks taken from those that come with the pipeline."""

        def found(name: str | None) -> str | None:
            return file_or_packaged(name) if name else name

        demonstration = replace(
            self.demonstration,
            study=file_or_packaged(self.demonstration.study),
            vehicle=file_or_packaged(self.demonstration.vehicle),
        )
        return replace(
            self,
            study=file_or_packaged(self.study),
            mission=file_or_packaged(self.mission),
            mission_vehicle=found(self.mission_vehicle),
            missions_dir=found(self.missions_dir),
            covariance_designs=tuple(map(file_or_packaged, self.covariance_designs)),
            demonstration=demonstration,
        )

    def problems(self) -> Iterator[str]:
        """Designs whose results would lie in the same folder."""
        names = [PurePath(file).stem for file in self.covariance_designs]
        for name in sorted({name for name in names if names.count(name) > 1}):
            yield f"covariance_designs: two files are called {name}; expected different names"


RETIRED = {"sets_per_job": "no longer asked for, as one job takes all sets of a flight; delete it"}
"""Keys of former releases → what is to be said of them."""


def read_configuration(
    files: Sequence[AnyPath], given: Mapping[str, Any] | None = None, given_by: str = "--config"
) -> Configuration:
    """Read the configuration from files and from the command line.

    Parameters
    ----------
    files
        Of keys that stand in several, the last counts; sections and other mappings are put together key by key.
    given
        Keys of the command line, which count before those of the files; `decision.draws` is one of the section.
    given_by
        What gave them, for messages.

    Returns
    -------
    Configuration
        Its files are those of the working folder, or where that has none those that come with the pipeline.

    Raises
    ------
    UserError
        A file cannot be read; a key, a value or what they make together is wrong.
    """
    schema = schema_of(Configuration)
    retired = {name: {"not": {}, "description": reason} for name, reason in RETIRED.items()}
    schema = schema | {"properties": schema["properties"] | retired}
    asked: dict[str, Any] = {}
    for file in files:
        asked = _joined(asked, read_checked(file, schema))
    given = in_their_types(nested(given or {}, schema, given_by), schema)
    validate(given, schema, given_by)
    settings = checked(Configuration, _joined(asked, given), given_by if given or not files else files[-1])
    return settings.located


def _joined(values: Mapping[str, Any], others: Mapping[str, Any]) -> dict[str, Any]:
    joined = dict(values)
    for key, value in others.items():
        below = joined.get(key)
        if isinstance(value, Mapping) and isinstance(below, Mapping):
            value = _joined(below, value)
        joined[key] = value
    return joined
