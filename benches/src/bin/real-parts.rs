//! The whole chain on real parts: `real-parts [--quick] [--out DIR] PARTS_DIR`.
//!
//! `PARTS_DIR` holds the IndustReal assets of IsaacGymEnvs as OBJ files in metres (see
//! `docs/docking.md`); the identity is the assembled pose. Prints, for each pair, where the energy
//! along x, y and yaw is lowest, and where the snap script ends.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use fft_correlate::{
    DirectEvaluator, DirectOptions, EnergyScale, EnergySource, Pair, PairSetup, Pose, ScoreModel,
};
use glam::{DQuat, DVec3};
use haptic::{
    Clock, Geometry, HapticConfig, OperatorConfig, Script, Session, SimulatedOperator, Workspace,
};
use pegfit_benches::table::Table;
use pegfit_benches::{Arguments, Outcome, ask};
use pegfit_pictures::{LineChart, Series};
use sdf_grid::{LengthUnit, RepairOptions, Silent, TriangleMesh, mesh_io};

const PAIRS: [(&str, &str, &str); 2] = [
    (
        "round",
        "industreal_tray_insert_round_peg_8mm.obj",
        "industreal_round_peg_8mm.obj",
    ),
    (
        "rectangular",
        "industreal_tray_insert_rectangular_peg_8mm.obj",
        "industreal_rectangular_peg_8mm.obj",
    ),
];

/// The tray's floor is thin for the length of the pegs: with lighter interiors they gain more along
/// the walls behind it than it costs (`docs/docking.md`).
const MODEL: ScoreModel = ScoreModel {
    lambda_interior: 12.0,
    ..ScoreModel::GUIDED
};

/// Peak force that fixes the energy scale, newtons.
const PEAK_FORCE: f64 = 4.0;

fn main() -> Outcome<()> {
    let arguments = Arguments::parse()?;
    let [folder] = arguments.rest.as_slice() else {
        return Err("usage: real-parts [--quick] [--out DIR] PARTS_DIR".into());
    };
    let mut tables = Tables::new();
    for (name, fixed, moving) in PAIRS {
        eprintln!("{name}: {moving} in {fixed}");
        let read = |file: &str| -> Outcome<TriangleMesh> {
            let path = Path::new(folder).join(file);
            let (mesh, report) = mesh_io::read(&path, LengthUnit::M, &RepairOptions::default())?;
            for warning in report.warnings() {
                eprintln!("   {warning}");
            }
            Ok(mesh)
        };
        let (fixed, moving) = (read(fixed)?, read(moving)?);
        measure(name, &fixed, &moving, &arguments, &mut tables)?;
    }
    let Tables { curves, snaps } = tables;
    for table in [curves, snaps] {
        arguments.publish(&table, None)?;
    }
    Ok(())
}

struct Tables {
    curves: Table,
    snaps: Table,
}

impl Tables {
    fn new() -> Self {
        Self {
            curves: Table::new(
                "curves",
                "Real parts: energy from the assembled pose",
                "IndustReal's round and rectangular 8 mm pegs in their trays, interiors 12 times \
                 as heavy as exteriors. The part is moved straight along an axis or turned about \
                 z: where the energy is lowest, in depths of the assembled pose. The real play is \
                 about 0.5 mm; in the assembled pose the nodes of both lattices coincide, which \
                 may hold the part there.",
                &["pair", "along", "lowest at", "unit", "depth there"],
            ),
            snaps: Table::new(
                "snaps",
                "Real parts: the snap test",
                "A simulated hand carries the peg away and lets go of it near the mouth: how far \
                 it strayed, and where it ends.",
                &[
                    "pair",
                    "hand",
                    "strayed, mm",
                    "x, mm",
                    "y, mm",
                    "z, mm",
                    "tilt, degrees",
                    "peak force, N",
                ],
            ),
        }
    }
}

fn measure(
    name: &str,
    fixed: &TriangleMesh,
    moving: &TriangleMesh,
    arguments: &Arguments,
    tables: &mut Tables,
) -> Outcome<()> {
    let began = Instant::now();
    let mut setup = PairSetup {
        model: MODEL,
        energy: EnergyScale::PeakForce(PEAK_FORCE),
        ..PairSetup::new(Arc::new(fixed.clone()), Arc::new(moving.clone()))
    };
    setup.builder.spacing = arguments.quick.then_some(1e-3);
    let plan = setup.plan()?;
    let pair = setup.load(&Silent)?;
    eprintln!(
        "   {} + {} triangles, spacing {:.2} mm, halo {:.1} mm, {:?} + {:?} nodes, {:.1} s",
        fixed.triangles().len(),
        moving.triangles().len(),
        1e3 * plan.spacing(),
        1e3 * plan.density.halo,
        plan.fixed_lattice.shape(),
        plan.moving_lattice.shape(),
        began.elapsed().as_secs_f64()
    );
    let source = DirectEvaluator::new(&pair, &DirectOptions::FULL)?;
    curves(name, &pair, &source, arguments, &mut tables.curves)?;
    snap(name, &pair, moving, &mut tables.snaps)
}

