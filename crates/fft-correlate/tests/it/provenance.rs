//! What results were made from: every key of a provenance counts when a bake or a search goes on.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use fft_correlate::table::TableSetupError;
use fft_correlate::testing::{SearchDomain, SearchOptions, SearchPairs, search};
use fft_correlate::{
    BakeError, DockingError, EnergyScale, Pair, PairBuildError, PairBuilder, PairEnergies,
    PairProvenance, PairSetup, RotationDomain, ScoreModel, Share, StoreError, TableSpec,
    TableStore, TranslationWindow, bake,
};
use glam::{DQuat, DVec3};
use sdf_grid::{Aabb, Silent, TriangleMesh, shapes};

use crate::store_support::{StopAfter, resealed};

/// What a pair is made from, all that a scene can change.
#[derive(Clone, Copy)]
struct Made {
    /// Sides of the fixed and the moving cube, metres.
    sides: [f64; 2],
    builder: PairBuilder,
    model: ScoreModel,
}

impl Made {
    const FIRST: Self = Self {
        sides: [6e-3, 4e-3],
        builder: PairBuilder {
            spacing: Some(1e-3),
            halo: Some(2e-3),
            tolerance: 1e-3,
            smoothing: Some(0.7),
            memory_limit: None,
        },
        model: ScoreModel::GUIDED,
    };

    fn meshes(&self) -> [TriangleMesh; 2] {
        self.sides
            .map(|side| shapes::cuboid(DVec3::splat(side)).unwrap())
    }

    fn pair(&self) -> Pair {
        let [fixed, moving] = self.meshes();
        self.builder
            .build(&fixed, &moving, &self.model, &Silent)
            .unwrap()
    }
}

