//! Numbers of a scene that are far from any sensible one: refused by their key, or every answer is a
//! number.

use std::path::Path;

use crate::common::{pegfit, scene_folder, stderr, stdout};

/// In contact, apart, and turned.
const POSES: &str = "x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,1\n0.001,0,0.002,0,0,0,1\n\
                     0,0.004,0,0.06,0.08,0,0.995\n0,0,0.5,0,0,0,1\n";

const VALUES: [&str; 16] = [
    "1e300", "1e200", "1e100", "1e38", "1e30", "1e20", "1e6", "1e4", "1e-4", "1e-6", "1e-20",
    "1e-38", "1e-300", "0", "-1", "nan",
];

/// The scene's exit code, what it says, and whether every cell of its answers is a finite number.
fn answers(folder: &Path, args: &[&str]) -> (i32, String, bool) {
    let output = pegfit(folder, args);
    let out = stdout(&output);
    let numbers = out.lines().skip(1).flat_map(|line| line.split(','));
    let finite = numbers
        .map(|cell| cell.parse::<f64>())
        .all(|n| n.is_ok_and(f64::is_finite));
    let code = output.status.code().unwrap_or(-1);
    (code, stderr(&output), finite && out.lines().count() == 5)
}

#[test]
fn a_model_beyond_what_can_be_computed_is_refused_by_its_key() {
    let keys = [
        ("model", "lambda_exterior"),
        ("model", "lambda_interior"),
        ("model", "separation_weight"),
        ("model", "sigma"),
        ("energy", "gamma"),
        ("energy", "peak_force"),
    ];
    let (mut refused, mut answered) = (0, 0);
    for (table, key) in keys {
        for value in VALUES {
            let folder = scene_folder(&format!("[{table}]\n{key} = {value}\n"));
            let root = folder.path();
            std::fs::write(root.join("in.csv"), POSES).unwrap();
            let score = ["score", "--scene", "scene.toml", "--poses", "in.csv"];
            let (code, said, finite) = answers(root, &score);
            match code {
                0 => assert!(finite, "{key} = {value}"),
                2 => {
                    assert!(said.contains(key), "{key} = {value}: {said}");
                    assert!(said.contains("found"), "{key} = {value}: {said}");
                }
                _ => panic!("{key} = {value}: {code}: {said}"),
            }
            match code {
                0 => answered += 1,
                _ => refused += 1,
            }
        }
    }
    println!("{refused} refused, {answered} answered with numbers");
    assert!(refused > 40 && answered > 10);
}

/// The largest of everything at once, and the smallest.
#[test]
fn at_the_ends_of_all_ranges_scores_and_tables_are_numbers() {
    let ball = "[rotations]\nkind = \"ball\"\nangle_deg = 10.0\nstep_deg = 10.0\n";
    for (weight, energy) in [
        ("1e4", "gamma = 1e20"),
        ("1e4", "peak_force = 1e9"),
        ("1e-4", "gamma = 1e-20"),
        ("1e-4", "peak_force = 1e-9"),
    ] {
        let folder = scene_folder(&format!(
            "[model]\nlambda_exterior = {weight}\nlambda_interior = {weight}\n\
             separation_weight = 1.0\n[energy]\n{energy}\n{ball}"
        ));
        let root = folder.path();
        std::fs::write(root.join("in.csv"), POSES).unwrap();
        let bake = [
            "bake",
            "scene.toml",
            "-o",
            "t.zarr",
            "--json",
            "-q",
            "--poses",
            "50",
        ];
        let baked = pegfit(root, &bake);
        assert_eq!(baked.status.code(), Some(0), "{energy}: {}", stderr(&baked));
        let summary: serde_json::Value = serde_json::from_str(&stdout(&baked)).unwrap();
        let error = summary["error"]["force"]["rms"].as_f64();
        assert!(
            error.is_some_and(|e| e.is_finite() && e > 0.0),
            "{energy}: {summary}"
        );
        for source in [["--scene", "scene.toml"], ["--table", "t.zarr"]] {
            let args = [&["score"], &source[..], &["--poses", "in.csv"]].concat();
            let (code, said, _) = answers(root, &args);
            assert_eq!(code, 0, "{energy}: {said}");
            let out = stdout(&pegfit(root, &args));
            assert!(
                !out.contains("inf") && !out.contains("NaN"),
                "{energy}: {out}"
            );
        }
    }
}
