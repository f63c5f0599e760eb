"""Writes the recordings of tests/fixtures/bags and of the guide.

    python3 -m venv venv && venv/bin/pip install -r tests/tools/bags/requirements.txt
    venv/bin/python tests/tools/bags/write.py

Numbers of message k (from 0) and joint j (from 0) are 0.5 (j + 1) + k/8 rad, j - k/4 rad/s and
2 + k - j/2 N m; stamps are 1700000000 s + 10 ms k; messages are received 2 ms later. Row k of the files of
`parquet/` has the time k/100 and the number (k mod 7)/8, or the numbers that `compressions` states.
"""

import csv
import decimal
import json
import shutil
import sqlite3
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from mcap.writer import CompressionType, IndexType, Writer as McapWriter
from mcap_ros2.writer import Writer as RosWriter
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer as BagWriter
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

ROOT = Path(__file__).resolve().parents[3]
OUT = ROOT / "tests/fixtures/bags"
START = 1_700_000_000
ARM = ["shoulder", "elbow", "wrist"]
RULE = "=" * 80

HEADER = f"""{RULE}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{RULE}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
STATE = "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n"
POINT = "trajectory_msgs/JointTrajectoryPoint"
CONTROLLER = f"""std_msgs/Header header
string[] joint_names
{POINT} reference
{POINT} feedback
{POINT} error
{POINT} output
"""
POINT_TEXT = f"""{RULE}
MSG: {POINT}
float64[] positions
float64[] velocities
float64[] accelerations
float64[] effort
builtin_interfaces/Duration time_from_start
{RULE}
MSG: builtin_interfaces/Duration
int32 sec
uint32 nanosec
"""
DYNAMIC = "std_msgs/Header header\nstring[] joint_names\nInterfaceValue[] interface_values\n"
INTERFACE = f"{RULE}\nMSG: control_msgs/InterfaceValue\nstring[] interface_names\nfloat64[] values\n"


def stamp(k):
    return {"sec": START + k // 100, "nanosec": (k % 100) * 10_000_000}


def received(k):
    return START * 10**9 + k * 10_000_000 + 2_000_000


def header(k):
    return {"stamp": stamp(k), "frame_id": "base"}


def position(k, j):
    return 0.5 * (j + 1) + k / 8


def velocity(k, j):
    return j - k / 4


def effort(k, j):
    return 2 + k - j / 2


def state(k, joints, names=ARM, with_effort=True):
    return {
        "header": header(k),
        "name": [names[j] for j in joints],
        "position": [position(k, j) for j in joints],
        "velocity": [velocity(k, j) for j in joints],
        "effort": [effort(k, j) for j in joints] if with_effort else [],
    }


def point(positions=(), velocities=(), efforts=()):
    return {
        "positions": list(positions),
        "velocities": list(velocities),
        "accelerations": [],
        "effort": list(efforts),
        "time_from_start": {"sec": 0, "nanosec": 0},
    }


def controller(k):
    joints = range(3)
    return {
        "header": header(k),
        "joint_names": ARM,
        "reference": point([position(k, j) + 1 for j in joints]),
        "feedback": point([position(k, j) for j in joints], [velocity(k, j) for j in joints]),
        "error": point([1.0] * 3),
        "output": point(efforts=[effort(k, j) for j in joints]),
    }


def dynamic(k):
    # the last joint has no effort, and a temperature
    values = [
        {"interface_names": ["effort", "position"], "values": [effort(k, j), position(k, j)]}
        for j in range(2)
    ]
    values.append({"interface_names": ["position", "temperature"], "values": [position(k, 2), 40.0]})
    return {"header": header(k), "joint_names": ARM, "interface_values": values}


def mcap(name, compression, rows, chunk=1024):
    """rows: topic, type, definition, message, k"""
    with open(name if isinstance(name, Path) else OUT / name, "wb") as file:
        writer = RosWriter(file, chunk_size=chunk, compression=compression)
        schemas = {}
        for topic, kind, text, message, k in rows:
            if kind not in schemas:
                schemas[kind] = writer.register_msgdef(kind, text)
            writer.write_message(topic, schemas[kind], message, received(k), received(k), k)
        writer.finish()


LOW_STATE = f"""MotorState[3] motor_state
float32[2] battery
string note
{RULE}
MSG: demo_msgs/MotorState
float64 q
float32 dq
int8 mode
"""


def low_state(k):
    """Messages of a type of their own, without stamps."""
    motors = [{"q": position(k, j), "dq": velocity(k, j), "mode": j - 1} for j in range(3)]
    return {"motor_state": motors, "battery": [40.0, 0.5], "note": "x"}


def fields():
    other = [("/joint_states", "sensor_msgs/msg/JointState", STATE + HEADER, state(0, range(3)), 0)]
    stamped = "std_msgs/Header header\nfloat64 force\n" + HEADER
    return (
        other
        + [("/lowstate", "demo_msgs/msg/LowState", LOW_STATE, low_state(k), k) for k in range(12)]
        + [
            ("/wrench", "demo_msgs/msg/Wrench", stamped, {"header": header(k), "force": effort(k, 0)}, k)
            for k in range(8)
        ]
    )


def states(topic="/joint_states", count=20, **options):
    return [
        (topic, "sensor_msgs/msg/JointState", STATE + HEADER, state(k, range(3), **options), k)
        for k in range(count)
    ]


def several():
    rows = states(count=12)
    text = CONTROLLER + HEADER + POINT_TEXT
    kind = "control_msgs/msg/JointTrajectoryControllerState"
    rows += [("/arm_controller/state", kind, text, controller(k), k) for k in range(8)]
    kind = "control_msgs/msg/DynamicJointState"
    text = DYNAMIC + INTERFACE + HEADER
    rows += [("/dynamic_joint_states", kind, text, dynamic(k), k) for k in range(5)]
    rows += [("/chatter", "std_msgs/msg/String", "string data\n", {"data": "hello"}, 3)]
    return rows


def publishers():
    """An arm at 100 Hz and a gripper at 50 Hz, between its messages, on one topic."""
    rows = []
    for k in range(12):
        rows.append(states(count=k + 1)[k])
        if k % 2 == 1:
            message = state(k, [0], names=["gripper"])
            message["header"]["stamp"]["nanosec"] += 5_000_000
            rows.append(("/joint_states", "sensor_msgs/msg/JointState", STATE + HEADER, message, k))
    return rows


def changing():
    """Joints in another order in each message, and some messages without one of them."""
    kind = "sensor_msgs/msg/JointState"
    orders = [[0, 1, 2], [2, 0, 1], [1, 2], [2, 1, 0]]
    return [
        ("/joint_states", kind, STATE + HEADER, state(k, orders[k % 4]), k) for k in range(12)
    ]


def faulty():
    """A number that is none, and a clock that goes back."""
    rows = states(count=12)
    rows[5][3]["position"][1] = float("nan")
    rows[9][3]["header"] = header(7)
    return rows


def store():
    found = get_typestore(Stores.ROS2_JAZZY)
    types = {}
    classic = f"std_msgs/Header header\nstring[] joint_names\n{POINT} desired\n{POINT} actual\n{POINT} error\n"
    types.update(get_types_from_msg(classic, "control_msgs/msg/JointTrajectoryControllerState"))
    found.register(types)
    return found


def ros_state(types, k):
    message = state(k, range(3))
    kinds = types.types
    head = kinds["std_msgs/msg/Header"](kinds["builtin_interfaces/msg/Time"](**stamp(k)), "base")
    lists = {key: np.array(message[key]) for key in ("position", "velocity", "effort")}
    return kinds["sensor_msgs/msg/JointState"](header=head, name=ARM, **lists)


def ros_controller(types, k):
    kinds = types.types
    head = kinds["std_msgs/msg/Header"](kinds["builtin_interfaces/msg/Time"](**stamp(k)), "base")

    def point(positions, velocities):
        return kinds["trajectory_msgs/msg/JointTrajectoryPoint"](
            np.array(positions),
            np.array(velocities),
            np.zeros(0),
            np.zeros(0),
            kinds["builtin_interfaces/msg/Duration"](0, 0),
        )

    joints = range(3)
    actual = point([position(k, j) for j in joints], [velocity(k, j) for j in joints])
    desired = point([position(k, j) + 1 for j in joints], [])
    return kinds["control_msgs/msg/JointTrajectoryControllerState"](
        head, ARM, desired, actual, point([1.0] * 3, [])
    )


def big_endian():
    """Messages in the other byte order, outside of chunks."""
    types = store()
    with open(OUT / "big_endian.mcap", "wb") as file:
        writer = McapWriter(file, use_chunking=False, index_types=IndexType.NONE)
        writer.start(profile="ros2", library="regen")
        text = (STATE + HEADER).encode()
        schema = writer.register_schema("sensor_msgs/msg/JointState", "ros2msg", text)
        channel = writer.register_channel("/joint_states", "cdr", schema)
        for k in range(4):
            data = types.serialize_cdr(
                ros_state(types, k), "sensor_msgs/msg/JointState", little_endian=False
            )
            writer.add_message(channel, received(k), bytes(data), received(k))
        writer.finish()


def databases():
    types = store()
    kinds = {
        "/joint_states": ("sensor_msgs/msg/JointState", ros_state),
        "/arm_controller/state": (
            "control_msgs/msg/JointTrajectoryControllerState",
            ros_controller,
        ),
    }
    for name, compressed in [("folder", False), ("compressed", True)]:
        folder = OUT / name
        shutil.rmtree(folder, ignore_errors=True)
        writer = BagWriter(folder, version=8, storage_plugin=StoragePlugin.SQLITE3)
        if compressed:
            writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
        with writer:
            for topic, (kind, make) in kinds.items():
                connection = writer.add_connection(topic, kind, typestore=types)
                for k in range(8):
                    data = types.serialize_cdr(make(types, k), kind)
                    writer.write(connection, received(k), bytes(data))


def fuzz():
    """First inputs of the fuzz target: a pendulum's, without check sums so that changes get far."""
    out = ROOT / "tests/tools/fuzz/kept/bag"
    out.mkdir(exist_ok=True)
    types = store()
    kind = "sensor_msgs/msg/JointState"

    def data(k):
        message = ros_state(types, k)
        message.name = ["q1"]
        for key in ("position", "velocity", "effort"):
            setattr(message, key, getattr(message, key)[:1])
        return bytes(types.serialize_cdr(message, kind))

    for name, options in [
        ("plain", {"use_chunking": False}),
        ("chunk", {"compression": CompressionType.NONE}),
        ("zstd", {"compression": CompressionType.ZSTD}),
        ("lz4", {"compression": CompressionType.LZ4}),
    ]:
        with open(out / name, "wb") as file:
            writer = McapWriter(
                file, enable_crcs=False, enable_data_crcs=False, index_types=IndexType.NONE, **options
            )
            writer.start(profile="ros2", library="regen")
            schema = writer.register_schema(kind, "ros2msg", (STATE + HEADER).encode())
            channel = writer.register_channel("/joint_states", "cdr", schema)
            for k in range(8):
                writer.add_message(channel, received(k), data(k), received(k))
            writer.finish()
    path = out / "database"
    path.unlink(missing_ok=True)
    database = sqlite3.connect(path)
    database.execute("PRAGMA page_size = 512")
    database.execute("CREATE TABLE topics (id INTEGER PRIMARY KEY, name, type, serialization_format)")
    database.execute(
        "CREATE TABLE messages (id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)"
    )
    database.execute("INSERT INTO topics VALUES (1, '/joint_states', ?, 'cdr')", (kind,))
    for k in range(8):
        row = (k + 1, received(k), data(k))
        database.execute("INSERT INTO messages VALUES (?, 1, ?, ?)", row)
    database.commit()
    database.close()


