//! `pegfit plot`: the paper's figures for any scene.

use std::path::Path;

use fft_correlate::{DirectOptions, Pose, ScoreModel, TranslationWindow, Well};
use glam::DVec3;
use haptic::{Clock, Sample, Script};
use ndarray::{Array2, Array3, Axis};
use num_complex::Complex32;
use pegfit_pictures::{
    AXES, LineChart, Plot, PlotSheet, Quantity, Series, Slice, SliceError, Surface, density_map,
    distance_contours, sheet,
};
use pegfit_scene::{Assembly, Motion, ProfilePoint, SceneSetup};
use sdf_grid::text::significant;
use sdf_grid::{Aabb, DensityError, DensityField, Monitor, TriangleMesh, atomic};

use crate::args::{PlotArgs, PlotKind};
use crate::commands::scenes::scene_item;
use crate::commands::{haptic_session, scenes};
use crate::context::Context;
use crate::error::{CommandError, refuse};
use crate::report::output::require_folder;

pub(in crate::commands) fn run(args: &PlotArgs, context: &Context) -> Result<(), CommandError> {
    refuse_unused(args)?;
    let scene = scenes::read(&args.scene.file, args.scene.fixed.as_deref())?;
    let slice = match &args.slice {
        Some(text) => Some(Slice::parse(text, scene.unit).map_err(CommandError::slice)?),
        None => None,
    };
    let along = args.along.as_deref();
    let plane = parse_plane(along.filter(|_| args.kind == PlotKind::Score))?;
    let motion = Along::parse(along.filter(|_| args.kind == PlotKind::Energy))?;
    let picture = match args.kind {
        PlotKind::Density | PlotKind::Overlap => {
            let setup = scenes::setup(scene, context)?;
            let slice = slice.map_or_else(|| middle(&setup), Ok)?;
            match args.kind {
                PlotKind::Density => densities(&setup, &slice, context)?.png(DENSITIES)?,
                _ => overlap(&setup, &slice, context)?.png(OVERLAP)?,
            }
        }
        PlotKind::Score => {
            score_surface(&scenes::load_in_window(scene, context)?, plane)?.png(SCORE)?
        }
        PlotKind::Energy => curve(&scenes::load_in_window(scene, context)?, motion)?.png(CURVE)?,
        PlotKind::Force => both_tests(&scenes::load(scene, context)?, context)?.png(TESTS)?,
        PlotKind::Well => {
            let assembly = scenes::load_in_window(scene, context)?;
            let well = analyse(&assembly)?;
            return context.show(&well, || print_well(&assembly, &well));
        }
    };
    let output = output(args)?;
    atomic::write(output, &picture)?;
    if !context.json {
        say!("wrote {}", output.display());
    }
    Ok(())
}

/// Widths and heights of the figures in files, pixels.
pub(in crate::commands) const DENSITIES: (u32, u32) = (1500, 1240);
pub(in crate::commands) const OVERLAP: (u32, u32) = (1100, 940);
pub(in crate::commands) const SCORE: (u32, u32) = (1200, 950);
pub(in crate::commands) const CURVE: (u32, u32) = (1200, 1100);
const TESTS: (u32, u32) = (1300, 1100);

fn output(args: &PlotArgs) -> Result<&Path, CommandError> {
    args.output
        .as_deref()
        .ok_or_else(|| CommandError::option("--output", "a picture file", "none"))
}

/// Options that the kind would ignore are mistakes to report, before anything is computed.
fn refuse_unused(args: &PlotArgs) -> Result<(), CommandError> {
    let kind = args.kind;
    let unused =
        |option: &str| CommandError::option(option, "no such option for this figure", "one");
    if args.slice.is_some() && !matches!(kind, PlotKind::Density | PlotKind::Overlap) {
        return Err(unused("--slice"));
    }
    if args.along.is_some() && !matches!(kind, PlotKind::Score | PlotKind::Energy) {
        return Err(unused("--along"));
    }
    match (kind, &args.output) {
        (PlotKind::Well, Some(_)) => Err(unused("--output")),
        (PlotKind::Well, None) => Ok(()),
        _ => require_folder(output(args)?),
    }
}

