"""What is done about delays of sensors."""

from dataclasses import dataclass

from fusetune.settings.declaration import setting


@dataclass(frozen=True)
class DelaySettings:
    """What is done about delays of sensors that PX4 is told wrong.

    Section `delays` of the configuration.
    """

    mend: bool = setting(
        True,
        "delays are estimated before sets are compared; where one is proved wrong over the flights, every set is "
        "compared with it mended, too",
    )
    matters_ms: float = setting(
        15.0,
        "a delay is wrong where the interval of its estimate lies further from what PX4 is told",
        unit="ms",
        low=0,
        high=300,
    )
