//! Telling poses apart that a search left too close to call.

use std::time::Instant;

use sdf_grid::Monitor;

use crate::dock::descend::{Effort, Refinement, Sources, sort};
use crate::dock::domain::SearchDomain;
use crate::dock::error::SearchError;
use crate::dock::options::SearchOptions;
use crate::dock::report::{FoundPose, SearchReport, SearchStage};
use crate::dock::weights::with_docking_weights;
use crate::pair::fields::Pair;

/// Ranks the poses of a search anew where it left them too close to call ([`SearchReport::close`]):
/// those go downhill on the lattice of `finer`, and all take their energy, and width from
/// it. `finer` is the same parts with the search's pivot, usually on half the spacing
/// ([`crate::SearchLattices::deciding_plan`]); `domain` and `options` are the search's. When the
/// monitor cancels, the report stays as it is.
///
/// # Errors
/// If the weights are out of range or a part has no interior on the lattice.
pub fn decide(
    report: &mut SearchReport,
    finer: &Pair,
    domain: &SearchDomain,
    options: &SearchOptions,
    monitor: &dyn Monitor,
) -> Result<(), SearchError> {
    let began = Instant::now();
    let finer = with_docking_weights(finer, options.ratio)?;
    let refinement = Refinement::new(&finer, domain, options, monitor)?;
    let sources = Sources::new(&finer)?;
    let (few, full) = (sources.few(), sources.full());
    let (close, rest) = report.poses.split_at(report.close());
    monitor.begin("decision", close.len() as u64);
    let mut poses = refinement.descend(
        close.to_vec(),
        &finer,
        &[few, full],
        Effort::FINE,
        close.len(),
    );
    poses.extend(rest.iter().map(|p| FoundPose {
        energy: full.evaluate_full(&p.pose).response.energy,
        ..*p
    }));
    sort(&mut poses);
    let poses = refinement.finish(poses, full);
    if !monitor.cancelled() {
        report.stages.push(SearchStage {
            name: "decision",
            items: close.len(),
            seconds: began.elapsed().as_secs_f64(),
        });
        report.poses = poses;
    }
    Ok(())
}
