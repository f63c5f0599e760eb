"""Writes the files of tests/fixtures/arrays, and the seeds of the fuzz target `arrays`.

    python3 -m venv venv && venv/bin/pip install -r tests/tools/arrays/requirements.txt
    venv/bin/python tests/tools/arrays/write.py

Row k (from 0) has the time k/100 s, and joint j (from 0) the position 0.5 (j + 1) + k/8 and the effort
2 + k - j/2; all of these are exact in single precision but the time.
"""

from pathlib import Path

import h5py
import hdf5storage
import numpy as np
import scipy.io
import scipy.sparse
from asammdf import MDF, Signal
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

ROOT = Path(__file__).resolve().parents[3]
OUT = ROOT / "tests/fixtures/arrays"
SEEDS = ROOT / "tests/tools/fuzz/kept/arrays"
ROWS = 20
K = np.arange(ROWS)
J = np.arange(2)
T = K / 100
Q = 0.5 * (J + 1) + K[:, None] / 8
TAU = 2 + K[:, None] - J / 2


def numpy_files():
    record = np.zeros(ROWS, dtype=[("t", "<f8"), ("q", "<f4", (2,)), ("mode", "S3"), ("arm", [("tau", ">f8", (2,))])])
    record["t"], record["q"], record["arm"]["tau"] = T, Q, TAU
    np.save(OUT / "records.npy", record)
    np.save(OUT / "plain.npy", np.asfortranarray(np.column_stack([T, Q, TAU])))
    arrays = {
        "t": T,
        "q": Q.astype("<f2"),
        # one joint a row
        "tau": np.ascontiguousarray(TAU.T).astype(">f4"),
        "counts": (K - 5).astype("i2"),
        "short": np.arange(5.0),
        "notes": np.array(["a", "b"]),
        "waves": np.exp(1j * T),
    }
    np.savez(OUT / "stored.npz", **arrays)
    np.savez_compressed(OUT / "deflated.npz", **arrays)


def variables():
    state = np.zeros((1, 2), dtype=object)
    for j in J:
        state[0, j] = {"q": Q[:, j : j + 1], "id": float(j)}
    cells = np.empty((1, 2), dtype=object)
    cells[0, 0], cells[0, 1] = TAU, "text"
    records = np.zeros((1, 2), dtype=[("q", object), ("id", object)])
    for j in J:
        records[0, j]["q"], records[0, j]["id"] = Q[:, j : j + 1], float(j)
    return {
        "t": T[:, None],
        "data": {"q": Q, "tau": TAU.T, "arm": {"count": (K - 5).astype("i2")[:, None]}},
        "state": records,
        "c": cells,
        "short": np.arange(5.0)[None, :],
        "single": TAU[:, :1].astype("f4"),
        "note": "made by hand",
    }


def objects_of_level_73(path):
    """What MATLAB keeps of a sparse matrix and of a timeseries, which no Python package writes."""
    with h5py.File(path, "w", userblock_size=512, track_order=False) as file:
        file.create_dataset("t", data=T[None, :]).attrs["MATLAB_class"] = np.bytes_("double")
        thin = file.create_group("thin")
        thin.attrs["MATLAB_class"], thin.attrs["MATLAB_sparse"] = np.bytes_("double"), np.uint64(ROWS)
        thin["data"], thin["ir"], thin["jc"] = T[:2], np.arange(2, dtype="u8"), np.array([0, 2], dtype="u8")
        series = file.create_dataset("series", data=np.arange(6, dtype="u4")[:, None])
        series.attrs["MATLAB_class"], series.attrs["MATLAB_object_decode"] = np.bytes_("timeseries"), np.int32(3)
    head = b"MATLAB 7.3 MAT-file, made by hand".ljust(124) + b"\0\2IM"
    with open(path, "r+b") as file:
        file.write(head)


