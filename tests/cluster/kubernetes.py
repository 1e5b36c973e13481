"""Checks the Indexed Job's manifest, then runs its containers' command here, once for each index.

usage: kubernetes.py MANIFEST PEGFIT FOLDER      (FOLDER stands for the volume)
"""

import os
import subprocess
import sys

import yaml


def main(manifest, program, folder):
    with open(manifest) as file:
        job = yaml.safe_load(file)
    assert (job["apiVersion"], job["kind"]) == ("batch/v1", "Job")
    spec = job["spec"]
    assert spec["completionMode"] == "Indexed"
    completions = spec["completions"]
    assert 1 <= spec["parallelism"] <= completions
    pod = spec["template"]["spec"]
    # Jobs accept no other policies.
    assert pod["restartPolicy"] in ("Never", "OnFailure")
    (container,) = pod["containers"]
    assert container["command"] == ["pegfit"]
    mounts = {m["name"]: m["mountPath"] for m in container["volumeMounts"]}
    assert set(mounts) == {v["name"] for v in pod["volumes"]}
    args = [a.replace(mounts["work"], folder) for a in container["args"]]
    assert args[args.index("--size") + 1] == str(completions)
    pods = [
        subprocess.Popen(
            [program, *args, "--threads", "1"],
            env={**os.environ, "JOB_COMPLETION_INDEX": str(index)},
            stdout=subprocess.DEVNULL,
        )
        for index in range(completions)
    ]
    failed = [index for index, pod in enumerate(pods) if pod.wait() != 0]
    assert not failed, failed


if __name__ == "__main__":
    main(*sys.argv[1:])
