//! What a log's device was, in a small file beside the log: its limits are part of the forces.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use sdf_grid::atomic;

use crate::device::contract::DeviceSpec;
use crate::log::error::RecordError;

/// The file beside `log`: `run.device.json` beside `run.csv`, and `run.csv.part.device.json` beside
/// `run.csv.part`, which a run left that did not end.
pub fn device_file(log: &Path) -> PathBuf {
    match log.extension() {
        Some(end) if end == "part" => log.with_added_extension("device.json"),
        _ => log.with_extension("device.json"),
    }
}

/// Writes what the device of `log` is beside it.
///
/// # Errors
/// If the file cannot be written.
pub fn write_device(log: &Path, spec: &DeviceSpec) -> Result<(), RecordError> {
    let path = device_file(log);
    let failed = |source| RecordError::Io {
        path: path.clone(),
        source,
    };
    let text = serde_json::to_string_pretty(spec).map_err(|e| failed(e.into()))?;
    atomic::write(&path, format!("{text}\n").as_bytes()).map_err(|e| failed(e.into()))
}

/// What the device of `log` was; `None` if nobody wrote it down.
///
/// # Errors
/// If the file is there but cannot be read, or is not a device's record.
pub fn read_device(log: &Path) -> Result<Option<DeviceSpec>, RecordError> {
    let path = device_file(log);
    let text = match std::fs::read_to_string(&path) {
        Ok(text) => text,
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(None),
        Err(source) => return Err(RecordError::Io { path, source }),
    };
    match serde_json::from_str(&text) {
        Ok(spec) => Ok(Some(spec)),
        Err(e) => Err(RecordError::Format {
            path,
            line: e.line() as u64,
            expected: "what a device can do, as JSON".into(),
            found: e.to_string(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::simulated::OperatorConfig;

    #[test]
    fn a_device_is_read_back_to_the_last_bit_and_nonsense_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let log = folder.path().join("run.csv");
        assert_eq!(read_device(&log).unwrap(), None);
        let spec = DeviceSpec {
            // As drivers give it: a number of single precision.
            max_force: f64::from(3.3f32),
            max_torque: f64::INFINITY,
            nominal_rate: 1000.0 / 3.0,
            ..OperatorConfig::default().spec()
        };
        write_device(&log, &spec).unwrap();
        assert_eq!(read_device(&log).unwrap(), Some(spec));
        let file = folder.path().join("run.device.json");
        let text = std::fs::read_to_string(&file).unwrap();
        std::fs::write(&file, text.replace("max_force", "force")).unwrap();
        let said = read_device(&log).unwrap_err().to_string();
        assert!(
            said.contains("run.device.json line") && said.contains("force"),
            "{said}"
        );
    }
}
