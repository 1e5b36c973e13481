//! `pegfit score` from the outside.

use crate::common::{
    columns, pegfit, pegfit_with_input, refuse, scene_folder, stderr, stdout, succeed, words,
};

const POSES: &str = "\
qw,qx,qy,qz,x,y,z,note
1,0,0,0,0,0,0,assembled
1,0,0,0,0.002,0,0,against a wall
0.7071067811865476,0,0,0.7071067811865476,0,0,0,turned by 90 degrees
1.0005,0,0,0,0,0,0.004,nearly a unit quaternion
";

#[test]
fn poses_in_scores_out() {
    let folder = scene_folder("");
    std::fs::write(folder.path().join("in.csv"), POSES).unwrap();
    let args = words("score --scene scene.toml --poses in.csv -o out.csv -q");
    assert_eq!(succeed(folder.path(), &args), "");
    let text = std::fs::read_to_string(folder.path().join("out.csv")).unwrap();
    assert!(
        text.starts_with("x,y,z,qx,qy,qz,qw,score_re,score_im,energy,tx,ty,tz,fx,fy,fz,coverage\n")
    );
    let rows = columns(&text);
    assert_eq!(rows.len(), 4);
    // The fit is the best of the four; the wall pushes back; a square peg does not mind 90
    // degrees (to the rounding of single precision); score and energy have opposite signs.
    assert!(rows[0]["energy"] < rows[1]["energy"] && rows[0]["energy"] < rows[3]["energy"]);
    assert!(rows[1]["fx"] < 0.0, "{:?}", rows[1]);
    assert!((rows[2]["energy"] / rows[0]["energy"] - 1.0).abs() < 1e-4);
    assert!(rows[0]["score_re"] > 0.0 && rows[0]["energy"] < 0.0);
    assert!(
        rows.iter()
            .all(|r| r["score_im"].is_finite() && r["coverage"] == 1.0)
    );
    assert_eq!(rows[3]["qw"], 1.0);
}

/// The score is that without the column; apart in z by more than both parts' halos nothing cancels,
/// and a wall cut into cancels more than the fit does.
#[test]
fn condition_is_one_column_more() {
    let folder = scene_folder("");
    let poses = "x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,1\n0.004,0,0,0,0,0,1\n0,0,0.09,0,0,0,1\n";
    std::fs::write(folder.path().join("in.csv"), poses).unwrap();
    let args = ["score", "--scene", "scene.toml", "--poses", "in.csv", "-q"];
    let plain = columns(&succeed(folder.path(), &args));
    let rows = columns(&succeed(
        folder.path(),
        &[&args[..], &["--condition"]].concat(),
    ));
    assert!(!plain[0].contains_key("condition"));
    assert_eq!(rows[1]["score_re"], plain[1]["score_re"]);
    let number = |row: usize| rows[row]["condition"];
    assert!(number(0) >= 1.0 && number(1) > number(0), "{rows:?}");
    assert_eq!(number(2), 1.0);
    for of_scenes in [&["--condition"][..], &["--tolerance", "5%"]] {
        let table = ["score", "--table", "t.zarr", "--poses", "in.csv"];
        let refused = pegfit(folder.path(), &[&table[..], of_scenes].concat());
        let said = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert_eq!(refused.status.code(), Some(2));
        assert!(said.contains(of_scenes[0]), "{said}");
    }
}

/// What is chosen is as near to a lattice half as wide as was asked for; symmetry that leaves no
/// torque is no reason to go on for ever, and what cannot be met says why.
#[test]
fn a_tolerance_chooses_the_lattice() {
    let folder = scene_folder("");
    let poses = "x,y,z,qx,qy,qz,qw\n0.0013,0.0004,0.002,0,0,0,1\n-0.0007,0.0011,0.004,0.03,0,0,0.99955\n\
        0.0002,-0.0015,0.001,0,0.02,0.01,0.99975\n0,0.0001,0.007,0,0,0.04,0.9992\n";
    std::fs::write(folder.path().join("in.csv"), poses).unwrap();
    let args = ["score", "--scene", "scene.toml", "--poses", "in.csv"];
    let tolerant = |tolerance: &str| {
        pegfit(
            folder.path(),
            &[&args[..], &["--tolerance", tolerance]].concat(),
        )
    };
    let coarse = columns(&succeed(folder.path(), &[&args[..], &["-q"]].concat()));
    let found = tolerant("15%");
    assert!(found.status.success());
    let told = String::from_utf8_lossy(&found.stderr).into_owned();
    assert!(told.contains("as a lattice of"), "{told}");
    let rows = columns(&String::from_utf8(found.stdout).unwrap());
    assert_eq!(rows.len(), coarse.len());
    for (a, b) in rows.iter().zip(&coarse) {
        assert!(
            (a["energy"] / b["energy"] - 1.0).abs() < 0.15,
            "{a:?} {b:?}"
        );
    }
    let little = ["--tolerance", "0.1%", "--memory", "0.02"];
    let missed = pegfit(folder.path(), &[&args[..], &little].concat());
    let said = stderr(&missed);
    assert_eq!(missed.status.code(), Some(1), "{said}");
    assert!(
        said.contains("asked for") && said.contains("can be used"),
        "{said}"
    );
    // Straight along the hole: no torque at all.
    let straight = "x,y,z,qx,qy,qz,qw\n0,0,0.004,0,0,0,1\n0,0,0.002,0,0,0,1\n";
    std::fs::write(folder.path().join("in.csv"), straight).unwrap();
    assert!(tolerant("20%").status.success());
}

