//! Poses per second of a table in Rust, beside those of Python and of the command:
//! `rate TABLE POSES`, where `POSES` holds rows of seven doubles `x y z qx qy qz qw`. Prints the
//! rates on one thread and on all, the best of three; `benches/python/query.py` runs it.

use std::time::Instant;

use fft_correlate::{Pose, Response, TableStore};
use glam::{DQuat, DVec3};
use pegfit_benches::Outcome;

fn main() -> Outcome<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [table, poses] = words.as_slice() else {
        return Err("usage: rate TABLE POSES".into());
    };
    let table = TableStore::open(table.as_ref())?.load(u64::MAX)?;
    let bytes = std::fs::read(poses)?;
    let (numbers, _) = bytes.as_chunks();
    let numbers: Vec<f64> = numbers.iter().map(|b| f64::from_ne_bytes(*b)).collect();
    let (rows, _) = numbers.as_chunks();
    let pose = |&[x, y, z, qx, qy, qz, qw]: &[f64; 7]| {
        Pose::new(DQuat::from_xyzw(qx, qy, qz, qw), DVec3::new(x, y, z))
    };
    let poses: Vec<Pose> = rows.iter().map(pose).collect();
    let mut responses = vec![Response::default(); poses.len()];
    let mut best = |all: bool| {
        let times = (0..3).map(|_| {
            let began = Instant::now();
            match all {
                true => table.respond_many(&poses, &mut responses),
                false => table.respond_each(&poses, &mut responses),
            }
            began.elapsed().as_secs_f64()
        });
        poses.len() as f64 / times.fold(f64::INFINITY, f64::min)
    };
    println!("{:.0} {:.0}", best(false), best(true));
    Ok(())
}
