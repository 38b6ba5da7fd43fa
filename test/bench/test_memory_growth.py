"""One long run of one tracker: a recording is played back and forth, its stamps going on."""

from itertools import islice, pairwise
from pathlib import Path

from support.drawn_recording import PERIOD_NS, write_input

from lasso_motion_ros.bench.codecs import available_codec
from lasso_motion_ros.bench.memory_growth import _back_and_forth
from lasso_motion_ros.bench.undecoded import read_undecoded
from msg_adapters.messages import stamp_to_ns
from msg_adapters.topics import image_topic


def test_played_back_and_forth_the_stamps_go_on(tmp_path: Path) -> None:
    recording = write_input(tmp_path / "ring.mcap", [0.0, 1.0, 2.0])
    messages = read_undecoded(recording)
    codec = available_codec()
    stamps = [stamp_to_ns(codec.decode(raw.data, raw.type_name).header.stamp) for raw in messages]
    images = [
        (raw, stamp_ns)
        for raw, stamp_ns in islice(_back_and_forth(messages, stamps), 40)
        if raw.topic == image_topic("a").recorded_name
    ]
    places = [[m.data for m in messages if m.topic == images[0][0].topic].index(raw.data) for raw, _ in images]
    assert places[:6] == [0, 1, 2, 1, 0, 1]
    assert {later - earlier for (_, earlier), (_, later) in pairwise(images)} == {PERIOD_NS}