type Change = (&'static str, fn(&mut Made));

type OfSearch = (&'static str, fn(&mut SearchDomain, &mut SearchOptions));

/// Changes of a scene and the first key of the provenance in which they show.
const CHANGES: [Change; 12] = [
    ("fixed.halo", |m| m.builder.halo = Some(2.1e-3)),
    ("fixed.tolerance", |m| m.builder.tolerance = 2e-3),
    ("fixed.sampling", |m| m.builder.smoothing = None),
    ("fixed.sampling.smoothed.deviation", |m| {
        m.builder.smoothing = Some(0.65)
    }),
    ("fixed.sampling.smoothed.deviation", |m| {
        m.builder.spacing = Some(0.9e-3)
    }),
    ("fixed.mesh", |m| m.sides[0] = 6.1e-3),
    ("moving.mesh", |m| m.sides[1] = 4.1e-3),
    ("fixed.sigma", |m| m.model.sigma = 0.3),
    ("model.lambda_exterior", |m| m.model.lambda_exterior = 1.5),
    ("model.lambda_interior", |m| m.model.lambda_interior = 99.0),
    ("model.separation_weight", |m| {
        m.model.separation_weight = 0.5
    }),
    ("model.gamma", |m| m.model.gamma = 2.0),
];

fn spec(pair: &Pair, window: &TranslationWindow) -> TableSpec {
    TableSpec::for_pair(pair, window, RotationDomain::ball(20.0, 10.0))
}

fn baked(path: &Path, made: &Made, monitor: &dyn sdf_grid::Monitor) -> Result<(), BakeError> {
    let pair = made.pair();
    let window = TranslationWindow::cube(2e-3, pair.spacing()).unwrap();
    let energies = PairEnergies::plan(&pair, &window).unwrap();
    let share = Share {
        resume: true,
        ..Share::ALL
    };
    bake(path, &spec(&pair, &window), &energies, share, monitor).map(|_| ())
}

/// The key, the stored and the given value by which a bake refuses to go on.
fn refused(result: Result<(), BakeError>) -> [String; 3] {
    match result {
        Err(BakeError::Store(StoreError::Different { difference: d, .. })) => {
            [d.key, d.stored, d.given]
        }
        other => panic!("{other:?}"),
    }
}

/// A table knows its parts, whatever lattice, sampling and scale it has chosen itself.
#[test]
fn a_table_of_other_parts_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.zarr");
    baked(&path, &Made::FIRST, &Silent).unwrap();
    let store = TableStore::open(&path).unwrap();
    let expect = |change: fn(&mut Made), energy: EnergyScale| {
        let mut made = Made::FIRST;
        change(&mut made);
        let [fixed, moving] = made.meshes().map(Arc::new);
        let setup = PairSetup {
            builder: made.builder,
            model: made.model,
            energy,
            ..PairSetup::new(fixed, moving)
        };
        match store.expect_setup(&setup) {
            Ok(()) => "same".to_owned(),
            Err(TableSetupError::Store(StoreError::Different { difference, .. })) => difference.key,
            Err(other) => panic!("{other}"),
        }
    };
    let (own, force) = (EnergyScale::Gamma(1.0), EnergyScale::PeakForce(3.0));
    assert_eq!(expect(|_| {}, own), "same");
    assert_eq!(expect(|m| m.builder.spacing = Some(5e-4), force), "same");
    assert_eq!(expect(|m| m.builder.smoothing = None, own), "same");
    assert_eq!(expect(|_| {}, EnergyScale::Gamma(2.0)), "model.gamma");
    assert_eq!(expect(|m| m.sides[1] = 4.1e-3, force), "moving.mesh");
    assert_eq!(expect(|m| m.builder.halo = Some(3e-3), own), "fixed.halo");
}

#[test]
fn an_interrupted_bake_goes_on_with_its_own_provenance_only() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.zarr");
    let stopped = baked(&path, &Made::FIRST, &StopAfter(2.into()));
    assert!(matches!(stopped, Err(BakeError::Cancelled)), "{stopped:?}");
    for (key, change) in CHANGES {
        let mut made = Made::FIRST;
        change(&mut made);
        let [found, stored, given] = refused(baked(&path, &made, &Silent));
        assert_eq!(found, format!("provenance.{key}"));
        assert_ne!(stored, given, "{key}");
    }
    let mut made = Made::FIRST;
    made.builder.halo = Some(2.1e-3);
    let said = baked(&path, &made, &Silent).unwrap_err().to_string();
    assert!(
        said.contains("provenance.fixed.halo")
            && said.contains("0.002 ")
            && said.contains("0.0021 "),
        "{said}"
    );
    // A field version of another program.
    let file = path.join("zarr.json");
    let whole = fs::read(&file).unwrap();
    let changed = resealed(&whole, |own| {
        own["table"]["provenance"]["moving"]["version"] = 1.into();
    });
    fs::write(&file, changed).unwrap();
    let [key, stored, _] = refused(baked(&path, &Made::FIRST, &Silent));
    assert_eq!((&key[..], &stored[..]), ("provenance.moving.version", "1"));
    fs::write(&file, whole).unwrap();
    baked(&path, &Made::FIRST, &Silent).unwrap();
    let store = TableStore::open(&path).unwrap();
    store
        .expect_provenance(&Made::FIRST.pair().provenance())
        .unwrap();
    assert!(store.load(1 << 30).is_ok());
}

/// A provenance can be had without its fields.
#[test]
fn a_plan_has_the_provenance_of_the_pair_it_makes() {
    for (_, change) in CHANGES {
        let mut made = Made::FIRST;
        change(&mut made);
        let [fixed, moving] = made.meshes();
        let plan = made.builder.plan(&fixed, &moving, &made.model).unwrap();
        let provenance: PairProvenance = plan.provenance(&fixed, &moving);
        assert_eq!(provenance, made.pair().provenance());
    }
}

fn seek(
    made: &Made,
    domain: &SearchDomain,
    options: &SearchOptions,
    state: &Path,
) -> Result<usize, DockingError> {
    let pair = made.pair();
    let pairs = SearchPairs {
        screening: None,
        coarse: &pair,
        fine: &pair,
    };
    search(&pairs, domain, options, Some(state), &Silent).map(|report| report.resumed)
}

