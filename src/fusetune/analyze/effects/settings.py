"""What is done about single effects that flights measure."""

from dataclasses import dataclass

from fusetune.settings.declaration import setting


@dataclass(frozen=True)
class EffectSettings:
    """What is done about single effects that PX4 is told otherwise than the flights measure them.

    Section `effects` of the configuration.
    """

    try_measured: bool = setting(
        True,
        "where two flights or more measure an effect (antenna, static pressure, ground effect, drag, lever arms, range "
        "finder) beyond doubt otherwise than PX4 is told, a set with the measured values is compared like any other, "
        "beside a search, too; not with `delays.mend: false`",
    )