/// The plane y = constant through the middle of the assembled moving part.
fn middle(setup: &SceneSetup) -> Result<Slice, CommandError> {
    let pivot = setup.placement().moving.apply(setup.pivot()?);
    Ok(Slice {
        axis: 1,
        at: setup.scene.fit.assembled.apply(pivot).y,
    })
}

/// Poses on a curve.
const SAMPLES: usize = 241;

/// Significant digits of what is measured on a well.
const DIGITS: usize = 3;

/// One degree of freedom through the assembled pose, by the number of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::commands) enum Along {
    /// Along an axis of the fixed part, as the window lies.
    Axis(usize),
    /// About such an axis through the pivot.
    About(usize),
}

impl Along {
    /// Reads `x`, `y`, `z`, `rx`, `ry` or `rz`; x if there is none.
    fn parse(text: Option<&str>) -> Result<Self, CommandError> {
        let Some(text) = text else {
            return Ok(Self::Axis(0));
        };
        let axis = |name: &str| AXES.iter().position(|a| *a == name);
        match (axis(text), text.strip_prefix('r').and_then(axis)) {
            (Some(a), _) => Ok(Self::Axis(a)),
            (None, Some(a)) => Ok(Self::About(a)),
            _ => refuse("--along", "x, y, z, rx, ry or rz", text),
        }
    }
}

/// Energy above, force or torque below.
pub(in crate::commands) fn curve(
    assembly: &Assembly,
    along: Along,
) -> Result<PlotSheet, CommandError> {
    let source = assembly.direct(&DirectOptions::FULL)?;
    let (motion, reach) = match along {
        Along::Axis(axis) => (
            Motion::Translation(DVec3::AXES[axis]),
            assembly.setup.parts.reach()[axis],
        ),
        Along::About(axis) => (Motion::Rotation(DVec3::AXES[axis]), std::f64::consts::PI),
    };
    let amounts = pegfit_pictures::samples([-reach, reach], SAMPLES);
    let points = assembly.profile(&source, motion, &amounts);
    Ok(curve_sheet(assembly, along, &points))
}

fn curve_sheet(assembly: &Assembly, along: Along, points: &[ProfilePoint]) -> PlotSheet {
    let unit = assembly.setup.display_unit();
    let (name, scale, horizontal, load) = match along {
        Along::Axis(a) => (
            format!("along {}", AXES[a]),
            1.0 / unit.in_metres(),
            format!("displacement along {} ({unit})", AXES[a]),
            format!("force along {} (N)", AXES[a]),
        ),
        Along::About(a) => (
            format!("about {}", AXES[a]),
            180.0 / std::f64::consts::PI,
            format!("turn about {} (degrees)", AXES[a]),
            format!("torque about {} (N·m)", AXES[a]),
        ),
    };
    // So that ripples look small: the energy's axis spans at least half of its size, the slope's
    // at least what takes it to nothing within half the range.
    let size = points
        .iter()
        .map(|p| p.response.energy.abs())
        .fold(0.0, f64::max);
    let reach = points.last().map_or(1.0, |p| p.amount);
    let chart = |title: String,
                 vertical: &str,
                 quantity: Quantity,
                 least_span: f64,
                 value: &dyn Fn(&ProfilePoint) -> f64| LineChart {
        least_span,
        title,
        horizontal: horizontal.clone(),
        vertical: vertical.to_owned(),
        series: vec![Series {
            points: points
                .iter()
                .map(|p| (scale * p.amount, value(p)))
                .collect(),
            quantity: Some(quantity),
            ..Series::default()
        }],
        ..LineChart::default()
    };
    let energy = chart(
        format!("Energy of {} {name}", assembly.scene().moving.name),
        "energy (mJ)",
        Quantity::Energy,
        1e3 * 0.5 * size,
        &|p| 1e3 * p.response.energy,
    );
    let quantity = match along {
        Along::Axis(_) => Quantity::Force,
        Along::About(_) => Quantity::Torque,
    };
    let span = 2.0 * size / reach;
    let slope = chart(String::new(), &load, quantity, span, &|p| p.load);
    PlotSheet {
        what: "energy curve",
        plots: vec![Plot::Lines(energy), Plot::Lines(slope)],
        across: 1,
    }
}

