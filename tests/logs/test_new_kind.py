"""A new kind of message takes a class, a codec and a row of the table: it then goes through MCAP, rosbag2 and CSV unchanged."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import gridslam.logs.kinds
from tests.conftest import REPOSITORY

# The class of `core/messages.py` and the codec of `logs/codecs/`: gas readings, each with a name and a concentration.
CLASS_AND_CODEC = """
from dataclasses import dataclass
from gridslam.logs.encoding.csv_fields import name_field, number_field
from gridslam.logs.encoding.encoded import single_message, with_header
from gridslam.logs.encoding.ros_fields import valid_head

DEFINITION = "std_msgs/Header header\\nstring gas\\nfloat64[] heights_m\\nfloat64[] ppm\\n"

@dataclass(frozen=True, slots=True)
class Gas:
    stamp_ns: int
    frame_id: str
    gas: str
    heights_m: tuple[float, ...]
    ppm: tuple[float, ...]

def from_ros(message, topic):
    return Gas(*valid_head(message), message.gas, tuple(message.heights_m.tolist()), tuple(message.ppm.tolist()))

def to_ros(gas, topic):
    body = with_header(gas).text(gas.gas)
    for values in (gas.heights_m, gas.ppm):
        body.uint32(len(values)).float64(*values)
    return single_message(topic or "/gas", "demo_msgs/msg/Gas", gas, body)

def from_csv(rows):
    heights, ppm = (tuple(row.number(name) for row in rows) for name in ("height", "ppm"))
    return Gas(rows[0].stamp_ns, rows[0].frame, rows[0].text("gas"), heights, ppm)

def to_csv(gas, pictures):
    pairs = zip(gas.heights_m, gas.ppm, strict=True)
    return [[name_field(gas.gas), number_field(h), number_field(p), name_field(gas.frame_id)] for h, p in pairs]
"""
ROW = """
    MessageKind(
        "gas",
        gas_kind.Gas,
        ros={"demo_msgs/msg/Gas": gas_kind.from_ros},
        definitions={"demo_msgs/msg/Gas": gas_kind.DEFINITION},
        to_ros=gas_kind.to_ros,
        csv=CsvTableKind(
            gas_kind.from_csv,
            gas_kind.to_csv,
            required=("gas", "height", "ppm"),
            optional=("frame",),
            default_frame="nose",
            texts=("gas",),
            units={"height": LENGTHS},
            naming_column="gas",
            rows_name_frames=True,
            groups=RowGroups(by="gas", item="height"),
        ),
        is_sensor=True,
    ),
"""
TABLE_BEGINS = "\nKINDS_IN_ORDER = (\n"
SCRIPT = """
import importlib.util, sys
sys.path.insert(0, ".")
spec = importlib.util.spec_from_file_location("gridslam.logs.kinds", "kinds.py")
module = importlib.util.module_from_spec(spec)
sys.modules["gridslam.logs.kinds"] = module
spec.loader.exec_module(module)
import gas_kind
from pathlib import Path
import gridslam
from gridslam.logs.write import open_writer

events = [
    gas_kind.Gas(10**18 + k, f"nose_{k % 2}", gas, (0.5, 1.0), (400.0, 410.5 + k))
    for k, gas in enumerate(("CO", "CO2", "CO"))
]

def read(name, config=None):
    with gridslam.open_log(name, config, ["gas"]) as log:
        found = [event for event in log.events() if isinstance(event, gas_kind.Gas)]
        assert [(stream.kind, stream.count) for stream in log.streams] == [("gas", 3)], log.streams
        assert not log.is_lossy, log.problems
    return found

gridslam.write_log("log.mcap", events)
gridslam.write_log("folder", events)
with open_writer("bag", as_rosbag2=True) as writer:
    for event in events:
        writer.write(event)
for name in ("log.mcap", "folder", "bag"):
    assert read(name) == events, (name, read(name))
table = Path("folder/gas.csv")
table.write_text(table.read_text().replace(",0.5,", ",500,").replace(",1,", ",1000,").replace(",1.0,", ",1000,"))
layout = Path("folder/log.yaml")
layout.write_text(layout.read_text().replace("kind: gas,", "kind: gas, units: {height: mm},"))
in_mm = read("folder", gridslam.LogConfig(topics={"gas": "gas.csv"}))
assert in_mm == events, (table.read_text(), in_mm)
"""


def test_an_invented_kind_goes_through_mcap_rosbag2_and_csv(tmp_path: Path) -> None:
    table = Path(gridslam.logs.kinds.__file__).read_text()
    assert TABLE_BEGINS in table
    table = table.replace(TABLE_BEGINS, f"\nimport gas_kind\n{TABLE_BEGINS}{ROW}")
    (tmp_path / "kinds.py").write_text(table)
    (tmp_path / "gas_kind.py").write_text(CLASS_AND_CODEC)
    environment = {"PYTHONPATH": str(REPOSITORY), "PATH": ""}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        env=environment,
        check=False,
    )
    assert done.returncode == 0, done.stderr
