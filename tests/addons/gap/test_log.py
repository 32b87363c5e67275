"""Reading a log: the same from every format and under other names and units; one line where something is missing."""

import json
from functools import partial

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as parquet
import pytest
from scipy.io import savemat
from support.doors import BadInput

from cmacexp.addons.gap.clock import regularise
from cmacexp.addons.gap.matching import list_absent, match_names
from cmacexp.addons.gap.readers import load_reader
from cmacexp.addons.gap.reading import read_log

TIME = np.arange(0.0, 0.5, 0.005)
NAMES = ("shoulder", "elbow", "wrist")
ANGLE = np.sin(TIME[:, None] + np.arange(3))
COMMAND = ANGLE + 0.1


def columns(angle="q_{}", command="q_des_{}", time="time"):
    measured = {angle.format(name): ANGLE[:, j] for j, name in enumerate(NAMES)}
    return {time: TIME, **measured, **{command.format(name): COMMAND[:, j] for j, name in enumerate(NAMES)}}


def write_parquet(path):
    table = pa.table(columns()).replace_schema_metadata({"units": "s, rad", "kp": "20", "kd": "1,2,3"})
    parquet.write_table(table, path)


def write_csv(path):
    text = pd.DataFrame(columns("pos_{}", "cmd_{}", "t")).to_csv(index=False, sep=";").replace("\n", ";;\n")
    path.write_text(f"# kp: 20\n# kd: 1,2,3\n{text}")


def write_npz(path):
    np.savez(path, time=TIME, q=ANGLE, q_des=COMMAND, names=NAMES, kp=20.0, kd=[1.0, 2.0, 3.0])


@pytest.mark.parametrize(("suffix", "write"), [("parquet", write_parquet), ("csv", write_csv), ("npz", write_npz)])
def test_a_log_is_the_same_from_every_format(tmp_path, suffix, write):
    write(path := tmp_path / f"log.{suffix}")
    log = read_log(path)
    assert log.joints == NAMES
    np.testing.assert_allclose([log.angle, log.command], [ANGLE, COMMAND])
    np.testing.assert_allclose([log.kp, log.kd], [[20.0] * 3, [1.0, 2.0, 3.0]])
    assert log.leave_out(["elbow"]).kd.tolist() == [1.0, 3.0]


def test_names_and_units_are_options_and_another_format_needs_a_reader_of_a_few_lines(tmp_path):
    path, reader = tmp_path / "log.txt", tmp_path / "reader.py"
    degrees = {name: np.degrees(own) for name, own in columns("ist_{}", "soll_{}").items()} | {"time": 1e3 * TIME}
    np.savetxt(path, np.column_stack(list(degrees.values())), header=" ".join(degrees), comments="")
    reader.write_text(
        "import numpy as np\n"
        "def read(path):\n"
        "    rows = np.loadtxt(path, skiprows=1)\n"
        "    return dict(zip(path.open().readline().split(), rows.T))\n"
    )
    named = {"angle": "ist_{joint}", "command": "soll_{joint}"}
    units = {"time": "ms", "angle": "deg", "command": "deg"}
    log = read_log(path, named, units, {"kp": [20.0], "kd": [1.0]}, load_reader(f"{reader}:read"))
    assert log.joints == NAMES
    np.testing.assert_allclose([log.angle, log.command], [ANGLE, COMMAND])
    np.testing.assert_allclose(log.time, TIME)


def test_a_folder_that_is_no_bag_is_refused(tmp_path):
    with pytest.raises(BadInput, match="is a folder, and no bag of ROS 2"):
        read_log(tmp_path)


