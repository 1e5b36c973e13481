//! Which share of a batch this process has, as the launcher that started it says.

/// A process's place among those that work on one batch.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Launcher {
    /// This process, 0 .. size.
    pub rank: usize,
    /// Number of processes.
    pub size: usize,
    /// What said so.
    pub source: String,
}

/// A launcher's variables contradict each other or are not numbers.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("environment: {name} must be {expected}, found {found:?}")]
pub struct LauncherError {
    /// The variable.
    pub name: &'static str,
    /// What is accepted.
    pub expected: &'static str,
    /// What was found.
    pub found: String,
}

/// Variables in which a launcher says which of how many processes this is.
struct Kind {
    name: &'static str,
    rank: &'static str,
    size: &'static str,
    /// Number of the first process, and the step to the next: only Slurm's arrays have others than 0
    /// and 1.
    first: Option<[&'static str; 2]>,
}

const fn kind(name: &'static str, rank: &'static str, size: &'static str) -> Kind {
    Kind {
        name,
        rank,
        size,
        first: None,
    }
}

/// Jobs of many tasks that know of each other by a number alone.
const ARRAYS: [Kind; 4] = [
    Kind {
        first: Some(["SLURM_ARRAY_TASK_MIN", "SLURM_ARRAY_TASK_STEP"]),
        ..kind(
            "Slurm array",
            "SLURM_ARRAY_TASK_ID",
            "SLURM_ARRAY_TASK_COUNT",
        )
    },
    kind(
        "AWS Batch array",
        "AWS_BATCH_JOB_ARRAY_INDEX",
        "AWS_BATCH_JOB_ARRAY_SIZE",
    ),
    kind(
        "Kubernetes indexed job",
        "JOB_COMPLETION_INDEX",
        "JOB_COMPLETIONS",
    ),
    kind("Google Batch", "BATCH_TASK_INDEX", "BATCH_TASK_COUNT"),
];

const OPEN_MPI: Kind = kind("Open MPI", "OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE");

const PMI: Kind = kind("PMI", "PMI_RANK", "PMI_SIZE");

/// Of the step that srun started. `SLURM_NTASKS` alone is how many tasks were asked for.
const SLURM: Kind = kind("Slurm", "SLURM_PROCID", "SLURM_STEP_NUM_TASKS");

/// Number of the step that salloc starts its shell in.
const INTERACTIVE_STEP: &str = "4294967290";

impl Launcher {
    /// Reads the environment of this process. `size` stands in where a launcher tells the rank but
    /// not the number of processes (Kubernetes, AWS). `None` if no launcher is found.
    ///
    /// A task of an array may itself consist of several processes, each of which then has a share of
    /// the task's. A shell or a script to which Slurm has given several tasks but which runs once has
    /// rank 0 of 1: it is srun that would start the others.
    ///
    /// # Errors
    /// If a launcher's variable is not a number, the size is not known, or the rank is not below
    /// the size.
    pub fn from_env(size: Option<usize>) -> Result<Option<Self>, LauncherError> {
        Self::from_variables(|name| std::env::var(name).ok(), size)
    }

    /// [`Launcher::from_env`] with any source of variables.
    ///
    /// # Errors
    /// As [`Launcher::from_env`].
    pub fn from_variables(
        variable: impl Fn(&str) -> Option<String>,
        size: Option<usize>,
    ) -> Result<Option<Self>, LauncherError> {
        let mut array = None;
        for kind in &ARRAYS {
            array = match array {
                None => kind.read(&variable, size)?,
                found => found,
            };
        }
        let processes = processes(&variable, size)?;
        Ok(match (array, processes) {
            (Some(array), Some(inner)) if inner.size > 1 => Some(array.split(&inner)),
            (Some(found), _) | (None, Some(found)) => Some(found),
            (None, None) => None,
        })
    }