/// A part's density on a plane: computed for the picture, finer than the scene's lattice.
fn on_plane(
    mesh: &TriangleMesh,
    setup: &SceneSetup,
    bounds: &Aabb,
    slice: &Slice,
    monitor: &dyn Monitor,
) -> Result<DensityField, CommandError> {
    let of = |item: &str| scene_item(&setup.scene, item);
    let density = slice.density(mesh, setup.parts.model.sigma, bounds, monitor);
    density.map_err(|e| match e {
        SliceError::Density(DensityError::Cancelled) => CommandError::Interrupted,
        SliceError::Density(e) => CommandError::bad_input(of("density"), e),
        SliceError::Kernel(e) => CommandError::bad_input(of("model"), e),
        SliceError::Lattice(e) => CommandError::bad_input(format!("slice {}", AXES[slice.axis]), e),
    })
}

/// Real and imaginary part of both parts' densities, each where the scene puts it.
pub(in crate::commands) fn densities(
    setup: &SceneSetup,
    slice: &Slice,
    context: &Context,
) -> Result<PlotSheet, CommandError> {
    let (scene, model) = (&setup.scene, &setup.parts.model);
    let unit = setup.display_unit();
    let parts = [
        (&scene.fixed.name, setup.placed_fixed()),
        (&scene.moving.name, setup.moving_at(&Pose::IDENTITY)),
    ];
    let bounds = setup.bounds(0.1);
    let mut maps = Vec::new();
    for (name, mesh) in parts {
        let field = on_plane(&mesh, setup, &bounds, slice, &context.progress)?;
        let density = field.combined(model.lambda_exterior as f32, model.lambda_interior as f32);
        for (part, values) in [
            ("Re", density.mapv(|v| v.re)),
            ("Im", density.mapv(|v| v.im)),
        ] {
            maps.push(Plot::Map(density_map(
                format!("{part} of the density of {name}, {}", slice.label(unit)),
                &format!("{part} ρ\n(no unit)"),
                sheet(&values, &field, slice),
                &field,
                slice,
                unit,
            )));
        }
    }
    context.progress.finish();
    Ok(PlotSheet {
        what: "densities",
        plots: maps,
        across: 2,
    })
}

/// The real part of the product of both densities at the assembled pose: what the score sums.
pub(in crate::commands) fn overlap(
    setup: &SceneSetup,
    slice: &Slice,
    context: &Context,
) -> Result<PlotSheet, CommandError> {
    let unit = setup.display_unit();
    let bounds = setup.bounds(0.1);
    let moved = setup.moving_at(&setup.scene.fit.assembled);
    let lies = setup.placed_fixed();
    let fixed = on_plane(&lies, setup, &bounds, slice, &context.progress)?;
    let moving = on_plane(&moved, setup, &bounds, slice, &context.progress)?;
    context.progress.finish();
    let mut map = density_map(
        format!("Score density at the assembled pose, {}", slice.label(unit)),
        "Re ρ₁ρ₂\n(no unit)",
        product(&setup.parts.model, &fixed, &moving, slice),
        &fixed,
        slice,
        unit,
    );
    let other = distance_contours(&moving, slice, unit).0;
    map.contours.push(other);
    for lines in &mut map.contours {
        lines.levels.clear();
    }
    map.note = "lines: the boundaries; red: reward, blue: penalty and separation".to_owned();
    Ok(PlotSheet {
        what: "overlap",
        plots: vec![Plot::Map(map)],
        across: 1,
    })
}

