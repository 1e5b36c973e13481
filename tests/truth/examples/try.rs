use fft_correlate::{Pose, ScoreModel};
use glam::{DQuat, DVec3};
use pegfit_truth::{Truth, TruthOptions};
use sdf_grid::shapes::PegInHole;
use std::time::Instant;
fn e(v: DVec3) -> String {
    format!("({:.4e} {:.4e} {:.4e})", v.x, v.y, v.z)
}
fn main() {
    let a: Vec<f64> = std::env::args()
        .skip(1)
        .map(|a| a.parse().unwrap())
        .collect();
    let (hole, peg) = PegInHole::Rectangular.pair(a[3] * 1e-3).unwrap();
    let o = TruthOptions {
        tolerance: a[0],
        smallest: 1.0 / a[1],
        largest: 1.0 / a[2],
        ..TruthOptions::FINE
    };
    let t = Instant::now();
    let truth = Truth::new(&hole, &peg, &ScoreModel::GUIDED, &o).unwrap();
    println!(
        "setup {:.1} s, {} cells",
        t.elapsed().as_secs_f64(),
        truth.cell_count()
    );
    let poses = [
        Pose::new(DQuat::from_rotation_y(0.01), DVec3::new(3e-4, 0.0, 2e-3)),
        Pose::new(DQuat::IDENTITY, DVec3::new(5e-4, 1e-4, 2e-4)),
        Pose::new(DQuat::from_rotation_z(0.06), DVec3::new(2e-4, -1e-4, 3e-4)),
        Pose::new(
            DQuat::from_scaled_axis(DVec3::new(0.05, -0.07, 0.03)),
            DVec3::new(2e-3, 1e-3, -3e-3),
        ),
    ];
    for p in poses {
        let t = Instant::now();
        let r = truth.at(&p);
        let s = t.elapsed().as_secs_f64();
        println!(
            "E {:.6e} F {} T {} | {s:.2} s",
            r.energy,
            e(r.wrench.force),
            e(r.wrench.torque)
        );
        if a.len() > 4 {
            let h = a[4] * 1e-3;
            let d = |axis: usize, turn: bool| {
                let f = |s: f64| {
                    let mut v = DVec3::ZERO;
                    v[axis] = s;
                    let tw = if turn {
                        fft_correlate::Twist {
                            angular: v * 100.0,
                            linear: DVec3::ZERO,
                        }
                    } else {
                        fft_correlate::Twist {
                            linear: v,
                            angular: DVec3::ZERO,
                        }
                    };
                    truth.at(&p.perturbed(&tw)).energy
                };
                -(f(h) - f(-h)) / (2.0 * h) / if turn { 100.0 } else { 1.0 }
            };
            let f = DVec3::new(d(0, false), d(1, false), d(2, false));
            let m = DVec3::new(d(0, true), d(1, true), d(2, true));
            println!(
                "   diff F {} T {}  rel {:.2e} {:.2e}",
                e(f),
                e(m),
                (f - r.wrench.force).length() / f.length(),
                (m - r.wrench.torque).length() / m.length()
            );
        }
    }
}
