//! Tables shared by threads, and closed under them.

use pegfit_c::{PegfitResponse, PegfitStatus, pegfit_table_close, pegfit_table_query};

use crate::table::{STIFFNESS, at, bake_spring, load};

#[test]
fn threads_query_one_table_until_it_is_closed_under_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = bake_spring(folder.path());
    let table = load(&path);
    let (begun, ready) = std::sync::mpsc::channel();
    let threads: Vec<_> = (0..4)
        .map(|thread| {
            let begun = begun.clone();
            std::thread::spawn(move || {
                let x = 0.001 * f64::from(thread);
                let mut answers = 0u32;
                loop {
                    let mut response = PegfitResponse {
                        energy: 0.0,
                        torque: [0.0; 3],
                        force: [0.0; 3],
                        coverage: 0.0,
                    };
                    // SAFETY: places of ours.
                    match unsafe { pegfit_table_query(table, &at(x), &raw mut response) } {
                        PegfitStatus::Ok => {
                            // Half-precision energies of a parabola.
                            assert!((response.force[0] + STIFFNESS * x).abs() < 0.02);
                            answers += 1;
                        }
                        PegfitStatus::NoSuchTable => return answers,
                        other => panic!("{other:?}"),
                    }
                    if answers == 100 {
                        begun.send(()).unwrap();
                    }
                }
            })
        })
        .collect();
    for _ in &threads {
        ready.recv().unwrap();
    }
    assert_eq!(pegfit_table_close(table), PegfitStatus::Ok);
    // Another one takes the place, not the handle.
    let other = load(&path);
    assert_ne!(other, table);
    for thread in threads {
        assert!(thread.join().unwrap() >= 100);
    }
    assert_eq!(pegfit_table_close(other), PegfitStatus::Ok);
}