/// `Re [l1 l2 (O1 I2 + I1 O2) + l2² I1 I2 + w l1² O1 O2]` on the plane.
fn product(
    model: &ScoreModel,
    fixed: &DensityField,
    moving: &DensityField,
    slice: &Slice,
) -> Array2<f32> {
    let (l1, l2) = (model.lambda_exterior as f32, model.lambda_interior as f32);
    let w = model.separation_weight as f32;
    let o1 = sheet(&fixed.exterior, fixed, slice);
    let i1 = sheet(&fixed.interior, fixed, slice);
    let o2 = sheet(&moving.exterior, moving, slice);
    let i2 = sheet(&moving.interior, moving, slice);
    Array2::from_shape_fn(o1.dim(), |p| {
        let (o1, i1, o2, i2) = (o1[p], i1[p], o2[p], i2[p]);
        let sum: Complex32 =
            (o1 * i2 + i1 * o2) * (l1 * l2) + i1 * i2 * (l2 * l2) + o1 * o2 * (w * l1 * l1);
        sum.re
    })
}

/// Seconds of each test.
const SECONDS: f64 = 8.0;

/// Runs the collision and the snap test in simulated time and draws both.
fn both_tests(assembly: &Assembly, context: &Context) -> Result<PlotSheet, CommandError> {
    let source = assembly.source(&DirectOptions::REAL_TIME)?;
    let mut charts = Vec::new();
    for (script, title) in [
        (
            Script::Collision,
            "Collision test: pushed against the walls",
        ),
        (Script::Snap, "Snap test: let go near the fit"),
    ] {
        context.progress.note(&format!("{title} ..."));
        let run =
            haptic_session::run_simulated(assembly, &source, script, SECONDS, Clock::Simulated)?;
        charts.push(Plot::Lines(force_chart(title.to_owned(), &run.samples)));
    }
    Ok(PlotSheet {
        what: "force against time",
        plots: charts,
        across: 1,
    })
}

/// The force on the hand, its size and components.
pub(in crate::commands) fn force_chart(title: String, samples: &[Sample]) -> LineChart {
    let series = |label: &str, value: &dyn Fn(&Sample) -> f64| Series {
        label: label.to_owned(),
        points: samples.iter().map(|s| (s.time, value(s))).collect(),
        quantity: (label == "size").then_some(Quantity::Force),
        ..Series::default()
    };
    LineChart {
        title,
        horizontal: "time (s)".to_owned(),
        vertical: "force on the hand (N)".to_owned(),
        series: vec![
            series("size", &|s| s.wrench.force.length()),
            series("x", &|s| s.wrench.force.x),
            series("y", &|s| s.wrench.force.y),
            series("z", &|s| s.wrench.force.z),
        ],
        ..LineChart::default()
    }
}

/// Two different axes from text such as `xz`; x and z if there is none.
fn parse_plane(text: Option<&str>) -> Result<[usize; 2], CommandError> {
    let Some(text) = text else {
        return Ok([0, 2]);
    };
    let axis = |c: char| "xyz".find(c);
    match text.chars().map(axis).collect::<Vec<_>>()[..] {
        [Some(a), Some(b)] if a != b => Ok([a, b]),
        _ => refuse("--along", "two of x, y, z, such as xz", text),
    }
}

/// The score with the assembled rotation over the scene's window along two of its axes, the third
/// displacement being that of the fit.
pub(in crate::commands) fn score_surface(
    assembly: &Assembly,
    plane: [usize; 2],
) -> Result<PlotSheet, CommandError> {
    let parts = &assembly.setup.parts;
    let middle = assembly.pair.displacement(&parts.assembled);
    let across = 3 - plane[0] - plane[1];
    let mut reach = parts.reach();
    reach[across] = 0.0;
    let window = TranslationWindow::new(middle - reach, middle + reach, assembly.pair.spacing())
        .map_err(|e| CommandError::bad_input(scene_item(assembly.scene(), "window"), e))?;
    let score = assembly.scores(&window)?;
    Ok(surface_sheet(assembly, plane, &window, middle, &score))
}

