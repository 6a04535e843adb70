"""What the report says should be done for the next flights."""

from fusetune.report.sections.advice import advice_section

WARNING = {"severity": "warning"}
PROFILE = WARNING | {"id": "logging_profile", "found": "logged thinned", "remedy": "Set SDLOG_PROFILE = 3"}
MOUNTING = WARNING | {"id": "magnetometer_mounting", "found": "sat by yaw 90°", "remedy": "Compare CAL_MAG0_ROT"}


def test_the_most_frequent_remedy_comes_first_with_its_flights():
    verdicts = [{"flight": f"log_{number}", "advice": [PROFILE]} for number in range(5)]
    verdicts[4]["advice"] = [MOUNTING, PROFILE]
    html = advice_section(verdicts)
    assert html.index("SDLOG_PROFILE") < html.index("CAL_MAG0_ROT")
    assert "log_0, log_1, log_2 and 2 more" in html
    assert "for one: logged thinned" in html
    assert 'data-label="because">sat by yaw 90°</td>' in html


def test_a_flight_with_two_reasons_for_one_remedy_counts_once():
    again = PROFILE | {"id": "barometer", "found": "5 Hz"}
    html = advice_section([{"flight": "log", "advice": [PROFILE, again]}])
    assert html.count(">log</td>") == 1
    assert "5 Hz" not in html


def test_logs_without_fault_need_no_advice():
    assert advice_section([{"flight": "log", "advice": []}, {"flight": "old"}]) == ""