def mat_files():
    # every second row is zero
    thin = np.where(K[:, None] % 2 == 0, TAU, 0)
    more = {"thin": scipy.sparse.csc_matrix(thin), "wave": np.exp(1j * T)[:, None]}
    level4 = {
        "t": T[:, None],
        "q": Q,
        "tau": TAU.astype("f4"),
        "counts": (K - 5).astype("i2")[:, None],
        "note": "made by hand",
        "thinwave": scipy.sparse.csc_matrix(1j * thin),
    }
    scipy.io.savemat(OUT / "level4.mat", level4 | more, format="4")
    objects_of_level_73(OUT / "objects73.mat")
    scipy.io.savemat(OUT / "level5.mat", variables() | more)
    scipy.io.savemat(OUT / "level5_compressed.mat", variables() | more, do_compression=True)
    (OUT / "level73.mat").unlink(missing_ok=True)
    hdf5storage.savemat(
        str(OUT / "level73.mat"), variables(), format="7.3", oned_as="column", store_python_metadata=False
    )


def hdf5_files():
    with h5py.File(OUT / "early.h5", "w") as file:
        file["t"] = T
        arm = file.create_group("arm")
        arm.create_dataset("q", data=Q, chunks=(7, 1), compression="gzip", shuffle=True)
        arm.create_dataset("tau", data=TAU.astype(">f4"), chunks=(8, 2), compression="lzf", fletcher32=True)
        # a text of any length, and one of a fixed length
        arm["q"].attrs["unit"], arm["tau"].attrs["units"] = "rad", np.bytes_("N m")
        arm["on"] = K % 2 == 0
        arm["short"] = np.arange(5.0)
        arm["name"] = "arm"
        arm["again"] = h5py.SoftLink("/t")
        arm["itself"] = arm
        record = np.zeros(ROWS, dtype=[("id", "i4"), ("q", "f8", (2,)), ("inner", [("tau", "f4")])])
        record["id"], record["q"], record["inner"]["tau"] = K, Q, TAU[:, 1]
        arm["records"] = record
        # never written: zeros
        arm.create_dataset("nothing", shape=(ROWS,), dtype="f8", chunks=(10,))
        # another clock
        file["slow/t"] = T[:10] * 2
        file["slow/heat"] = 40 + K[:10] / 4
    with h5py.File(OUT / "late.h5", "w", libver="latest") as file:
        file["time"] = T
        file.create_dataset("one", data=Q[:, 0], chunks=(ROWS,), compression="gzip")
        file.create_dataset("fixed", data=Q, chunks=(3, 2))
        file.create_dataset("fixed_packed", data=TAU, chunks=(6, 1), compression="gzip")
        file.create_dataset("growing", data=Q[:, 1], chunks=(1,), maxshape=(None,))
        file.create_dataset("growing_packed", data=Q, chunks=(2, 2), maxshape=(None, 2), compression="gzip")
        file.create_dataset("tree", data=TAU, chunks=(3, 1), maxshape=(None, None))
        file.create_dataset("tree_packed", data=TAU, chunks=(3, 1), maxshape=(None, None), compression="gzip")
        many = file.create_group("many")
        for k in range(40):
            many[f"joint{k}"] = Q[:, 0] + k


def mdf_file(name, compression, version="4.10"):
    mdf = MDF(version=version)
    counts = Signal(
        (K * 2 - 7).astype("i2"), T, name="counts", unit="rad", conversion={"a": 0.25, "b": 1.0}
    )
    q = [Signal(Q[:, j], T, name=f"q{j + 1}", unit="rad") for j in J]
    tau = [Signal(TAU[:, j].astype("f4"), T, name=f"tau_q{j + 1}") for j in J]
    mdf.append([*q, *tau, counts], acq_name="arm", common_timebase=True)
    slow = T[:10] * 2
    mdf.append([Signal(40 + K[:10] / 4, slow, name="heat")], acq_name="slow")
    mdf.save(OUT / name, overwrite=True, compression=compression)
    mdf.close()


def tdms_file():
    def wave(name, values):
        return ChannelObject("wave", name, values, properties={"wf_increment": 0.01, "wf_start_offset": 0.5})

    with TdmsWriter(OUT / "segments.tdms") as writer:
        # two segments, of which the second one has no list of channels of its own
        for rows in (slice(0, 12), slice(12, ROWS)):
            writer.write_segment(
                [
                    RootObject(),
                    GroupObject("arm"),
                    ChannelObject("arm", "time", T[rows]),
                    *[ChannelObject("arm", f"q{j + 1}", Q[rows, j]) for j in J],
                    *[ChannelObject("arm", f"tau_q{j + 1}", TAU[rows, j].astype("f4")) for j in J],
                    ChannelObject("arm", "counts", (K[rows] - 5).astype("i2")),
                    wave("heat", 40 + K[rows] / 4),
                ]
            )