#[test]
fn standard_input_and_output_give_the_same() {
    let folder = scene_folder("");
    std::fs::write(folder.path().join("in.csv"), POSES).unwrap();
    let from_file = succeed(
        folder.path(),
        &["score", "--scene", "scene.toml", "--poses", "in.csv", "-q"],
    );
    let piped = pegfit_with_input(
        folder.path(),
        &words("score --scene scene.toml --poses - -o - -q"),
        POSES,
    );
    assert_eq!(piped.status.code(), Some(0), "{}", stderr(&piped));
    assert_eq!(stdout(&piped), from_file);
    assert_eq!(columns(&from_file).len(), 4);
}

#[test]
fn bad_poses_name_their_row_and_write_nothing() {
    let folder = scene_folder("");
    let cases = [
        ("x,y,z,qx,qy,qz\n0,0,0,0,0,0\n", "a column `qw`"),
        (
            "x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,1\n0,a,0,0,0,0,1\n",
            "row 2, column y",
        ),
        (
            "x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,1.01\n",
            "row 1, column qx,qy,qz,qw",
        ),
        ("x,y,z,qx,qy,qz,qw\n0,0,0\n", "row 1"),
    ];
    for (text, message) in cases {
        std::fs::write(folder.path().join("in.csv"), text).unwrap();
        let said = refuse(
            folder.path(),
            &words("score --scene scene.toml --poses in.csv -o out.csv"),
        );
        assert!(said.contains("in.csv") && said.contains(message), "{said}");
        assert!(!folder.path().join("out.csv").exists());
    }
    let neither = pegfit(folder.path(), &["score", "--poses", "in.csv"]);
    assert_eq!(neither.status.code(), Some(2));
    let missing = refuse(
        folder.path(),
        &["score", "--scene", "scene.toml", "--poses", "none.csv"],
    );
    assert!(missing.contains("none.csv"), "{missing}");
}

#[test]
fn bad_scenes_are_refused_with_file_and_line() {
    let folder = scene_folder("[model]\nsigmoid = 1\n");
    std::fs::write(folder.path().join("in.csv"), POSES).unwrap();
    let args = ["score", "--scene", "scene.toml", "--poses", "in.csv"];
    let said = refuse(folder.path(), &args);
    assert!(said.contains("scene.toml, line 11"), "{said}");
    assert!(said.contains("unknown key `sigmoid`"), "{said}");

    let folder = scene_folder("");
    std::fs::write(folder.path().join("in.csv"), POSES).unwrap();
    std::fs::remove_file(folder.path().join("peg.obj")).unwrap();
    assert!(refuse(folder.path(), &args).contains("peg.obj"));
}

#[test]
fn a_scene_beyond_the_memory_is_refused_with_the_number() {
    let folder = scene_folder("");
    std::fs::write(folder.path().join("in.csv"), POSES).unwrap();
    let said = refuse(
        folder.path(),
        &words("score --scene scene.toml --poses in.csv --memory 0.0001"),
    );
    assert!(
        said.contains("the density fields needs") || said.contains("density fields"),
        "{said}"
    );
    assert!(said.contains("KiB"), "{said}");
}

#[test]
fn parts_of_very_different_size_are_warned_about() {
    let folder = scene_folder("");
    std::fs::write(folder.path().join("in.csv"), POSES).unwrap();
    // The same scene with a peg in millimetres: a thousand times larger.
    let peg = std::fs::read_to_string(folder.path().join("peg.obj")).unwrap();
    let large = peg
        .lines()
        .map(
            |line| match line.split_whitespace().collect::<Vec<_>>()[..] {
                ["v", x, y, z] => {
                    let [x, y, z] = [x, y, z].map(|c| 1000.0 * c.parse::<f64>().unwrap());
                    format!("v {x} {y} {z}\n")
                }
                _ => format!("{line}\n"),
            },
        )
        .collect::<String>();
    std::fs::write(folder.path().join("peg.obj"), large).unwrap();
    let output = pegfit(
        folder.path(),
        &words("score --scene scene.toml --poses in.csv --memory 0.01"),
    );
    assert!(
        stderr(&output).contains("are both in m?"),
        "{}",
        stderr(&output)
    );
}
