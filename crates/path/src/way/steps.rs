//! Poses at equal steps along a way.

use fft_correlate::Pose;

use crate::motion::frame::Frame;

/// Poses along the screw motions between `corners`, both ends among them, in which no point of the part
/// moves by more than `step` metres from one to the next, or by a little more where there would be more
/// than `most`; and the way of the point that goes farthest in each motion, summed up, at each of them.
pub(crate) fn equal_steps(
    frame: &Frame,
    corners: &[Pose],
    step: f64,
    most: usize,
) -> (Vec<Pose>, Vec<f64>) {
    let lengths: Vec<f64> = corners
        .windows(2)
        .map(|w| frame.largest(&w[0], &frame.between(&w[0], &w[1])))
        .collect();
    let whole: f64 = lengths.iter().sum();
    let step = step.max(whole / most.max(1) as f64);
    let (mut poses, mut way) = (vec![corners[0]], vec![0.0]);
    let mut gone = 0.0;
    for (w, length) in corners.windows(2).zip(&lengths) {
        let count = (length / step - 1e-9).ceil().max(1.0);
        for i in 1..=count as usize {
            let share = i as f64 / count;
            poses.push(frame.interpolated(&w[0], &w[1], share));
            way.push(gone + share * length);
        }
        gone += length;
    }
    (poses, way)
}