def seeds():
    """A short log of a pendulum in each format."""
    t = K[:12] / 10
    log = {"t": t, "q1": np.sin(t), "tau_q1": np.cos(t)}
    record = np.zeros(12, dtype=[(name, "f8") for name in log])
    for name, values in log.items():
        record[name] = values
    np.save(SEEDS / "npy", record)
    np.savez(SEEDS / "npz", **log)
    np.savez_compressed(SEEDS / "npz_packed", **log)
    scipy.io.savemat(SEEDS / "mat", {"data": log}, appendmat=False)
    scipy.io.savemat(SEEDS / "mat_packed", log, appendmat=False, do_compression=True)
    thin = scipy.sparse.csc_matrix(log["q1"][:, None])
    scipy.io.savemat(SEEDS / "mat4", {own: log[own][:, None] for own in log} | {"q1": thin}, format="4", appendmat=False)
    scipy.io.savemat(SEEDS / "mat_sparse", {own: log[own][:, None] for own in log} | {"q1": thin}, appendmat=False)
    for name, version, options in (
        ("hdf5", "earliest", {}),
        ("hdf5_packed", "earliest", {"chunks": (5,), "compression": "gzip", "shuffle": True}),
        ("hdf5_late", "latest", {"chunks": (5,), "compression": "lzf"}),
        ("hdf5_growing", "latest", {"chunks": (1,), "maxshape": (None,)}),
    ):
        with h5py.File(SEEDS / name, "w", libver=version) as file:
            for own, values in log.items():
                file.create_dataset(own, data=values, **(options if own == "q1" else {}))
    states = h5py.enum_dtype({"off": 0, "on": 1}, basetype="i2")
    with h5py.File(SEEDS / "hdf5_states", "w", libver="latest") as file:
        for own, values in log.items():
            file.create_dataset(own, data=values)
        file.create_dataset("mode", data=np.arange(12) % 2, dtype=states)
    dates = np.datetime64("2026-11-30", "ns") + (1e8 * np.arange(12)).astype("m8[ns]")
    np.savez(SEEDS / "npz_dates", **(log | {"t": dates}))
    # 8 TB that were never written
    with h5py.File(SEEDS / "hdf5_claims", "w") as file:
        for own in log:
            file.create_dataset(own, shape=(10**12,), dtype="f8", chunks=(1000,))
    for name, compression in (("mdf", 0), ("mdf_packed", 2)):
        mdf = MDF(version="4.10")
        mdf.append([Signal(log[own], t, name=own) for own in ("q1", "tau_q1")], common_timebase=True)
        mdf.save(SEEDS / f"{name}.mf4", overwrite=True, compression=compression)
        mdf.close()
    mdf = MDF(version="4.10")
    said = "<CNcomment><TX>x &amp; y</TX><names><display>q1</display></names></CNcomment>"
    names = {"val_0": 0, "text_0": b"off", "val_1": 1, "text_1": b"on", "default": b""}
    mode = Signal((np.arange(12) % 2).astype("u1"), t, name="mode", conversion=names)
    q = Signal(log["q1"], t, name="angle", comment=said)
    mdf.append([q, Signal(log["tau_q1"], t, name="tau_q1"), mode], common_timebase=True)
    mdf.save(SEEDS / "mdf_names.mf4", overwrite=True)
    mdf.close()
    with TdmsWriter(SEEDS / "tdms") as writer:
        writer.write_segment([ChannelObject("arm", own, values) for own, values in log.items()])
    for path in [*SEEDS.glob("*.npy"), *SEEDS.glob("*.npz"), *SEEDS.glob("*.mf4")]:
        path.rename(path.with_suffix(""))


if __name__ == "__main__":
    SEEDS.mkdir(exist_ok=True)
    seeds()
    OUT.mkdir(exist_ok=True)
    numpy_files()
    mat_files()
    hdf5_files()
    mdf_file("plain.mf4", 0)
    mdf_file("packed.mf4", 2)
    mdf_file("old.mdf", 0, "3.30")
    tdms_file()
    for path in sorted(OUT.iterdir()):
        print(path.name, path.stat().st_size)
