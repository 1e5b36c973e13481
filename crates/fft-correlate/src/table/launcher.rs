//! Which share of a batch this process has, as the launcher that started it says.

/// A process's place among those that work on one batch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Launcher {
    /// This process, 0 .. size.
    pub rank: usize,
    /// Number of processes.
    pub size: usize,
    /// What said so.
    pub source: &'static str,
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

/// Name, rank variable, size variables of which the first present counts, variable of the first
/// rank's number. Arrays come first: a task of an array may itself run under a launcher.
const LAUNCHERS: [(&str, &str, &[&str], Option<&str>); 7] = [
    (
        "Slurm array",
        "SLURM_ARRAY_TASK_ID",
        &["SLURM_ARRAY_TASK_COUNT"],
        Some("SLURM_ARRAY_TASK_MIN"),
    ),
    ("Slurm", "SLURM_PROCID", &["SLURM_NTASKS"], None),
    (
        "Open MPI",
        "OMPI_COMM_WORLD_RANK",
        &["OMPI_COMM_WORLD_SIZE"],
        None,
    ),
    ("PMI", "PMI_RANK", &["PMI_SIZE"], None),
    (
        "AWS Batch array",
        "AWS_BATCH_JOB_ARRAY_INDEX",
        &["AWS_BATCH_JOB_ARRAY_SIZE"],
        None,
    ),
    (
        "Kubernetes indexed job",
        "JOB_COMPLETION_INDEX",
        &["JOB_COMPLETIONS"],
        None,
    ),
    (
        "Google Batch",
        "BATCH_TASK_INDEX",
        &["BATCH_TASK_COUNT"],
        None,
    ),
];

impl Launcher {
    /// Reads the environment of this process. `size` stands in where a launcher tells the rank but
    /// not the number of processes (Kubernetes, AWS). `None` if no launcher is found.
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
        for (source, rank_name, size_names, first_name) in LAUNCHERS {
            let Some(rank) = number(&variable, rank_name)? else {
                continue;
            };
            let mut found = None;
            for name in size_names {
                found = found.or(number(&variable, name)?);
            }
            let first = match first_name {
                Some(name) => number(&variable, name)?.unwrap_or(0),
                None => 0,
            };
            let Some(size) = found.or(size) else {
                return Err(LauncherError {
                    name: size_names[0],
                    expected: "the number of processes, or give --size",
                    found: String::new(),
                });
            };
            // Only Slurm's arrays may count in steps.
            let step = match first_name {
                Some(_) => number(&variable, "SLURM_ARRAY_TASK_STEP")?
                    .unwrap_or(1)
                    .max(1),
                None => 1,
            };
            if rank < first || (rank - first) % step != 0 || (rank - first) / step >= size {
                return Err(LauncherError {
                    name: rank_name,
                    expected: "below the number of processes",
                    found: format!("{rank} of {size}"),
                });
            }
            return Ok(Some(Self {
                rank: (rank - first) / step,
                size,
                source,
            }));
        }
        Ok(None)
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
            (found.rank, found.size, found.source),
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