def lerobot():
    folder = OUT / "lerobot"
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "meta").mkdir(parents=True)
    (folder / "data/chunk-000").mkdir(parents=True)
    names = [f"{name}.pos" for name in ARM]
    feature = {"dtype": "float32", "shape": [3], "names": names}
    plain = {"dtype": "float32", "shape": [1], "names": None}
    info = {
        "codebase_version": "v3.0",
        "fps": 100,
        "features": {
            "observation.state": feature,
            "action": {**feature, "names": {"motors": names}},
            "timestamp": plain,
            "episode_index": {**plain, "dtype": "int64"},
        },
    }
    (folder / "meta/info.json").write_text(json.dumps(info, indent=1) + "\n")
    list3 = pa.list_(pa.float32(), 3)

    def table(episodes):
        rows = [(e, k) for e in episodes for k in range(10 + e)]
        columns = {
            "observation.state": pa.array(
                [[position(k, j) + 100 * e for j in range(3)] for e, k in rows], list3
            ),
            "action": pa.array([[position(k, j) + 1 for j in range(3)] for e, k in rows], list3),
            "timestamp": pa.array([k / 100 for _, k in rows], pa.float32()),
            "episode_index": pa.array([e for e, _ in rows], pa.int64()),
        }
        return pa.table(columns)

    pq.write_table(table([0]), folder / "data/chunk-000/episode_000000.parquet")
    pq.write_table(table([1, 2, 3]), folder / "data/chunk-000/file-000.parquet", row_group_size=20)


