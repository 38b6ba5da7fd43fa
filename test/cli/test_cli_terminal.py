"""What a recording calls its topics cannot steer the terminal."""

from __future__ import annotations

from pathlib import Path

import pytest

from lasso_motion_ros.cli.main import main
from lasso_motion_ros.core.terminal import printable
from msg_adapters.recordings.writer import RecordingWriter

STEERING = "/a\x1b]0;owned\x07\x9b31m\r/b\u202e"


@pytest.mark.parametrize("words", ["check IN", "track IN -o OUT", "track IN -o OUT --remap /x:=/y", "evaluate IN"])
def test_control_characters_of_a_recording_are_written_out(
    words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording = tmp_path / "in.mcap"
    with RecordingWriter(recording) as writer:
        writer.write(STEERING, "std_msgs/msg/String", {"data": ""}, 1)
    named = {"IN": str(recording), "OUT": str(tmp_path / "out.mcap")}
    assert main([named.get(word, word) for word in words.split()]) == 2
    said = "".join(capsys.readouterr())
    assert not set(said) & set("\x1b\x07\x9b\r\u202e")


def test_text_stays_as_it_is() -> None:
    assert printable("1024² Größe\t–\n") == "1024² Größe\t–\n"
    assert printable(STEERING) == "/a\\x1b]0;owned\\x07\\x9b31m\\r/b\\u202e"
