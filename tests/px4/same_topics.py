"""Whether two flights hold the same topics, to the type of each column."""

import numpy as np

from fusetune.px4.flight import Flight


def assert_same_topics(found: Flight, expected: Flight) -> None:
    assert found.topics.keys() == expected.topics.keys()
    for key, table in expected.topics.items():
        assert found.topics[key].keys() == table.keys()
        for name, values in table.items():
            assert found.topics[key][name].dtype == values.dtype
            np.testing.assert_array_equal(found.topics[key][name], values)