#[test]
fn a_search_goes_on_with_its_own_provenance_only() {
    let folder = tempfile::tempdir().unwrap();
    let state = folder.path().join("state.json");
    let pivot = Made::FIRST.pair().pivot();
    let domain = SearchDomain {
        rotations: vec![DQuat::IDENTITY, DQuat::from_rotation_z(0.5)],
        step: 0.5,
        places: Aabb {
            min: pivot - 2e-3,
            max: pivot + 2e-3,
        },
        symmetries: Vec::new(),
    };
    let options = SearchOptions {
        top: 1,
        coarse_poses: 1,
        fine_poses: 1,
        // Less than the model's own, which then counts.
        ratio: 0.1,
        ..SearchOptions::default()
    };
    assert_eq!(seek(&Made::FIRST, &domain, &options, &state).unwrap(), 0);
    let key = |result: Result<usize, DockingError>| match result {
        Err(DockingError::OtherState { difference, .. }) => difference.key,
        other => panic!("{other:?}"),
    };
    for (expected, change) in CHANGES {
        // A search leaves separation out.
        if expected == "model.separation_weight" {
            continue;
        }
        let mut made = Made::FIRST;
        change(&mut made);
        let found = key(seek(&made, &domain, &options, &state));
        // The exterior's weight is what the interior's is a multiple of.
        let same = found == format!("coarse.{expected}");
        assert!(same || expected == "fixed.sigma", "{expected}: {found}");
    }
    let changes: [OfSearch; 8] = [
        ("options.top", |_, o| o.top = 2),
        ("options.per_rotation", |_, o| o.per_rotation = 3),
        ("options.coarse_poses", |_, o| o.coarse_poses = 2),
        ("options.ratio", |_, o| o.ratio = 0.2),
        ("places", |d, _| d.places.max.x += 1e-3),
        ("step", |d, _| d.step = 0.4),
        ("rotations.hash", |d, _| {
            d.rotations[1] = DQuat::from_rotation_z(0.4)
        }),
        ("symmetries", |d, _| {
            d.symmetries.push(fft_correlate::Pose::IDENTITY)
        }),
    ];
    for (expected, change) in changes {
        let (mut domain, mut options) = (domain.clone(), options.clone());
        change(&mut domain, &mut options);
        let found = key(seek(&Made::FIRST, &domain, &options, &state));
        assert!(found.starts_with(expected), "{expected}: {found}");
    }
    assert_eq!(seek(&Made::FIRST, &domain, &options, &state).unwrap(), 2);
}

/// A part of which no cell would be filled is refused before anything is computed; one that is a
/// little larger than a cell is coarse, but there.
#[test]
fn a_part_smaller_than_a_cell_is_refused() {
    for (part, which) in [("fixed", 0), ("moving", 1)] {
        let mut made = Made::FIRST;
        made.sides[which] *= 1e-3;
        let [fixed, moving] = made.meshes();
        let found = made.builder.plan(&fixed, &moving, &made.model).unwrap_err();
        let PairBuildError::TooSmall {
            part: named,
            size,
            spacing,
        } = found
        else {
            panic!("{found}");
        };
        assert_eq!((named, spacing), (part, 1e-3));
        assert!((size - made.sides[which]).abs() < 1e-12);
    }
    let mut made = Made::FIRST;
    made.sides[1] = 1.2e-3;
    let inside = made.pair().moving().interior.iter().any(|v| v.re != 0.0);
    assert!(inside, "a part of 1.2 cells is felt");
}

/// Metadata that was written again has the mode of any new file.
#[cfg(unix)]
#[test]
fn a_tables_metadata_is_as_readable_as_any_file() {
    use std::os::unix::fs::PermissionsExt;

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.zarr");
    baked(&path, &Made::FIRST, &Silent).unwrap();
    let mut store = TableStore::open(&path).unwrap();
    let table = store.load(1 << 30).unwrap();
    let report = fft_correlate::measure_error(&table, &table, 3, 1);
    store.write_error_report(&report).unwrap();
    let ordinary = folder.path().join("ordinary");
    fs::write(&ordinary, "").unwrap();
    let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
    assert_eq!(mode(&path.join("zarr.json")), mode(&ordinary));
    assert_eq!(mode(&path.join("coefficients/zarr.json")), mode(&ordinary));
    // Nothing is left beside or in the table.
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
}