WRONG = {
    "no such file": ({"path": "nowhere.csv"}, "there is no such file"),
    "format": ({"path": "log.xyz"}, "name a reader"),
    "no angles": (
        {"rename": {f"q_{name}": f"x_{name}" for name in NAMES}},
        "no measured angles under q_{joint} .*--names angle=",
    ),
    "no time": ({"rename": {"time": "clock"}}, "no column of time"),
    "one command": ({"rename": {"q_des_wrist": "q_dse_wrist"}}, "no column q_des_wrist .*did you mean q_dse_wrist"),
    "no gains": ({"gains": {"kp": [20.0]}}, "neither both gains of the drives, --kp and --kd, nor torques found"),
    "gains": ({"gains": {"kp": [20.0, 1.0], "kd": [1.0]}}, "--kp=20,1.* one for each of 3 joints"),
    "unit": ({"units": {"angle": "grad"}}, "is no unit of angle"),
    "quantity": ({"names": {"angel": "q_{joint}"}}, "is no quantity"),
    "text": ({"rename": {"note": "q_wrist", "q_wrist": "other"}}, "holds no numbers in column q_wrist"),
    "one angle": (
        {"rename": {"q_wrist": "Q_wrist"}},
        "no column q_wrist for angle of joint wrist.*--leave-out wrist",
    ),
    "orientation": ({"add": {"qw": 1.0, "qx": 0.0, "qy": 0.0}}, "no column qz for orientation"),
    "three of four": (
        {"reader": "def read(_): return {'time': [0.1], 'q_a': [1.0], 'quat': [[1.0, 0.0, 0.0]]}"},
        "no column quat_z for orientation",
    ),
    "a matrix": (
        {"reader": "def read(_): return {'time': [0.1], 'q_a': [1.0], 'quat': [[1.0, 0, 0, 0, 1, 0, 0, 0, 1]]}"},
        "quat has 9 columns, a quaternion 4",
    ),
    "unit of nothing": (
        {"units": {"feedforward": "Nm"}},
        "--units=feedforward=Nm: the log has no feedforward; it has time",
    ),
    "no such gain": ({"names": {"kp": "gain"}, "gains": {"kd": [1.0]}}, "no column gain for kp"),
    "declared unit": ({"head": "# units: s, furlong\n"}, "declares the unit furlong: must be one of rad"),
    "all left out": ({"left_out": NAMES}, "--leave-out=shoulder,elbow,wrist: leaves no joint"),
    "infinite": ({"gains": {"kp": [np.inf], "kd": [1.0]}}, "--kp=inf.*: must be one finite number"),
    "reader": ({"reader": "def read(:"}, "--reader=.*SyntaxError"),
    "one time": ({"reader": "def read(_): return {'time': 0.1, 'q_a': [1.0, 2.0]}"}, "q_a has 2 values, time has 1"),
    "torques only": ({"drop": [f"q_des_{name}" for name in NAMES]}, "neither commanded angles nor torques"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_missing_or_wrong_is_one_line(tmp_path, name):
    case, words = WRONG[name]
    path = tmp_path / case.get("path", "log.csv")
    if path.name != "nowhere.csv":
        frame = pd.DataFrame({**columns(), "note": "a", **case.get("add", {})}).rename(columns=case.get("rename", {}))
        path.write_text(case.get("head", "") + frame.drop(columns=case.get("drop", [])).to_csv(index=False))
    (tmp_path / "reader.py").write_text(case.get("reader", ""))
    gains = case.get("gains", {"kp": [20.0], "kd": [1.0]})
    load = partial(load_reader, f"{tmp_path}/reader.py:read") if "reader" in case else lambda: None
    with pytest.raises(BadInput, match=words) as caught:
        read_log(path, case.get("names"), case.get("units"), gains, load(), case.get("left_out", ()))
    assert "\n" not in str(caught.value)


def test_a_joint_without_a_measured_angle_can_be_left_out_and_pairs_of_joints_must_be_of_the_log(tmp_path):
    pd.DataFrame(columns() | {"q_des_thumb": TIME}).to_csv(tmp_path / "log.csv", index=False)
    assert read_log(tmp_path / "log.csv", gains={"kp": [20.0], "kd": [1.0]}, left_out=["thumb"]).joints == NAMES
    torques = {key.replace("q_des_", "tau_"): values for key, values in columns().items()}
    pd.DataFrame(torques).to_csv(tmp_path / "log.csv", index=False)
    assert read_log(tmp_path / "log.csv", left_out=["elbow"]).joints == ("shoulder", "wrist")
    with pytest.raises(BadInput, match="--joints=thumb=wrist: the log has no joint thumb"):
        match_names(NAMES, NAMES, {"thumb": "wrist"})


def test_measured_signals_come_before_filtered_ones_and_one_joint_needs_no_name(tmp_path):
    signals = {"pos_filt": COMMAND, "pos_meas": ANGLE, "tau_con": ANGLE, "tau_meas": COMMAND}
    table = {f"{name}{k + 1}": values[:, k] for name, values in signals.items() for k in range(3)}
    pd.DataFrame({"time": TIME, **table}).to_csv(tmp_path / "log.csv", index=False)
    log = read_log(tmp_path / "log.csv")
    assert log.joints == ("1", "2", "3")
    np.testing.assert_allclose([log.angle, log.torque], [ANGLE, COMMAND])
    np.savez(tmp_path / "log.npz", time=TIME, q=ANGLE, q_clean=COMMAND[:5], tau=COMMAND)
    assert read_log(tmp_path / "log.npz").joints == ("0", "1", "2")
    table = {"time": TIME, "position": ANGLE[:, 0], "velocity": TIME, "torque": COMMAND[:, 0]}
    pd.DataFrame(table).to_csv(tmp_path / "log.csv", index=False)
    for names in ({}, {"angle": "position"}):
        log = read_log(tmp_path / "log.csv", names)
        assert match_names(log.joints, ["arm"], {}) == ("arm",)
        np.testing.assert_allclose([log.angle, log.torque], [ANGLE[:, :1], COMMAND[:, :1]])
    pd.DataFrame(columns()).to_csv(tmp_path / "log.csv", index=False)
    for names, said in (
        ({"angle": "q_elbow"}, "neither commanded angles nor torques"),
        ({"command": "q_des_elbow"}, "--names=command=q_des_elbow: must contain {joint}"),
    ):
        with pytest.raises(BadInput, match=said):
            read_log(tmp_path / "log.csv", names, gains={"kp": [20.0], "kd": [1.0]})


def test_joints_with_the_same_numbers_are_matched_and_all_others_are_in_one_line():
    arm = [*(f"panda_joint{k}" for k in range(1, 8)), "panda_finger_joint1", "panda_finger_joint2"]
    assert match_names([f"fer_joint{k}" for k in range(1, 8)], arm, {}) == tuple(arm[:7])
    for stem in ("", "joint_"):
        assert match_names([f"{stem}{k}" for k in range(7)], arm, {}) == tuple(arm[:7])
    with pytest.raises(
        BadInput, match="no joint a, b; say if it is this order, --joints a=x,b=y, or --leave-out a,b"
    ):
        match_names(["a", "b", "z"], ["x", "y", "z"], {})
    assert list_absent(["x", "y", "grip"], ["x", "y", "z"], {}) == ["grip"]
    assert not list_absent(["x", "grip"], ["x", "y", "z"], {})
    legs = [f"{leg}_{joint}_joint" for leg in ("FL", "FR") for joint in ("hip", "thigh")]
    with pytest.raises(BadInput, match="FR_0=FR_hip_joint,FR_1=FR_thigh_joint,FL_0=FL_hip_joint,FL_1=FL_thigh_joint"):
        match_names(["FR_0", "FR_1", "FL_0", "FL_1"], legs, {})
    assert match_names(["b"], ["x", "y"], {"a": "x", "b": "y"}, ["a"]) == ("y",)


@pytest.mark.parametrize(
    "joints", [("pan", "lift", "elbow", "wrist_1", "wrist_2"), [f"joint_{k}" for k in range(1, 6)]]
)
@pytest.mark.parametrize("first", [0, 1])
def test_numbered_joints_count_those_of_the_model_whatever_numbers_their_names_have(joints, first):
    numbers = [str(first + k) for k in range(5)]
    assert match_names(numbers, joints, {}) == tuple(joints)
    assert match_names(numbers[1:4], joints, {}, [numbers[0], numbers[4]]) == tuple(joints[1:4])
    with pytest.raises(BadInput, match="say --joints"):
        match_names([*numbers, str(first + 5)], joints, {})


OTHER_STYLES = {
    "numbered": (lambda n: f"jpos{n}", lambda n: f"jpos_des{n}", "timestamp_ms", ("0", "1", "2")),
    "spaces": (lambda n: f"- {NAMES[n]} position", lambda n: f"- {NAMES[n]} command", "Time [s]", NAMES),
    "arrays": (lambda n: f"q[{n}]", lambda n: f"q_d[{n}]", "t", ("0", "1", "2")),
    "motors": (lambda n: f"motor{n}.q", lambda n: f"motor{n}.q_target", "t", ("motor0", "motor1", "motor2")),
    "paths": (lambda n: f"{NAMES[n]}/pos/measured", lambda n: f"{NAMES[n]}/pos/commanded", "Timestamp [s]", NAMES),
    "prefixes": (lambda n: f"q_act_{NAMES[n]}", lambda n: f"q_ref_{NAMES[n]}", "time_s", NAMES),
}


@pytest.mark.parametrize("style", OTHER_STYLES)
def test_names_of_other_tools_are_understood_and_times_since_1970_keep_their_digits(tmp_path, style):
    angle, command, time, joints = OTHER_STYLES[style]
    stamps = 1_700_000_000_000 + np.round(1e3 * TIME).astype(int) if time.endswith("ms") else TIME
    signals = {angle(n): ANGLE[:, n] for n in range(3)} | {command(n): COMMAND[:, n] for n in range(3)}
    pd.DataFrame({time: stamps, **signals}).to_csv(tmp_path / "log.csv.gz", index=False)
    log = read_log(tmp_path / "log.csv.gz", gains={"kp": [20.0], "kd": [1.0]})
    assert log.joints == joints
    np.testing.assert_allclose([log.angle, log.command], [ANGLE, COMMAND])
    np.testing.assert_allclose(log.time, TIME, atol=1e-12)


@pytest.mark.parametrize("has_names", [True, False])
def test_numbers_with_decimal_commas_are_read_beside_semicolons(tmp_path, has_names):
    frame = pd.DataFrame(columns())
    frame.to_csv(tmp_path / "log.csv", index=False, sep=";", decimal=",", header=has_names)
    names = {} if has_names else {"time": "1", "angle": "2-4", "command": "5-7"}
    log = read_log(tmp_path / "log.csv", names, gains={"kp": [20.0], "kd": [1.0]})
    np.testing.assert_allclose(log.time, TIME, atol=1e-12)
    np.testing.assert_allclose(log.angle[:, 0], frame.to_numpy()[:, 1])


def test_columns_without_names_are_named_by_number_and_a_rate_stands_for_times(tmp_path):
    np.savetxt(tmp_path / "log.txt", np.column_stack([ANGLE, COMMAND]))
    names = {"angle": "1-3", "command": "4-6"}
    log = read_log(tmp_path / "log.txt", names, gains={"kp": [20.0], "kd": [1.0]}, rate=200.0)
    np.testing.assert_allclose([log.angle, log.command], [ANGLE, COMMAND])
    np.testing.assert_allclose(log.time, TIME, atol=1e-12)
    with pytest.raises(BadInput, match="--names=angle=1-7: must be columns from 1 to"):
        read_log(tmp_path / "log.txt", {"angle": "1-7"}, rate=200.0)


def test_a_bag_of_ros_2_gives_joints_by_name_whatever_their_order(tmp_path):
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    types = {name.rpartition("/")[2]: kind for name, kind in store.types.items()}
    with rosbag2.Writer(tmp_path / "bag", version=9) as bag:
        topics = {
            name: bag.add_connection(name, "sensor_msgs/msg/JointState", typestore=store)
            for name in ("/joint_states", "/joint_command")
        }
        for k, at in enumerate(TIME):
            order = np.roll(np.arange(3), k)
            nanoseconds = round(at * 1e9)
            for topic, values in {"/joint_states": ANGLE, "/joint_command": COMMAND}.items():
                stamp = types["Time"](sec=1_700_000_000 + nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
                message = types["JointState"](
                    header=types["Header"](stamp=stamp, frame_id=""),
                    name=[NAMES[j] for j in order],
                    position=values[k, order],
                    velocity=np.zeros(0),
                    effort=np.zeros(0),
                )
                raw = store.serialize_cdr(message, "sensor_msgs/msg/JointState")
                bag.write(topics[topic], 1_700_000_000 * 10**9 + nanoseconds, raw)
    log = read_log(tmp_path / "bag", gains={"kp": [20.0], "kd": [1.0]})
    assert set(log.joints) == set(NAMES)
    order = [log.joints.index(name) for name in NAMES]
    np.testing.assert_allclose([log.angle[:, order], log.command[:, order]], [ANGLE, COMMAND])
    np.testing.assert_allclose(log.time, TIME, atol=1e-9)


OTHER_FILES = {
    "json": lambda path: path.write_text(json.dumps({"gain": 3, "rows": list_records()})),
    "jsonl": lambda path: path.write_text("\n".join(map(json.dumps, list_records()))),
    "mat": lambda path: savemat(path, {"time": TIME, "data": {"q": ANGLE.T, "tau": COMMAND}, "joint_names": NAMES}),
    "npy": lambda path: np.save(path, np.column_stack([TIME, ANGLE, COMMAND])),
}


def list_records():
    """The log as records, each of a time, angles by joint, and torques by joint."""
    rows = zip(TIME.tolist(), ANGLE.tolist(), COMMAND.tolist(), strict=True)
    return [
        {"time": t, "q": dict(zip(NAMES, q, strict=True)), "tau": dict(zip(NAMES, tau, strict=True))}
        for t, q, tau in rows
    ]


@pytest.mark.parametrize("suffix", OTHER_FILES)
def test_files_of_other_tools_are_read(tmp_path, suffix):
    OTHER_FILES[suffix](tmp_path / f"log.{suffix}")
    names = {"time": "1", "angle": "2-4", "torque": "5-7"} if suffix == "npy" else {}
    log = read_log(tmp_path / f"log.{suffix}", names)
    assert log.joints == (("0", "1", "2") if suffix == "npy" else NAMES)
    np.testing.assert_allclose([log.angle, log.torque], [ANGLE, COMMAND])
    np.testing.assert_allclose(log.time, TIME)


def test_a_file_of_hdf5_is_read(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file.update({"time": TIME, "observations/qpos": ANGLE, "observations/effort": COMMAND})
    log = read_log(tmp_path / "log.h5")
    np.testing.assert_allclose([log.angle, log.torque], [ANGLE, COMMAND])


def test_of_several_runs_in_a_file_the_longest_is_read(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "log.h5", "w") as file:
        for k, rows in enumerate((50, len(TIME), 20)):
            file.update({f"data/demo_{k}/{name}": it[:rows] for name, it in {"q": ANGLE, "tau": COMMAND}.items()})
    runs = [{"q": ANGLE[:9].tolist()}, {"q": ANGLE.tolist(), "tau": COMMAND.tolist()}]
    (tmp_path / "log.json").write_text(json.dumps(runs))
    for name in ("log.h5", "log.json"):
        log = read_log(tmp_path / name, rate=200.0)
        np.testing.assert_allclose([log.angle, log.torque], [ANGLE, COMMAND])


def test_a_signal_in_each_row_counts_of_an_encoder_and_times_of_two_files_are_read(tmp_path):
    np.savetxt(tmp_path / "wide.txt", np.column_stack([TIME, ANGLE, COMMAND]).T)
    log = read_log(tmp_path / "wide.txt", {"time": "1", "angle": "2-4", "torque": "5-7"})
    np.testing.assert_allclose([log.angle, log.torque], [ANGLE, COMMAND])
    pd.DataFrame(columns()).to_csv(tmp_path / "log.csv", index=False)
    counts = read_log(tmp_path / "log.csv", None, {"angle": "4096/rev"}, {"kp": [20.0], "kd": [1.0]})
    np.testing.assert_allclose(counts.angle, ANGLE * 2.0 * np.pi / 4096)
    for name, values in {"log_q_actual": ANGLE, "log_q_target": COMMAND}.items():
        np.savetxt(tmp_path / f"{name}.csv", np.column_stack([TIME, values]), delimiter=",")
    log = read_log(
        tmp_path / "log_q_actual.csv", gains={"kp": [20.0], "kd": [1.0]}, others=[tmp_path / "log_q_target.csv"]
    )
    np.testing.assert_allclose([log.angle, log.command], [ANGLE, COMMAND])
    np.testing.assert_allclose(log.time, TIME)


def test_files_with_one_quantity_each_are_joined_under_the_signals_in_their_names(tmp_path):
    for name, values in {"arm_position": ANGLE, "arm_torque": COMMAND}.items():
        pd.DataFrame(values, columns=NAMES).assign(t=TIME).to_csv(tmp_path / f"{name}.csv", index=False)
    log = read_log(tmp_path / "arm_position.csv", others=[tmp_path / "arm_torque.csv"])
    assert log.joints == NAMES
    np.testing.assert_allclose([log.angle, log.torque], [ANGLE, COMMAND])
    for name, values in {"t": TIME, "q": ANGLE, "tau": COMMAND}.items():
        np.savetxt(tmp_path / f"{name}.txt", values)
    for first, rate in {"q": 200.0, "t": None}.items():
        log = read_log(
            tmp_path / f"{first}.txt", rate=rate, others=[tmp_path / f"{name}.txt" for name in ("q", "tau")]
        )
    np.testing.assert_allclose([log.angle, log.torque], [ANGLE, COMMAND])


@pytest.mark.parametrize("style", ["columns", "list", "no header"])
def test_names_of_joints_in_the_data_are_those_of_its_numbers(tmp_path, style):
    """As exported from messages of joint states by bagpy, by lists in cells, and by ``ros2 topic echo --csv``."""
    table = {"Time": TIME, **{f"field.name{k}": name for k, name in enumerate(NAMES)}}
    table |= {f"field.position{k}": ANGLE[:, k] for k in range(3)} | {
        f"field.effort{k}": COMMAND[:, k] for k in range(3)
    }
    if style == "list":
        lists = {"name": [list(NAMES)] * len(TIME), "position": ANGLE.tolist(), "effort": COMMAND.tolist()}
        table = {"Time": TIME, **lists}
    pd.DataFrame(table).to_csv(tmp_path / "log.csv", index=False, header=style != "no header")
    numbers = {"time": "1", "angle": "5-7", "torque": "8-10"} if style == "no header" else {}
    log = read_log(tmp_path / "log.csv", numbers)
    assert log.joints == NAMES
    np.testing.assert_allclose([log.angle, log.torque], [ANGLE, COMMAND])


def test_a_repeated_name_is_known_by_its_number_a_joint_without_torque_is_passive_and_units_of_time_are_seen(
    tmp_path,
):
    table = pd.DataFrame({**columns(), "note": COMMAND[:, 2], "tau_wrist": ANGLE[:, 2]})
    table["time"] = np.round(1e6 * TIME).astype(int)
    table.rename(columns={"note": "q_wrist"}).to_csv(tmp_path / "log.csv", index=False)
    log = read_log(tmp_path / "log.csv")
    np.testing.assert_allclose(log.angle, ANGLE)
    np.testing.assert_allclose(log.torque, ANGLE * [0.0, 0.0, 1.0])
    np.testing.assert_allclose(log.time, TIME)
    assert [
        words in " ".join(log.notes) for words in ("8 (q_wrist) repeat", "shoulder, elbow is logged", "in us")
    ] == [True] * 3


def test_counts_of_sixteen_bits_have_signs(tmp_path):
    load = np.round(300.0 * np.sin(40.0 * TIME))
    pd.DataFrame({"time": TIME, "position": TIME, "load": load % 2**16}).to_csv(tmp_path / "log.csv", index=False)
    np.testing.assert_allclose(read_log(tmp_path / "log.csv").torque[:, 0], load)


def test_names_and_episodes_of_a_data_set_are_read(tmp_path):
    (tmp_path / "meta").mkdir()
    names = [f"{name}.pos" for name in NAMES]
    features = {key: {"names": names} for key in ("observation.state", "action")}
    (tmp_path / "meta" / "info.json").write_text(json.dumps({"features": features}))
    table = {"observation.state": ANGLE.tolist(), "action": COMMAND.tolist(), "timestamp": TIME}
    pd.DataFrame(table).to_parquet(tmp_path / "file.parquet")
    log = read_log(tmp_path / "file.parquet", gains={"kp": [20.0], "kd": [1.0]})
    assert log.joints == NAMES
    np.testing.assert_allclose([log.angle, log.command], [ANGLE, COMMAND])
    twice = {key: np.concatenate([values, values]) for key, values in columns().items()}
    pd.DataFrame(twice).to_csv(tmp_path / "log.csv", index=False)
    log = read_log(tmp_path / "log.csv", gains={"kp": [20.0], "kd": [1.0]})
    once = regularise(log)
    assert len(once.time) == len(TIME)
    assert "Time begins anew in 1 places" in once.notes[-1]


def test_rows_of_other_topics_are_held(tmp_path):
    """As PlotJuggler exports two topics: each row has the values of one of them."""
    own = pd.DataFrame({key: values for key, values in columns().items() if "des" not in key})
    other = pd.DataFrame({key: values for key, values in columns().items() if "q_" not in key or "des" in key})
    table = pd.concat([own, other.assign(time=TIME + 1e-3)]).sort_values("time")
    table.to_csv(tmp_path / "log.csv", index=False)
    log = regularise(read_log(tmp_path / "log.csv", gains={"kp": [20.0], "kd": [1.0]}))
    np.testing.assert_allclose(log.angle, ANGLE[1:])
    np.testing.assert_allclose(log.command, COMMAND[:-1])