    /// The place of a process that is `inner` among those of this one's task.
    fn split(&self, inner: &Self) -> Self {
        Self {
            rank: self.rank * inner.size + inner.rank,
            size: self.size.saturating_mul(inner.size),
            source: format!("{}, {}", self.source, inner.source),
        }
    }
}

/// The launcher that started this process beside others; the innermost where one started another.
fn processes(
    variable: &impl Fn(&str) -> Option<String>,
    size: Option<usize>,
) -> Result<Option<Launcher>, LauncherError> {
    if let Some(found) = OPEN_MPI.read(variable, size)? {
        return Ok(Some(found));
    }
    let Some(rank) = number(variable, SLURM.rank)? else {
        return PMI.read(variable, size);
    };
    let alone = |source: &str| {
        Ok(Some(Launcher {
            rank: 0,
            size: 1,
            source: source.to_owned(),
        }))
    };
    // Only the first of the tasks has the terminal; the others of a shell end at once.
    let interactive = variable("SLURM_STEP_ID").is_some_and(|id| id.trim() == INTERACTIVE_STEP)
        || variable("SLURM_PTY_PORT").is_some_and(|port| !port.is_empty());
    if interactive {
        return alone("Slurm, an interactive shell");
    }
    if number(variable, SLURM.size)?.is_some() {
        return SLURM.read(variable, size);
    }
    // mpirun of MPICH in a batch script, which has Slurm's variables, too.
    if let Some(found) = PMI.read(variable, size)? {
        return Ok(Some(found));
    }
    match rank {
        0 => alone("Slurm, without srun"),
        _ => Kind {
            size: "SLURM_NTASKS",
            ..SLURM
        }
        .read(variable, size),
    }
}

impl Kind {
    /// What this launcher says, if it is there.
    fn read(
        &self,
        variable: &impl Fn(&str) -> Option<String>,
        size: Option<usize>,
    ) -> Result<Option<Launcher>, LauncherError> {
        let Some(number_of_rank) = number(variable, self.rank)? else {
            return Ok(None);
        };
        let Some(size) = number(variable, self.size)?.or(size) else {
            return Err(LauncherError {
                name: self.size,
                expected: "the number of processes, or give --size",
                found: String::new(),
            });
        };
        let (first, step) = match self.first {
            Some([first, step]) => (
                number(variable, first)?.unwrap_or(0),
                number(variable, step)?.unwrap_or(1).max(1),
            ),
            None => (0, 1),
        };
        let rank = number_of_rank
            .checked_sub(first)
            .filter(|distance| distance % step == 0 && distance / step < size);
        match rank {
            Some(distance) => Ok(Some(Launcher {
                rank: distance / step,
                size,
                source: self.name.to_owned(),
            })),
            None => Err(LauncherError {
                name: self.rank,
                expected: "below the number of processes",
                found: format!("{number_of_rank} of {size}"),
            }),
        }
    }
}

fn number(
    variable: &impl Fn(&str) -> Option<String>,
    name: &'static str,
) -> Result<Option<usize>, LauncherError> {
    match variable(name) {
        None => Ok(None),
        Some(found) => found.trim().parse().map(Some).map_err(|_| LauncherError {
            name,
            expected: "a whole number",
            found,
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(
        variables: &[(&str, &str)],
        size: Option<usize>,
    ) -> Result<Option<Launcher>, LauncherError> {
        let get = |name: &str| {
            variables
                .iter()
                .find(|(n, _)| *n == name)
                .map(|(_, v)| v.to_string())
        };
        Launcher::from_variables(get, size)
    }

    #[test]
    fn launchers_are_recognized_arrays_first() {
        assert_eq!(read(&[], None), Ok(None));
        let array = [
            ("SLURM_PROCID", "0"),
            ("SLURM_NTASKS", "1"),
            ("SLURM_ARRAY_TASK_ID", "7"),
            ("SLURM_ARRAY_TASK_COUNT", "4"),
            ("SLURM_ARRAY_TASK_MIN", "5"),
        ];
        let found = read(&array, None).unwrap().unwrap();
        assert_eq!(
            (found.rank, found.size, found.source.as_str()),
            (2, 4, "Slurm array")
        );
        let stepped = [
            ("SLURM_ARRAY_TASK_ID", "7"),
            ("SLURM_ARRAY_TASK_COUNT", "4"),
            ("SLURM_ARRAY_TASK_MIN", "1"),
            ("SLURM_ARRAY_TASK_STEP", "3"),
        ];
        let found = read(&stepped, None).unwrap().unwrap();
        assert_eq!((found.rank, found.size), (2, 4));
        let mpi = [("OMPI_COMM_WORLD_RANK", "1"), ("OMPI_COMM_WORLD_SIZE", "2")];
        let found = read(&mpi, Some(9)).unwrap().unwrap();
        assert_eq!((found.rank, found.size), (1, 2));
        let found = read(&[("JOB_COMPLETION_INDEX", "3")], Some(4))
            .unwrap()
            .unwrap();
        assert_eq!((found.rank, found.size), (3, 4));
    }

    fn place(variables: &[(&str, &str)]) -> (usize, usize, String) {
        let found = read(variables, None).unwrap().unwrap();
        (found.rank, found.size, found.source)
    }

    #[test]
    fn a_shell_or_a_script_of_several_tasks_that_runs_once_is_alone() {
        // What salloc's shell, `srun --pty`, and a script of sbatch have.
        let salloc = [
            ("SLURM_PROCID", "0"),
            ("SLURM_NTASKS", "4"),
            ("SLURM_STEP_ID", "4294967290"),
            ("SLURM_STEP_NUM_TASKS", "4"),
        ];
        let pty = [
            ("SLURM_PROCID", "0"),
            ("SLURM_NTASKS", "4"),
            ("SLURM_STEP_ID", "0"),
            ("SLURM_STEP_NUM_TASKS", "4"),
            ("SLURM_PTY_PORT", "40001"),
            ("PMI_RANK", "0"),
            ("PMI_SIZE", "4"),
        ];
        let script = [("SLURM_PROCID", "0"), ("SLURM_NTASKS", "4")];
        for variables in [&salloc[..], &pty, &script] {
            let (rank, size, source) = place(variables);
            assert_eq!((rank, size), (0, 1), "{source}");
            assert!(source.starts_with("Slurm, "), "{source}");
        }
    }

    #[test]
    fn tasks_of_srun_share_whether_or_not_the_step_says_how_many() {
        let step = [
            ("SLURM_PROCID", "0"),
            ("SLURM_NTASKS", "8"),
            ("SLURM_STEP_NUM_TASKS", "4"),
        ];
        assert_eq!(place(&step), (0, 4, "Slurm".into()));
        let other = [("SLURM_PROCID", "3"), ("SLURM_NTASKS", "4")];
        assert_eq!(place(&other), (3, 4, "Slurm".into()));
    }

    #[test]
    fn the_innermost_launcher_counts_and_shares_what_its_array_has() {
        // mpirun in a script of sbatch, whose variables every process has.
        let mpirun = [
            ("SLURM_PROCID", "0"),
            ("SLURM_NTASKS", "2"),
            ("OMPI_COMM_WORLD_RANK", "1"),
            ("OMPI_COMM_WORLD_SIZE", "2"),
        ];
        assert_eq!(place(&mpirun), (1, 2, "Open MPI".into()));
        let array = [
            ("SLURM_ARRAY_TASK_ID", "2"),
            ("SLURM_ARRAY_TASK_COUNT", "3"),
        ];
        let both = [&mpirun[..], &array].concat();
        assert_eq!(place(&both), (5, 6, "Slurm array, Open MPI".into()));
        // All places are different, and there are as many as processes.
        let step = |task: &'static str, process: &'static str| {
            place(&[
                ("SLURM_ARRAY_TASK_ID", task),
                ("SLURM_ARRAY_TASK_COUNT", "2"),
                ("SLURM_PROCID", process),
                ("SLURM_STEP_NUM_TASKS", "2"),
            ])
        };
        let ranks = [
            step("0", "0"),
            step("0", "1"),
            step("1", "0"),
            step("1", "1"),
        ];
        assert!(ranks.iter().map(|r| (r.0, r.1)).eq((0..4).map(|r| (r, 4))));
    }

    #[test]
    fn contradictions_are_refused_by_name() {
        let name = |r: Result<_, LauncherError>| r.unwrap_err().name;
        assert_eq!(
            name(read(&[("JOB_COMPLETION_INDEX", "3")], None)),
            "JOB_COMPLETIONS"
        );
        assert_eq!(name(read(&[("PMI_RANK", "x")], Some(1))), "PMI_RANK");
        assert_eq!(
            name(read(&[("PMI_RANK", "2"), ("PMI_SIZE", "2")], None)),
            "PMI_RANK"
        );
    }
}