def compressions():
    """The same 64 rows with each compression, and numbers of the kinds that other programs write."""
    folder = OUT / "parquet"
    folder.mkdir(parents=True, exist_ok=True)
    rows = range(64)
    bare = dict(store_schema=False, write_statistics=False, write_page_checksum=True)
    log = pa.table({"t": [k / 100 for k in rows], "q": [k % 7 / 8 for k in rows]})
    for name in ["none", "snappy", "gzip", "brotli", "lz4", "zstd"]:
        # the second version leaves levels as they are and compresses the values alone
        version = "2.0" if name == "zstd" else "1.0"
        pq.write_table(
            log,
            folder / f"{name}.parquet",
            compression=name,
            use_dictionary=name != "none",
            data_page_version=version,
            **bare,
        )
    kinds = {
        "t": pa.array([k / 100 for k in rows]),
        "half": pa.array(np.array([k / 8 - 3 for k in rows], np.float16)),
        "large": pa.array([2**63 + 2048 * k for k in rows], pa.uint64()),
        "word": pa.array([2**31 + k for k in rows], pa.uint32()),
        "decimal": pa.array([decimal.Decimal(k) / 4 for k in rows], pa.decimal64(9, 2)),
    }
    pq.write_table(
        pa.table(kinds),
        folder / "kinds.parquet",
        compression="zstd",
        store_decimal_as_integer=True,
        **bare,
    )
    pq.write_table(log.slice(0, 0), folder / "empty.parquet", **bare)


