//! Events and privileges in words.

use haptic::LoopReport;
use haptic::scene::SceneChange;

use crate::bytes::display_bytes;

/// A scene event in words.
pub(crate) fn told(what: &SceneChange) -> String {
    match what {
        SceneChange::Loaded { seconds, bytes } => {
            format!("loaded in {seconds:.2} s, {}", display_bytes(*bytes))
        }
        SceneChange::Reloaded { seconds, bytes } => {
            format!(
                "changed and loaded again in {seconds:.2} s, {}",
                display_bytes(*bytes)
            )
        }
        SceneChange::Opened { rotations, each } => format!(
            "table opened, {rotations} rotations of {} each",
            display_bytes(*each)
        ),
        SceneChange::Complete { bytes } => {
            format!(
                "all rotations of the table loaded, {}",
                display_bytes(*bytes)
            )
        }
        SceneChange::Unloaded => "unloaded to make room".to_owned(),
        SceneChange::Failed(why) => format!("cannot be loaded: {why}"),
        SceneChange::NoRoom { needed, free } => format!(
            "needs {} but only {} of the scene's memory can be made free",
            display_bytes(*needed),
            display_bytes(*free)
        ),
    }
}

/// What the operating system granted, in words.
pub(crate) fn privileges(report: &LoopReport) -> Vec<(&'static str, String)> {
    let yes = |granted: bool| if granted { "granted" } else { "not granted" };
    let mut rows = vec![
        ("SCHED_FIFO", yes(report.granted.fifo).to_owned()),
        ("locked memory", yes(report.granted.locked).to_owned()),
    ];
    rows.extend(report.granted.notes.iter().map(|n| ("note", n.clone())));
    rows
}
