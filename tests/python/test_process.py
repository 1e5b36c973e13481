"""Ctrl-C, threads and processes at once, the command, and what the wheel holds."""

import multiprocessing
import os
import signal
import threading
import time
from importlib import metadata, resources

import numpy as np
import pytest

import pegfit
from conftest import random_poses


def interrupted(work, begun=None):
    """Sends Ctrl-C to this process a second into `work`, or when it has `begun`; seconds until it was
    raised."""
    sent = []

    def send():
        time.sleep(1.0) if begun is None else begun.wait(60)
        sent.append(time.perf_counter())
        os.kill(os.getpid(), signal.SIGINT)

    sender = threading.Thread(target=send)
    sender.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            work()
        return time.perf_counter() - sent[0]
    finally:
        sender.join()


@pytest.fixture(scope="module")
def fine():
    pair = pegfit.Pair(*pegfit.peg_in_hole("combined"), spacing=0.0006)
    pair.correlate(window=0.001)
    return pair


@pytest.mark.parametrize("work", ["density", "bake", "dock", "query", "feel", "tolerance"])
def test_ctrl_c_is_raised_soon_and_leaves_the_process_usable(work, fine, table, tmp_path):
    poses = random_poses(20000, reach=0.01, angle=0.1, seed=1)
    hole, begun = pegfit.peg_in_hole("combined")[0], threading.Event()
    told = dict(progress=lambda done, total: begun.set())
    calls = {
        "density": lambda: pegfit.density(hole, spacing=1e-4, **told),
        "bake": lambda: fine.bake(tmp_path / "t.zarr", step_deg=2.0, **told),
        "dock": lambda: fine.dock(exhaustive=True, state=tmp_path / "state", **told),
        "query": lambda: fine.evaluator().query(poses),
        "feel": lambda: pegfit.feel(table, seconds=1e6),
        "tolerance": lambda: fine.bake(tmp_path / "u.zarr", tolerance=1e-3, **told),
    }
    taken = interrupted(calls[work], None if work in ("query", "feel") else begun)
    print(f"{work}: {1e3 * taken:.1f} ms")
    # What is promised is 50 ms (`benches/python` measures it); a busy machine gets more.
    assert taken < 1.0
    assert len(table.query(poses[:10])) == 10


def test_a_bake_that_was_interrupted_is_resumed(tmp_path):
    pair = pegfit.Pair(*pegfit.peg_in_hole("combined"), spacing=0.001, half_extent=0.01)
    pair.correlate(window=0.001)
    path, options = tmp_path / "t.zarr", dict(angle_deg=10, step_deg=4)
    begun = threading.Event()

    def progress(done, total):
        if total > 100 and done > 0:
            begun.set()

    interrupted(lambda: pair.bake(path, progress=progress, **options), begun)
    # Pieces that were begun then may still end in the background.
    left = [f for f in (path / "coefficients").rglob("c.*") if f.is_file()]
    with pytest.raises(pegfit.TableError):
        pegfit.Table.open(path)
    table = pair.bake(path, resume=True, **options)
    assert table.rotations > len(left) > 0


def test_threads_get_the_same_at_once(table, evaluator):
    poses = random_poses(4000, reach=0.009, angle=0.1, seed=2)
    expected = table.query(poses).energy
    direct = evaluator.query(poses[:20]).energy
    wrong = []

    def ask():
        for _ in range(10):
            if not np.array_equal(table.query(poses).energy, expected):
                wrong.append("table")
            if not np.array_equal(evaluator.query(poses[:20]).energy, direct):
                wrong.append("evaluator")

    threads = [threading.Thread(target=ask) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []


def test_others_run_while_it_computes(table):
    """The interpreter is free: this thread counts while another one waits for a query."""
    poses = random_poses(100_000, reach=0.009, angle=0.1, seed=3)
    done = threading.Event()

    def ask():
        table.query(poses, threads=1)
        done.set()

    thread = threading.Thread(target=ask)
    count = 0
    thread.start()
    while not done.is_set():
        count += 1
        time.sleep(1e-3)
    thread.join()
    # A query that held the interpreter would let this thread count to 1.
    assert count > 10


def child(path, poses, queue):
    queue.put(pegfit.Table.open(path).query(poses).energy)


def forked(table, poses, queue):
    queue.put(table.query(poses).energy)


@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_processes_get_the_same_at_once(method, table):
    if method not in multiprocessing.get_all_start_methods():
        pytest.skip(f"no {method} here")
    context = multiprocessing.get_context(method)
    poses = random_poses(4000, reach=0.009, angle=0.1, seed=4)
    # This process has threads at work by now, which a forked one does not inherit.
    expected = table.query(poses).energy
    queue = context.Queue()
    target, what = (forked, table) if method == "fork" else (child, table.path)
    processes = [context.Process(target=target, args=(what, poses, queue)) for _ in range(2)]
    for process in processes:
        process.start()
    for _ in processes:
        np.testing.assert_array_equal(queue.get(timeout=120), expected)
    for process in processes:
        process.join(60)
        assert process.exitcode == 0


def test_bakes_of_one_table_wait_for_each_other(pair, tmp_path):
    """What an interrupted bake has begun may still end; the next one does not run into it."""
    path, options = tmp_path / "t.zarr", dict(half_extent=0.01, angle_deg=10, step_deg=5)
    failed = []

    def bake():
        try:
            pair.bake(path, resume=True, **options)
        except pegfit.PegfitError as error:
            failed.append(error)

    threads = [threading.Thread(target=bake) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert failed == [] and pegfit.Table.open(path).rotations == 343


def test_the_command_came_along(command, tmp_path):
    code, out, _ = command("--version")
    assert code == 0 and out.split()[1] == pegfit.__version__
    assert command("--help")[0] == 0
    assert command("bake")[0] == 2
    code, out, said = command("check", tmp_path / "none.stl")
    assert code != 0 and "none.stl" in out + said
    assert command("table", tmp_path)[0] == 2


def test_the_wheel_is_typed_and_says_its_version():
    assert metadata.version("pegfit") == pegfit.__version__
    assert resources.files("pegfit").joinpath("py.typed").is_file()
    assert resources.files("pegfit").joinpath("_core.pyi").is_file()


def test_everything_says_what_it_is(table, evaluator, pair):
    response = table.query([[0, 0, 0, 0, 0, 0, 1]])
    scores = pair.correlate(window=0.002)
    things = [table, evaluator, pair, response, scores, pegfit.ForcePath(table)]
    for thing in things:
        assert type(thing).__name__ in repr(thing) and " at 0x" not in repr(thing)