def guide():
    """Every fourth row of a log of the guide."""
    rows = list(csv.reader(open(ROOT / "runtime/guide/fivebar/run1.csv")))[1::4]
    kind = "sensor_msgs/msg/JointState"
    out = []
    for t, q1, q3, tau1, tau3 in rows:
        nano = START * 10**9 + round(float(t) * 1e9)
        message = {
            "header": {
                "stamp": {"sec": nano // 10**9, "nanosec": nano % 10**9},
                "frame_id": "",
            },
            "name": ["left_motor", "right_motor"],
            "position": [float(q1), float(q3)],
            "velocity": [],
            "effort": [float(tau1), float(tau3)],
        }
        out.append(("/joint_states", kind, STATE + HEADER, message, len(out)))
    path = ROOT / "runtime/guide/fivebar/run1.mcap"
    mcap(path, CompressionType.ZSTD, out, chunk=1 << 20)


if __name__ == "__main__":
    OUT.mkdir(exist_ok=True)
    mcap("states.mcap", CompressionType.ZSTD, states(with_effort=False))
    mcap("several.mcap", CompressionType.LZ4, several())
    mcap("fields.mcap", CompressionType.ZSTD, fields(), chunk=1 << 20)
    mcap("publishers.mcap", CompressionType.NONE, publishers())
    mcap("changing.mcap", CompressionType.ZSTD, changing(), chunk=1 << 20)
    mcap("faulty.mcap", CompressionType.ZSTD, faulty(), chunk=1 << 20)
    big_endian()
    databases()
    lerobot()
    compressions()
    fuzz()
    guide()
