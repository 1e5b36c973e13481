//! The share of a batch that this process has, as the scheduler or MPI launcher states it.

use sdf_grid::text::quoted;

/// A process's place among those that work on one batch.
///
/// ```no_run
/// use fft_correlate::{Launcher, Share};
///
/// // The share of a task of Slurm or MPI, or all of it.
/// let share = match Launcher::from_env(None)? {
///     Some(Launcher { rank, size, .. }) => Share { rank, size, resume: true },
///     None => Share::ALL,
/// };
/// assert!(share.rank < share.size);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Launcher {
    /// This process, 0 .. size.
    pub rank: usize,
    /// Number of processes.
    pub size: usize,
    /// Name of the launcher.
    pub source: String,
}

/// A launcher's variables contradict each other or are not numbers.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("environment: {name} must be {expected}, found {}", quoted(found))]
pub struct LauncherError {
    /// The variable.
    pub name: &'static str,
    /// What is accepted.
    pub expected: &'static str,
    /// What was found.
    pub found: String,
}

/// A launcher's name and the variables that hold rank and number of processes.
type Kind = [&'static str; 3];

/// Array jobs, whose tasks know of each other by a number alone.
const ARRAYS: [Kind; 4] = [
    [
        "Slurm array",
        "SLURM_ARRAY_TASK_ID",
        "SLURM_ARRAY_TASK_COUNT",
    ],
    [
        "AWS Batch array",
        "AWS_BATCH_JOB_ARRAY_INDEX",
        "AWS_BATCH_JOB_ARRAY_SIZE",
    ],
    [
        "Kubernetes indexed job",
        "JOB_COMPLETION_INDEX",
        "JOB_COMPLETIONS",
    ],
    ["Google Batch", "BATCH_TASK_INDEX", "BATCH_TASK_COUNT"],
];
const OPEN_MPI: Kind = ["Open MPI", "OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"];
const PMI: Kind = ["PMI", "PMI_RANK", "PMI_SIZE"];
/// The step that srun started.
const SLURM: Kind = ["Slurm", "SLURM_PROCID", "SLURM_STEP_NUM_TASKS"];
/// The tasks of the job, whether or not srun started them.
const SLURM_JOB: Kind = ["Slurm", "SLURM_PROCID", "SLURM_NTASKS"];

/// Number of the step in which salloc starts its shell.
const INTERACTIVE_STEP: &str = "4294967290";

impl Launcher {
    /// Reads the environment of this process. `size` is the number of processes where a launcher
    /// gives only the rank (Kubernetes, AWS). `None` without a launcher.
    ///
    /// A task of an array may itself consist of several processes, each of which then has a share of
    /// the task's. A shell or a script that runs once, though Slurm has given it several tasks, has
    /// rank 0 of 1: srun would start the others.
    ///
    /// # Errors
    /// If a launcher's variable is not a number, the size is not known, or the rank is not below
    /// the size.
    pub fn from_env(size: Option<usize>) -> Result<Option<Self>, LauncherError> {
        let variable = |name: &str| std::env::var(name).ok();
        Environment { variable, size }.launcher()
    }

    fn new(source: &str, rank: usize, size: usize) -> Self {
        let source = source.to_owned();
        Self { rank, size, source }
    }
}

/// Where variables come from, and the number of processes where they do not hold it.
struct Environment<F> {
    variable: F,
    size: Option<usize>,
}

impl<F: Fn(&str) -> Option<String>> Environment<F> {
    fn launcher(&self) -> Result<Option<Launcher>, LauncherError> {
        let mut array = None;
        for kind in ARRAYS {
            array = match array {
                None => self.read(kind)?,
                found => found,
            };
        }
        let processes = self.processes()?;
        Ok(match (array, processes) {
            (Some(array), Some(inner)) if inner.size > 1 => Some(Launcher {
                rank: array.rank * inner.size + inner.rank,
                size: array.size.saturating_mul(inner.size),
                source: format!("{}, {}", array.source, inner.source),
            }),
            (array, processes) => array.or(processes),
        })
    }

    /// The launcher that started this process beside others; the innermost where one started another.
    fn processes(&self) -> Result<Option<Launcher>, LauncherError> {
        if let Some(found) = self.read(OPEN_MPI)? {
            return Ok(Some(found));
        }
        let Some(rank) = self.number(SLURM[1])? else {
            return self.read(PMI);
        };
        // Only the first of the tasks has the terminal; the others of a shell end at once.
        let interactive = (self.variable)("SLURM_STEP_ID")
            .is_some_and(|id| id.trim() == INTERACTIVE_STEP)
            || (self.variable)("SLURM_PTY_PORT").is_some_and(|port| !port.is_empty());
        if interactive {
            return Ok(Some(Launcher::new("Slurm, an interactive shell", 0, 1)));
        }
        if self.number(SLURM[2])?.is_some() {
            return self.read(SLURM);
        }
        // mpirun of MPICH in a batch script, which has Slurm's variables, too.
        match (self.read(PMI)?, rank) {
            (Some(found), _) => Ok(Some(found)),
            (None, 0) => Ok(Some(Launcher::new("Slurm, without srun", 0, 1))),
            (None, _) => self.read(SLURM_JOB),
        }
    }

    /// The place that a launcher gives, if it is there.
    fn read(&self, kind: Kind) -> Result<Option<Launcher>, LauncherError> {
        let [name, rank, count] = kind;
        let Some(number) = self.number(rank)? else {
            return Ok(None);
        };
        let Some(size) = self.number(count)?.or(self.size) else {
            return Err(LauncherError {
                name: count,
                expected: "the number of processes, or give --size",
                found: String::new(),
            });
        };
        // Only Slurm's arrays begin elsewhere than at 0 or take other steps than 1.
        let (mut first, mut step) = (0, 1);
        if kind == ARRAYS[0] {
            first = self.number("SLURM_ARRAY_TASK_MIN")?.unwrap_or(0);
            step = self.number("SLURM_ARRAY_TASK_STEP")?.unwrap_or(1).max(1);
        }
        match number.checked_sub(first) {
            Some(from) if from % step == 0 && from / step < size => {
                Ok(Some(Launcher::new(name, from / step, size)))
            }
            _ => Err(LauncherError {
                name: rank,
                expected: "below the number of processes",
                found: format!("{number} of {size}"),
            }),
        }
    }

    fn number(&self, name: &'static str) -> Result<Option<usize>, LauncherError> {
        let parse = |found: String| {
            found.trim().parse().map_err(|_| LauncherError {
                name,
                expected: "a whole number",
                found,
            })
        };
        (self.variable)(name).map(parse).transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reads `NAME=value` pairs.
    fn read(text: &str, size: Option<usize>) -> Result<Option<Launcher>, LauncherError> {
        let variable = |name: &str| {
            let mut pairs = text.split_whitespace().filter_map(|p| p.split_once('='));
            pairs.find(|(n, _)| *n == name).map(|(_, v)| v.to_owned())
        };
        Environment { variable, size }.launcher()
    }

    fn expect(text: &str, rank: usize, size: usize, source: &str) {
        let expected = Launcher::new(source, rank, size);
        assert_eq!(read(text, None), Ok(Some(expected)), "{text}");
    }

    #[test]
    fn launchers_are_recognized_arrays_first() {
        assert_eq!(read("", None), Ok(None));
        let array = "SLURM_PROCID=0 SLURM_NTASKS=1 SLURM_ARRAY_TASK_ID=7 SLURM_ARRAY_TASK_COUNT=4";
        expect(
            &format!("{array} SLURM_ARRAY_TASK_MIN=5"),
            2,
            4,
            "Slurm array",
        );
        let stepped = format!("{array} SLURM_ARRAY_TASK_MIN=1 SLURM_ARRAY_TASK_STEP=3");
        expect(&stepped, 2, 4, "Slurm array");
        let mpi = "OMPI_COMM_WORLD_RANK=1 OMPI_COMM_WORLD_SIZE=2";
        expect(mpi, 1, 2, "Open MPI");
        let found = read("JOB_COMPLETION_INDEX=3", Some(4)).unwrap().unwrap();
        assert_eq!((found.rank, found.size), (3, 4));
    }

    /// The variables of salloc's shell, of `srun --pty`, and of a script of sbatch.
    #[test]
    fn a_shell_or_a_script_of_several_tasks_that_runs_once_is_alone() {
        let tasks = "SLURM_PROCID=0 SLURM_NTASKS=4";
        let shell = format!("{tasks} SLURM_STEP_ID=4294967290 SLURM_STEP_NUM_TASKS=4");
        expect(&shell, 0, 1, "Slurm, an interactive shell");
        let pty = format!(
            "{tasks} SLURM_STEP_ID=0 SLURM_STEP_NUM_TASKS=4 SLURM_PTY_PORT=40001 PMI_RANK=0 PMI_SIZE=4"
        );
        expect(&pty, 0, 1, "Slurm, an interactive shell");
        expect(tasks, 0, 1, "Slurm, without srun");
    }

    #[test]
    fn tasks_of_srun_share_whether_or_not_the_step_says_how_many() {
        let step = "SLURM_PROCID=0 SLURM_NTASKS=8 SLURM_STEP_NUM_TASKS=4";
        expect(step, 0, 4, "Slurm");
        expect("SLURM_PROCID=3 SLURM_NTASKS=4", 3, 4, "Slurm");
    }

    #[test]
    fn the_innermost_launcher_counts_and_shares_what_its_array_has() {
        // mpirun in a script of sbatch, whose variables every process has.
        let mpirun = "SLURM_PROCID=0 SLURM_NTASKS=2 OMPI_COMM_WORLD_RANK=1 OMPI_COMM_WORLD_SIZE=2";
        expect(mpirun, 1, 2, "Open MPI");
        let both = format!("{mpirun} SLURM_ARRAY_TASK_ID=2 SLURM_ARRAY_TASK_COUNT=3");
        expect(&both, 5, 6, "Slurm array, Open MPI");
        // All places are different, and there are as many as processes.
        for rank in 0..4 {
            let (task, process) = (rank / 2, rank % 2);
            let step = format!(
                "SLURM_ARRAY_TASK_ID={task} SLURM_ARRAY_TASK_COUNT=2 SLURM_PROCID={process} \
                 SLURM_STEP_NUM_TASKS=2"
            );
            expect(&step, rank, 4, "Slurm array, Slurm");
        }
    }

    #[test]
    fn contradictions_are_refused_by_name() {
        for (text, size, name) in [
            ("JOB_COMPLETION_INDEX=3", None, "JOB_COMPLETIONS"),
            ("PMI_RANK=x", Some(1), "PMI_RANK"),
            ("PMI_RANK=2 PMI_SIZE=2", None, "PMI_RANK"),
        ] {
            assert_eq!(read(text, size).unwrap_err().name, name);
        }
    }
}
