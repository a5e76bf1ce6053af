"""The page on troubleshooting explains every sentence that nodes and commands can say, and no other."""

from __future__ import annotations

import re

from command_sentences import beginning, command_sentences, without_beginning
from node_sentences import HOLE, ROOT, sentences

PAGE = (ROOT / "docs" / "troubleshooting.md").read_text(encoding="utf-8")
ROWS = re.findall(r"^\| `([^`]+)` \| (.+) \|$", PAGE.split("## Errors and warnings of commands")[1], re.MULTILINE)
HEADINGS = re.compile(r"^\*\*(.+)\*\*$", re.MULTILINE)

NOT_MESSAGES = {
    "Observe the friction of positioning axes from position and control effort.",
    "Simulate positioning axes with friction and publish what a real stage would.",
    "Written by … on … after … samples.",
    "step time p50 [us]",
    "step time p99 [us]",
    "step time max [us]",
}


def test_every_sentence_is_explained() -> None:
    said = sentences()
    assert len(said) > 30
    missing = {text: file for text, file in said.items() if text not in HEADINGS.findall(PAGE)}
    assert set(missing) <= NOT_MESSAGES, "explain in docs/troubleshooting.md, in bold on a line of its own"


def test_no_other_sentence_is_explained() -> None:
    said = sentences()
    stale = [text for text in HEADINGS.findall(PAGE) if text not in said]
    assert not stale, "no node says this any more; remove it from docs/troubleshooting.md"


def test_each_explanation_is_more_than_its_sentence() -> None:
    for text, explanation in re.findall(r"^\*\*(.+)\*\*\n\n(.+)$", PAGE, re.MULTILINE):
        assert explanation.strip() not in ("", text), text


def test_sentences_of_diagnostics_are_found_by_the_scan() -> None:
    """The scan of the source sees what the code really says."""
    from sgms_observer.nodes.intake import IntakeCounts
    from sgms_observer.observer.pairing import PairingCounts
    from sgms_observer.status import Status

    spoken = [status.sentence for status in Status]
    spoken += PairingCounts(*[7] * 9).sentences()
    spoken += IntakeCounts(*[7] * 5).sentences(["x"])
    pattern = "|".join(re.escape(text).replace(re.escape(HOLE), ".+") for text in sentences())
    for sentence in spoken:
        assert re.fullmatch(rf"(7 )?({pattern})", sentence), sentence


def test_every_error_and_warning_of_a_command_has_its_row() -> None:
    said = command_sentences()
    assert len(said) > 150
    listed = [message for message, _ in ROWS]
    assert {message: file for message, file in said.items() if message not in listed} == {}
    assert len(listed) == len(set(listed))


def test_every_message_has_a_beginning_that_a_row_can_have() -> None:
    assert without_beginning() == {}


def test_the_scan_finds_messages_in_every_form() -> None:
    """Lists of doubts, a returned caution, lists of warnings, arguments, and every folder but the nodes'."""
    said = command_sentences()
    for message, file in {
        "pauses lack samples, the longest … s": "sgms_observer/application/bag_info.py",
        "the motion does not separate mass, friction and offset": "sgms_observer/application/bag_info.py",
        "the position never changes": "sgms_observer/application/axis_draft.py",
        "lacks its file": "sgms_observer/bags/bag_folder.py",
        "no node subscribed to the played topics within … s": "sgms_observer/cli/play.py",
        "the recording has no reference, so nothing shows whether stage.controller of the file is the controller of the"
        " recording": "sgms_observer/diagnosis/tracking.py",
        "estimator.kind is …, and C has the EKF only": "sgms_observer/export/c_target.py",
        "is not YAML": "sgms_observer/settings/yaml_text.py",
        "axes must be given": "sgms_observer/settings/node_parameters.py",
        "must rise from entry to entry, but entry … is … after": "sgms_observer/effects/map_entries.py",
        "line … … is not a number": "sim_plant/reference_file.py",
        "is empty": "sgms_observer/bags/mcap_reader.py",
        "holds … in": "sgms_observer/bags/writer.py",
        "has … entries, time": "sgms_observer/bags/conversion.py",
        "cannot be written, so no kernel can be cached": "sgms_observer/application/kernels.py",
        "the kernels of … could not be compiled ahead": "sgms_observer/application/kernels.py",
        "the process that worked on it ended by itself": "sgms_observer/fleet/jobs.py",
        "is no seed": "sgms_observer/cli/simulate.py",
    }.items():
        assert said[message] == file


def test_no_row_explains_what_no_command_says() -> None:
    said = command_sentences()
    assert [message for message, _ in ROWS if message not in said] == []


def test_each_row_says_what_to_do() -> None:
    for message, advice in ROWS:
        assert len(advice.split()) > 2 and advice.endswith("."), message


def test_beginning_of_a_sentence_is_what_a_reader_can_look_up() -> None:
    assert beginning("Warning: x: the fit did not converge; record longer") == "x"
    assert beginning(f"Warning: {HOLE}: the fit did not converge; record longer") == "the fit did not converge"
    assert beginning(f"{HOLE} in {HOLE} has the type {HOLE}; {HOLE} is needed") == f"in {HOLE} has the type"
    assert beginning("the position of x is shifted by 1 mm. Home the axis") == "the position of x is shifted by 1 mm"
    assert beginning(f"{HOLE} exists already and is not overwritten; give another name") == (
        "exists already and is not overwritten"
    )
