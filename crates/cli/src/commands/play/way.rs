//! A way in from a file, for the hand to follow.

use std::fs::File;
use std::path::Path;

use fft_correlate::Pose;
use pegfit_scene::poses::PoseReader;

use crate::error::CommandError;

/// Most poses of a way: many more than `pegfit path` writes.
const MOST: usize = 100_000;

/// The poses of a way, as `pegfit path` writes them.
pub(super) fn read(path: &Path) -> Result<Vec<Pose>, CommandError> {
    let file = File::open(path).map_err(|e| CommandError::read(path, e))?;
    let name = path.display().to_string();
    let reader = PoseReader::new(&name, file)?;
    let poses = reader.take(MOST + 1).collect::<Result<Vec<Pose>, _>>()?;
    match poses.len() {
        2..=MOST => Ok(poses),
        found => Err(CommandError::Input {
            file: name,
            item: "rows".into(),
            expected: format!("2 to {MOST} poses"),
            found: match found > MOST {
                true => "more".into(),
                false => found.to_string(),
            },
        }),
    }
}
