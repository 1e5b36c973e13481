#!/usr/bin/env bash
# One bake by real launchers on one machine: a Slurm job array, mpirun, and the command of a
# Kubernetes Indexed Job. All tables must equal, byte for byte, the one that a single process makes.
# Needs root and Debian's packages (installed by apt when absent).
# usage: tests/cluster/run.sh [PEGFIT]      (default: target/release/pegfit)
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
pegfit=$(realpath "${1:-$root/target/release/pegfit}")

if ! command -v slurmctld slurmd sbatch munged mpirun > /dev/null; then
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq slurm-wlm munge openmpi-bin
fi
python3 -c 'import yaml' 2> /dev/null || pip install --quiet PyYAML==6.0.3

work=$(mktemp -d)
started=()
finish() {
    for pid in "${started[@]}"; do kill "$pid" 2> /dev/null || true; done
    wait 2> /dev/null || true
    rm -rf "$work"
}
trap finish EXIT
cp "$root"/fixtures/rectangular_*.obj "$here/scene.toml" "$work"
cd "$work"
# Threads of one process and of many share the same processors here.
export RAYON_NUM_THREADS=1

echo "== one process"
"$pegfit" bake scene.toml -o single.zarr --quiet

same() {
    diff -r single.zarr "$1"
    echo "$1 equals single.zarr ($(find "$1/coefficients" -name 'c.*' | wc -l) chunks)"
}

echo "== Slurm $(slurmctld -V)"
install -d -m 700 munge
head -c 128 /dev/urandom > munge/key
chmod 400 munge/key
munged --foreground --force --key-file "$work/munge/key" --socket "$work/munge/socket" \
    --log-file "$work/munge/log" --pid-file "$work/munge/pid" --seed-file "$work/munge/seed" &
started+=($!)
mkdir state spool
host=$(hostname -s)
cat > slurm.conf << CONF
ClusterName=one
SlurmctldHost=$host
SlurmUser=root
SlurmdUser=root
SlurmctldPort=16817
SlurmdPort=16818
AuthType=auth/munge
AuthInfo=socket=$work/munge/socket
CredType=cred/munge
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd.pid
SlurmctldLogFile=$work/slurmctld.log
SlurmdLogFile=$work/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
ReturnToService=2
NodeName=$host NodeAddr=127.0.0.1 CPUs=$(nproc)
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF
export SLURM_CONF=$work/slurm.conf
slurmctld -D & started+=($!)
slurmd -D & started+=($!)
for _ in $(seq 60); do
    sinfo -h -o %T 2> /dev/null | grep -q idle && break
    sleep 0.5
done
sinfo
# Numbers of an array need not start at 0.
sbatch --quiet --wait --array=3-7 --chdir="$work" --output="$work/array-%a.log" \
    --wrap "$pegfit bake scene.toml -o slurm.zarr --quiet" \
    || { cat array-*.log slurm*.log; exit 1; }
same slurm.zarr

echo "== $(mpirun --version | head -1)"
mpirun -n 2 --allow-run-as-root --oversubscribe \
    "$pegfit" bake scene.toml -o mpi.zarr --quiet > /dev/null
same mpi.zarr

echo "== Kubernetes Indexed Job (its command, run here)"
python3 "$here/kubernetes.py" "$here/kubernetes-job.yaml" "$pegfit" "$work"
same table.zarr