fn surface_sheet(
    assembly: &Assembly,
    plane: [usize; 2],
    window: &TranslationWindow,
    middle: glam::DVec3,
    score: &Array3<f32>,
) -> PlotSheet {
    let unit = assembly.setup.display_unit();
    let metre = unit.in_metres();
    let across = 3 - plane[0] - plane[1];
    // A fit between two nodes has two sheets; the first is within half a spacing.
    let values: Array2<f32> = score
        .index_axis(Axis(across), 0)
        .mapv(|v| (f64::from(v) / metre.powi(3)) as f32);
    let values = if plane[0] < plane[1] {
        values
    } else {
        values.reversed_axes()
    };
    let bounds = window.lattice().node_bounds();
    let range = |axis: usize| {
        [
            (bounds.min[axis] - middle[axis]) / metre,
            (bounds.max[axis] - middle[axis]) / metre,
        ]
    };
    let surface = Surface {
        title: format!(
            "Score of {} in {} over two translations",
            assembly.scene().moving.name,
            assembly.scene().fixed.name
        ),
        first: format!("{} ({unit})", AXES[plane[0]]),
        second: format!("{} ({unit})", AXES[plane[1]]),
        height: format!("score ({unit}³)"),
        values,
        first_range: range(plane[0]),
        second_range: range(plane[1]),
    };
    PlotSheet {
        what: "score surface",
        plots: vec![Plot::Surface(surface)],
        across: 1,
    }
}

pub(in crate::commands) fn analyse(assembly: &Assembly) -> Result<Well, CommandError> {
    let source = assembly.direct(&DirectOptions::REAL_TIME)?;
    Ok(assembly.well(&source)?)
}

fn print_well(assembly: &Assembly, well: &Well) {
    let unit = assembly.setup.display_unit();
    let metre = unit.in_metres();
    say!("depth       {:.4} mJ", 1e3 * well.depth);
    let offset = DVec3::from_array(well.offset) / metre;
    let turn = DVec3::from_array(well.turn).length().to_degrees();
    say!(
        "minimum     ({:.4}, {:.4}, {:.4}) {unit} and {turn:.3} degrees from the fit",
        offset.x,
        offset.y,
        offset.z
    );
    say!(
        "stiffness is the second difference of the energy over {} {unit} (and the angle that \
         moves the rim by it)",
        significant(well.length / metre, DIGITS)
    );
    say!("  axis     stiffness          diameter           peak");
    for (name, axis) in AXES.iter().zip(&well.translations) {
        say!(
            "  {name:<4} {:>13} N/m  {:>10} {unit}  {:>10} N",
            significant(axis.stiffness, DIGITS),
            significant(
                (axis.sides[0].convex + axis.sides[1].convex) / metre,
                DIGITS
            ),
            significant(axis.sides[0].peak.max(axis.sides[1].peak), DIGITS)
        );
    }
    for (name, axis) in AXES.iter().zip(&well.rotations) {
        say!(
            "  r{name:<3} {:>13} N·m/rad {:>7} degrees {:>7} N·m",
            significant(axis.stiffness, DIGITS),
            significant(
                (axis.sides[0].convex + axis.sides[1].convex).to_degrees(),
                DIGITS
            ),
            significant(axis.sides[0].peak.max(axis.sides[1].peak), DIGITS)
        );
    }
    say!("barriers, as fractions of the depth: the climb on the path out and on the path in");
    for barrier in &well.barriers {
        // Adding zero turns -0 into 0.
        let [x, y, z] = barrier.direction.map(|c| c + 0.0);
        say!(
            "  ({x:>2.0}, {y:>2.0}, {z:>2.0})  out {:>7.3}  in {:>7.3}  beyond {:>7.3}",
            barrier.escape,
            barrier.entry,
            barrier.beyond
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motions_have_names() {
        assert_eq!(Along::parse(Some("y")).unwrap(), Along::Axis(1));
        assert_eq!(Along::parse(Some("rz")).unwrap(), Along::About(2));
        for bad in ["", "r", "rr", "xy", "w"] {
            assert!(Along::parse(Some(bad)).is_err(), "{bad}");
        }
    }

    #[test]
    fn planes_are_two_letters() {
        assert_eq!(parse_plane(None).unwrap(), [0, 2]);
        assert_eq!(parse_plane(Some("zy")).unwrap(), [2, 1]);
        for bad in ["x", "xx", "xyz", "xw", ""] {
            assert!(parse_plane(Some(bad)).is_err(), "{bad}");
        }
    }
}
