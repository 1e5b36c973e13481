//! A table or a direct evaluator, asked in the scene.

use std::sync::Arc;

use fft_correlate::{DirectEvaluator, EnergySource, EnergyTable, InScene, Pose, Response, Scratch};

/// A table or a direct evaluator, asked in the scene.
#[derive(Clone)]
pub(crate) enum AnySource {
    Direct(Arc<InScene<DirectEvaluator>>),
    Table(Arc<InScene<EnergyTable>>),
}

/// Working memory for many poses.
pub(crate) struct Batch {
    scratch: Scratch,
    shapes: Vec<Pose>,
    responses: Vec<Response>,
}

impl AnySource {
    pub(crate) fn as_source(&self) -> &dyn EnergySource {
        match self {
            Self::Direct(source) => source.as_ref(),
            Self::Table(source) => source.as_ref(),
        }
    }

    /// Poses that one thread answers at a time.
    pub(crate) fn piece(&self) -> usize {
        match self {
            Self::Direct(_) => 1,
            Self::Table(_) => 512,
        }
    }

    pub(crate) fn batch(&self) -> Batch {
        Batch {
            scratch: self.as_source().scratch(),
            shapes: Vec::new(),
            responses: Vec::new(),
        }
    }

    /// Answers at poses in the scene, one after the other.
    pub(crate) fn respond<'b>(&self, poses: &[Pose], batch: &'b mut Batch) -> &'b [Response] {
        batch.responses.clear();
        match self {
            Self::Direct(source) => {
                let scratch = &mut batch.scratch;
                let answers = poses.iter().map(|pose| source.evaluate(pose, scratch));
                batch.responses.extend(answers);
            }
            Self::Table(table) => {
                // Random poses of a large table take less time together: the next one's energies
                // are fetched meanwhile.
                let placement = table.placement();
                batch.shapes.clear();
                batch
                    .shapes
                    .extend(poses.iter().map(|p| placement.to_shapes(p)));
                batch.responses.resize(poses.len(), Response::default());
                table
                    .source()
                    .respond_each(&batch.shapes, &mut batch.responses);
                for (response, pose) in batch.responses.iter_mut().zip(poses) {
                    response.wrench = placement.wrench_to_scene(pose, &response.wrench);
                }
            }
        }
        &batch.responses
    }
}
