"""Which aid sources a parameter of the estimator works through, and what switches these on, in PX4 v1.16."""

from collections.abc import Mapping

from fusetune.px4.aid_sources import AID_SOURCES


def required_sources(parameter: str) -> tuple[str, ...]:
    """Sources of which one must be fused for a parameter to act; empty where it acts without any."""
    starts = [start for source in AID_SOURCES.values() for start in source.acts if parameter.startswith(start)]
    longest = max(starts, key=len, default=None)
    return tuple(source.name for source in AID_SOURCES.values() if longest in source.acts)


def observation_noise_of(parameter: str) -> tuple[str, ...]:
    """Sources into whose observation variance, and into little else, a parameter goes.

    The GNSS floors are not among them: the receiver's reports tell about these, and tell why.
    """
    return tuple(source.name for source in AID_SOURCES.values() if parameter in source.noise_parameters)


def switched_off(source: str, parameters: Mapping[str, float]) -> str:
    """The parameter setting that keeps a source from being fused, in words, or an empty text."""
    switch = AID_SOURCES[source].switch
    value = None if switch is None else parameters.get(switch.parameter)
    if switch is None or value is None or switch.is_on(value):
        return ""
    return f"{switch.parameter} is {int(value)}"