/// A motion from the assembled pose: its name, unit, reach, and the pose at a value in that unit.
type Motion = (&'static str, &'static str, f64, fn(&Pair, f64) -> Pose);

const MOTIONS: [Motion; 4] = [
    ("x", "mm", 3.0, |p, s| {
        p.pose(DQuat::IDENTITY, DVec3::X * s * 1e-3)
    }),
    ("y", "mm", 3.0, |p, s| {
        p.pose(DQuat::IDENTITY, DVec3::Y * s * 1e-3)
    }),
    ("z", "mm", 12.0, |p, s| {
        p.pose(DQuat::IDENTITY, DVec3::Z * s * 1e-3)
    }),
    ("yaw", "degrees", 30.0, |p, s| {
        p.pose(DQuat::from_rotation_z(s.to_radians()), DVec3::ZERO)
    }),
];

fn curves(
    name: &str,
    pair: &Pair,
    source: &dyn EnergySource,
    arguments: &Arguments,
    table: &mut Table,
) -> Outcome<()> {
    let assembled = ask(source, &Pose::IDENTITY).energy;
    let mut chart = LineChart {
        title: format!("{name} pair: energy from the assembled pose"),
        horizontal: "displacement (fraction of the reach)".into(),
        vertical: "energy (of the assembled depth)".into(),
        ..LineChart::default()
    };
    for (axis, unit, reach, pose) in MOTIONS {
        const STEPS: i32 = 120;
        let at = |i: i32| reach * f64::from(i) / f64::from(STEPS);
        let energies: Vec<(f64, f64)> = (-STEPS..=STEPS)
            .map(|i| (at(i), ask(source, &pose(pair, at(i))).energy))
            .collect();
        let lowest = energies
            .iter()
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .expect("poses were asked");
        table.push([
            name.to_owned(),
            axis.to_owned(),
            format!("{:+.2}", lowest.0),
            unit.to_owned(),
            format!("{:.3}", lowest.1 / assembled),
        ]);
        chart.series.push(Series {
            label: format!("{axis}, ±{reach} {unit}"),
            points: energies
                .iter()
                .map(|(s, e)| (s / reach, e / -assembled))
                .collect(),
            ..Series::default()
        });
    }
    let png = pegfit_pictures::png("energy curves", (1000, 620), |sheet| chart.draw(sheet))?;
    std::fs::write(arguments.out.join(format!("real-{name}.png")), png)?;
    Ok(())
}

fn snap(name: &str, pair: &Pair, moving: &TriangleMesh, table: &mut Table) -> Outcome<()> {
    let source = DirectEvaluator::new(pair, &DirectOptions::REAL_TIME)?;
    let size = moving.bounds().size();
    let geometry = Geometry {
        seated: Pose::IDENTITY,
        axis: DVec3::NEG_Z,
        depth: size.z,
        radius: 0.25 * size.x.min(size.y),
        tilt: 0.08,
    };
    let workspace = Workspace::new(1.0, Pose::IDENTITY, pair.pivot());
    let seconds = 6.0;
    for seed in 0..3 {
        let hand = OperatorConfig {
            duration: seconds,
            seed,
            ..OperatorConfig::default()
        };
        let outcome = Session::new(HapticConfig::default(), workspace)
            .keep_samples()
            .run(
                &mut SimulatedOperator::new(hand, Script::Snap, geometry, workspace),
                &source,
                Clock::Simulated,
                seconds,
                &AtomicBool::new(false),
            )?;
        let strayed = outcome
            .samples
            .iter()
            .map(|s| pair.displacement(&s.object).length())
            .fold(0.0, f64::max);
        let end = outcome.last.object;
        let d = 1e3 * pair.displacement(&end);
        let tilt = (end.rotation * DVec3::Z).angle_between(DVec3::Z);
        table.push([
            name.to_owned(),
            seed.to_string(),
            format!("{:.0}", 1e3 * strayed),
            format!("{:+.3}", d.x),
            format!("{:+.3}", d.y),
            format!("{:+.3}", d.z),
            format!("{:.2}", tilt.to_degrees()),
            format!("{:.2}", outcome.report.peak_force),
        ]);
    }
    Ok(())
}
