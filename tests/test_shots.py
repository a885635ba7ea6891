"""Shots as a table: what is read, and which line a sentence names."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "blend_fixtures"))

from shots import COLUMNS, BadTable, read_shots

HEADER = "\t".join(COLUMNS)
#: Two people in one shot, and one alone in another room; the lines are 2 to 8.
ROWS = (
    "hall\tmeet\tAnn\t\tstart\t0\t0\t0\t90\t\t\t",
    "hall\tmeet\tAnn\t2\tsit\t1\t2\t0.55\t-90\t1.5\t\tSofa",
    "hall\tmeet\tAnn\t1\tpass\t0.5\t1\t\t\t\t\t",
    "hall\tmeet\tBen\t0\tstart\t3\t0\t\t\t\t\t",
    "hall\tmeet\tBen\t4\tstop\t3\t2\t0\t180\t\t120",
    "hall\tmeet\tBen\t7\tsit\t\t\t\t\t0\t240\tStool",
    "attic\talone\tCid\t\tstart\t0\t0\t0\t0",
    "attic\talone\tCid\t1\tstop\t2\t0",
)


@pytest.fixture
def table(tmp_path):
    """Writes the rows, some of them changed: line → what stands there; None takes the line out."""

    def write(changed=(), header=HEADER):
        lines = dict(enumerate([header, *ROWS], 1)) | dict(changed)
        path = tmp_path / "shots.tsv"
        path.write_text("".join(f"{line}\n" for line in lines.values() if line is not None), encoding="utf-8")
        return path

    return write


def test_people_and_cues_come_in_their_order(table):
    meet, alone = read_shots(table())
    assert (meet.file, alone.file) == ("hall-meet", "attic-alone")
    ann, ben = meet.people
    assert [(row.name, row.kind, row.step) for row in ann] == [
        ("Ann", "start", 0),
        ("Ann 1 Pass", "pass", 1),
        ("Ann 2 Sit", "sit", 2),
    ]
    assert (ann[0].heading, ann[1].heading, ann[1].z, ann[2].z, ann[2].hold) == (90.0, None, None, 0.55, 1.5)
    assert [(row.at_frame, row.object, row.x) for row in ben[1:]] == [(120, "", 3.0), (240, "Stool", None)]
    assert len(meet.cues) == 4
    assert read_shots(table(), "attic") == [alone]


def test_a_look_is_a_row_of_its_own(table):
    (alone,) = read_shots(table({3: f"{ROWS[1]}\nhall\tmeet\tAnn\t3\tlook\t\t\t\t\t2\t\tSofa"}), "attic")
    assert len(alone.cues) == 1
    (meet,) = read_shots(table({3: f"{ROWS[1]}\nhall\tmeet\tAnn\t3\tlook\t\t\t\t\t2\t\tSofa"}), "hall")
    assert [row.kind for row in meet.people[0]] == ["start", "pass", "sit", "look"]
    assert (meet.people[0][3].hold, meet.people[0][3].object, len(meet.cues)) == (2.0, "Sofa", 4)


def test_remarks_and_empty_lines_count_as_lines(table):
    path = table({3: f"# a remark\n\n{ROWS[1]}", 7: ROWS[5].replace("\tsit\t", "\tlie\t")})
    with pytest.raises(BadTable, match=r"line 9: kind is “lie”"):
        read_shots(path)


@pytest.mark.parametrize(
    ("line", "row", "said"),
    [
        (4, "hall\tmeet\tAnn\t1\thand\t0\t1", "line 4: kind is “hand”, which a shot cannot have; give one of start, "),
        (4, "hall\tmeet\tAnn\t1\t\t0\t1", "line 4: kind is “”"),
        (4, "hall\tmeet\tAnn\t\tstart\t0\t1\t0\t0", "line 4: Ann starts on line 2 already"),
        (4, "hall\tmeet\tEve\t1\tstop\t0\t1\t0\t0", "line 4: nobody named Eve starts in shot meet of hall"),
        (4, "hall\tmeet\t\t1\tstop\t0\t1\t0\t0", "line 4: this stop is of nobody"),
        (4, "hall\tmeet\tAnn\t2\tstop\t0\t1\t0\t0", "line 4: Ann has step 2 on line 3 already"),
        (4, "hall\tmeet\tAnn\t\tstop\t0\t1\t0\t0", "line 4: this stop has no step"),
        (4, "hall\tmeet\tAnn\t3\tpass\t0\t1", "line 4: nothing follows this pass"),
        (4, "hall\tmeet\tAnn\t-1\tpass\t0\t1", "line 4: step -1 of Ann comes before the start"),
        (4, "hall\tmeet\tAnn\t1.5\tpass\t0\t1", "line 4: step is 1.5, and is to be a whole number"),
        (4, "hall\tmeet\tAnn\t1\tpass\t0", "line 4: this pass has no x and y."),
        (4, "hall\tmeet\tAnn\t1\tpass\t0\t1\t\t\t2", "line 4: a pass has no hold_s"),
        (4, "hall\tmeet\tAnn\t1\tpass\t0\t1\t\t\t\t90", "line 4: a pass has no at_frame"),
        (4, "hall\tmeet\tAnn\t1\tpass\t0\tone", "line 4: y is “one”, which is no number"),
        (4, "hall\tmeet\tAnn\t1\tpass\tnan\t1", "line 4: x is “nan”, which is no number"),
        (4, "hall\t\tAnn\t1\tpass\t0\t1", "line 4: shot is empty"),
        (4, "hall\tmeet/2\tAnn\t1\tpass\t0\t1", "line 4: “meet/2” becomes a file's name"),
        (4, ROWS[2] + "\tmore", "line 4: there are 13 fields, and 12 columns"),
        (3, "hall\tmeet\tAnn\t2\tsit\t\t\t\t\t1", "line 3: this sit has no x and y, and names no object to sit on"),
        (3, "hall\tmeet\tAnn\t2\tsit\t1\t2\t0.55\t\t601", "line 3: hold_s is 601: give 0 to 600"),
        (7, ROWS[5].replace("240", "120"), "line 7: at_frame 120 of step 7 is not after 120, which step 4 on line 6"),
        (7, ROWS[5].replace("240", "1"), "line 7: at_frame is 1, and the motion begins on frame 1"),
        (9, None, "line 8: Cid starts and has nowhere to go"),
        (9, "attic\talone\tCid\t1\tlook\t2\t0\t1", "line 8: Cid starts and has nowhere to go"),
        (4, "hall\tmeet\tAnn\t1\tlook\t0\t1", "line 4: this look has no z"),
        (4, "hall\tmeet\tAnn\t1\tlook", "line 4: this look has no x and y, and names no object to look at"),
        (4, "hall\tmeet\tAnn\t1\tlook\t0\t1\t1\t\t\t90", "line 4: a look has no at_frame: only stop and sit have"),
    ],
)
def test_a_bad_row_is_named(table, line, row, said):
    with pytest.raises(BadTable) as refused:
        read_shots(table({line: row}), "hall")
    assert said in str(refused.value)
    assert str(refused.value).count("\n") == 0


def test_what_is_no_table_is_named(table, tmp_path):
    with pytest.raises(BadTable, match="line 1: the first line names the columns, and kind is not among them"):
        read_shots(table(header=HEADER.replace("kind", "what")))
    with pytest.raises(BadTable, match="has no shot in a room named castle"):
        read_shots(table(), "castle")
    (tmp_path / "empty.tsv").write_text("")
    with pytest.raises(BadTable, match="has no shot"):
        read_shots(tmp_path / "empty.tsv")
    with pytest.raises(BadTable, match=r"gone\.tsv cannot be read"):
        read_shots(tmp_path / "gone.tsv")


def test_the_projects_own_shots_can_be_read():
    shots = read_shots(Path(__file__).parents[1] / "blend_fixtures" / "shots.tsv")
    assert len(shots) >= 16
    assert len({shot.file for shot in shots}) == len(shots)
    assert len({shot.room for shot in shots}) == 7
    assert sum(len(shot.people) > 1 for shot in shots) >= 8
    assert sum(bool(shot.done) for shot in shots) >= 8
    assert all(4 <= len(shot.cues) + len(shot.done) <= 12 for shot in shots)
