"""What is measured of one tool on one pair."""

from __future__ import annotations

import os
import resource
import time

import numpy as np

from contact_cases import LENGTH, row

#: Steps along the insertion path, around the loop and up from the seat.
STEPS = 200


def ask(tool, at: np.ndarray):
    return tool.read(tool.query(tool.pose(at)))


def rises(tool) -> float:
    heights = np.linspace(LENGTH * 1.1, 0, STEPS)
    values = np.array([ask(tool, row([0, 0, z]))[1] for z in heights])
    size = np.ptp(values)
    return float(np.maximum(np.diff(values), 0).sum() / size) if size > 0 else 0.0


def loop(tool) -> float:
    angle = np.linspace(0, 2 * np.pi, STEPS + 1)
    at = np.stack([5e-4 * np.cos(angle), 5e-4 * np.sin(angle), np.full_like(angle, 0.015)], axis=1)
    forces = np.array([ask(tool, row(p))[2] for p in at])
    work = (0.5 * (forces[1:] + forces[:-1]) * np.diff(at, axis=0)).sum(axis=1)
    total = np.abs(work).sum()
    return float(abs(work.sum()) / total) if total > 0 else 0.0


def turned(pose: np.ndarray, axis: int, angle: float) -> np.ndarray:
    step = np.append(np.sin(0.5 * angle) * np.eye(3)[axis], np.cos(0.5 * angle))
    v, w, u, s = step[:3], step[3], pose[3:6], pose[6]
    return np.append(pose[:3], np.append(w * u + s * v + np.cross(v, u), w * s - v @ u))


def torque_error(tool, poses: np.ndarray) -> float:
    h, worst, largest = 1e-4, 0.0, 0.0
    for pose in poses:
        ask(tool, pose)
        torque = tool.torque
        for k in range(3):
            up, down = (ask(tool, turned(pose, k, sign * h))[1] for sign in (1, -1))
            worst = max(worst, abs((down - up) / (2 * h) - torque[k]))
        largest = max(largest, float(np.linalg.norm(torque)))
    return worst / largest


def pull(tool) -> float:
    heights = np.linspace(0.0, 1.15 * LENGTH, STEPS)
    along = np.array([-ask(tool, row([0, 0, z]))[2][2] for z in heights])
    felt = heights[along > 0.01 * along.max()] if along.max() > 0 else heights[:0]
    return float(felt.max() / LENGTH) if len(felt) else 0.0


def resident() -> float:
    """MiB of this process."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize() / 2**20


def wrong(touches: np.ndarray, share: np.ndarray) -> tuple[float, float]:
    """Shares of poses without overlap that are called contact, and of overlaps that are not."""
    free, deep = share <= 0, share > 1e-6
    false = touches[free].mean() if free.any() else np.nan
    missed = (~touches[deep]).mean() if deep.any() else np.nan
    return float(false), float(missed)


def measure(tool, parts, poses: np.ndarray, share: np.ndarray, folder: str, seconds: float) -> dict:
    """All columns of a row; of the poses as many as `seconds` of the processor allow."""
    before, began = resident(), time.process_time()
    tool.set_up(*parts, folder)
    ask(tool, poses[0])
    found = {"set-up": time.process_time() - began, "MiB": resident() - before}
    times, touches, began = [], [], time.process_time()
    for pose in poses:
        given = tool.pose(pose)
        start = time.thread_time_ns()
        answer = tool.query(given)
        times.append(time.thread_time_ns() - start)
        touches.append(tool.read(answer)[0])
        if time.process_time() - began > seconds:
            break
    found["poses"] = len(times)
    found["p50"], found["p99"] = (1e-3 * np.quantile(times, q) for q in (0.5, 0.99))
    if touches[0] is None:
        found["torque"], found["pull"] = torque_error(tool, poses[:50]), pull(tool)
    else:
        found["false"], found["missed"] = wrong(np.array(touches), share[: len(touches)])
        found["pull"] = 0.0
    return {**found, "rises": rises(tool), "loop": loop(tool)}
