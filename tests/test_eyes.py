"""`nox -s evaluate -- --only eyes variation`: what is picked from reports, and what the table makes of it, by hand."""

import numpy as np
import pytest

from tools.evaluation import eyes, eyes_table


def far(part, first, end, gap):
    return {"part": part, "first": first, "end": end, "degrees": 30.0, "frame": first, "gap_cm": gap}


def test_an_arm_in_a_narrow_gap_is_not_counted():
    beyond = [
        far("left_arm", 10, 30, None),
        # The other arm meanwhile, and a little longer: a frame counts once.
        far("right_arm", 20, 40, 80.0),
        far("left_arm", 60, 90, 55.0),
        far("trunk", 0, 100, None),
    ]
    assert eyes.arms_far(beyond, 100) == pytest.approx(30.0)
    assert eyes.arms_far([], 0) == 0.0


def test_the_two_nearest_of_some_poses():
    rest = np.zeros((22, 3))
    moved = rest.copy()
    moved[:11, 0] = 0.10  # half of the joints by 10 cm: 5 cm in the mean
    elsewhere = rest + np.array([0.0, 0.0, 1.0])
    assert eyes.nearest_pair([rest, elsewhere, moved]) == pytest.approx(5.0)
    assert eyes.nearest_pair([rest]) is None
    assert eyes.spread([2.5, 4.0, 3.0]) == 1.5
    assert eyes.spread([]) is None


def row(library="ACCAD", **changes):
    flat = {"stances": 4, "heel_drift_cm": {"median": 1.0, "p90": 2.0}, "ball_drift_cm": {"median": 0.5, "p90": 1.0}}
    flat |= {"swivel_degrees": {"median": 0.0, "p90": 0.0}, "swivelled_percent": 0.0, "swivels": []}
    turned = {"percent": 0.0, "out_degrees": 20.0, "in_degrees": 0.0}
    steps = {"steps": 2, "heel_first_percent": 50.0, "toe_up_degrees": 9.0, "toe_clearance_cm": 3.0}
    style = dict.fromkeys(STYLE)
    plain = {
        "problem": "",
        "problems": [],
        "own_percent": 0.0,
        "own_cm": 0.0,
        "hinge_degrees": 0.0,
        "met": True,
        "arms_percent": 0.0,
        "trunk_percent": 0.0,
        "scene_percent": 0.0,
        "scene_cm": 0.0,
        "scene_named": False,
        "feet": {"flat": flat, "turned": turned, "steps": steps | {"heel_up_degrees": 40.0}},
        "style": style,
    }
    return {"library": library, **plain, **changes}


#: Every row that the table asks for; what is not there fails as a report without it would.
STYLE = {
    f"{group}.{name}"
    for group, names in {
        "walking": (
            "speed_m_per_s neck_sideways_cm head_bob_cm shoulders_degrees head_pitch_degrees wrist_fore_aft_cm "
            "wrist_sideways_cm"
        ),
        "way": "speed_variation fastest_turn_degrees_per_s head_leads_degrees",
        "start": "weight_shift_cm shift_s",
        "descent": (
            "turn_before_degrees still_before_s descent_s lean_degrees lean_leads_s sunk_at_lean_percent "
            "lean_at_seat_degrees upper_arm_degrees fastest_sink_m_per_s feet_move_cm pelvis_turns_degrees"
        ),
        "seated": (
            "trunk_degrees feet_fore_aft_cm ankles_apart_cm knees_apart_cm wrists_cm_per_s head_cm_per_s knees_cm_per_s"
        ),
        "rising": "rise_s lean_degrees",
    }.items()
    for name in names.split()
}


def cells(rows, clips=None):
    header, body = eyes_table.lines(rows, clips or {})
    return {line[0]: dict(zip(header[1:], line[1:], strict=True)) for line in body}


def test_motions_are_counted_by_library():
    rows = [
        row(own_percent=1.0, hinge_degrees=6.1, scene_percent=4.0, scene_named=True),
        row(arms_percent=2.1, scene_percent=5.0),
        row(),
        row("starter", hinge_degrees=6.0),
        {"library": "starter", "problem": "There is no way."},
    ]
    table = cells(rows)
    assert table["own body over 1 cm, motions"]["motions, ACCAD"] == "1 of 3"
    assert table["own body over 1 cm, motions"]["motions, starter"] == "0 of 1"
    hinges = table["elbow or knee beyond its limit by 6°, motions"]
    assert (hinges["motions, ACCAD"], hinges["motions, starter"]) == ("1 of 3", "0 of 1")
    (arms,) = [line for name, line in table.items() if name.startswith("arm over")]
    assert arms["motions, ACCAD"] == "1 of 3"
    assert table["cue met, motions"]["motions, ACCAD"] == "3 of 3"
    (depth,) = [line for name, line in table.items() if name.startswith("scene deeper")]
    assert depth["motions, ACCAD"] == "3.0 / 5.0"
    (named,) = [line for name, line in table.items() if "named" in name]
    assert named["motions, ACCAD"] == "2 of 3, 1 named"
    assert [eyes_table.shows(one) for one in rows[:4]] == [True, True, False, False]


def test_shares_are_pooled_and_medians_are_of_what_is_there():
    many = row()
    many["feet"]["flat"] |= {"stances": 12, "swivelled_percent": 25.0}
    many["style"] = many["style"] | {"descent.descent_s": 1.2, "way.fastest_turn_degrees_per_s": 110.0}
    none = row()
    none["feet"]["flat"] |= {"stances": 0, "heel_drift_cm": {"median": 0.0, "p90": 0.0}}
    none["feet"]["steps"] = dict.fromkeys(none["feet"]["steps"], None) | {"steps": 0}
    table = cells(
        [many, row(), none], {"ACCAD, captured": {"motions": [{"own_percent": 0.0, "hinge_degrees": 0.0}], **none}}
    )
    assert table["flat foot swivels over 15°, % of stances"]["motions, ACCAD"] == "18.8"
    # The motion without a stance has no drift to tell of.
    assert table["heel drift while flat, cm"]["motions, ACCAD"] == "1.0"
    assert table["heel first at landing, %"]["motions, ACCAD"] == "50.0"
    assert table["descent, s"]["motions, ACCAD"] == "1.20"
    assert table["the same, 95th percentile of motions"]["motions, ACCAD"] == "110"
    assert table["descent, s"]["clips, ACCAD, captured"] == "–"
    assert table["own body over 1 cm, motions"]["clips, ACCAD, captured"] == "0 of 1"
