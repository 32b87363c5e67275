"""``python -m docs.lerobot_recipe DIR OUT``: convert a run to a LeRobot v3 data set, an episode per whole cycle.

Adapt this recipe as needed: FEATURES declares observations and actions. LeRobot need not be installed; it reads the
data set with ``LeRobotDataset("me/walk", root=OUT)``.
"""

import json
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

import cmacexp

FEATURES = {
    "observation.state": ("q1", "q2", "dq1", "dq2", "force"),
    "observation.goal": ("x_desired", "y_desired", "force_desired"),
    "action": ("tau_feedback_1", "tau_feedback_2", "tau_feedforward_1", "tau_feedforward_2"),
}
"""Trace columns of each leg that form a feature."""
INDICES = {"timestamp": "float32", **dict.fromkeys(("frame_index", "episode_index", "index", "task_index"), "int64")}
DATA, EPISODES = "data/chunk-000/file-000.parquet", "meta/episodes/chunk-000/file-000.parquet"
QUANTILES = (0.01, 0.1, 0.5, 0.9, 0.99)


def measure(values):
    """Compute the statistics of values (frames, width) that LeRobot stores for normalisation."""
    values = np.asarray(values, dtype=float).reshape(len(values), -1)
    kinds = {name: getattr(values, name)(axis=0).tolist() for name in ("min", "max", "mean", "std")}
    quantiles = zip(QUANTILES, np.quantile(values, QUANTILES, axis=0).tolist(), strict=True)
    return {**kinds, "count": [len(values)], **{f"q{round(100 * share):02d}": value for share, value in quantiles}}


def export(folder, out):
    """Write the run in ``folder`` as a data set to the new folder ``out``; NaN becomes 0.

    Returns:
        Numbers of episodes and frames.
    """
    run = cmacexp.load(folder)
    out = Path(out)
    trace = run.trace[run.trace["cycle"] <= run.whole_cycles]
    legs = trace["leg"].unique().tolist()
    arrays = {
        feature: np.nan_to_num(trace[list(columns)].to_numpy(np.float32).reshape(-1, len(legs) * len(columns)))
        for feature, columns in FEATURES.items()
    }
    names = {feature: [f"leg{leg}.{name}" for leg in legs for name in group] for feature, group in FEATURES.items()}
    episode = trace["cycle"].to_numpy(np.int64)[:: len(legs)] - 1
    starts = np.searchsorted(episode, np.arange(run.whole_cycles))
    ends = [*starts[1:].tolist(), len(episode)]
    frame = np.arange(len(episode)) - starts[episode]
    columns = {"timestamp": (frame * run.config["sampling_period"]).astype(np.float32), "frame_index": frame}
    columns |= {"episode_index": episode, "index": np.arange(len(episode)), "task_index": np.zeros_like(episode)}
    for path in (DATA, EPISODES):
        (out / path).parent.mkdir(parents=True)

    lists = {name: pa.FixedSizeListArray.from_arrays(pa.array(a.ravel()), a.shape[1]) for name, a in arrays.items()}
    pq.write_table(pa.table({**lists, **columns}), out / DATA)
    task = f"{run.config['scenario']}: track the path of the foot and its force"
    tasks = pd.DataFrame({"task_index": [0]}, index=pd.Index([task], name="task"))
    tasks.to_parquet(out / "meta" / "tasks.parquet")
    rows = [
        {
            "episode_index": number,
            "tasks": [task],
            "length": end - start,
            "dataset_from_index": start,
            "dataset_to_index": end,
            **{f"{kind}/{which}_index": 0 for kind in ("data", "meta/episodes") for which in ("chunk", "file")},
            **{
                f"stats/{name}/{key}": value
                for name, values in {**arrays, **columns}.items()
                for key, value in measure(values[start:end]).items()
            },
        }
        for number, (start, end) in enumerate(zip(starts.tolist(), ends, strict=True))
    ]
    pq.write_table(pa.Table.from_pylist(rows), out / EPISODES)
    vectors = {name: {"dtype": "float32", "shape": [len(names[name])], "names": names[name]} for name in arrays}
    info = {
        "codebase_version": "v3.0",
        "robot_type": run.config["machine"]["kind"],
        "total_episodes": len(rows),
        "total_frames": len(episode),
        "total_tasks": 1,
        "chunks_size": 1000,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": round(1.0 / run.config["sampling_period"]),
        "splits": {"train": f"0:{len(rows)}"},
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": None,
        "features": vectors | {key: {"dtype": kind, "shape": [1], "names": None} for key, kind in INDICES.items()},
    }
    statistics = {name: measure(values) for name, values in {**arrays, **columns}.items()}
    for name, content in {"info": info, "stats": statistics}.items():
        (out / "meta" / f"{name}.json").write_text(json.dumps(content, indent=1))
    return len(rows), len(episode)


if __name__ == "__main__":
    print("{} episodes, {} frames".format(*export(*sys.argv[1:])))
